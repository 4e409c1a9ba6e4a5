//! What a device must be able to do: some of it for everything, and some of it only to draw. A device that cannot draw
//! still computes. ARCHITECTURE.md lists all that is asked of it.

use ash::vk;

/// What a device without any queue that computes lacks, in words.
pub(super) const COMPUTE_QUEUE: &str = "a queue for compute";

/// What a device lacks, in words.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Lacking {
    /// Without this the device cannot be used.
    pub(super) to_work: Vec<String>,
    /// Without this it cannot draw.
    pub(super) to_draw: Vec<String>,
}

/// What a device for Vulkan 1.3 lacks of queues, features and formats.
pub(super) fn lacking(instance: &ash::Instance, handle: vk::PhysicalDevice) -> Lacking {
    let mut offered = vk::PhysicalDeviceVulkan13Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut offered);
    // SAFETY: V1.
    unsafe { instance.get_physical_device_features2(handle, &mut features) };
    let mut lacking = Lacking::default();
    lacking.add_queues(queue_family(instance, handle));
    lacking.add_features(&offered);
    lacking.add_formats(|format| {
        // SAFETY: V1.
        unsafe { instance.get_physical_device_format_properties(handle, format) }.optimal_tiling_features
    });
    lacking
}

impl Lacking {
    fn add_queues(&mut self, family: Option<QueueFamily>) {
        match family {
            None => self.to_work.push(COMPUTE_QUEUE.to_owned()),
            Some(family) if !family.has_graphics => self.to_draw.push("a queue for graphics".to_owned()),
            Some(_) => {}
        }
    }

    fn add_features(&mut self, offered: &vk::PhysicalDeviceVulkan13Features<'_>) {
        let absent = |features: [(vk::Bool32, &'static str); 2]| {
            let absent = features.into_iter().filter(|(available, _)| *available == vk::FALSE);
            absent.map(|(_, name)| format!("the feature {name}"))
        };
        self.to_work.extend(absent([
            (offered.synchronization2, "synchronization2"),
            // Workgroups whose size is a specialisation constant (`LocalSizeId`).
            (offered.maintenance4, "maintenance4"),
        ]));
        self.to_draw.extend(absent([
            (offered.dynamic_rendering, "dynamicRendering"),
            // What `discard` compiles to.
            (offered.shader_demote_to_helper_invocation, "shaderDemoteToHelperInvocation"),
        ]));
    }

    /// All images are for drawing. `offered` tells what a format can be used for.
    fn add_formats(&mut self, offered: impl Fn(vk::Format) -> vk::FormatFeatureFlags) {
        let color = vk::FormatFeatureFlags::COLOR_ATTACHMENT | vk::FormatFeatureFlags::TRANSFER_SRC;
        let depth = vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT;
        let sampled = vk::FormatFeatureFlags::SAMPLED_IMAGE | vk::FormatFeatureFlags::TRANSFER_DST;
        for (format, needs, words) in [
            (vk::Format::R8G8B8A8_UNORM, color, "R8G8B8A8_UNORM as a colour attachment"),
            (vk::Format::R32_UINT, color, "R32_UINT as a colour attachment"),
            (vk::Format::D32_SFLOAT, depth, "D32_SFLOAT as a depth attachment"),
            (vk::Format::R8G8_UINT, sampled, "R8G8_UINT as a sampled image"),
        ] {
            if !offered(format).contains(needs) {
                self.to_draw.push(words.to_owned());
            }
        }
    }
}

/// A queue family that computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct QueueFamily {
    /// Its number.
    pub(super) index: u32,
    /// Number of valid bits of its timestamps.
    pub(super) timestamp_bits: u32,
    /// Whether it draws, too.
    pub(super) has_graphics: bool,
}

/// The queue family to work with; `None` if no family of the device computes.
pub(super) fn queue_family(instance: &ash::Instance, handle: vk::PhysicalDevice) -> Option<QueueFamily> {
    best_family(&computing_families(instance, handle))
}

/// All families of the device that compute, in its order. They copy, too, even if they do not say so.
pub(super) fn computing_families(instance: &ash::Instance, handle: vk::PhysicalDevice) -> Vec<QueueFamily> {
    // SAFETY: V1.
    computing(&unsafe { instance.get_physical_device_queue_family_properties(handle) })
}

fn computing(families: &[vk::QueueFamilyProperties]) -> Vec<QueueFamily> {
    let computing = (0..).zip(families).filter(|(_, family)| family.queue_flags.contains(vk::QueueFlags::COMPUTE));
    computing
        .map(|(index, family)| QueueFamily {
            index,
            timestamp_bits: family.timestamp_valid_bits,
            has_graphics: family.queue_flags.contains(vk::QueueFlags::GRAPHICS),
        })
        .collect()
}

/// The first family that draws, too, or else the first.
fn best_family(families: &[QueueFamily]) -> Option<QueueFamily> {
    families.iter().find(|family| family.has_graphics).or(families.first()).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Families with these flags, each with its own number of timestamp bits.
    fn families(flags: &[vk::QueueFlags]) -> Vec<vk::QueueFamilyProperties> {
        let family = |(timestamp_valid_bits, &queue_flags)| vk::QueueFamilyProperties {
            queue_flags,
            queue_count: 1,
            timestamp_valid_bits,
            ..Default::default()
        };
        (36..).zip(flags).map(family).collect()
    }

    #[test]
    fn a_family_for_graphics_and_compute_is_taken_before_one_for_compute_alone() {
        let (graphics, compute) = (vk::QueueFlags::GRAPHICS, vk::QueueFlags::COMPUTE);
        let transfer = vk::QueueFlags::TRANSFER;
        let of = |flags: &[vk::QueueFlags]| best_family(&computing(&families(flags)));
        let both = QueueFamily { index: 2, timestamp_bits: 38, has_graphics: true };
        assert_eq!(of(&[transfer, compute | transfer, graphics | compute, graphics | compute]), Some(both));
        let compute_alone = QueueFamily { index: 1, timestamp_bits: 37, has_graphics: false };
        assert_eq!(of(&[graphics | transfer, compute, compute | transfer]), Some(compute_alone));
        assert_eq!(of(&[graphics, transfer]), None);
        assert_eq!(of(&[]), None);
    }

    #[test]
    fn without_graphics_a_device_cannot_draw_and_without_compute_it_is_of_no_use() {
        let lacking = |family: Option<QueueFamily>| {
            let mut lacking = Lacking::default();
            lacking.add_queues(family);
            (lacking.to_work, lacking.to_draw)
        };
        let family = |has_graphics| Some(QueueFamily { index: 0, timestamp_bits: 64, has_graphics });
        assert_eq!(lacking(family(true)), (vec![], vec![]));
        assert_eq!(lacking(family(false)), (vec![], vec!["a queue for graphics".to_owned()]));
        assert_eq!(lacking(None), (vec!["a queue for compute".to_owned()], vec![]));
    }

    #[test]
    fn each_feature_that_is_not_there_is_named_with_what_needs_it() {
        let all = vk::PhysicalDeviceVulkan13Features::default()
            .synchronization2(true)
            .maintenance4(true)
            .dynamic_rendering(true)
            .shader_demote_to_helper_invocation(true);
        let lacking = |offered: vk::PhysicalDeviceVulkan13Features<'_>| {
            let mut lacking = Lacking::default();
            lacking.add_features(&offered);
            [lacking.to_work.join(", "), lacking.to_draw.join(", ")]
        };
        assert_eq!(lacking(all), ["", ""]);
        assert_eq!(lacking(all.synchronization2(false)), ["the feature synchronization2", ""]);
        assert_eq!(lacking(all.maintenance4(false)), ["the feature maintenance4", ""]);
        assert_eq!(lacking(all.dynamic_rendering(false)), ["", "the feature dynamicRendering"]);
        let demote = "the feature shaderDemoteToHelperInvocation";
        assert_eq!(lacking(all.shader_demote_to_helper_invocation(false)), ["", demote]);
    }

    #[test]
    fn a_format_that_is_not_there_keeps_nobody_from_computing() {
        let everything = vk::FormatFeatureFlags::COLOR_ATTACHMENT
            | vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT
            | vk::FormatFeatureFlags::SAMPLED_IMAGE
            | vk::FormatFeatureFlags::TRANSFER_SRC
            | vk::FormatFeatureFlags::TRANSFER_DST;
        let mut lacking = Lacking::default();
        lacking.add_formats(|_| everything);
        assert_eq!(lacking, Lacking::default());
        lacking.add_formats(|format| match format {
            vk::Format::D32_SFLOAT => vk::FormatFeatureFlags::empty(),
            vk::Format::R32_UINT => everything & !vk::FormatFeatureFlags::TRANSFER_SRC,
            _ => everything,
        });
        assert_eq!(lacking.to_work, Vec::<String>::new());
        assert_eq!(lacking.to_draw, ["R32_UINT as a colour attachment", "D32_SFLOAT as a depth attachment"]);
    }
}
