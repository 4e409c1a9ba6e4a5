//! What is bound to a pipeline: one descriptor set of storage buffers and sampled images, which is written once.

use std::sync::Arc;

use ash::vk;

use super::handle::Owned;
use super::pipeline_layout::{BindingKind, PipelineLayout};
use super::{Buffer, Device, Image, call_failed, refused};
use crate::error::Result;

/// What to bind at one binding.
#[derive(Clone, Copy)]
pub enum Binding<'a> {
    /// A whole storage buffer.
    Buffer(&'a Arc<Buffer>),
    /// All layers of an image.
    SampledImage(&'a Arc<Image>),
}

impl Binding<'_> {
    fn kind(self) -> BindingKind {
        match self {
            Self::Buffer(_) => BindingKind::StorageBuffer,
            Self::SampledImage(_) => BindingKind::SampledImage,
        }
    }
}

/// What is bound to a pipeline. A group fits every pipeline that expects the same kinds in the same order.
pub struct BindingGroup {
    // The pool owns the set.
    _pool: Owned<vk::DescriptorPool>,
    set: vk::DescriptorSet,
    kinds: Vec<BindingKind>,
    name: String,
    _buffers: Vec<Arc<Buffer>>,
    _images: Vec<Arc<Image>>,
}

impl BindingGroup {
    /// Binds `bindings` to set 0, binding 0, 1, ... and keeps them alive.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if they are not what the pipeline expects.
    pub fn create(name: &str, layout: &PipelineLayout, bindings: &[Binding<'_>]) -> Result<Arc<Self>> {
        let kinds: Vec<BindingKind> = bindings.iter().map(|binding| binding.kind()).collect();
        if kinds != layout.bindings() {
            return Err(refused(
                format!("creation of binding group {name}"),
                format!("pipeline {} expects {:?}, not {kinds:?}", layout.name(), layout.bindings()),
            ));
        }
        let device = layout.device();
        let pool = create_pool(device, name, &kinds)?;
        let set_layouts = [layout.set_layout()];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool.get()).set_layouts(&set_layouts);
        // SAFETY: V1.
        let sets = unsafe { device.raw().allocate_descriptor_sets(&info) }
            .map_err(|result| call_failed(format!("allocation of binding group {name}"), result))?;
        let set = sets.first().copied().unwrap_or_default();
        device.set_name(set, name);
        write_set(device, set, bindings);
        Ok(Arc::new(Self {
            _pool: pool,
            set,
            kinds,
            name: name.to_owned(),
            _buffers: bindings.iter().filter_map(buffer_of).collect(),
            _images: bindings.iter().filter_map(image_of).collect(),
        }))
    }

    /// The kinds of bindings, in order.
    #[must_use]
    pub fn kinds(&self) -> &[BindingKind] {
        &self.kinds
    }

    /// The debug name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn raw(&self) -> vk::DescriptorSet {
        self.set
    }
}

fn buffer_of(binding: &Binding<'_>) -> Option<Arc<Buffer>> {
    match binding {
        Binding::Buffer(buffer) => Some(Arc::clone(buffer)),
        Binding::SampledImage(_) => None,
    }
}

fn image_of(binding: &Binding<'_>) -> Option<Arc<Image>> {
    match binding {
        Binding::SampledImage(image) => Some(Arc::clone(image)),
        Binding::Buffer(_) => None,
    }
}

fn create_pool(device: &Arc<Device>, name: &str, kinds: &[BindingKind]) -> Result<Owned<vk::DescriptorPool>> {
    // A pool without descriptors is invalid, so an empty group has one that it does not use.
    let sizes: Vec<vk::DescriptorPoolSize> = if kinds.is_empty() { &[BindingKind::StorageBuffer] } else { kinds }
        .iter()
        .map(|kind| vk::DescriptorPoolSize::default().ty(kind.raw()).descriptor_count(1))
        .collect();
    let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
    // SAFETY: V1.
    let pool = unsafe { device.raw().create_descriptor_pool(&info, None) }
        .map_err(|result| call_failed(format!("creation of the pool of binding group {name}"), result))?;
    Ok(Owned::new(device, pool, name))
}

fn write_set(device: &Device, set: vk::DescriptorSet, bindings: &[Binding<'_>]) {
    for (index, binding) in (0..).zip(bindings) {
        let write =
            vk::WriteDescriptorSet::default().dst_set(set).dst_binding(index).descriptor_type(binding.kind().raw());
        let (buffers, images);
        let write = match binding {
            Binding::Buffer(buffer) => {
                buffers = [vk::DescriptorBufferInfo::default().buffer(buffer.raw()).range(vk::WHOLE_SIZE)];
                write.buffer_info(&buffers)
            }
            Binding::SampledImage(image) => {
                images = [vk::DescriptorImageInfo::default()
                    .image_view(image.view())
                    .image_layout(vk::ImageLayout::GENERAL)];
                write.image_info(&images)
            }
        };
        // SAFETY: V1; the set is new, so nothing uses it.
        unsafe { device.raw().update_descriptor_sets(&[write], &[]) };
    }
}
