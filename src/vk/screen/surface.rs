//! The surface of a window: where Vulkan shows what it drew. Also finds out which device can show it best.

use std::any::Any;
use std::ffi::CStr;
use std::sync::Arc;

use ash::{khr, vk};
use winit::raw_window_handle::{HandleError, HasDisplayHandle, HasWindowHandle, RawDisplayHandle};

use crate::error::{Error, NoDevice, Result};
use crate::vk::abilities::{QueueFamily, computing_families};
use crate::vk::choose::rank;
use crate::vk::instance::{Instance, InstanceOptions};
use crate::vk::physical::{DeviceInfo, has_extension};
use crate::vk::{call_failed, refused};

/// A window's surface.
pub(super) struct Surface {
    functions: khr::surface::Instance,
    handle: vk::SurfaceKHR,
    instance: Arc<Instance>,
    // Last, since the surface lives in it.
    _window: Arc<dyn Any + Send + Sync>,
}

impl Surface {
    /// Creates an instance that can show windows like this one, and the window's surface.
    pub(super) fn create<W>(window: Arc<W>, options: InstanceOptions) -> Result<Arc<Self>>
    where
        W: HasDisplayHandle + HasWindowHandle + Send + Sync + 'static,
    {
        let gone = |error: HandleError| refused("opening of the window", error.to_string());
        let display = window.display_handle().map_err(gone)?.as_raw();
        let instance = Instance::create_for_surface(options, &extensions(display)?)?;
        let raw_window = window.window_handle().map_err(gone)?.as_raw();
        // SAFETY: V1; the extensions are enabled, and the window is kept until the surface is gone.
        let handle = unsafe { ash_window::create_surface(instance.entry(), instance.raw(), display, raw_window, None) }
            .map_err(|result| call_failed("creation of the window's surface", result))?;
        let functions = khr::surface::Instance::new(instance.entry(), instance.raw());
        Ok(Arc::new(Self { functions, handle, instance, _window: window }))
    }

    pub(super) fn instance(&self) -> &Arc<Instance> {
        &self.instance
    }

    pub(super) fn raw(&self) -> vk::SurfaceKHR {
        self.handle
    }

    /// The best device that draws and shows the window, with the family of queues for that.
    pub(super) fn best_device(&self) -> Result<(DeviceInfo, QueueFamily)> {
        let mut devices = self.instance.physical_devices()?;
        devices.sort_by_key(rank);
        let mut reasons = Vec::new();
        for info in devices {
            match self.family_of(&info)? {
                Ok(family) => return Ok((info, family)),
                Err(missing) => reasons.push(format!("{} lacks {missing}", info.name)),
            }
        }
        let why = if reasons.is_empty() { "there is none".to_owned() } else { reasons.join("; ") };
        Err(Error::NoSuitableDevice { why: NoDevice::Other(format!("no Vulkan device can draw in a window: {why}")) })
    }

    /// The family of queues that computes, draws and presents, or what the device lacks, in words.
    fn family_of(&self, info: &DeviceInfo) -> Result<Result<QueueFamily, String>> {
        if !info.missing.is_empty() || !info.can_draw() {
            let missing: Vec<&str> = info.missing.iter().chain(&info.missing_for_drawing).map(String::as_str).collect();
            return Ok(Err(missing.join(", ")));
        }
        let handles = self.instance.physical_handles()?;
        let Some(&physical) = handles.get(info.index) else { return Ok(Err("its hardware".to_owned())) };
        if !has_extension(self.instance.raw(), physical, khr::swapchain::NAME)? {
            return Ok(Err("VK_KHR_swapchain".to_owned()));
        }
        for family in computing_families(self.instance.raw(), physical).into_iter().filter(|it| it.has_graphics) {
            // SAFETY: V1.
            let presents =
                unsafe { self.functions.get_physical_device_surface_support(physical, family.index, self.handle) };
            if presents.map_err(|result| call_failed("vkGetPhysicalDeviceSurfaceSupportKHR", result))? {
                return Ok(Ok(family));
            }
        }
        Ok(Err("a queue that computes, draws and presents".to_owned()))
    }

    /// The format for the swapchain's images: colours go there as they are.
    pub(super) fn format(&self, physical: vk::PhysicalDevice) -> Result<vk::SurfaceFormatKHR> {
        // SAFETY: V1.
        let offered = unsafe { self.functions.get_physical_device_surface_formats(physical, self.handle) }
            .map_err(|result| call_failed("vkGetPhysicalDeviceSurfaceFormatsKHR", result))?;
        best_format(&offered).ok_or_else(|| {
            let why = "the window takes no colours of 8 bits a channel as they are (B8G8R8A8_UNORM, R8G8B8A8_UNORM)";
            Error::NoSuitableDevice { why: NoDevice::Other(why.to_owned()) }
        })
    }

    /// What the surface is like now.
    pub(super) fn capabilities(&self, physical: vk::PhysicalDevice) -> Result<vk::SurfaceCapabilitiesKHR> {
        // SAFETY: V1.
        unsafe { self.functions.get_physical_device_surface_capabilities(physical, self.handle) }
            .map_err(|result| call_failed("vkGetPhysicalDeviceSurfaceCapabilitiesKHR", result))
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        // SAFETY: V1, V2: every swapchain holds its surface, so none is left.
        unsafe { self.functions.destroy_surface(self.handle, None) };
    }
}

/// The instance extensions for a surface on this display.
fn extensions(display: RawDisplayHandle) -> Result<Vec<&'static CStr>> {
    let names = ash_window::enumerate_required_extensions(display).map_err(|_| {
        let why = "Vulkan knows no windows of this system".to_owned();
        Error::NoSuitableDevice { why: NoDevice::Other(why) }
    })?;
    // SAFETY: V1; they are constants of `ash`, which ends each with a zero.
    Ok(names.iter().map(|&name| unsafe { CStr::from_ptr(name) }).collect())
}

/// Where formats encode colours themselves, the interface would blend them as light; `egui` wants them blended as they
/// are stored.
fn best_format(offered: &[vk::SurfaceFormatKHR]) -> Option<vk::SurfaceFormatKHR> {
    let is_srgb = |it: &&vk::SurfaceFormatKHR| it.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR;
    let wanted = [vk::Format::B8G8R8A8_UNORM, vk::Format::R8G8B8A8_UNORM];
    wanted.into_iter().find_map(|format| offered.iter().filter(is_srgb).find(|it| it.format == format).copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_format_that_stores_colours_as_they_are_is_taken_before_any_that_encodes_them() {
        let of = |formats: &[vk::Format]| {
            let color_space = vk::ColorSpaceKHR::SRGB_NONLINEAR;
            let offered: Vec<_> = formats.iter().map(|&format| vk::SurfaceFormatKHR { format, color_space }).collect();
            best_format(&offered).map(|found| found.format)
        };
        let (bgra, rgba) = (vk::Format::B8G8R8A8_UNORM, vk::Format::R8G8B8A8_UNORM);
        assert_eq!(of(&[vk::Format::B8G8R8A8_SRGB, rgba, bgra]), Some(bgra));
        assert_eq!(of(&[vk::Format::R8G8B8A8_SRGB, rgba]), Some(rgba));
        assert_eq!(of(&[vk::Format::R8G8B8A8_SRGB]), None);
        let wide = vk::SurfaceFormatKHR { format: bgra, color_space: vk::ColorSpaceKHR::HDR10_ST2084_EXT };
        assert_eq!(best_format(&[wide]), None);
    }
}
