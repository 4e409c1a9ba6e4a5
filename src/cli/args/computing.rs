//! What computes: the flags of all commands that evolve or draw, and the devices and threads they ask for.

use std::sync::Arc;
use std::time::Duration;

use clap::{Args, ValueEnum};

use crate::cli::files::pipelines;
use crate::cli::terminal::{self, Verbosity};
use crate::cli::values;
use crate::error::{Error, NoDevice, Result};
use crate::studio::{self, Device, Opening};
use crate::threads;
use crate::vk::{DeviceRequest, Validation};

/// Most CPU threads.
const THREADS_MAX: u64 = 1_024;

/// The flags.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Computing")]
pub(crate) struct ComputingArgs {
    /// What computes: auto (the best GPU, else the CPU), cpu, vulkan, or one of smalti devices by its number or a part
    /// of its name
    ///
    /// uuid:HEX and pci:ADDRESS name a device exactly. The result is the same on every device.
    #[arg(long, value_name = "DEVICE", env = "SMALTI_DEVICE", hide_env_values = true, default_value = "auto")]
    pub device: String,
    /// CPU threads, 1 to 1,024; the result does not depend on them [default: all]
    #[arg(long, value_name = "T", env = "SMALTI_THREADS", hide_env_values = true, value_parser = thread_choice)]
    pub threads: Option<ThreadChoice>,
    /// If a graphics card is lost in the middle of the work: stop (exit code 75; the same command goes on later), or
    /// let the cpu make the rest, which comes to the same bytes
    #[arg(long, value_enum, value_name = "WHAT", default_value = "stop", hide_short_help = true)]
    pub on_device_lost: OnDeviceLost,
    /// How long a graphics card may take for a piece of work that is meant to last tenths of a second, before it counts
    /// as lost: such as 30s [default: 120s]
    #[arg(long, value_name = "TIME", value_parser = values::duration, hide_short_help = true)]
    pub device_timeout: Option<Duration>,
}

/// What is done when a device is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OnDeviceLost {
    /// The work ends with exit code 75.
    Stop,
    /// The CPU makes the rest.
    Cpu,
}

/// How many threads were asked for. An empty SMALTI_THREADS asks for none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ThreadChoice(Option<u64>);

fn thread_choice(text: &str) -> Result<ThreadChoice, String> {
    if text.is_empty() { Ok(ThreadChoice(None)) } else { values::count(text).map(Some).map(ThreadChoice) }
}

/// The flag of commands that can use several devices.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Computing")]
pub(crate) struct DevicesArg {
    /// Use several devices, each for its own pictures: all (every hardware GPU), or a list such as 0,1
    #[arg(long, value_name = "all|LIST")]
    pub devices: Option<String>,
}

impl DevicesArg {
    /// Opens the devices of the list or, without a list, the one of `--device` or SMALTI_DEVICE. The loss of one is an
    /// error, since another one may take its pictures.
    ///
    /// # Errors
    /// [`Error::NoSuitableDevice`] if one of them does not exist, or if `all` finds none; [`Error::Usage`] if the list
    /// is empty.
    pub(crate) fn select(&self, computing: &Computing) -> Result<Vec<Device>> {
        let Some(list) = &self.devices else { return Ok(vec![computing.select_itself()?]) };
        if list.trim() == "all" {
            return studio::select_all(&computing.opening(OnDeviceLost::Stop));
        }
        let names: Vec<&str> = list.split(',').map(str::trim).filter(|name| !name.is_empty()).collect();
        if names.is_empty() {
            return Err(Error::Usage("--devices: expected all, or devices with commas, such as 0,1".to_owned()));
        }
        let opening = computing.opening(OnDeviceLost::Stop);
        names.into_iter().map(|name| studio::select(&request(name)?, &opening)).collect()
    }
}

/// What was asked for, checked.
#[derive(Clone, Debug)]
pub(crate) struct Computing {
    pub request: DeviceRequest,
    pub validation: Validation,
    pub on_device_lost: OnDeviceLost,
    device_timeout: Option<Duration>,
    threads: Option<usize>,
}

impl ComputingArgs {
    /// Checks the flags. With `validation` the device must be one that the validation layer can watch.
    ///
    /// # Errors
    /// [`Error::Usage`] or [`Error::NoSuitableDevice`] that names the flag and what it may be.
    pub(crate) fn check(&self, validation: Validation) -> Result<Computing> {
        let request = request(&self.device)?;
        if validation == Validation::On && request == DeviceRequest::Cpu {
            let sentence = "--validate watches Vulkan, and --device cpu uses none; drop one of them";
            return Err(Error::Usage(sentence.to_owned()));
        }
        let in_range = |count| values::in_range("--threads", count, 1..=THREADS_MAX).map(|count| count as usize);
        let asked_for = self.threads.and_then(|ThreadChoice(count)| count);
        let threads = asked_for.map(in_range).transpose()?;
        let Self { on_device_lost, device_timeout, .. } = *self;
        Ok(Computing { request, validation, on_device_lost, device_timeout, threads })
    }

    /// Gives the CPU twin its threads, opens the device, and says so if the CPU computes unasked. For commands that
    /// need nothing between these steps.
    ///
    /// # Errors
    /// As [`ComputingArgs::check`] and [`Computing::select`].
    pub(crate) fn begin(&self, verbosity: Verbosity) -> Result<Device> {
        let computing = self.check(Validation::Off)?;
        computing.start_threads()?;
        let device = computing.select()?;
        if verbosity > Verbosity::Quiet {
            say_device(&device);
        }
        Ok(device)
    }
}

impl Computing {
    /// What is asked for where there are no flags.
    #[cfg(feature = "view")]
    pub(crate) fn usual() -> Self {
        Self {
            request: DeviceRequest::Auto,
            validation: Validation::Off,
            on_device_lost: OnDeviceLost::Stop,
            device_timeout: None,
            threads: None,
        }
    }

    /// Starts the threads of the CPU: as many as were asked for, or as many as there are processors.
    pub(crate) fn start_threads(&self) -> Result<()> {
        threads::start(self.threads).map_err(|error| match (self.threads, error) {
            (Some(count), Error::Threads { reason }) => {
                Error::Usage(format!("--threads {count}: the threads cannot be started ({reason}); ask for fewer"))
            }
            (_, error) => error,
        })
    }

    /// CPU threads: as many as were asked for, or all.
    pub(crate) fn thread_count(&self) -> usize {
        self.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
    }

    /// Finds and opens the device, with the pipelines that an earlier run cached for it. If it is lost, what was asked
    /// for is done.
    ///
    /// # Errors
    /// As [`studio::select`].
    pub(crate) fn select(&self) -> Result<Device> {
        studio::select(&self.request, &self.opening(self.on_device_lost))
    }

    /// As [`Computing::select`], but the loss of the device is an error, whatever was asked for.
    ///
    /// # Errors
    /// As [`studio::select`].
    pub(crate) fn select_itself(&self) -> Result<Device> {
        studio::select(&self.request, &self.opening(OnDeviceLost::Stop))
    }

    /// The same for another device.
    pub(crate) fn of(&self, request: DeviceRequest) -> Self {
        Self { request, ..self.clone() }
    }

    fn opening(&self, on_device_lost: OnDeviceLost) -> Opening {
        let tell = |error: &Error| terminal::error(&format!("{error}; the CPU makes the rest"));
        Opening {
            validation: self.validation,
            keeper: Some(pipelines::keeper()),
            patience: self.device_timeout,
            on_lost: if on_device_lost == OnDeviceLost::Cpu { Some(Arc::new(tell)) } else { None },
        }
    }
}

/// Says that the CPU computes, unless the user asked for it.
pub(crate) fn say_device(device: &Device) {
    if let Some(reason) = device.stand_in_reason() {
        terminal::say(&format!("smalti: computing on the CPU, since {reason}"));
    }
}

/// The device that was asked for. An empty text, as in an empty SMALTI_DEVICE, asks for none.
fn request(text: &str) -> Result<DeviceRequest> {
    let text = text.trim();
    if text.is_empty() {
        return Ok(DeviceRequest::Auto);
    }
    if text.bytes().all(|byte| byte.is_ascii_digit()) && text.parse::<usize>().is_err() {
        let why = format!(
            "--device {text}: there is no device with this number; see smalti devices for the numbers, or use auto"
        );
        return Err(Error::NoSuitableDevice { why: NoDevice::Other(why) });
    }
    text.parse().or_else(|_| by_word(text))
}

/// The device that a word means which is none of the forms: a part of a name, but not what every GPU could be called.
fn by_word(text: &str) -> Result<DeviceRequest> {
    let word = text.to_lowercase();
    if ["gpu", "cuda", "opencl", "metal", "rocm", "hardware"].contains(&word.as_str()) {
        return Err(Error::Usage(format!(
            "--device {text}: write --device auto, which takes the best GPU and, where there is none, the CPU; smalti \
             devices lists what there is"
        )));
    }
    if word.len() >= 3 && word.starts_with(char::is_alphabetic) && !word.contains([':', ',']) {
        return Ok(DeviceRequest::Name(word));
    }
    Err(Error::Usage(format!("--device {text}: expected {}", DeviceRequest::FORMS)))
}
