//! The Vulkan instance: loader and layers, and a sentence for each reason why Vulkan may be unavailable.

use std::ffi::CStr;
use std::sync::Arc;

use ash::vk;

use super::messages::{Messenger, ValidationLog};
use super::physical::{self, DeviceInfo};
use super::{call_failed, loader};
use crate::error::{Error, NoDevice, Result};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
const VALIDATION_FEATURES: &CStr = c"VK_EXT_validation_features";

/// Whether the validation layer watches every call.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Validation {
    /// No layer.
    #[default]
    Off,
    /// Core and synchronisation validation; messages go to [`Instance::validation_log`].
    On,
}

/// How to create an [`Instance`].
#[derive(Debug, Clone, Copy, Default)]
pub struct InstanceOptions {
    /// Whether to load the validation layer. Asking for it is an error if it is not installed.
    pub validation: Validation,
}

/// A connection to the Vulkan loader.
pub struct Instance {
    messenger: Option<Messenger>,
    log: Arc<ValidationLog>,
    raw: ash::Instance,
    has_debug_utils: bool,
    // Dropping it unloads libvulkan, so it comes last.
    entry: ash::Entry,
}

impl Instance {
    /// Opens the Vulkan loader and creates an instance for Vulkan 1.3.
    ///
    /// # Errors
    /// [`Error::NoSuitableDevice`] with what to install if the loader, a driver or the validation layer is missing;
    /// [`Error::Vulkan`] for anything else.
    pub fn create(options: InstanceOptions) -> Result<Arc<Self>> {
        Self::create_for_surface(options, &[])
    }

    /// As [`Self::create`], with the extensions that a surface needs.
    pub(super) fn create_for_surface(options: InstanceOptions, surface: &[&'static CStr]) -> Result<Arc<Self>> {
        let entry = loader::open().map_err(|error| no_loader(&error))?;
        require_vulkan_1_3(&entry)?;
        let extensions = Extensions::available(&entry, options.validation, surface)?;
        let log = Arc::new(ValidationLog::default());
        let has_debug_utils = extensions.debug_utils;
        let raw = create_raw(&entry, options.validation, &extensions, &log)?;
        let mut instance = Self { messenger: None, log, raw, has_debug_utils, entry: entry.clone() };
        if options.validation == Validation::On {
            instance.messenger = Some(Messenger::create(&entry, &instance.raw, &instance.log)?);
        }
        Ok(Arc::new(instance))
    }

    /// All Vulkan devices of this machine, usable or not, in the loader's order.
    ///
    /// # Errors
    /// [`Error::NoSuitableDevice`] if a driver is installed but finds no hardware.
    pub fn physical_devices(&self) -> Result<Vec<DeviceInfo>> {
        let handles = self.physical_handles()?;
        Ok(handles
            .iter()
            .enumerate()
            .map(|(index, &handle)| physical::describe_for_list(&self.raw, handle, index))
            .collect())
    }

    /// The messages of the validation layer; empty without [`Validation::On`]. The log may outlive the instance.
    #[must_use]
    pub fn validation_log(&self) -> &Arc<ValidationLog> {
        &self.log
    }

    /// Whether the validation layer is loaded and its messages are collected.
    #[must_use]
    pub fn validation(&self) -> Validation {
        if self.messenger.is_some() { Validation::On } else { Validation::Off }
    }

    pub(super) fn raw(&self) -> &ash::Instance {
        &self.raw
    }

    pub(super) fn entry(&self) -> &ash::Entry {
        &self.entry
    }

    pub(super) fn has_debug_utils(&self) -> bool {
        self.has_debug_utils
    }

    pub(super) fn physical_handles(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: V1.
        unsafe { self.raw.enumerate_physical_devices() }.map_err(explain_enumeration)
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some(messenger) = &self.messenger {
            messenger.destroy();
        }
        // SAFETY: V1: every device holds this instance, so none is left.
        unsafe { self.raw.destroy_instance(None) };
    }
}

/// The instance extensions to enable.
struct Extensions<'a> {
    /// What a surface needs; all of it is available.
    surface: &'a [&'static CStr],
    /// Object names, labels and the messenger.
    debug_utils: bool,
    /// Settings of the validation layer; offered by the layer itself.
    validation_features: bool,
    /// Makes the loader list drivers that implement only a part of Vulkan, such as those on top of Metal.
    portability: bool,
}

impl<'a> Extensions<'a> {
    fn available(entry: &ash::Entry, validation: Validation, surface: &'a [&'static CStr]) -> Result<Self> {
        let mut offered = list_extensions(entry, None)?;
        if validation == Validation::On {
            offered.extend(list_extensions(entry, Some(VALIDATION_LAYER))?);
        }
        let has =
            |name: &CStr| offered.iter().any(|extension| extension.extension_name_as_c_str().is_ok_and(|n| n == name));
        if let Some(absent) = surface.iter().find(|name| !has(name)) {
            let absent = absent.to_string_lossy();
            return Err(no_device(NoDevice::Other(format!("Vulkan shows no window here: no driver offers {absent}"))));
        }
        Ok(Self {
            surface,
            debug_utils: has(ash::ext::debug_utils::NAME),
            validation_features: has(VALIDATION_FEATURES),
            portability: has(ash::khr::portability_enumeration::NAME),
        })
    }

    fn names(&self) -> Vec<*const std::ffi::c_char> {
        let optional = [
            (self.debug_utils, ash::ext::debug_utils::NAME),
            (self.validation_features, VALIDATION_FEATURES),
            (self.portability, ash::khr::portability_enumeration::NAME),
        ]
        .into_iter()
        .filter_map(|(available, name)| available.then_some(name.as_ptr()));
        optional.chain(self.surface.iter().map(|name| name.as_ptr())).collect()
    }
}

fn list_extensions(entry: &ash::Entry, layer: Option<&CStr>) -> Result<Vec<vk::ExtensionProperties>> {
    // SAFETY: V1.
    unsafe { entry.enumerate_instance_extension_properties(layer) }.map_err(explain_creation)
}

fn require_vulkan_1_3(entry: &ash::Entry) -> Result<()> {
    // SAFETY: V1.
    let version = unsafe { entry.try_enumerate_instance_version() }
        .map_err(|result| call_failed("vkEnumerateInstanceVersion", result))?
        .unwrap_or(vk::API_VERSION_1_0);
    if version >= vk::API_VERSION_1_3 {
        return Ok(());
    }
    Err(no_device(NoDevice::OldLoader { major: vk::api_version_major(version), minor: vk::api_version_minor(version) }))
}

fn create_raw(
    entry: &ash::Entry,
    validation: Validation,
    extensions: &Extensions<'_>,
    log: &Arc<ValidationLog>,
) -> Result<ash::Instance> {
    let application = vk::ApplicationInfo::default().application_name(c"smalti").api_version(vk::API_VERSION_1_3);
    let extension_names = extensions.names();
    let layer_names = [VALIDATION_LAYER.as_ptr()];
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    // This messenger is chained in addition to the one created later, since only this one gets messages about the
    // creation and destruction of the instance itself.
    let mut messenger = log.messenger_info();
    let mut info =
        vk::InstanceCreateInfo::default().application_info(&application).enabled_extension_names(&extension_names);
    if extensions.portability {
        info = info.flags(vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
    }
    if validation == Validation::On {
        info = info.enabled_layer_names(&layer_names).push_next(&mut messenger);
        if extensions.validation_features {
            info = info.push_next(&mut features);
        }
    }
    // SAFETY: V1.
    unsafe { entry.create_instance(&info, None) }.map_err(explain_creation)
}

fn no_device(why: NoDevice) -> Error {
    Error::NoSuitableDevice { why }
}

fn no_loader(error: &ash::LoadingError) -> Error {
    no_device(NoDevice::NoLoader { reason: error.to_string() })
}

/// The error of a failure on the way to an instance.
fn explain_creation(result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => no_device(NoDevice::NoDriver),
        vk::Result::ERROR_LAYER_NOT_PRESENT => no_device(NoDevice::NoValidationLayer),
        other => call_failed("vkCreateInstance", other),
    }
}

/// The error of a failure to list the devices of an instance.
fn explain_enumeration(result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_INITIALIZATION_FAILED => no_device(NoDevice::NoHardware),
        other => call_failed("vkEnumeratePhysicalDevices", other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_in_which_vulkan_is_missing_tells_what_to_install() {
        for (error, expected) in [
            (explain_creation(vk::Result::ERROR_INCOMPATIBLE_DRIVER), NoDevice::NoDriver),
            (explain_creation(vk::Result::ERROR_LAYER_NOT_PRESENT), NoDevice::NoValidationLayer),
            (explain_enumeration(vk::Result::ERROR_INITIALIZATION_FAILED), NoDevice::NoHardware),
        ] {
            let Error::NoSuitableDevice { why } = &error else { panic!("{error}") };
            assert_eq!(*why, expected);
            // What that is on each system is tested in `error/install.rs`.
            assert!(why.to_string().contains("; install "), "{why}");
        }
    }
}
