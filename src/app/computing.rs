//! What computes: the flags that all commands share which evolve or draw, and what they ask for.

use clap::Args;

use super::device::{self, Selected};
use super::{options, report, values};
use crate::error::{Error, Result};
use crate::vk::{DeviceRequest, Validation};

/// Most CPU threads.
const THREADS_MAX: u64 = 1_024;

/// The flags.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Computing")]
pub(super) struct ComputingArgs {
    /// What computes: auto (best GPU, else the CPU), cpu, vulkan, a number, uuid:HEX, pci:ADDRESS, name:PART
    #[arg(long, value_name = "DEVICE", env = "SMALTI_DEVICE", default_value = "auto")]
    pub device: String,
    /// CPU threads, 1 to 1,024; changes no result [default: all]
    #[arg(long, value_name = "T", value_parser = values::count)]
    pub threads: Option<u64>,
}

/// What was asked for, checked.
#[derive(Clone, Debug)]
pub(super) struct Computing {
    pub request: DeviceRequest,
    pub validation: Validation,
    threads: Option<usize>,
}

impl ComputingArgs {
    /// Checks the flags; with `validation` the device must be one that can be watched.
    ///
    /// # Errors
    /// [`Error::Usage`] or [`Error::NoSuitableDevice`] that names the flag and what it may be.
    pub(super) fn check(&self, validation: Validation) -> Result<Computing> {
        let request = request(&self.device)?;
        if validation == Validation::On && request == DeviceRequest::Cpu {
            let sentence = "--validate watches Vulkan, and --device cpu uses none; drop one of them";
            return Err(Error::Usage(sentence.to_owned()));
        }
        let in_range = |count| options::in_range("--threads", count, (1, THREADS_MAX)).map(|count| count as usize);
        Ok(Computing { request, validation, threads: self.threads.map(in_range).transpose()? })
    }

    /// Gives the CPU twin its threads and opens the device, and says so if nobody asked for the CPU: for
    /// commands that need nothing else before.
    ///
    /// # Errors
    /// As [`ComputingArgs::check`] and [`Computing::select`].
    pub(super) fn begin(&self, verbosity: options::Verbosity) -> Result<Selected> {
        let computing = self.check(Validation::Off)?;
        computing.start_threads()?;
        let selected = computing.select()?;
        if verbosity > options::Verbosity::Quiet {
            report::say_device(&selected);
        }
        Ok(selected)
    }
}

impl Computing {
    /// Gives the CPU twin as many threads as were asked for.
    pub(super) fn start_threads(&self) -> Result<()> {
        let Some(count) = self.threads else { return Ok(()) };
        rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build_global()
            .map_err(|error| Error::Usage(format!("--threads {count}: the threads cannot be started ({error})")))
    }

    /// Finds and opens the device.
    ///
    /// # Errors
    /// As [`device::select`].
    pub(super) fn select(&self) -> Result<Selected> {
        device::select(&self.request, self.validation)
    }
}

/// The device that was asked for; no word at all, as in an empty SMALTI_DEVICE, asks for none.
fn request(text: &str) -> Result<DeviceRequest> {
    let text = text.trim();
    if text.is_empty() {
        return Ok(DeviceRequest::Auto);
    }
    if text.bytes().all(|byte| byte.is_ascii_digit()) && text.parse::<usize>().is_err() {
        let why = format!("--device {text}: no machine has as many; see smalti devices for the numbers, or use auto");
        return Err(Error::NoSuitableDevice { why });
    }
    text.parse()
}
