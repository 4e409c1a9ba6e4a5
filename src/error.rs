//! What can go wrong, one sentence each: what happened, to which file or device, and what to do about it.
//!
//! Every message is written for the person at the terminal. [`Error::exit_code`] is the documented exit code of the
//! command line (README, "Exit codes").

use std::path::{Path, PathBuf};

/// Result of everything in the crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A failure, in the words that the user reads.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option or a combination of options makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A file named on the command line cannot be used.
    #[error("{}: {reason}", path.display())]
    Input {
        /// The file, as the user wrote it.
        path: PathBuf,
        /// Why it cannot be used, and what to do.
        reason: String,
    },
    /// An output cannot be written.
    #[error("{}: {reason}", path.display())]
    Output {
        /// The file, as the user wrote it.
        path: PathBuf,
        /// Why it cannot be written, and what to do.
        reason: String,
    },
    /// No device fits `--device`, or Vulkan itself is missing.
    #[error("no suitable device: {why}")]
    NoSuitableDevice {
        /// What was asked for, what was found, and what to install or to choose instead.
        why: String,
    },
    /// The device stopped working in the middle of the work.
    #[error("the Vulkan device was lost during `{last_pass}`; run the same command again, or use --device cpu")]
    DeviceLost {
        /// Label of the last pass that was submitted.
        last_pass: String,
    },
    /// The device has no room for a buffer or an image.
    #[error(
        "the Vulkan device has no memory left for {name} ({bytes} bytes); use a smaller --size or fewer --tiles, or --device cpu"
    )]
    OutOfDeviceMemory {
        /// Debug name of the buffer or image.
        name: String,
        /// Bytes asked for.
        bytes: u64,
    },
    /// A Vulkan call failed in a way that has no sentence of its own.
    #[error("Vulkan: {call} failed: {reason}")]
    Vulkan {
        /// The call that failed, with the name of the object it was for.
        call: String,
        /// The driver's result code or the loader's message.
        reason: String,
    },
    /// A picture or population is larger than a limit.
    #[error("{0}")]
    TooLarge(String),
    /// The validation layer complained (only with `--validate`).
    #[error("Vulkan validation: {0}")]
    Validation(String),
    /// Somebody asked for the end before the work was done.
    #[error("interrupted; run the same command again")]
    Interrupted,
    /// The engine contradicts itself: a bug.
    #[error("internal error: {0}; please report it with the command that led to it")]
    Internal(String),
}

impl Error {
    /// An [`Error::Input`] about `path`.
    pub fn input(path: &Path, reason: impl Into<String>) -> Self {
        Self::Input { path: path.to_owned(), reason: reason.into() }
    }

    /// An [`Error::Output`] about `path`.
    pub fn output(path: &Path, reason: impl Into<String>) -> Self {
        Self::Output { path: path.to_owned(), reason: reason.into() }
    }

    /// The exit code of the command line: 1 failed; 2 usage, configuration or unreadable input; 4 no suitable device;
    /// 75 device lost, run again.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Input { .. } | Self::TooLarge(_) => 2,
            Self::NoSuitableDevice { .. } => 4,
            Self::DeviceLost { .. } | Self::Interrupted => 75,
            Self::Output { .. }
            | Self::OutOfDeviceMemory { .. }
            | Self::Vulkan { .. }
            | Self::Validation(_)
            | Self::Internal(_) => 1,
        }
    }
}
