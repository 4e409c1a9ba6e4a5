//! What the command line adds to an error of the library: the flags that help, and the exit code.

use std::collections::HashSet;
use std::sync::OnceLock;

use clap::Command;

use crate::archive::IS_A_PICTURE;
use crate::error::{Error, NoDevice, Remedy};

/// The advice when a Vulkan device has no memory left.
const LESS_MEMORY: [Remedy; 3] = [Remedy::SmallerPicture, Remedy::FewerTiles, Remedy::Cpu];

/// The failure in one sentence: what happened, and what to do about it.
pub(crate) fn sentence(error: &Error) -> String {
    match error {
        Error::NoSuitableDevice { why } => format!("no suitable device: {}", no_device(why)),
        Error::Parameter { name, value, reason } => {
            let name = if is_flag(&flag(name)) { format!("--{}", flag(name)) } else { name.clone() };
            let space = if value.is_empty() { "" } else { " " };
            format!("{name}{space}{value}: {}", with_flags(reason))
        }
        Error::TooLarge { remedies, .. } if !remedies.is_empty() => format!("{error}; {}", use_these(remedies)),
        Error::OutOfDeviceMemory { .. } | Error::OutOfMemory { .. } => format!("{error}; {}", use_these(&LESS_MEMORY)),
        Error::DeviceLost { .. } => {
            format!("{error}; run the same command again, or let the CPU make the rest by --on-device-lost cpu")
        }
        Error::Interrupted => format!("{error}; run the same command again"),
        Error::Input { reason, .. } if reason == IS_A_PICTURE => {
            format!("{error}, which smalti evolve writes with -o tiles.npz")
        }
        Error::Internal(_) => format!("{error} with the command that led to it"),
        _ => error.to_string(),
    }
}

/// Why the CPU replaces the Vulkan device, as a clause after "since".
pub(crate) fn why_no_vulkan(error: &Error) -> String {
    match error {
        Error::NoSuitableDevice { why } => no_device(why),
        other => sentence(other),
    }
}

/// The exit code of the process: 1 failed; 2 usage, configuration or unreadable input; 4 no suitable device; 75 device
/// lost or interrupted, run again (docs/reference.md, "Exit codes").
pub(crate) fn exit_code(error: &Error) -> u8 {
    match error {
        Error::Usage(_)
        | Error::Parameter { .. }
        | Error::UnknownName { .. }
        | Error::Input { .. }
        | Error::Encoding { .. }
        | Error::TooLarge { .. } => 2,
        Error::NoSuitableDevice { .. } | Error::DisplayLost => 4,
        Error::Rescued { error, .. } => exit_code(error),
        Error::DeviceLost { .. } | Error::Interrupted => 75,
        Error::Output { .. }
        | Error::OutOfDeviceMemory { .. }
        | Error::OutOfMemory { .. }
        | Error::Vulkan { .. }
        | Error::Threads { .. }
        | Error::Validation(_)
        | Error::Internal(_) => 1,
    }
}

fn no_device(why: &NoDevice) -> String {
    match why {
        NoDevice::NoLoader { .. } | NoDevice::OldLoader { .. } | NoDevice::NoDriver | NoDevice::NoHardware => {
            format!("{why}, or use --device cpu")
        }
        NoDevice::NoValidationLayer => format!("{why}, or run without --validate"),
        NoDevice::Lacks { request: Some(request), device, missing } => {
            let missing = missing.join(", ");
            format!("--device {request} is {device}, which lacks {missing}; choose another, or --device cpu")
        }
        NoDevice::Unlisted { request, devices } if devices.is_empty() => {
            format!("--device {request} was asked for and Vulkan lists no device; use --device cpu")
        }
        NoDevice::Unlisted { request, devices } => {
            format!("--device {request} fits no device; choose {}, or --device cpu", devices.join(", "))
        }
        NoDevice::NoGpu => format!("--devices all: {why}; see smalti devices, or leave it to --device auto"),
        NoDevice::NothingToValidate { reason } => {
            format!("--validate needs a Vulkan device, and {reason}; name one, such as --device vulkan")
        }
        NoDevice::Gone { .. } => format!("{why}; run again"),
        NoDevice::Lacks { request: None, .. } | NoDevice::NoDisplay { .. } | NoDevice::Other(_) => why.to_string(),
    }
}

/// "use fewer --tiles, a smaller --size, or --device cpu"
fn use_these(remedies: &[Remedy]) -> String {
    let mut words: Vec<&str> = remedies.iter().map(|&remedy| in_flags(remedy)).collect();
    match words.pop() {
        Some(last) if words.is_empty() => format!("use {last}"),
        last => format!("use {}, or {}", words.join(", "), last.unwrap_or_default()),
    }
}

fn in_flags(remedy: Remedy) -> &'static str {
    match remedy {
        Remedy::SmallerPicture => "a smaller --size",
        Remedy::SmallerOutput => "a smaller --output-size",
        Remedy::FewerTiles => "fewer --tiles",
        Remedy::MoreTiles => "more --tiles",
        Remedy::FewerCandidates => "fewer --candidates",
        Remedy::FewerPictures => "fewer pictures at once",
        Remedy::Cpu => "--device cpu",
    }
}

/// The name that the flag of a parameter would have.
fn flag(name: &str) -> String {
    name.replace('_', "-")
}

/// The names of all flags of all commands.
static FLAGS: OnceLock<HashSet<String>> = OnceLock::new();

/// Remembers the flags of the command line, so that messages call a parameter of the library by its flag.
pub(crate) fn know_flags(definition: &Command) {
    let arguments = definition.get_subcommands().flat_map(Command::get_arguments);
    let names = arguments.filter_map(|argument| argument.get_long()).map(str::to_owned).collect();
    // A second call fails, and its flags would be the same.
    let _ = FLAGS.set(names);
}

/// Whether a command has a flag with this name. Otherwise only the library has the parameter.
fn is_flag(name: &str) -> bool {
    FLAGS.get().is_some_and(|flags| flags.contains(name))
}

/// A reason in which the parameters in backticks are replaced by their flags.
fn with_flags(reason: &str) -> String {
    let parts = reason.split('`').enumerate();
    let spelt = parts.map(|(number, part)| match flag(part) {
        name if number % 2 == 1 && is_flag(&name) => format!("--{name}"),
        _ if number % 2 == 1 => format!("`{part}`"),
        _ => part.to_owned(),
    });
    spelt.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Prepares the flags, as reading the command line does.
    fn sentence(error: &Error) -> String {
        know_flags(&Command::new("smalti").subcommand(
            Command::new("evolve").args(["grout-width", "restarts"].map(|name| clap::Arg::new(name).long(name))),
        ));
        super::sentence(error)
    }

    fn of(why: NoDevice) -> String {
        sentence(&Error::NoSuitableDevice { why })
    }

    #[test]
    fn a_parameter_is_called_by_its_flag_if_it_has_one() {
        let wrong = |name: &str| sentence(&Error::parameter(name, "must be 1 to 9, not 10"));
        assert_eq!(wrong("grout_width"), "--grout-width: must be 1 to 9, not 10");
        assert_eq!(wrong("texels"), "texels: must be 1 to 9, not 10");
        let split = Error::value("mitosis", 3, "tiles split at restarts; make `restarts` at least 3, not `few`");
        assert_eq!(sentence(&split), "mitosis 3: tiles split at restarts; make --restarts at least 3, not `few`");
    }

    #[test]
    fn what_is_too_large_is_told_with_each_flag_that_makes_it_fit() {
        let too_large =
            |remedies: &'static [Remedy]| sentence(&Error::TooLarge { what: "it is too large".to_owned(), remedies });
        assert_eq!(too_large(&[]), "it is too large");
        assert_eq!(too_large(&[Remedy::FewerPictures]), "it is too large; use fewer pictures at once");
        assert_eq!(
            too_large(&[Remedy::MoreTiles, Remedy::SmallerPicture, Remedy::Cpu]),
            "it is too large; use more --tiles, a smaller --size, or --device cpu"
        );
    }

    #[test]
    fn memory_that_is_full_is_told_with_the_flags_that_need_less() {
        let full = Error::OutOfDeviceMemory { name: "tiles".to_owned(), bytes: 9 };
        let working = Error::OutOfMemory { call: "vkQueueSubmit2 after pass evaluate".to_owned() };
        for (error, what) in [(full, "tiles (9 bytes)"), (working, "vkQueueSubmit2 after pass evaluate")] {
            let told = sentence(&error);
            assert!(told.contains(what), "{told}");
            assert!(told.ends_with("; use a smaller --size, fewer --tiles, or --device cpu"), "{told}");
        }
    }

    #[test]
    fn a_device_that_is_not_there_is_told_with_the_flag_that_asked_for_it() {
        let unlisted = |devices: &[&str]| NoDevice::Unlisted {
            request: "9".to_owned(),
            devices: devices.iter().map(|&device| device.to_owned()).collect(),
        };
        assert_eq!(
            of(unlisted(&["0 (Iris)", "1 (llvmpipe)"])),
            "no suitable device: --device 9 fits no device; choose 0 (Iris), 1 (llvmpipe), or --device cpu"
        );
        assert!(of(unlisted(&[])).ends_with("--device 9 was asked for and Vulkan lists no device; use --device cpu"));
        let lacks = |request: Option<&str>| NoDevice::Lacks {
            request: request.map(str::to_owned),
            device: "Iris".to_owned(),
            missing: vec!["Vulkan 1.3".to_owned()],
        };
        assert!(of(lacks(Some("1"))).contains("--device 1 is Iris, which lacks Vulkan 1.3; choose another"));
        assert_eq!(of(lacks(None)), "no suitable device: Iris lacks Vulkan 1.3");
    }

    #[test]
    fn a_machine_without_vulkan_is_told_how_to_go_on_without_it() {
        for why in [NoDevice::NoDriver, NoDevice::NoHardware, NoDevice::OldLoader { major: 1, minor: 2 }] {
            assert!(of(why).ends_with(", or use --device cpu"));
        }
        assert!(of(NoDevice::NoValidationLayer).ends_with(", or run without --validate"));
        let error = Error::NoSuitableDevice { why: NoDevice::NoDriver };
        assert!(why_no_vulkan(&error).starts_with("no Vulkan driver is installed; install"));
    }
}
