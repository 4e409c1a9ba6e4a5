//! Which evaluator does the work: the only place where the command line meets Vulkan and the CPU twin.

use std::sync::Arc;

use crate::cpu::CpuEvaluator;
use crate::error::{Error, Result};
use crate::gpu::GpuEvaluator;
use crate::model::{Evaluator, Scene};
use crate::vk::{
    Choice, Device, DeviceInfo, DeviceOptions, DeviceRequest, Instance, InstanceOptions, Validation, ValidationLog,
    choose,
};

/// The device that was chosen, not yet opened.
pub(super) enum Selected {
    /// The CPU twin.
    Cpu {
        /// Why, if it was not asked for.
        reason: Option<String>,
    },
    /// A Vulkan device.
    Vulkan { instance: Arc<Instance>, info: Box<DeviceInfo> },
}

/// An evaluator that is ready to work.
pub(super) struct Opened {
    pub evaluator: Box<dyn Evaluator>,
    /// What the validation layer says; complete once the evaluator is gone.
    pub validation_log: Option<Arc<ValidationLog>>,
}

/// Finds the device that was asked for.
///
/// # Errors
/// [`Error::NoSuitableDevice`] if there is none, or if Vulkan or its validation layer is asked for and missing.
pub(super) fn select(request: &DeviceRequest, validation: Validation) -> Result<Selected> {
    if *request == DeviceRequest::Cpu {
        return Ok(Selected::Cpu { reason: None });
    }
    let listed = Instance::create(InstanceOptions { validation })
        .and_then(|instance| instance.physical_devices().map(|devices| (instance, devices)));
    let (instance, devices) = match listed {
        Ok(listed) => listed,
        Err(Error::NoSuitableDevice { .. }) if *request == DeviceRequest::Auto && validation == Validation::Off => {
            let reason = "there is no Vulkan on this machine (`smalti devices` says what to install)".to_owned();
            return Ok(Selected::Cpu { reason: Some(reason) });
        }
        Err(error) => return Err(error),
    };
    match choose(request, &devices)? {
        Choice::Cpu { reason } => Ok(Selected::Cpu { reason: Some(reason) }),
        Choice::Vulkan(index) => {
            let info = devices.into_iter().find(|info| info.index == index).map(Box::new);
            let info = info.ok_or_else(|| Error::Internal(format!("device {index} was chosen and is not listed")))?;
            Ok(Selected::Vulkan { instance, info })
        }
    }
}

impl Selected {
    /// The device's name, for people.
    pub(super) fn label(&self) -> &str {
        match self {
            Self::Cpu { .. } => "CPU",
            Self::Vulkan { info, .. } => &info.name,
        }
    }

    /// An evaluator with one lane per scene on this device.
    ///
    /// # Errors
    /// If the device cannot be opened or has no room for the scenes.
    pub(super) fn open(self, scenes: Vec<Scene>) -> Result<Opened> {
        match self {
            Self::Cpu { .. } => Ok(Opened { evaluator: Box::new(CpuEvaluator::new(scenes)), validation_log: None }),
            Self::Vulkan { instance, info } => {
                let device = Device::create(&instance, &info, &DeviceOptions::default())?;
                let validation_log = Some(Arc::clone(instance.validation_log()));
                Ok(Opened { evaluator: Box::new(GpuEvaluator::create(&device, scenes)?), validation_log })
            }
        }
    }
}
