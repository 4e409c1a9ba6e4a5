//! What a pipeline expects to be bound: the kinds of its bindings, and the size of its push constants.

use std::sync::Arc;

use ash::vk;

use super::handle::Owned;
use super::{Device, call_failed, refused};
use crate::error::Result;

/// The stages that can access every binding and every push constant.
pub(super) const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::COMPUTE.as_raw()
        | vk::ShaderStageFlags::VERTEX.as_raw()
        | vk::ShaderStageFlags::FRAGMENT.as_raw(),
);

/// The kind of thing that a shader expects at a binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindingKind {
    /// A storage buffer.
    StorageBuffer,
    /// An image without a sampler, read by `texelFetch`.
    SampledImage,
}

impl BindingKind {
    pub(super) fn raw(self) -> vk::DescriptorType {
        match self {
            Self::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
            Self::SampledImage => vk::DescriptorType::SAMPLED_IMAGE,
        }
    }
}

/// What a pipeline expects to be bound.
pub struct PipelineLayout {
    handle: Owned<vk::PipelineLayout>,
    set_layout: Owned<vk::DescriptorSetLayout>,
    bindings: Vec<BindingKind>,
    push_constant_bytes: u32,
    name: String,
}

impl PipelineLayout {
    pub(super) fn create(
        device: &Arc<Device>,
        name: &str,
        bindings: &[BindingKind],
        push_constant_bytes: u32,
    ) -> Result<Self> {
        let limit = device.info().limits.push_constant_bytes;
        if push_constant_bytes > limit || !push_constant_bytes.is_multiple_of(4) {
            return Err(refused(
                format!("creation of pipeline {name}"),
                format!("{push_constant_bytes} bytes of push constants are not a multiple of 4 up to {limit}"),
            ));
        }
        let set_layout = create_set_layout(device, name, bindings)?;
        let set_layouts = [set_layout.get()];
        let ranges = [vk::PushConstantRange::default().stage_flags(STAGES).size(push_constant_bytes)];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts);
        if push_constant_bytes > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: V1.
        let handle = unsafe { device.raw().create_pipeline_layout(&info, None) }
            .map_err(|result| call_failed(format!("creation of the layout of pipeline {name}"), result))?;
        let handle = Owned::new(device, handle, name);
        Ok(Self { handle, set_layout, bindings: bindings.to_vec(), push_constant_bytes, name: name.to_owned() })
    }

    /// The kinds of bindings, in order.
    #[must_use]
    pub fn bindings(&self) -> &[BindingKind] {
        &self.bindings
    }

    /// The name of the pipeline.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn device(&self) -> &Arc<Device> {
        self.handle.device()
    }

    pub(super) fn raw(&self) -> vk::PipelineLayout {
        self.handle.get()
    }

    pub(super) fn set_layout(&self) -> vk::DescriptorSetLayout {
        self.set_layout.get()
    }

    pub(super) fn push_constant_bytes(&self) -> u32 {
        self.push_constant_bytes
    }
}

/// The layout of a set with these bindings, visible to all stages.
fn create_set_layout(
    device: &Arc<Device>,
    name: &str,
    kinds: &[BindingKind],
) -> Result<Owned<vk::DescriptorSetLayout>> {
    let bindings: Vec<vk::DescriptorSetLayoutBinding<'_>> = (0..)
        .zip(kinds)
        .map(|(binding, kind)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(binding)
                .descriptor_type(kind.raw())
                .descriptor_count(1)
                .stage_flags(STAGES)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: V1.
    let layout = unsafe { device.raw().create_descriptor_set_layout(&info, None) }
        .map_err(|result| call_failed(format!("creation of the set layout of pipeline {name}"), result))?;
    Ok(Owned::new(device, layout, name))
}
