//! The logical device: one queue that computes and, if the device can, draws; the memory allocator and the pipeline
//! cache.

use std::ffi::{CStr, CString};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use ash::ext::debug_utils;
use ash::vk;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings};

use super::abilities::{self, QueueFamily};
use super::observe::{Calibrated, clock_extension};
use super::physical::{self, DeviceInfo, DeviceKind};
use super::{Instance, SubmissionObserver, call_failed, lock, refused};
use crate::error::{Error, NoDevice, Result};

const PORTABILITY_SUBSET: &CStr = c"VK_KHR_portability_subset";
const MIB: u64 = 1 << 20;
/// A submission is meant to last tenths of a second.
const PATIENCE: Duration = Duration::from_secs(120);

/// How bytes reach buffers on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Staging {
    /// Directly if the CPU and the device share fast memory, otherwise through a staging buffer.
    #[default]
    Auto,
    /// Always through a staging buffer, so that a test on software Vulkan runs the same code as a discrete GPU.
    Forced,
}

/// How to create a [`Device`].
#[derive(Debug, Clone, Default)]
pub struct DeviceOptions {
    /// How bytes reach buffers on the device.
    pub staging: Staging,
    /// How long a submission to hardware may last; two minutes if nothing is said. Software Vulkan never hangs, it is
    /// only slow, so that it is always waited for.
    pub patience: Option<Duration>,
    /// What [`Device::pipeline_cache_bytes`] returned earlier, perhaps for another device or driver; empty if there is
    /// none.
    pub pipeline_cache: Vec<u8>,
}

/// A device that is ready to work.
pub struct Device {
    pipeline_cache: vk::PipelineCache,
    allocator: Mutex<Allocator>,
    queue: Mutex<vk::Queue>,
    queue_family: u32,
    staging: Staging,
    patience: Option<Duration>,
    /// Whether a submission outlasted the patience. The device may still use all that it ever was given, so that
    /// nothing of it is destroyed any more.
    is_given_up: AtomicBool,
    recordings: AtomicU64,
    submissions: AtomicU64,
    pub(super) observers: Mutex<Vec<Arc<dyn SubmissionObserver>>>,
    info: DeviceInfo,
    // Dropped after the allocator, which returns its memory to the device.
    raw: RawDevice,
}

/// The Vulkan device itself; destroyed after everything that was made from it.
struct RawDevice {
    functions: ash::Device,
    debug_utils: Option<debug_utils::Device>,
    calibrated: Option<Calibrated>,
    physical: vk::PhysicalDevice,
    instance: Arc<Instance>,
}

impl Drop for RawDevice {
    fn drop(&mut self) {
        // SAFETY: V1, V2: every wrapper holds the device, so none is left.
        unsafe { self.functions.destroy_device(None) };
    }
}

impl Device {
    /// Opens the device that `info` describes. If it lacks something for drawing, it is opened without what only
    /// drawing needs.
    ///
    /// # Errors
    /// [`Error::NoSuitableDevice`] if it lacks something or is no longer there; [`Error::Vulkan`] if the driver
    /// refuses.
    pub fn create(instance: &Arc<Instance>, info: &DeviceInfo, options: &DeviceOptions) -> Result<Arc<Self>> {
        let physical = find_physical(instance, info)?;
        let family = abilities::queue_family(instance.raw(), physical)
            .ok_or_else(|| lacks(info, vec![abilities::COMPUTE_QUEUE.to_owned()]))?;
        Self::open(instance, info, (physical, family), &[], options)
    }

    /// As [`Self::create`], with one more extension and a queue of a family that the device can present from.
    #[cfg(feature = "view")]
    pub(super) fn create_to_present(
        instance: &Arc<Instance>,
        info: &DeviceInfo,
        family: QueueFamily,
        extension: &CStr,
    ) -> Result<Arc<Self>> {
        let physical = find_physical(instance, info)?;
        let mut info = info.clone();
        info.limits.timestamp_bits = family.timestamp_bits;
        Self::open(instance, &info, (physical, family), &[extension], &DeviceOptions::default())
    }

    fn open(
        instance: &Arc<Instance>,
        info: &DeviceInfo,
        (physical, family): (vk::PhysicalDevice, QueueFamily),
        extensions: &[&CStr],
        options: &DeviceOptions,
    ) -> Result<Arc<Self>> {
        let queue_family = family.index;
        let clock = clock_extension(instance, physical)?;
        let extensions: Vec<&CStr> = extensions.iter().copied().chain(clock).collect();
        let functions = create_raw(instance, physical, info, queue_family, &extensions)?;
        let debug_utils = instance.has_debug_utils().then(|| debug_utils::Device::new(instance.raw(), &functions));
        let calibrated = clock.map(|name| Calibrated::new(instance.raw(), &functions, name));
        let raw = RawDevice { functions, debug_utils, calibrated, physical, instance: Arc::clone(instance) };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw().clone(),
            device: raw.functions.clone(),
            physical_device: physical,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: false,
            // The first blocks are small: many pictures are small, and on software Vulkan every mapped page costs time.
            allocation_sizes: AllocationSizes::new(8 * MIB, 8 * MIB)
                .with_max_device_memblock_size(256 * MIB)
                .with_max_host_memblock_size(64 * MIB),
        })
        .map_err(|error| refused("creation of the memory allocator", error.to_string()))?;
        // SAFETY: V1.
        let (queue, properties) = unsafe {
            (raw.functions.get_device_queue(queue_family, 0), instance.raw().get_physical_device_properties(physical))
        };
        let device = Self {
            pipeline_cache: create_pipeline_cache(&raw.functions, &properties, &options.pipeline_cache),
            allocator: Mutex::new(allocator),
            queue: Mutex::new(queue),
            queue_family,
            staging: options.staging,
            patience: (info.kind != DeviceKind::Cpu).then(|| options.patience.unwrap_or(PATIENCE)),
            is_given_up: AtomicBool::new(false),
            recordings: AtomicU64::new(0),
            submissions: AtomicU64::new(0),
            observers: Mutex::default(),
            info: info.clone(),
            raw,
        };
        device.set_name(device.raw().handle(), "device");
        device.set_name(queue, "queue");
        device.set_name(device.pipeline_cache, "pipeline cache");
        Ok(Arc::new(device))
    }

    /// The device's description.
    #[must_use]
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Refuses `call`, which only a device that can draw may be asked for.
    pub(super) fn require_drawing(&self, call: &str) -> Result<()> {
        if self.info.can_draw() {
            return Ok(());
        }
        Err(refused(call, format!("the device cannot draw: it lacks {}", self.info.missing_for_drawing.join(", "))))
    }

    /// How bytes reach buffers on the device.
    #[must_use]
    pub fn staging(&self) -> Staging {
        self.staging
    }

    /// The compiled pipelines, which the next start can reuse; empty if the driver returns none, or never answered.
    #[must_use]
    pub fn pipeline_cache_bytes(&self) -> Vec<u8> {
        if self.is_given_up() {
            return Vec::new();
        }
        // SAFETY: V1.
        unsafe { self.raw().get_pipeline_cache_data(self.pipeline_cache) }.unwrap_or_default()
    }

    pub(super) fn raw(&self) -> &ash::Device {
        &self.raw.functions
    }

    /// Names and labels for debuggers, if the instance offers them.
    pub(super) fn debug_utils(&self) -> Option<&debug_utils::Device> {
        self.raw.debug_utils.as_ref()
    }

    pub(super) fn allocator(&self) -> &Mutex<Allocator> {
        &self.allocator
    }

    pub(super) fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        lock(&self.queue)
    }

    pub(super) fn queue_family(&self) -> u32 {
        self.queue_family
    }

    pub(super) fn pipeline_cache(&self) -> vk::PipelineCache {
        self.pipeline_cache
    }

    pub(super) fn calibrated(&self) -> Option<&Calibrated> {
        self.raw.calibrated.as_ref()
    }

    pub(super) fn instance(&self) -> &Instance {
        &self.raw.instance
    }

    pub(super) fn physical(&self) -> vk::PhysicalDevice {
        self.raw.physical
    }

    /// A number that no other recording of this device has.
    pub(super) fn next_recording(&self) -> u64 {
        self.recordings.fetch_add(1, Ordering::Relaxed)
    }

    /// The number of the next submission, counted from 1.
    pub(super) fn next_submission(&self) -> u64 {
        self.submissions.fetch_add(1, Ordering::Relaxed) + 1
    }

    /// Gives a handle its debug name. Names only help people, so a failure is ignored.
    pub(super) fn set_name<T: vk::Handle + Copy>(&self, handle: T, name: &str) {
        if handle.is_null() {
            return;
        }
        if let (Some(debug_utils), Ok(name)) = (self.debug_utils(), CString::new(name)) {
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
            // SAFETY: V1; the handle was just created and no other thread has it.
            let _ = unsafe { debug_utils.set_debug_utils_object_name(&info) };
        }
    }

    /// How long a submission may last; none for as long as it needs.
    pub(super) fn patience(&self) -> Option<Duration> {
        self.patience
    }

    /// Whether a submission never ended.
    pub(super) fn is_given_up(&self) -> bool {
        self.is_given_up.load(Ordering::Relaxed)
    }

    /// Notes that a submission never ended. From here on nothing of the device is destroyed, and nothing is submitted.
    pub(super) fn give_up(self: &Arc<Self>) {
        self.is_given_up.store(true, Ordering::Relaxed);
        // One owner more than there are, so that it is never dropped.
        std::mem::forget(Arc::clone(self));
    }

    /// Waits until the queue is idle. A lost device counts as idle.
    pub(super) fn wait_idle(&self) {
        let queue = self.queue();
        // SAFETY: V1, V3.
        let _ = unsafe { self.raw().queue_wait_idle(*queue) };
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.wait_idle();
        // SAFETY: V1, V2.
        unsafe { self.raw().destroy_pipeline_cache(self.pipeline_cache, None) };
    }
}

fn lacks(info: &DeviceInfo, missing: Vec<String>) -> Error {
    Error::NoSuitableDevice { why: NoDevice::Lacks { request: None, device: info.name.clone(), missing } }
}

/// The handle behind a description, checked in case a device came or went in between.
fn find_physical(instance: &Instance, info: &DeviceInfo) -> Result<vk::PhysicalDevice> {
    if !info.missing.is_empty() {
        return Err(lacks(info, info.missing.clone()));
    }
    let handles = instance.physical_handles()?;
    let gone = || Error::NoSuitableDevice { why: NoDevice::Gone { device: info.name.clone() } };
    let handle = *handles.get(info.index).ok_or_else(gone)?;
    let now = physical::describe(instance.raw(), handle, info.index)?;
    if now.uuid == info.uuid { Ok(handle) } else { Err(gone()) }
}

fn create_raw(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    info: &DeviceInfo,
    queue_family: u32,
    extensions: &[&CStr],
) -> Result<ash::Device> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
    let mut extensions: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    // An implementation that is only partial requires this extension to be enabled.
    if physical::has_extension(instance.raw(), physical, PORTABILITY_SUBSET)? {
        extensions.push(PORTABILITY_SUBSET.as_ptr());
    }
    let mut features = vk::PhysicalDeviceVulkan13Features::default()
        .synchronization2(true)
        .maintenance4(true)
        .dynamic_rendering(info.can_draw())
        .shader_demote_to_helper_invocation(info.can_draw());
    let create_info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut features);
    // SAFETY: V1; `DeviceInfo::missing` was empty, so the features are there; those for drawing by `can_draw`.
    unsafe { instance.raw().create_device(physical, &create_info, None) }
        .map_err(|result| call_failed(format!("vkCreateDevice for {}", info.name), result))
}

/// A pipeline cache, filled with the bytes of an earlier one if they fit. Without a cache, a device still works, but
/// starts more slowly.
fn create_pipeline_cache(
    device: &ash::Device,
    properties: &vk::PhysicalDeviceProperties,
    bytes: &[u8],
) -> vk::PipelineCache {
    let bytes = if cache_fits(bytes, properties) { bytes } else { &[] };
    let info = vk::PipelineCacheCreateInfo::default().initial_data(bytes);
    // SAFETY: V1.
    unsafe { device.create_pipeline_cache(&info, None) }.unwrap_or_default()
}

/// Whether the header of a saved pipeline cache (`VkPipelineCacheHeaderVersionOne`) names this device and driver.
fn cache_fits(bytes: &[u8], properties: &vk::PhysicalDeviceProperties) -> bool {
    const HEADER_BYTES: usize = 32;
    let word = |index: usize| -> Option<u32> {
        Some(u32::from_ne_bytes(bytes.get(index * 4..index * 4 + 4)?.try_into().ok()?))
    };
    word(0).is_some_and(|size| size as usize >= HEADER_BYTES && size as usize <= bytes.len())
        && word(1) == u32::try_from(vk::PipelineCacheHeaderVersion::ONE.as_raw()).ok()
        && word(2) == Some(properties.vendor_id)
        && word(3) == Some(properties.device_id)
        && bytes.get(16..HEADER_BYTES) == Some(properties.pipeline_cache_uuid.as_slice())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_pipeline_cache_fits_only_the_device_and_driver_that_made_it() {
        let properties = vk::PhysicalDeviceProperties {
            vendor_id: 0x10de,
            device_id: 0x2330,
            pipeline_cache_uuid: [7; 16],
            ..Default::default()
        };
        let mut saved = Vec::new();
        for word in [32_u32, 1, 0x10de, 0x2330] {
            saved.extend(word.to_ne_bytes());
        }
        saved.extend([7; 16]);
        assert!(cache_fits(&saved, &properties));
        for index in [4, 8, 12, 16, 31] {
            let mut other = saved.clone();
            other[index] ^= 1;
            assert!(!cache_fits(&other, &properties), "byte {index} differs");
        }
        for length in [0, 3, 16, 31] {
            assert!(!cache_fits(&saved[..length], &properties), "cut at {length}");
        }
    }
}
