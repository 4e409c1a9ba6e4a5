//! `smalti devices`: lists the Vulkan devices, what each of them lacks, and which one `--device auto` takes.

use std::process::ExitCode;

use clap::Args;
use indicatif::{BinaryBytes, HumanCount};
use serde_json::json;

use crate::cli::terminal::{self, advice};
use crate::error::Result;
use crate::vk::{Choice, DeviceInfo, DeviceKind, DeviceLimits, DeviceRequest, Instance, InstanceOptions, choose};

#[derive(Debug, Args)]
pub(crate) struct DevicesArgs {
    /// Print JSON to stdout instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Lists the devices; returns the exit code of the process.
pub(crate) fn list(args: &DevicesArgs) -> ExitCode {
    terminal::exit_code(print_list(args))
}

fn print_list(args: &DevicesArgs) -> Result<()> {
    let listed = Instance::create(InstanceOptions::default()).and_then(|instance| instance.physical_devices());
    let (devices, automatic) = match listed {
        Ok(devices) => {
            let automatic = choose(&DeviceRequest::Auto, &devices)?;
            (devices, automatic)
        }
        // Having no device is not a failure, since there is always the CPU twin.
        Err(error) => (Vec::new(), Choice::Cpu { reason: advice::why_no_vulkan(&error) }),
    };
    if args.json {
        let automatic = match &automatic {
            Choice::Cpu { reason } => json!({ "device": "cpu", "reason": reason }),
            Choice::Vulkan(index) => json!({ "device": index, "reason": null }),
        };
        return terminal::print_json(&json!({ "devices": devices, "auto": automatic }));
    }
    let mut text: String = devices.iter().map(block).collect();
    text.push_str(&match automatic {
        Choice::Cpu { reason } => format!("--device auto takes the CPU, since {reason}\n"),
        Choice::Vulkan(index) => format!("--device auto takes device {index}\n"),
    });
    terminal::write_stdout(text.as_bytes())
}

/// The lines about one device.
fn block(device: &DeviceInfo) -> String {
    let DeviceInfo { index, name, limits, .. } = device;
    let rows = [
        ("type", format!("{}, Vulkan {}", kind_name(device.kind), device.api_version)),
        ("driver", format!("{} {}", device.driver_name, device.driver_info)),
        ("uuid", device.uuid.clone()),
        ("pci", device.pci.clone().unwrap_or_else(|| "not told".to_owned())),
        ("memory", BinaryBytes(device.memory_bytes).to_string()),
        ("subgroup", format!("{} invocations; {}", device.subgroup_size, device.subgroup_operations.join(", "))),
        ("limits", limits_line(limits)),
        ("lacks", lacks_line(&device.missing, &device.missing_for_drawing)),
    ];
    let rows: String = rows.iter().map(|(title, text)| format!("   {title:<9} {text}\n")).collect();
    format!("{index}  {name}\n{rows}")
}

/// What a device lacks, and what follows if that is only for drawing.
fn lacks_line(missing: &[String], missing_for_drawing: &[String]) -> String {
    match (missing, missing_for_drawing) {
        ([], []) => "nothing".to_owned(),
        ([], lacking) => format!("{}; it searches, and the CPU draws opaque tiles", lacking.join(", ")),
        (lacking, _) => lacking.join(", "),
    }
}

fn limits_line(limits: &DeviceLimits) -> String {
    format!(
        "storage buffer {}; workgroup {} invocations, {} shared; push constants {}; image {} px, {} layers",
        BinaryBytes(limits.storage_buffer_bytes),
        HumanCount(u64::from(limits.workgroup_invocations)),
        BinaryBytes(u64::from(limits.shared_memory_bytes)),
        BinaryBytes(u64::from(limits.push_constant_bytes)),
        HumanCount(u64::from(limits.image_side_px)),
        HumanCount(u64::from(limits.image_layers)),
    )
}

fn kind_name(kind: DeviceKind) -> &'static str {
    match kind {
        DeviceKind::Discrete => "discrete GPU",
        DeviceKind::Integrated => "integrated GPU",
        DeviceKind::Virtual => "virtual GPU",
        DeviceKind::Cpu => "software on the CPU",
        DeviceKind::Other => "other",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_that_only_cannot_draw_is_told_apart_from_one_that_is_of_no_use() {
        let words = |words: &[&str]| words.iter().map(|&word| word.to_owned()).collect::<Vec<_>>();
        let line = |missing: &[&str], for_drawing: &[&str]| lacks_line(&words(missing), &words(for_drawing));
        assert_eq!(line(&[], &[]), "nothing");
        assert_eq!(
            line(&[], &["a queue for graphics", "R32_UINT as a colour attachment"]),
            "a queue for graphics, R32_UINT as a colour attachment; it searches, and the CPU draws opaque tiles"
        );
        assert_eq!(line(&["Vulkan 1.3", "a queue for compute"], &["x"]), "Vulkan 1.3, a queue for compute");
    }
}
