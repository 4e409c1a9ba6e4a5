//! Which evaluator does the work: the only place where the command line meets Vulkan and the CPU twin.

use std::sync::Arc;

use super::advice::why_no_vulkan;
use super::pipelines::{KeptPipelines, PipelineFile};
use super::prepared::check_messages;
use crate::cpu::CpuEvaluator;
use crate::cpu::cells::CpuSearch;
use crate::engine::{PaperCrew, SearchCrew};
use crate::error::{Error, NoDevice, Result};
use crate::gpu::{GpuEvaluator, VulkanLanes, VulkanSearch};
use crate::model::cells::{Course, Search};
use crate::model::{Evaluator, Fly, Scene};
use crate::vk::{
    Choice, Device, DeviceInfo, DeviceKind, DeviceOptions, DeviceRequest, Instance, InstanceOptions, Timing,
    Validation, ValidationLog, choose,
};

/// The device that was chosen, ready for an evaluator.
pub(super) enum Selected {
    /// The CPU twin.
    Cpu {
        /// Why, if it was not asked for.
        reason: Option<String>,
    },
    /// A Vulkan device.
    Vulkan {
        device: Arc<Device>,
        validation_log: Arc<ValidationLog>,
        /// Whether somebody asked for Vulkan; else the CPU may stand in for it.
        is_asked_for: bool,
        /// Keeps what the driver compiled for the next run, when it is dropped.
        _kept: KeptPipelines,
    },
}

/// An evaluator that is ready to work.
pub(super) struct Opened {
    pub evaluator: Box<dyn Evaluator>,
    /// What the validation layer says; complete once the evaluator is gone.
    pub validation_log: Option<Arc<ValidationLog>>,
}

/// An evaluator whose passes are timed where they run on a device.
pub(super) enum Timed {
    Cpu(CpuEvaluator),
    Vulkan(Box<GpuEvaluator>),
}

impl Timed {
    /// As [`Evaluator::load`].
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        match self {
            Self::Cpu(evaluator) => evaluator.load(populations),
            Self::Vulkan(evaluator) => evaluator.load(populations),
        }
    }

    /// Name and milliseconds of each pass of the last evaluation; none where there are no timestamps.
    pub(super) fn pass_times(&self) -> Vec<(&'static str, f64)> {
        match self {
            Self::Cpu(_) => Vec::new(),
            Self::Vulkan(evaluator) => evaluator.pass_times().iter().map(|time| (time.name, time.ms)).collect(),
        }
    }
}

/// A search that is ready to begin.
pub(super) struct OpenedSearch {
    pub search: Box<dyn Search>,
    /// Why the CPU searches in place of a device that nobody asked for, to follow the word "since".
    pub stand_in: Option<String>,
    /// What the validation layer says; complete once the search is gone.
    pub validation_log: Option<Arc<ValidationLog>>,
}

/// Finds and opens the device that was asked for. Who leaves the choice to `auto` gets the CPU twin wherever Vulkan
/// fails, since nobody asked for Vulkan; `--validate` asks for it.
///
/// # Errors
/// [`Error::NoSuitableDevice`] if there is none, or if Vulkan or its validation layer is asked for and missing;
/// [`Error::Vulkan`] if a device that was asked for cannot be opened.
pub(super) fn select(request: &DeviceRequest, validation: Validation) -> Result<Selected> {
    if *request == DeviceRequest::Cpu {
        return Ok(Selected::Cpu { reason: None });
    }
    let is_asked_for = *request != DeviceRequest::Auto || validation == Validation::On;
    unless_nobody_asked(find_and_open(request, validation, is_asked_for), is_asked_for)
}

/// Opens every hardware GPU.
///
/// # Errors
/// [`Error::NoSuitableDevice`] if there is none; [`Error::Vulkan`] if one of them cannot be opened.
pub(super) fn select_all(validation: Validation) -> Result<Vec<Selected>> {
    let instance = Instance::create(InstanceOptions { validation })?;
    let devices = instance.physical_devices()?;
    let gpus: Vec<&DeviceInfo> = devices.iter().filter(|info| info.kind != DeviceKind::Cpu).collect();
    if gpus.is_empty() {
        let why =
            "--devices all: there is no hardware GPU; see smalti devices, or leave it to --device auto".to_owned();
        return Err(Error::NoSuitableDevice { why: NoDevice::Other(why) });
    }
    let open = |info: &&DeviceInfo| {
        let (device, _kept) = open_device(&instance, info)?;
        let validation_log = Arc::clone(instance.validation_log());
        Ok(Selected::Vulkan { device, validation_log, is_asked_for: true, _kept })
    };
    gpus.iter().map(open).collect()
}

/// Opens a device, with the pipelines that an earlier run kept.
fn open_device(instance: &Arc<Instance>, info: &DeviceInfo) -> Result<(Arc<Device>, KeptPipelines)> {
    let pipelines = PipelineFile::read(info);
    let options = DeviceOptions { pipeline_cache: pipelines.bytes().to_vec(), ..DeviceOptions::default() };
    let device = Device::create(instance, info, &options)?;
    let kept = KeptPipelines::new(pipelines, &device);
    Ok((device, kept))
}

fn find_and_open(request: &DeviceRequest, validation: Validation, is_asked_for: bool) -> Result<Selected> {
    let instance = Instance::create(InstanceOptions { validation })?;
    let devices = instance.physical_devices()?;
    let index = match choose(request, &devices)? {
        Choice::Cpu { reason } if validation == Validation::On => {
            let why = format!("--validate needs a Vulkan device, and {reason}; name one, such as --device vulkan");
            return Err(Error::NoSuitableDevice { why: NoDevice::Other(why) });
        }
        Choice::Cpu { reason } => return Ok(Selected::Cpu { reason: Some(reason) }),
        Choice::Vulkan(index) => index,
    };
    let info = devices.iter().find(|info| info.index == index);
    let info = info.ok_or_else(|| Error::Internal(format!("device {index} was chosen and is not listed")))?;
    let (device, _kept) = open_device(&instance, info)?;
    Ok(Selected::Vulkan { device, validation_log: Arc::clone(instance.validation_log()), is_asked_for, _kept })
}

/// The CPU twin in place of a Vulkan that failed and that nobody asked for.
fn unless_nobody_asked(found: Result<Selected>, is_asked_for: bool) -> Result<Selected> {
    match found {
        Err(error) if !is_asked_for => Ok(Selected::Cpu { reason: Some(why_no_vulkan(&error)) }),
        found => found,
    }
}

impl Selected {
    /// Whether somebody asked for this device; else the CPU may stand in for it.
    pub(super) fn is_asked_for(&self) -> bool {
        matches!(self, Self::Vulkan { is_asked_for: true, .. })
    }

    /// The device's name, for people.
    pub(super) fn label(&self) -> &str {
        match self {
            Self::Cpu { .. } => "CPU",
            Self::Vulkan { device, .. } => &device.info().name,
        }
    }

    /// An evaluator with one lane per scene on this device.
    ///
    /// # Errors
    /// If the device has no room for the scenes.
    pub(super) fn open(&self, scenes: Vec<Scene>) -> Result<Opened> {
        match self {
            Self::Cpu { .. } => Ok(Opened { evaluator: Box::new(CpuEvaluator::new(scenes)), validation_log: None }),
            Self::Vulkan { device, validation_log, .. } => {
                let evaluator = Box::new(GpuEvaluator::create(device, scenes)?);
                Ok(Opened { evaluator, validation_log: Some(Arc::clone(validation_log)) })
            }
        }
    }

    /// The crews that evolve many pictures as lanes of this device, by either scheme; none on the CPU, which has a thread for each
    /// picture instead.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn crews(&self) -> Result<Option<(SearchCrew, PaperCrew)>> {
        let Self::Vulkan { device, .. } = self else { return Ok(None) };
        let searches = SearchCrew::new(Box::new(VulkanLanes::create(device, Timing::Off)?));
        Ok(Some((searches, PaperCrew::new(Box::new(GpuEvaluator::create(device, Vec::new())?)))))
    }

    /// What the validation layer said, as an error.
    ///
    /// # Errors
    /// [`Error::Validation`] if it said anything.
    pub(super) fn check_validation(&self) -> Result<()> {
        match self {
            Self::Cpu { .. } => Ok(()),
            Self::Vulkan { validation_log, .. } => check_messages(validation_log),
        }
    }

    /// An evaluator that tells how long its passes took on the device.
    ///
    /// # Errors
    /// If the device has no room for the scenes.
    pub(super) fn open_timed(&self, scenes: Vec<Scene>) -> Result<Timed> {
        match self {
            Self::Cpu { .. } => Ok(Timed::Cpu(CpuEvaluator::new(scenes))),
            Self::Vulkan { device, .. } => Ok(Timed::Vulkan(Box::new(GpuEvaluator::create_timed(device, scenes)?))),
        }
    }

    /// Name and version of the Vulkan driver.
    pub(super) fn driver(&self) -> Option<String> {
        match self {
            Self::Cpu { .. } => None,
            Self::Vulkan { device, .. } => {
                let info = device.info();
                Some(format!("{} {}", info.driver_name, info.driver_info).trim().to_owned())
            }
        }
    }

    /// A search in cells on this device, which begins with absent flies. Where nobody asked for the device, the CPU twin searches what the
    /// device has no room for: it comes to the same bytes.
    ///
    /// # Errors
    /// If a device that was asked for has no room for the search, or its numbers do not fit it.
    pub(super) fn open_search(&self, course: Course) -> Result<OpenedSearch> {
        let on_cpu = |course, stand_in| OpenedSearch {
            search: Box::new(CpuSearch::new(course)),
            stand_in,
            validation_log: None,
        };
        match self {
            Self::Cpu { .. } => Ok(on_cpu(course, None)),
            Self::Vulkan { device, validation_log, is_asked_for, .. } => {
                match VulkanSearch::new(device, course.clone()) {
                    Ok(search) => {
                        let validation_log = Some(Arc::clone(validation_log));
                        Ok(OpenedSearch { search: Box::new(search), stand_in: None, validation_log })
                    }
                    Err(error) if !is_asked_for => Ok(on_cpu(course, Some(why_no_vulkan(&error)))),
                    Err(error) => Err(error),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vulkan_that_fails_is_an_error_only_for_those_who_asked_for_it() {
        let failures = || {
            let broken = Error::Vulkan { call: "vkCreateInstance".to_owned(), reason: "ended".to_owned() };
            [broken, Error::NoSuitableDevice { why: NoDevice::Other("vkCreateInstance ended".to_owned()) }]
        };
        for error in failures() {
            match unless_nobody_asked(Err(error), false) {
                Ok(Selected::Cpu { reason: Some(reason) }) => assert!(reason.contains("vkCreateInstance"), "{reason}"),
                _ => panic!("the CPU twin was left out"),
            }
        }
        for error in failures() {
            assert!(unless_nobody_asked(Err(error), true).is_err());
        }
    }
}
