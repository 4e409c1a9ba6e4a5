//! What a physical device is and what it lacks, as plain data that can be printed, and compared without a device.

use std::ffi::CStr;

use ash::vk;
use serde::Serialize;

use super::abilities::{self, Lacking};
use super::call_failed;
use crate::error::Result;

/// The kind of hardware behind a Vulkan device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// A GPU with its own memory.
    Discrete,
    /// A GPU that shares the memory of the CPU.
    Integrated,
    /// A GPU lent to a virtual machine.
    Virtual,
    /// Software on the CPU.
    Cpu,
    /// Anything else.
    Other,
}

/// The limits of a device that decide whether a job fits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceLimits {
    /// Largest storage buffer that a shader can access, in bytes.
    pub storage_buffer_bytes: u64,
    /// Largest buffer, in bytes; unlimited below Vulkan 1.3.
    pub buffer_bytes: u64,
    /// Largest allocation of memory, in bytes; unlimited below Vulkan 1.3.
    pub allocation_bytes: u64,
    /// Most storage buffers that one shader stage can access.
    pub storage_buffers_per_stage: u32,
    /// Most workgroups of one dispatch along x, y and z.
    pub workgroups: [u32; 3],
    /// Most invocations of one workgroup.
    pub workgroup_invocations: u32,
    /// Shared memory of one workgroup, in bytes.
    pub shared_memory_bytes: u32,
    /// Push constants of one pipeline, in bytes.
    pub push_constant_bytes: u32,
    /// Longest side of a two-dimensional image, in pixels.
    pub image_side_px: u32,
    /// Most layers of an image.
    pub image_layers: u32,
    /// Nanoseconds per tick of a timestamp.
    pub timestamp_period_ns: f32,
    /// Number of valid bits of a timestamp; 0 if there are no timestamps.
    pub timestamp_bits: u32,
}

impl DeviceLimits {
    /// The largest storage buffer that can be made and seen whole, in bytes.
    #[must_use]
    pub fn largest_storage_buffer_bytes(&self) -> u64 {
        self.storage_buffer_bytes.min(self.buffer_bytes).min(self.allocation_bytes)
    }

    /// Nanoseconds from one timestamp to another; negative if the second one is older. Only the valid bits count.
    #[must_use]
    pub fn ns_between(&self, from_ticks: u64, to_ticks: u64) -> f64 {
        let unused = 64 - self.timestamp_bits.clamp(1, 64);
        // The highest valid bit becomes the sign.
        let ticks = (to_ticks.wrapping_sub(from_ticks) << unused).cast_signed() >> unused;
        ticks as f64 * f64::from(self.timestamp_period_ns)
    }
}

/// A description of a Vulkan device.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceInfo {
    /// Position in the loader's list, counted from 0.
    pub index: usize,
    /// Name given by the driver.
    pub name: String,
    /// Kind of hardware.
    pub kind: DeviceKind,
    /// PCI vendor, or a number that Khronos assigned.
    pub vendor_id: u32,
    /// Number that the vendor gave to the device.
    pub device_id: u32,
    /// Name of the driver; empty below Vulkan 1.3.
    pub driver_name: String,
    /// The driver's own words about its version; empty below Vulkan 1.3.
    pub driver_info: String,
    /// The driver's version as a plain number, whose format depends on the vendor.
    pub driver_version: u32,
    /// Vulkan version of the device, such as `1.3.230`.
    pub api_version: String,
    /// Device UUID in lower-case hexadecimal with dashes; empty below Vulkan 1.3.
    pub uuid: String,
    /// Address on the PCI bus, such as `0000:65:00.0`, if the driver reports it.
    pub pci: Option<String>,
    /// Memory on the device, in bytes.
    pub memory_bytes: u64,
    /// Invocations of a subgroup; 0 below Vulkan 1.3.
    pub subgroup_size: u32,
    /// Groups of subgroup operations that compute shaders may use.
    pub subgroup_operations: Vec<&'static str>,
    /// The limits that decide whether a job fits.
    pub limits: DeviceLimits,
    /// What the device lacks, in words; empty if it can be used.
    pub missing: Vec<String>,
    /// What the device lacks to draw, in words; empty if it can draw, or not known below Vulkan 1.3. Without it the
    /// device still computes.
    pub missing_for_drawing: Vec<String>,
}

impl DeviceInfo {
    /// Whether the device can draw, if it can be used at all.
    #[must_use]
    pub fn can_draw(&self) -> bool {
        self.missing_for_drawing.is_empty()
    }

    /// Whether it ends all loops of an invocation silently after 65,535 turns, as lavapipe does (Mesa 22.3.6).
    #[must_use]
    pub fn cuts_loops_short(&self) -> bool {
        self.driver_name == "llvmpipe"
    }

    /// Whether compute shaders may add up over subgroups. Where they may not, others take their place.
    #[must_use]
    pub fn has_subgroup_arithmetic(&self) -> bool {
        ["basic", "arithmetic"].iter().all(|needed| self.subgroup_operations.contains(needed))
    }
}

const SUBGROUP_NAMES: [(vk::SubgroupFeatureFlags, &str); 8] = [
    (vk::SubgroupFeatureFlags::BASIC, "basic"),
    (vk::SubgroupFeatureFlags::VOTE, "vote"),
    (vk::SubgroupFeatureFlags::ARITHMETIC, "arithmetic"),
    (vk::SubgroupFeatureFlags::BALLOT, "ballot"),
    (vk::SubgroupFeatureFlags::SHUFFLE, "shuffle"),
    (vk::SubgroupFeatureFlags::SHUFFLE_RELATIVE, "shuffle-relative"),
    (vk::SubgroupFeatureFlags::CLUSTERED, "clustered"),
    (vk::SubgroupFeatureFlags::QUAD, "quad"),
];

/// A limit of which some pipeline needs more than every Vulkan device has.
#[derive(Clone, Copy, Debug)]
pub struct NeededLimit {
    /// What it is called.
    pub name: &'static str,
    /// How much is needed.
    pub needed: u32,
    offered: fn(&DeviceLimits) -> u32,
}

/// All such limits. A test compares the needs with the modules of the shaders.
pub const NEEDED_LIMITS: [NeededLimit; 2] = [
    NeededLimit {
        name: "storage buffers per shader stage",
        needed: 14,
        offered: |limits| limits.storage_buffers_per_stage,
    },
    NeededLimit { name: "invocations in a workgroup", needed: 256, offered: |limits| limits.workgroup_invocations },
];

/// Asks the driver everything that [`DeviceInfo`] holds.
pub(super) fn describe(instance: &ash::Instance, handle: vk::PhysicalDevice, index: usize) -> Result<DeviceInfo> {
    let mut info = identity(instance, handle, index);
    add_details(instance, handle, &mut info)?;
    Ok(info)
}

/// As [`describe`], but a failure of the driver only adds to [`DeviceInfo::missing`]: a broken driver must not hide the
/// devices of the others.
pub(super) fn describe_for_list(instance: &ash::Instance, handle: vk::PhysicalDevice, index: usize) -> DeviceInfo {
    let mut info = identity(instance, handle, index);
    if let Err(error) = add_details(instance, handle, &mut info) {
        info.missing.push(format!("a working driver ({error})"));
    }
    info
}

/// What every driver reports without failing.
fn identity(instance: &ash::Instance, handle: vk::PhysicalDevice, index: usize) -> DeviceInfo {
    // SAFETY: V1.
    let properties = unsafe { instance.get_physical_device_properties(handle) };
    let family = abilities::queue_family(instance, handle);
    let version = properties.api_version;
    DeviceInfo {
        index,
        name: text(properties.device_name_as_c_str()),
        kind: kind_of(properties.device_type),
        vendor_id: properties.vendor_id,
        device_id: properties.device_id,
        driver_name: String::new(),
        driver_info: String::new(),
        driver_version: properties.driver_version,
        api_version: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        uuid: String::new(),
        pci: None,
        memory_bytes: local_memory_bytes(instance, handle),
        subgroup_size: 0,
        subgroup_operations: Vec::new(),
        limits: limits_of(&properties.limits, family.map_or(0, |family| family.timestamp_bits)),
        missing: Vec::new(),
        missing_for_drawing: Vec::new(),
    }
}

fn add_details(instance: &ash::Instance, handle: vk::PhysicalDevice, info: &mut DeviceInfo) -> Result<()> {
    // SAFETY: V1.
    if unsafe { instance.get_physical_device_properties(handle) }.api_version < vk::API_VERSION_1_3 {
        // The queries below need Vulkan 1.3; they would be invalid for an older device.
        info.missing.push(format!("Vulkan 1.3 (the driver offers {})", info.api_version));
        return Ok(());
    }
    add_modern_properties(instance, handle, info)?;
    let Lacking { to_work, to_draw } = abilities::lacking(instance, handle);
    info.missing.extend(to_work);
    info.missing.extend(missing_limits(&info.limits));
    info.missing_for_drawing = to_draw;
    Ok(())
}

/// The limits that are too low, in words.
fn missing_limits(limits: &DeviceLimits) -> impl Iterator<Item = String> {
    let too_low = |NeededLimit { name, needed, offered }: NeededLimit| {
        let offered = offered(limits);
        (offered < needed).then(|| format!("{needed} {name} (it has {offered})"))
    };
    NEEDED_LIMITS.into_iter().filter_map(too_low)
}

/// Whether the device offers the extension.
pub(super) fn has_extension(instance: &ash::Instance, handle: vk::PhysicalDevice, name: &CStr) -> Result<bool> {
    // SAFETY: V1.
    let extensions = unsafe { instance.enumerate_device_extension_properties(handle) }
        .map_err(|result| call_failed("vkEnumerateDeviceExtensionProperties", result))?;
    Ok(extensions.iter().any(|extension| extension.extension_name_as_c_str().is_ok_and(|found| found == name)))
}

fn kind_of(device_type: vk::PhysicalDeviceType) -> DeviceKind {
    match device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
        vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
        _ => DeviceKind::Other,
    }
}

fn limits_of(limits: &vk::PhysicalDeviceLimits, timestamp_bits: u32) -> DeviceLimits {
    DeviceLimits {
        storage_buffer_bytes: u64::from(limits.max_storage_buffer_range),
        buffer_bytes: u64::MAX,
        allocation_bytes: u64::MAX,
        storage_buffers_per_stage: limits.max_per_stage_descriptor_storage_buffers,
        workgroups: limits.max_compute_work_group_count,
        workgroup_invocations: limits.max_compute_work_group_invocations,
        shared_memory_bytes: limits.max_compute_shared_memory_size,
        push_constant_bytes: limits.max_push_constants_size,
        image_side_px: limits.max_image_dimension2_d,
        image_layers: limits.max_image_array_layers,
        timestamp_period_ns: limits.timestamp_period,
        timestamp_bits,
    }
}

fn local_memory_bytes(instance: &ash::Instance, handle: vk::PhysicalDevice) -> u64 {
    // SAFETY: V1.
    let memory = unsafe { instance.get_physical_device_memory_properties(handle) };
    memory
        .memory_heaps_as_slice()
        .iter()
        .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
        .map(|heap| heap.size)
        .sum()
}

fn add_modern_properties(instance: &ash::Instance, handle: vk::PhysicalDevice, info: &mut DeviceInfo) -> Result<()> {
    let has_pci = has_extension(instance, handle, ash::ext::pci_bus_info::NAME)?;
    let mut vulkan11 = vk::PhysicalDeviceVulkan11Properties::default();
    let mut vulkan12 = vk::PhysicalDeviceVulkan12Properties::default();
    let mut vulkan13 = vk::PhysicalDeviceVulkan13Properties::default();
    let mut pci = vk::PhysicalDevicePCIBusInfoPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceProperties2::default()
        .push_next(&mut vulkan11)
        .push_next(&mut vulkan12)
        .push_next(&mut vulkan13);
    if has_pci {
        properties = properties.push_next(&mut pci);
    }
    // SAFETY: V1.
    unsafe { instance.get_physical_device_properties2(handle, &mut properties) };

    info.driver_name = text(vulkan12.driver_name_as_c_str());
    info.driver_info = text(vulkan12.driver_info_as_c_str());
    info.uuid = dashed(&vulkan11.device_uuid);
    info.pci = has_pci
        .then(|| format!("{:04x}:{:02x}:{:02x}.{:x}", pci.pci_domain, pci.pci_bus, pci.pci_device, pci.pci_function));
    info.limits.buffer_bytes = vulkan13.max_buffer_size;
    info.limits.allocation_bytes = vulkan11.max_memory_allocation_size;
    info.subgroup_size = vulkan11.subgroup_size;
    let in_compute = vulkan11.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE);
    let operations =
        if in_compute { vulkan11.subgroup_supported_operations } else { vk::SubgroupFeatureFlags::empty() };
    info.subgroup_operations =
        SUBGROUP_NAMES.iter().filter(|(flag, _)| operations.contains(*flag)).map(|&(_, name)| name).collect();
    Ok(())
}

fn text<E>(words: Result<&CStr, E>) -> String {
    words.map(|words| words.to_string_lossy().into_owned()).unwrap_or_default()
}

/// A UUID as people write it: 8-4-4-4-12 hexadecimal digits.
fn dashed(uuid: &[u8; 16]) -> String {
    let mut words = String::with_capacity(36);
    for (index, byte) in uuid.iter().enumerate() {
        if matches!(index, 4 | 6 | 8 | 10) {
            words.push('-');
        }
        words.push_str(&format!("{byte:02x}"));
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_that_wraps_between_two_timestamps_still_gives_their_distance() {
        let limits = |timestamp_bits, timestamp_period_ns| {
            let limits = limits_of(&vk::PhysicalDeviceLimits::default(), timestamp_bits);
            DeviceLimits { timestamp_period_ns, ..limits }
        };
        assert_eq!(limits(64, 1.0).ns_between(1_000, 3_000), 2_000.0);
        assert_eq!(limits(64, 1.0).ns_between(3_000, 1_000), -2_000.0);
        assert_eq!(limits(36, 1.0).ns_between((1 << 36) - 1_000, 1_000), 2_000.0);
        assert_eq!(limits(36, 1.0).ns_between(1_000, (1 << 36) - 1_000), -2_000.0);
        assert_eq!(limits(64, 0.5).ns_between(u64::MAX, 1_999_999), 1e6);
    }

    #[test]
    fn each_limit_that_is_one_too_low_is_named_with_what_is_needed() {
        let enough = DeviceLimits {
            storage_buffers_per_stage: 14,
            workgroup_invocations: 256,
            ..limits_of(&vk::PhysicalDeviceLimits::default(), 64)
        };
        assert_eq!(missing_limits(&enough).count(), 0);
        let told = |limits: &DeviceLimits| missing_limits(limits).collect::<Vec<_>>();
        let few_buffers = DeviceLimits { storage_buffers_per_stage: 13, ..enough.clone() };
        assert_eq!(told(&few_buffers), ["14 storage buffers per shader stage (it has 13)"]);
        let few_invocations = DeviceLimits { workgroup_invocations: 255, ..enough };
        assert_eq!(told(&few_invocations), ["256 invocations in a workgroup (it has 255)"]);
    }

    #[test]
    fn a_uuid_is_written_in_five_dashed_groups() {
        let uuid = std::array::from_fn(|index| index as u8 * 17);
        assert_eq!(dashed(&uuid), "00112233-4455-6677-8899-aabbccddeeff");
    }
}
