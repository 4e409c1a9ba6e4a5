//! What can go wrong. An [`Error`] says what happened, and to which file, parameter or device. Its fields are for
//! callers that want to react to it.
//!
//! Nothing here names a flag of the command line or an exit code. The command line adds the flags that help.

mod install;

use std::path::{Path, PathBuf};
use std::time::Duration;
use std::{fmt, io};

use self::install::{Piece, what_brings};

/// Result of everything in the crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A failure. It is displayed as one sentence, without a full stop.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is outside its range, or does not fit the others, which the reason names in `backticks`.
    #[error("{name}{}: {reason}", if value.is_empty() { String::new() } else { format!(" {value}") })]
    Parameter {
        /// The parameter, in snake_case: `grout_width`.
        name: String,
        /// Its value as text; empty if that does not matter.
        value: String,
        /// What it may be, or what it does not fit.
        reason: String,
    },
    /// A name stands for none of the things that are built in.
    #[error("there is no {what} `{name}`; there are {known}")]
    UnknownName {
        /// What was looked for, in the singular.
        what: &'static str,
        /// The name that was given.
        name: String,
        /// The names that there are, with commas.
        known: String,
    },
    /// The command line makes no sense. Only the command line itself says this; the library never does.
    #[error("{0}")]
    Usage(String),
    /// A file that is to be read cannot be used.
    #[error("{}: {reason}", path.display())]
    Input {
        /// The file, as the caller named it.
        path: PathBuf,
        /// Why it cannot be used, and what to do.
        reason: String,
    },
    /// A file cannot be written.
    #[error("{}: {reason}", path.display())]
    Output {
        /// The file, as the caller named it.
        path: PathBuf,
        /// Why it cannot be written, and what to do.
        reason: String,
    },
    /// A file format cannot hold what is to be encoded.
    #[error("the {what} cannot be written as {format}: {reason}")]
    Encoding {
        /// What was to be encoded: a picture or a population.
        what: &'static str,
        /// The format.
        format: &'static str,
        /// Why it cannot be written.
        reason: String,
    },
    /// There is no device that can do the work.
    #[error("no suitable device: {why}")]
    NoSuitableDevice {
        /// What is missing.
        why: NoDevice,
    },
    /// The device stopped working in the middle of the work. The same work may succeed if it is tried again.
    #[error("{}", lost(last_pass, *waited))]
    DeviceLost {
        /// Label of the last pass that was submitted.
        last_pass: String,
        /// How long it was waited for, if the device never answered.
        waited: Option<Duration>,
    },
    /// The device has no room for a buffer or an image.
    #[error("the Vulkan device has no memory left for {name} ({bytes} bytes)")]
    OutOfDeviceMemory {
        /// Debug name of the buffer or image.
        name: String,
        /// Bytes asked for.
        bytes: u64,
    },
    /// The driver ran out of memory while it worked, though every buffer and image had been created.
    #[error("Vulkan: {call} failed: no memory is left")]
    OutOfMemory {
        /// The call that failed, with the pass that it was for.
        call: String,
    },
    /// A Vulkan call failed in a way that has no variant of its own.
    #[error("Vulkan: {call} failed: {reason}")]
    Vulkan {
        /// The call that failed, with the name of the object it was for.
        call: String,
        /// The driver's result code or the loader's message.
        reason: String,
    },
    /// The work is larger than a limit of the device, of the memory or of the engine.
    #[error("{what}")]
    TooLarge {
        /// What is too large, and the limit.
        what: String,
        /// What would make it fit; each of these helps by itself.
        remedies: &'static [Remedy],
    },
    /// The validation layer complained. It is only there if it was asked for.
    #[error("Vulkan validation: {0}")]
    Validation(String),
    /// The system starts no more threads for this process or its user.
    #[error(
        "no more threads can be started ({reason}); end other programs, or raise the limit of processes (ulimit -u)"
    )]
    Threads {
        /// What the system said.
        reason: String,
    },
    /// The display went away while a window was on it.
    #[error("the display of the window is gone")]
    DisplayLost,
    /// The window ended by a failure, and what it showed was saved.
    #[error("{error}; the tiles were saved as {}", path.display())]
    Rescued {
        /// Why it ended.
        error: Box<Self>,
        /// The population that was saved.
        path: PathBuf,
    },
    /// Somebody asked for the end before the work was done.
    #[error("interrupted")]
    Interrupted,
    /// The engine contradicts itself: a bug.
    #[error("internal error: {0}; please report it")]
    Internal(String),
}

/// Why there is no device that can do the work.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoDevice {
    /// The Vulkan loader is not installed, or cannot be opened.
    #[error("the Vulkan loader cannot be opened ({reason}); install {}", what_brings(Piece::Loader))]
    NoLoader {
        /// What the dynamic linker said.
        reason: String,
    },
    /// The Vulkan loader is older than Vulkan 1.3.
    #[error(
        "the Vulkan loader only knows Vulkan {major}.{minor} and 1.3 is needed; install {}",
        what_brings(Piece::NewerLoader)
    )]
    OldLoader {
        /// The first number of the loader's version.
        major: u32,
        /// The second number of the loader's version.
        minor: u32,
    },
    /// No Vulkan driver is installed.
    #[error("no Vulkan driver is installed; install {}", what_brings(Piece::Driver))]
    NoDriver,
    /// A driver is installed, and there is nothing that it could drive.
    #[error(
        "a Vulkan driver is installed but found no hardware that it drives; install {}",
        what_brings(Piece::FittingDriver)
    )]
    NoHardware,
    /// The validation layer was asked for and is not installed.
    #[error(
        "the validation layer VK_LAYER_KHRONOS_validation is not installed; install {}",
        what_brings(Piece::ValidationLayer)
    )]
    NoValidationLayer,
    /// The device that was asked for lacks something that the engine needs.
    #[error("{device} lacks {}", missing.join(", "))]
    Lacks {
        /// The request that led to the device, if it was not chosen by itself.
        request: Option<String>,
        /// Name of the device.
        device: String,
        /// What it lacks.
        missing: Vec<String>,
    },
    /// No device fits the request.
    #[error("{}", unlisted(request, devices))]
    Unlisted {
        /// What was asked for.
        request: String,
        /// The devices that there are: number and name of each.
        devices: Vec<String>,
    },
    /// The device went away after it was listed.
    #[error("{device} is no longer there")]
    Gone {
        /// Name of the device.
        device: String,
    },
    /// A window cannot be shown.
    #[error("there is no display for a window ({reason}); run it on a desktop, or use smalti evolve")]
    NoDisplay {
        /// What the system said.
        reason: String,
    },
    /// Every hardware GPU was asked for, and there is none.
    #[error("there is no hardware GPU")]
    NoGpu,
    /// Validation was asked for, and the CPU would compute.
    #[error("validation needs a Vulkan device, and {reason}")]
    NothingToValidate {
        /// Why there is no Vulkan device.
        reason: String,
    },
    /// Another reason, in the words of whoever needed the device.
    #[error("{0}")]
    Other(String),
}

/// What makes work fit that is too large.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Remedy {
    /// Evolve the picture at a smaller size.
    SmallerPicture,
    /// Draw the result at a smaller size.
    SmallerOutput,
    /// Use fewer tiles.
    FewerTiles,
    /// Use more tiles: each is smaller then.
    MoreTiles,
    /// Make fewer candidates for each birth.
    FewerCandidates,
    /// Evolve fewer pictures at once.
    FewerPictures,
    /// Compute on the CPU, which has no such limit.
    Cpu,
}

impl Error {
    /// An [`Error::Parameter`] whose value does not matter.
    pub fn parameter(name: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Parameter { name: name.into(), value: String::new(), reason: reason.into() }
    }

    /// An [`Error::Parameter`] about a value.
    pub fn value(name: impl Into<String>, value: impl fmt::Display, reason: impl Into<String>) -> Self {
        Self::Parameter { name: name.into(), value: value.to_string(), reason: reason.into() }
    }

    /// An [`Error::Input`] about `path`.
    pub fn input(path: &Path, reason: impl Into<String>) -> Self {
        Self::Input { path: path.to_owned(), reason: reason.into() }
    }

    /// An [`Error::Output`] about `path`.
    pub fn output(path: &Path, reason: impl Into<String>) -> Self {
        Self::Output { path: path.to_owned(), reason: reason.into() }
    }

    /// An [`Error::Encoding`] of a picture.
    pub(crate) fn picture_as(format: &'static str, reason: &dyn fmt::Display) -> Self {
        Self::Encoding { what: "picture", format, reason: reason.to_string() }
    }
}

/// What the system refused, in plain words, as a clause after "since" or in brackets. What it says itself is for
/// programmers: "Not a directory (os error 20)".
pub(crate) fn in_words(error: &io::Error) -> String {
    use io::ErrorKind as Kind;
    let words = match error.kind() {
        Kind::NotFound => "there is nothing of this name",
        Kind::NotADirectory => "a part of the path is a file, not a folder",
        Kind::IsADirectory => "it is a folder",
        Kind::PermissionDenied => "its permissions forbid it",
        Kind::AlreadyExists => "a file of this name is there already",
        Kind::DirectoryNotEmpty => "the folder is not empty",
        Kind::StorageFull => "the disk is full",
        Kind::QuotaExceeded => "your share of the disk is full",
        Kind::ReadOnlyFilesystem => "the disk can only be read",
        Kind::FileTooLarge => "a file may not be as large here",
        Kind::TooManyLinks => "the file has too many links",
        Kind::InvalidFilename => "the name is too long or has characters that are not allowed",
        Kind::CrossesDevices => "the two places are on different disks",
        Kind::ResourceBusy | Kind::ExecutableFileBusy | Kind::WouldBlock => "it is in use",
        Kind::BrokenPipe => "the reader went away",
        Kind::UnexpectedEof => "the file ends too early",
        Kind::OutOfMemory => "no memory is left",
        Kind::TimedOut => "it took too long",
        Kind::StaleNetworkFileHandle | Kind::HostUnreachable | Kind::NetworkUnreachable | Kind::NetworkDown => {
            "the network disk is gone"
        }
        _ => return told_by_system(error),
    };
    words.to_owned()
}

/// The system's own words for what has no kind of its own, without the number that it appends.
fn told_by_system(error: &io::Error) -> String {
    #[cfg(unix)]
    match error.raw_os_error() {
        Some(5) => return "the disk or its connection has a fault".to_owned(),
        Some(23 | 24) => return "too many files are open at once".to_owned(),
        Some(40) => return "its links lead in a circle".to_owned(),
        _ => {}
    }
    let told = error.to_string();
    let told = told.split(" (os error").next().unwrap_or_default();
    let mut letters = told.chars();
    letters
        .next()
        .map_or_else(|| "no reason was given".to_owned(), |first| first.to_lowercase().chain(letters).collect())
}

/// What became of a device in the middle of its work.
fn lost(last_pass: &str, waited: Option<Duration>) -> String {
    match waited {
        None => format!("the Vulkan device was lost during `{last_pass}`"),
        Some(waited) => {
            format!("the Vulkan device did not finish `{last_pass}` within {} seconds", waited.as_secs_f64())
        }
    }
}

fn unlisted(request: &str, devices: &[String]) -> String {
    if devices.is_empty() {
        return format!("`{request}` was asked for and Vulkan lists no device");
    }
    format!("`{request}` fits no device; there are {}", devices.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_can_cross_threads_and_be_boxed() {
        fn is_error<T: std::error::Error + Send + Sync + 'static>() {}
        is_error::<Error>();
        is_error::<NoDevice>();
    }

    #[test]
    fn no_reason_of_the_system_is_told_by_its_number() {
        for number in 1..140 {
            let words = in_words(&io::Error::from_raw_os_error(number));
            assert!(!words.contains("os error") && !words.is_empty(), "{number}: {words}");
        }
        let words = in_words(&io::Error::other("It fell."));
        assert_eq!(words, "it fell.");
    }
}
