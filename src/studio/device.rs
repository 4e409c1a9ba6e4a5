//! What computes: the only place that chooses between Vulkan and the CPU twin.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use super::stand_in::{EvaluatorOrTwin, LanesOrTwins, PainterOrTwin, StandIn, Tell, search_or_twin};
use crate::cpu::cells::CpuSearch;
use crate::cpu::{CpuEvaluator, CpuPainter};
use crate::engine::Crew;
use crate::error::{Error, NoDevice, Result};
use crate::gpu::{GpuEvaluator, GpuPainter, VulkanLanes, VulkanSearch};
use crate::model::cells::{Course, Search};
use crate::model::{Evaluator, Fly, Painter, Scene};
use crate::vk::{
    self, Choice, DeviceInfo, DeviceKind, DeviceOptions, DeviceRequest, Instance, InstanceOptions, Timing, Validation,
    ValidationLog, choose,
};

/// Keeps what a driver compiled, for the next time that the same device is opened.
pub(crate) trait PipelineKeeper: Send + Sync {
    /// What was kept of a device; empty if nothing.
    fn read(&self, info: &DeviceInfo) -> Vec<u8>;

    /// Keeps the pipelines of a device. It only saves time, so that no failure is told.
    fn write(&self, info: &DeviceInfo, bytes: &[u8]);
}

/// What makes pictures: a Vulkan device, or the CPU. It is opened once and may make many pictures, also at the same
/// time.
pub struct Device {
    kind: Kind,
}

enum Kind {
    /// The CPU twin.
    Cpu {
        /// Why, if it was not asked for.
        reason: Option<String>,
    },
    /// A Vulkan device.
    Vulkan(Opened),
}

struct Opened {
    device: Arc<vk::Device>,
    validation_log: Arc<ValidationLog>,
    /// Whether somebody asked for Vulkan; else the CPU may stand in for it.
    is_asked_for: bool,
    keeper: Option<Arc<dyn PipelineKeeper>>,
    /// Makes the rest if the device is lost; if none, its loss is an error.
    stand_in: Option<StandIn>,
}

/// How a device is opened.
#[derive(Clone, Default)]
pub(crate) struct Opening {
    pub validation: Validation,
    /// Keeps what its driver compiles.
    pub keeper: Option<Arc<dyn PipelineKeeper>>,
    /// How long a submission to hardware may last, if not as long as usual.
    pub patience: Option<Duration>,
    /// Is called when the device is lost, after which the CPU makes the rest. Without it the loss is an error.
    pub on_lost: Option<Arc<Tell>>,
}

impl Drop for Opened {
    fn drop(&mut self) {
        if let Some(keeper) = &self.keeper {
            keeper.write(self.device.info(), &self.device.pipeline_cache_bytes());
        }
    }
}

impl fmt::Debug for Device {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_tuple("Device").field(&self.label()).finish()
    }
}

/// An evaluator whose passes are timed where they run on a device.
pub(crate) enum Timed {
    Cpu(CpuEvaluator),
    Vulkan(Box<GpuEvaluator>),
}

impl Timed {
    /// As [`Evaluator::load`].
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        match self {
            Self::Cpu(evaluator) => evaluator.load(populations),
            Self::Vulkan(evaluator) => evaluator.load(populations),
        }
    }

    /// Name and milliseconds of each pass of the last evaluation; none where there are no timestamps.
    pub(crate) fn pass_times(&self) -> Vec<(&'static str, f64)> {
        match self {
            Self::Cpu(_) => Vec::new(),
            Self::Vulkan(evaluator) => evaluator.pass_times().iter().map(|time| (time.name, time.ms)).collect(),
        }
    }
}

/// A search that is ready to begin.
pub(crate) struct OpenedSearch {
    pub search: Box<dyn Search>,
    /// Why the CPU searches in place of a device that nobody asked for, to follow the word "since".
    pub stand_in: Option<String>,
}

/// Finds and opens the device that was asked for. If the choice is left to `auto`, the CPU twin stands in wherever
/// Vulkan fails, since nobody asked for Vulkan; validation asks for it.
///
/// # Errors
/// [`Error::NoSuitableDevice`] if there is none, or if Vulkan or its validation layer is asked for and missing;
/// [`Error::Vulkan`] if a device that was asked for cannot be opened.
pub(crate) fn select(request: &DeviceRequest, opening: &Opening) -> Result<Device> {
    if *request == DeviceRequest::Cpu {
        return Ok(Device::cpu());
    }
    let is_asked_for = *request != DeviceRequest::Auto || opening.validation == Validation::On;
    let found = find(request, opening.validation).and_then(|found| match found {
        Found::Cpu { reason } => Ok(Device { kind: Kind::Cpu { reason: Some(reason) } }),
        Found::Vulkan(instance, info) => open(&instance, &info, is_asked_for, opening),
    });
    unless_nobody_asked(found, is_asked_for)
}

/// Opens every hardware GPU.
///
/// # Errors
/// [`Error::NoSuitableDevice`] if there is none; [`Error::Vulkan`] if one of them cannot be opened.
pub(crate) fn select_all(opening: &Opening) -> Result<Vec<Device>> {
    let instance = Instance::create(InstanceOptions { validation: opening.validation })?;
    let devices = instance.physical_devices()?;
    let gpus: Vec<&DeviceInfo> = devices.iter().filter(|info| info.kind != DeviceKind::Cpu).collect();
    if gpus.is_empty() {
        return Err(Error::NoSuitableDevice { why: NoDevice::NoGpu });
    }
    gpus.iter().map(|info| open(&instance, info, true, opening)).collect()
}

/// Opens a device, with the pipelines that were kept of it.
fn open(instance: &Arc<Instance>, info: &DeviceInfo, is_asked_for: bool, opening: &Opening) -> Result<Device> {
    let pipeline_cache = opening.keeper.as_ref().map_or_else(Vec::new, |keeper| keeper.read(info));
    let options = DeviceOptions { pipeline_cache, patience: opening.patience, ..DeviceOptions::default() };
    let device = vk::Device::create(instance, info, &options)?;
    let validation_log = Arc::clone(instance.validation_log());
    let keeper = opening.keeper.clone();
    let stand_in = opening.on_lost.clone().map(StandIn::new);
    Ok(Device { kind: Kind::Vulkan(Opened { device, validation_log, is_asked_for, keeper, stand_in }) })
}

/// What a request comes to.
enum Found {
    Cpu { reason: String },
    Vulkan(Arc<Instance>, Box<DeviceInfo>),
}

fn find(request: &DeviceRequest, validation: Validation) -> Result<Found> {
    let instance = Instance::create(InstanceOptions { validation })?;
    let devices = instance.physical_devices()?;
    let index = match choose(request, &devices)? {
        Choice::Cpu { reason } if validation == Validation::On => {
            return Err(Error::NoSuitableDevice { why: NoDevice::NothingToValidate { reason } });
        }
        Choice::Cpu { reason } => return Ok(Found::Cpu { reason }),
        Choice::Vulkan(index) => index,
    };
    let info = devices.into_iter().find(|info| info.index == index);
    let info = info.ok_or_else(|| Error::Internal(format!("device {index} was chosen and is not listed")))?;
    Ok(Found::Vulkan(instance, Box::new(info)))
}

/// The CPU twin in place of a Vulkan that failed and that nobody asked for.
fn unless_nobody_asked(found: Result<Device>, is_asked_for: bool) -> Result<Device> {
    match found {
        Err(error) if !is_asked_for => Ok(Device { kind: Kind::Cpu { reason: Some(why_no_vulkan(&error)) } }),
        found => found,
    }
}

/// Why the CPU twin stands in for Vulkan, to follow the word "since".
pub(crate) fn why_no_vulkan(error: &Error) -> String {
    match error {
        Error::NoSuitableDevice { why } => why.to_string(),
        other => other.to_string(),
    }
}

/// Turns what the validation layer said into an error.
///
/// # Errors
/// [`Error::Validation`] if it said anything.
pub(crate) fn check_messages(log: &ValidationLog) -> Result<()> {
    let messages = log.messages();
    let Some(first) = messages.first() else { return Ok(()) };
    let first = first.split_whitespace().collect::<Vec<_>>().join(" ");
    Err(Error::Validation(format!("{first} ({} messages in all)", messages.len())))
}

impl Device {
    /// The best hardware GPU, or else the CPU; both make the same bytes.
    ///
    /// # Errors
    /// None today: wherever Vulkan fails, the CPU stands in.
    pub fn auto() -> Result<Self> {
        select(&DeviceRequest::Auto, &Opening::default())
    }

    /// The CPU.
    #[must_use]
    pub fn cpu() -> Self {
        Self { kind: Kind::Cpu { reason: None } }
    }

    /// The device of a name: `auto`, `cpu`, `vulkan` (the best Vulkan device, software included), a number, `uuid:HEX`,
    /// `pci:ADDRESS` or `name:PART`.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the name has no such form; [`Error::NoSuitableDevice`] if there is no such device;
    /// [`Error::Vulkan`] if it cannot be opened.
    pub fn named(name: &str) -> Result<Self> {
        select(&name.parse()?, &Opening::default())
    }

    /// The device's name, for people.
    #[must_use]
    pub fn label(&self) -> &str {
        match &self.kind {
            Kind::Cpu { .. } => "CPU",
            Kind::Vulkan(opened) => &opened.device.info().name,
        }
    }

    /// Whether it is the CPU.
    #[must_use]
    pub fn is_cpu(&self) -> bool {
        matches!(self.kind, Kind::Cpu { .. })
    }

    /// Why the CPU stands in for Vulkan, if nobody asked for the CPU; to follow the word "since".
    #[must_use]
    pub fn stand_in_reason(&self) -> Option<&str> {
        if let Kind::Cpu { reason } = &self.kind { reason.as_deref() } else { None }
    }

    /// Whether somebody asked for this device; else the CPU may stand in for it.
    pub(crate) fn is_asked_for(&self) -> bool {
        matches!(&self.kind, Kind::Vulkan(opened) if opened.is_asked_for)
    }

    /// The Vulkan device, unless it is the CPU.
    pub(crate) fn vulkan(&self) -> Option<&Arc<vk::Device>> {
        if let Kind::Vulkan(opened) = &self.kind { Some(&opened.device) } else { None }
    }

    /// The Vulkan device unless it is lost, and what stands in for it.
    fn at_work(&self) -> Option<(&Arc<vk::Device>, Option<&StandIn>)> {
        let Kind::Vulkan(Opened { device, stand_in, .. }) = &self.kind else { return None };
        let is_lost = stand_in.as_ref().is_some_and(StandIn::is_needed);
        (!is_lost).then_some((device, stand_in.as_ref()))
    }

    /// An evaluator with one lane per scene on this device.
    ///
    /// # Errors
    /// If the device has no room for the scenes.
    pub(crate) fn open_evaluator(&self, scenes: Vec<Scene>) -> Result<Box<dyn Evaluator>> {
        Ok(match self.at_work() {
            None => Box::new(CpuEvaluator::new(scenes)),
            Some((device, None)) => Box::new(GpuEvaluator::create(device, scenes)?),
            Some((device, Some(stand_in))) => match GpuEvaluator::create(device, scenes.clone()) {
                Err(error) if stand_in.takes_over(&error) => Box::new(CpuEvaluator::new(scenes)),
                made => Box::new(EvaluatorOrTwin::new(Box::new(made?), scenes, stand_in.clone())),
            },
        })
    }

    /// A painter on this device. Where the device cannot draw, the CPU twin does it: it comes to the same bytes.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn open_painter(&self) -> Result<Box<dyn Painter>> {
        Ok(match self.at_work() {
            None => Box::new(CpuPainter),
            Some((device, None)) => Box::new(GpuPainter::create(device)?),
            Some((device, Some(stand_in))) => match GpuPainter::create(device) {
                Err(error) if stand_in.takes_over(&error) => Box::new(CpuPainter),
                made => Box::new(PainterOrTwin::new(Box::new(made?), stand_in.clone())),
            },
        })
    }

    /// A crew that evolves many pictures as lanes of this device; none on the CPU, which has a thread for each picture
    /// instead.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn open_crew(&self) -> Result<Option<Crew>> {
        let Some(device) = self.vulkan() else { return Ok(None) };
        let searches = Box::new(VulkanLanes::create(device, Timing::Off)?);
        let evolutions = Box::new(GpuEvaluator::create(device, Vec::new())?);
        Ok(Some(Crew::default().with_searches(searches).with_evolutions(evolutions)))
    }

    /// What the validation layer said so far, as an error. It is complete once what works on the device is gone.
    ///
    /// # Errors
    /// [`Error::Validation`] if it said anything.
    pub(crate) fn check_validation(&self) -> Result<()> {
        match &self.kind {
            Kind::Cpu { .. } => Ok(()),
            Kind::Vulkan(opened) => check_messages(&opened.validation_log),
        }
    }

    /// An evaluator that tells how long its passes took on the device.
    ///
    /// # Errors
    /// If the device has no room for the scenes.
    pub(crate) fn open_timed(&self, scenes: Vec<Scene>) -> Result<Timed> {
        match self.vulkan() {
            None => Ok(Timed::Cpu(CpuEvaluator::new(scenes))),
            Some(device) => Ok(Timed::Vulkan(Box::new(GpuEvaluator::create_timed(device, scenes)?))),
        }
    }

    /// What the device lacks for drawing, in words; empty if it draws by itself.
    pub(crate) fn missing_for_drawing(&self) -> &[String] {
        self.vulkan().map_or(&[], |device| device.info().missing_for_drawing.as_slice())
    }

    /// Name and version of the Vulkan driver.
    pub(crate) fn driver(&self) -> Option<String> {
        let info = self.vulkan()?.info();
        Some(format!("{} {}", info.driver_name, info.driver_info).trim().to_owned())
    }

    /// A search in cells on this device, which begins with absent flies. Where nobody asked for the device, the CPU
    /// twin searches what the device has no room for: it comes to the same bytes.
    ///
    /// # Errors
    /// If a device that was asked for has no room for the search, or its numbers do not fit it.
    pub(crate) fn open_search(&self, course: Course) -> Result<OpenedSearch> {
        let on_cpu = |course, stand_in| OpenedSearch { search: Box::new(CpuSearch::new(course)), stand_in };
        let Some((device, stand_in)) = self.at_work() else { return Ok(on_cpu(course, None)) };
        let opened: Result<Box<dyn Search>> = match stand_in {
            None => VulkanSearch::new(device, course.clone()).map(|search| -> Box<dyn Search> { Box::new(search) }),
            Some(stand_in) => VulkanLanes::create(device, Timing::Off)
                .and_then(|lanes| search_or_twin(LanesOrTwins::new(Box::new(lanes), stand_in.clone()), course.clone()))
                .map(|search| -> Box<dyn Search> { Box::new(search) }),
        };
        match opened {
            Ok(search) => Ok(OpenedSearch { search, stand_in: None }),
            Err(error) if stand_in.is_some_and(|stand_in| stand_in.takes_over(&error)) => Ok(on_cpu(course, None)),
            Err(error) if !self.is_asked_for() => Ok(on_cpu(course, Some(why_no_vulkan(&error)))),
            Err(error) => Err(error),
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
                Ok(device) => {
                    let reason = device.stand_in_reason().expect("the CPU twin stands in");
                    assert!(reason.contains("vkCreateInstance"), "{reason}");
                }
                Err(error) => panic!("the CPU twin was left out: {error}"),
            }
        }
        for error in failures() {
            assert!(unless_nobody_asked(Err(error), true).is_err());
        }
    }
}
