//! Which device does the work: matches the user's request with the list of devices. It is pure and needs no Vulkan.

use std::cmp::Reverse;
use std::fmt;
use std::str::FromStr;

use super::{DeviceInfo, DeviceKind};
use crate::error::{Error, NoDevice, Result};

/// The device that somebody asks for. The words for it are those that it is displayed as.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum DeviceRequest {
    /// The best hardware GPU, or the CPU twin if there is none.
    #[default]
    Auto,
    /// The CPU twin.
    Cpu,
    /// The best Vulkan device, software included.
    Vulkan,
    /// The device with this number in the list.
    Index(usize),
    /// The device with this UUID: hexadecimal digits in lower case, without dashes.
    Uuid(String),
    /// The device at this PCI address, in lower case with its domain.
    Pci(String),
    /// The best device whose name contains this, in lower case.
    Name(String),
}

impl DeviceRequest {
    /// The forms in which a device is asked for, for people.
    pub const FORMS: &str = "auto, cpu, vulkan, a number, uuid:HEX, pci:0000:65:00.0 or name:PART";
}

impl FromStr for DeviceRequest {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || Error::parameter("device", format!("expected {}, not `{text}`", Self::FORMS));
        let lower = text.trim().to_lowercase();
        match lower.as_str() {
            "auto" => return Ok(Self::Auto),
            "cpu" => return Ok(Self::Cpu),
            "vulkan" => return Ok(Self::Vulkan),
            _ => {}
        }
        if let Ok(index) = lower.parse() {
            return Ok(Self::Index(index));
        }
        match lower.split_once(':') {
            Some(("uuid", uuid)) => digits_of(uuid).map(Self::Uuid).ok_or_else(wrong),
            Some(("pci", address)) => full_address(address).map(Self::Pci).ok_or_else(wrong),
            Some(("name", part)) if !part.trim().is_empty() => Ok(Self::Name(part.trim().to_owned())),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for DeviceRequest {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => write!(out, "auto"),
            Self::Cpu => write!(out, "cpu"),
            Self::Vulkan => write!(out, "vulkan"),
            Self::Index(index) => write!(out, "{index}"),
            Self::Uuid(digits) => write!(out, "uuid:{digits}"),
            Self::Pci(address) => write!(out, "pci:{address}"),
            Self::Name(part) => write!(out, "name:{part}"),
        }
    }
}

/// The 32 digits of a UUID, with or without its dashes.
fn digits_of(uuid: &str) -> Option<String> {
    let digits = uuid.trim().replace('-', "");
    (digits.len() == 32 && digits.bytes().all(|byte| byte.is_ascii_hexdigit())).then_some(digits)
}

/// A PCI address with its domain, which users may leave out if it is 0.
fn full_address(address: &str) -> Option<String> {
    let address = address.trim();
    let parts = address.split([':', '.']).count();
    let is_address = address.bytes().all(|byte| byte.is_ascii_hexdigit() || byte == b':' || byte == b'.')
        && address.split([':', '.']).all(|part| !part.is_empty());
    match parts {
        4 if is_address => Some(address.to_owned()),
        3 if is_address => Some(format!("0000:{address}")),
        _ => None,
    }
}

/// What does the work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Choice {
    /// The CPU twin.
    Cpu {
        /// Why, in one line.
        reason: String,
    },
    /// The Vulkan device with this [`DeviceInfo::index`].
    Vulkan(usize),
}

/// Finds the device that fits the request.
///
/// # Errors
/// [`Error::NoSuitableDevice`] with the devices that there are, or with what the device lacks.
pub fn choose(request: &DeviceRequest, devices: &[DeviceInfo]) -> Result<Choice> {
    match request {
        DeviceRequest::Cpu => Ok(Choice::Cpu { reason: "asked for".to_owned() }),
        DeviceRequest::Auto => Ok(choose_automatically(devices)),
        DeviceRequest::Vulkan => choose_among(request, devices, |_| true),
        DeviceRequest::Index(index) => choose_among(request, devices, |device| device.index == *index),
        DeviceRequest::Uuid(digits) => choose_among(request, devices, |device| device.uuid.replace('-', "") == *digits),
        DeviceRequest::Pci(address) => choose_among(request, devices, |device| device.pci.as_ref() == Some(address)),
        DeviceRequest::Name(part) => {
            choose_among(request, devices, |device| device.name.to_lowercase().contains(part.as_str()))
        }
    }
}

fn choose_automatically(devices: &[DeviceInfo]) -> Choice {
    let hardware = || devices.iter().filter(|device| device.kind != DeviceKind::Cpu);
    if let Some(best) = hardware().filter(|device| device.missing.is_empty()).min_by_key(|device| rank(device)) {
        return Choice::Vulkan(best.index);
    }
    let reason = match hardware().next() {
        Some(unusable) => format!("{} lacks {}", unusable.name, unusable.missing.join(", ")),
        None => "there is no hardware GPU with Vulkan".to_owned(),
    };
    Choice::Cpu { reason }
}

fn choose_among(request: &DeviceRequest, devices: &[DeviceInfo], fits: impl Fn(&DeviceInfo) -> bool) -> Result<Choice> {
    let fitting = || devices.iter().filter(|device| fits(device));
    if let Some(best) = fitting().filter(|device| device.missing.is_empty()).min_by_key(|device| rank(device)) {
        return Ok(Choice::Vulkan(best.index));
    }
    let why = match fitting().next() {
        Some(unusable) => NoDevice::Lacks {
            request: Some(request.to_string()),
            device: unusable.name.clone(),
            missing: unusable.missing.clone(),
        },
        None => NoDevice::Unlisted { request: request.to_string(), devices: list(devices) },
    };
    Err(Error::NoSuitableDevice { why })
}

/// The order of preference; the best device has the lowest rank.
pub(super) fn rank(device: &DeviceInfo) -> (u8, Reverse<u64>, usize) {
    let kind = match device.kind {
        DeviceKind::Discrete => 0,
        DeviceKind::Integrated => 1,
        DeviceKind::Virtual => 2,
        DeviceKind::Other => 3,
        DeviceKind::Cpu => 4,
    };
    (kind, Reverse(device.memory_bytes), device.index)
}

fn list(devices: &[DeviceInfo]) -> Vec<String> {
    devices.iter().map(|device| format!("{} ({})", device.index, device.name)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::DeviceLimits;
    use super::*;

    fn device(index: usize, name: &str, kind: DeviceKind, memory_bytes: u64) -> DeviceInfo {
        DeviceInfo {
            index,
            name: name.to_owned(),
            kind,
            vendor_id: 0,
            device_id: 0,
            driver_name: String::new(),
            driver_info: String::new(),
            driver_version: 0,
            api_version: "1.3.0".to_owned(),
            uuid: format!("00000000-0000-0000-0000-{index:012x}"),
            pci: Some(format!("0000:{index:02x}:00.0")),
            memory_bytes,
            subgroup_size: 32,
            subgroup_operations: Vec::new(),
            limits: DeviceLimits {
                storage_buffer_bytes: 1 << 27,
                buffer_bytes: 1 << 30,
                allocation_bytes: 1 << 30,
                storage_buffers_per_stage: 16,
                workgroups: [65_535; 3],
                workgroup_invocations: 1024,
                shared_memory_bytes: 1 << 15,
                push_constant_bytes: 128,
                image_side_px: 16_384,
                image_layers: 2048,
                timestamp_period_ns: 1.0,
                timestamp_bits: 64,
            },
            missing: Vec::new(),
            missing_for_drawing: Vec::new(),
        }
    }

    fn machine() -> Vec<DeviceInfo> {
        vec![
            device(0, "llvmpipe (LLVM 15)", DeviceKind::Cpu, 64 << 30),
            device(1, "Iris", DeviceKind::Integrated, 32 << 30),
            device(2, "GeForce small", DeviceKind::Discrete, 8 << 30),
            device(3, "GeForce large", DeviceKind::Discrete, 24 << 30),
            device(4, "GeForce large", DeviceKind::Discrete, 24 << 30),
        ]
    }

    fn chosen(request: &str, devices: &[DeviceInfo]) -> Result<Choice> {
        choose(&request.parse()?, devices)
    }

    fn refusal(request: &str, devices: &[DeviceInfo]) -> NoDevice {
        match chosen(request, devices) {
            Err(Error::NoSuitableDevice { why }) => why,
            other => panic!("{request} gave {other:?}"),
        }
    }

    #[test]
    fn every_form_of_request_is_parsed_whatever_its_case() -> Result<()> {
        let uuid = "0123456789abcdef0123456789abcdef".to_owned();
        for (text, request) in [
            ("AUTO", DeviceRequest::Auto),
            (" cpu ", DeviceRequest::Cpu),
            ("vulkan", DeviceRequest::Vulkan),
            ("12", DeviceRequest::Index(12)),
            ("uuid:01234567-89AB-CDEF-0123-456789ABCDEF", DeviceRequest::Uuid(uuid.clone())),
            ("uuid:0123456789abcdef0123456789abcdef", DeviceRequest::Uuid(uuid)),
            ("pci:0000:65:00.0", DeviceRequest::Pci("0000:65:00.0".to_owned())),
            ("PCI:65:00.0", DeviceRequest::Pci("0000:65:00.0".to_owned())),
            ("name:GeForce RTX", DeviceRequest::Name("geforce rtx".to_owned())),
        ] {
            assert_eq!(text.parse::<DeviceRequest>()?, request, "{text}");
        }
        Ok(())
    }

    #[test]
    fn a_request_of_unknown_form_is_refused_and_quoted() {
        for text in
            ["", "gpu", "-1", "uuid:12", "uuid:", "pci:65", "pci::65:00.0", "pci:zz:00.0", "name:", "name: ", "x:y"]
        {
            match text.parse::<DeviceRequest>() {
                Err(Error::Parameter { name, reason, .. }) => {
                    assert_eq!(name, "device");
                    assert!(reason.contains(&format!("`{text}`")) && reason.contains("expected"), "{reason}");
                }
                other => panic!("{text:?} gave {other:?}"),
            }
        }
    }

    #[test]
    fn auto_takes_the_discrete_gpu_with_most_memory_and_the_lowest_number() -> Result<()> {
        assert_eq!(chosen("auto", &machine())?, Choice::Vulkan(3));
        assert_eq!(chosen("auto", &machine()[..2])?, Choice::Vulkan(1));
        Ok(())
    }

    #[test]
    fn auto_passes_over_a_gpu_that_lacks_something() -> Result<()> {
        let mut devices = machine();
        devices[3].missing.push("Vulkan 1.3".to_owned());
        assert_eq!(chosen("auto", &devices)?, Choice::Vulkan(4));
        Ok(())
    }

    #[test]
    fn a_gpu_that_cannot_draw_is_taken_all_the_same() -> Result<()> {
        let mut devices = machine();
        devices[3].missing_for_drawing.push("a queue for graphics".to_owned());
        assert_eq!(chosen("auto", &devices)?, Choice::Vulkan(3));
        assert_eq!(chosen("name:large", &devices)?, Choice::Vulkan(3));
        Ok(())
    }

    #[test]
    fn auto_takes_the_cpu_twin_and_says_why_where_there_is_no_usable_gpu() -> Result<()> {
        let cpu = |reason: &str| Choice::Cpu { reason: reason.to_owned() };
        assert_eq!(chosen("auto", &[])?, cpu("there is no hardware GPU with Vulkan"));
        assert_eq!(chosen("auto", &machine()[..1])?, cpu("there is no hardware GPU with Vulkan"));
        let mut old = device(0, "Old", DeviceKind::Discrete, 1);
        old.missing.push("Vulkan 1.3".to_owned());
        assert_eq!(chosen("auto", &[old])?, cpu("Old lacks Vulkan 1.3"));
        Ok(())
    }

    #[test]
    fn vulkan_takes_software_only_where_there_is_no_gpu() -> Result<()> {
        assert_eq!(chosen("vulkan", &machine())?, Choice::Vulkan(3));
        assert_eq!(chosen("vulkan", &machine()[..1])?, Choice::Vulkan(0));
        Ok(())
    }

    #[test]
    fn a_device_is_found_by_its_number_uuid_address_or_part_of_its_name() -> Result<()> {
        let devices = machine();
        assert_eq!(chosen("2", &devices)?, Choice::Vulkan(2));
        assert_eq!(chosen("uuid:00000000-0000-0000-0000-000000000001", &devices)?, Choice::Vulkan(1));
        assert_eq!(chosen("pci:04:00.0", &devices)?, Choice::Vulkan(4));
        assert_eq!(chosen("name:LLVMPIPE", &devices)?, Choice::Vulkan(0));
        assert_eq!(chosen("name:geforce", &devices)?, Choice::Vulkan(3));
        assert!(matches!(chosen("cpu", &devices)?, Choice::Cpu { .. }));
        Ok(())
    }

    #[test]
    fn a_request_that_nothing_fits_lists_what_there_is() {
        let why = refusal("name:radeon", &machine()).to_string();
        for part in ["name:radeon", "0 (llvmpipe (LLVM 15))", "4 (GeForce large)"] {
            assert!(why.contains(part), "{why}");
        }
        assert_eq!(refusal("vulkan", &[]), NoDevice::Unlisted { request: "vulkan".to_owned(), devices: Vec::new() });
        assert_eq!(refusal("9", &machine()), NoDevice::Unlisted { request: "9".to_owned(), devices: list(&machine()) });
    }

    #[test]
    fn a_device_that_lacks_something_is_refused_with_what_it_lacks() {
        let mut devices = machine();
        let missing = vec!["the feature maintenance4".to_owned(), "Vulkan 1.3".to_owned()];
        devices[1].missing.clone_from(&missing);
        let why = refusal("1", &devices);
        assert_eq!(why.to_string(), "Iris lacks the feature maintenance4, Vulkan 1.3");
        assert_eq!(why, NoDevice::Lacks { request: Some("1".to_owned()), device: "Iris".to_owned(), missing });
    }
}
