//! Watching a device: its observers are notified of every submission of recorded work, and its clock can be read.
//!
//! Observers may read the clock of the CPU and write files; nothing here does. A recorder does not notify observers
//! that were added after its creation.

use std::ffi::CStr;
use std::fmt::Debug;
use std::sync::Arc;

use ash::{ext, khr, vk};

use super::commands::run_once;
use super::physical::has_extension;
use super::timer::Timer;
use super::{Device, Instance, PassTime, Timing, call_failed, refused};
use crate::error::Result;

/// A submission of recorded work.
#[derive(Clone, Copy, Debug)]
pub struct Submission<'a> {
    /// Its number on this device, counted from 1 in the order of submission.
    pub number: u64,
    /// Name of the recorder that made it.
    pub recorder: &'a str,
}

/// Watches the submissions of a device. The thread that submits makes both calls, and several threads may do so at
/// once. Neither call may use a recorder of the device.
pub trait SubmissionObserver: Debug + Send + Sync {
    /// Whether recorders must time their passes.
    fn timing(&self) -> Timing {
        Timing::Off
    }

    /// Called just before the work is handed to the queue.
    fn before(&self, device: &Arc<Device>, submission: &Submission<'_>);

    /// Called when the work is over, with the times of its passes, if known; empty if the work failed.
    fn after(&self, device: &Arc<Device>, submission: &Submission<'_>, passes: &[PassTime]);
}

/// How to read the clock of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockMethod {
    /// Directly, by `VK_KHR_calibrated_timestamps` or `VK_EXT_calibrated_timestamps`.
    Calibrated,
    /// By a separate submission that writes a timestamp, at some moment before the submission is over.
    Submission,
}

/// The functions of calibrated timestamps, from whichever of the two extensions the driver offers.
pub(super) enum Calibrated {
    Khr(khr::calibrated_timestamps::Device),
    Ext(ext::calibrated_timestamps::Device),
}

/// The extension of calibrated timestamps to enable, if the driver offers one that can read the device's clock.
pub(super) fn clock_extension(instance: &Instance, physical: vk::PhysicalDevice) -> Result<Option<&'static CStr>> {
    let entry = instance.entry();
    let names = [khr::calibrated_timestamps::NAME, ext::calibrated_timestamps::NAME];
    for name in names {
        if !has_extension(instance.raw(), physical, name)? {
            continue;
        }
        // SAFETY: V1; the extension is there.
        let domains = unsafe {
            if name == names[0] {
                khr::calibrated_timestamps::Instance::new(entry, instance.raw())
                    .get_physical_device_calibrateable_time_domains(physical)
            } else {
                ext::calibrated_timestamps::Instance::new(entry, instance.raw())
                    .get_physical_device_calibrateable_time_domains(physical)
            }
        };
        if domains.is_ok_and(|domains| domains.contains(&vk::TimeDomainKHR::DEVICE)) {
            return Ok(Some(name));
        }
    }
    Ok(None)
}

impl Calibrated {
    /// The functions of the extension that was enabled.
    pub(super) fn new(instance: &ash::Instance, device: &ash::Device, name: &CStr) -> Self {
        if name == khr::calibrated_timestamps::NAME {
            Self::Khr(khr::calibrated_timestamps::Device::new(instance, device))
        } else {
            Self::Ext(ext::calibrated_timestamps::Device::new(instance, device))
        }
    }

    fn ticks(&self) -> Result<u64> {
        let asked = [vk::CalibratedTimestampInfoKHR::default().time_domain(vk::TimeDomainKHR::DEVICE)];
        // SAFETY: V1; the driver lists the domain.
        let read = unsafe {
            match self {
                Self::Khr(functions) => functions.get_calibrated_timestamps(&asked),
                Self::Ext(functions) => functions.get_calibrated_timestamps(&asked),
            }
        };
        let (ticks, _) = read.map_err(|result| call_failed("vkGetCalibratedTimestamps", result))?;
        ticks.first().copied().ok_or_else(|| refused("vkGetCalibratedTimestamps", "the driver returned no timestamp"))
    }
}

impl Device {
    /// Notifies `observer` of the submissions of every recorder that is created from now on.
    pub fn observe(&self, observer: Arc<dyn SubmissionObserver>) {
        super::lock(&self.observers).push(observer);
    }

    /// Recorders that are created from now on no longer notify `observer`.
    pub fn stop_observing(&self, observer: &Arc<dyn SubmissionObserver>) {
        super::lock(&self.observers).retain(|other| !Arc::ptr_eq(other, observer));
    }

    /// The best way to read the device's clock; `None` if it has no timestamps.
    #[must_use]
    pub fn clock_method(&self) -> Option<ClockMethod> {
        let has_timestamps = self.info().limits.timestamp_bits > 0;
        let best = if self.calibrated().is_some() { ClockMethod::Calibrated } else { ClockMethod::Submission };
        has_timestamps.then_some(best)
    }

    /// The clock of the device in ticks, as in [`PassTime::start_ticks`], at some moment during this call.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the device has no such clock, or fails.
    pub fn read_clock(self: &Arc<Self>, method: ClockMethod) -> Result<u64> {
        match (method, self.calibrated()) {
            (ClockMethod::Calibrated, Some(calibrated)) => calibrated.ticks(),
            (ClockMethod::Calibrated, None) => {
                Err(refused("vkGetCalibratedTimestamps", "the driver does not offer it"))
            }
            (ClockMethod::Submission, _) => {
                let no_clock = || refused("reading of the clock", "the device has no timestamps");
                let mut timer = Timer::create(self, "clock", Timing::On)?.ok_or_else(no_clock)?;
                run_once(self, "clock", |commands| {
                    timer.record_reset(commands);
                    if let Some(stop) = timer.record_start(commands, "clock") {
                        timer.record_stamp(commands, stop);
                    }
                })?;
                timer.collect()?;
                timer.times().first().map(|time| time.start_ticks).ok_or_else(no_clock)
            }
        }
    }

    /// Names of the tools that are active between this program and the driver, such as `RenderDoc`.
    #[must_use]
    pub fn tools(&self) -> Vec<String> {
        let (instance, physical) = (self.instance().raw(), self.physical());
        // SAFETY: V1.
        let tools = unsafe {
            instance.get_physical_device_tool_properties_len(physical).and_then(|count| {
                let mut tools = vec![vk::PhysicalDeviceToolProperties::default(); count];
                instance.get_physical_device_tool_properties(physical, &mut tools).map(|()| tools)
            })
        };
        let name = |tool: &vk::PhysicalDeviceToolProperties<'_>| {
            tool.name_as_c_str().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
        };
        tools.map(|tools| tools.iter().map(name).collect()).unwrap_or_default()
    }
}
