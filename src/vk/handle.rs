//! One owner type for every kind of Vulkan handle: it names the handle when it takes it over, and destroys it when
//! dropped.

use std::sync::Arc;

use ash::vk;

use super::Device;

/// A handle that a single device call destroys.
pub(super) trait Destroy: vk::Handle + Copy {
    /// # Safety
    /// The handle belongs to `device`, nothing uses it, and it is destroyed only once.
    unsafe fn destroy(self, device: &ash::Device);
}

macro_rules! destroy_with {
    ($($handle:ty => $destroy:ident,)*) => {$(
        impl Destroy for $handle {
            unsafe fn destroy(self, device: &ash::Device) {
                // SAFETY: V1, V2; the caller's promise.
                unsafe { device.$destroy(self, None) };
            }
        }
    )*};
}

destroy_with! {
    vk::Buffer => destroy_buffer,
    vk::CommandPool => destroy_command_pool,
    vk::DescriptorPool => destroy_descriptor_pool,
    vk::DescriptorSetLayout => destroy_descriptor_set_layout,
    vk::Fence => destroy_fence,
    vk::Image => destroy_image,
    vk::ImageView => destroy_image_view,
    vk::Pipeline => destroy_pipeline,
    vk::PipelineLayout => destroy_pipeline_layout,
    vk::QueryPool => destroy_query_pool,
    vk::Sampler => destroy_sampler,
    vk::Semaphore => destroy_semaphore,
    vk::ShaderModule => destroy_shader_module,
}

/// Owns a Vulkan handle and keeps its device alive.
pub(super) struct Owned<T: Destroy> {
    handle: T,
    device: Arc<Device>,
}

impl<T: Destroy> Owned<T> {
    /// Takes over a handle that was just created, and gives it its debug name.
    pub(super) fn new(device: &Arc<Device>, handle: T, name: &str) -> Self {
        device.set_name(handle, name);
        Self { handle, device: Arc::clone(device) }
    }

    pub(super) fn get(&self) -> T {
        self.handle
    }

    pub(super) fn device(&self) -> &Arc<Device> {
        &self.device
    }
}

impl<T: Destroy> Drop for Owned<T> {
    fn drop(&mut self) {
        if self.device.is_given_up() {
            return;
        }
        // SAFETY: V1, V2.
        unsafe { self.handle.destroy(self.device.raw()) };
    }
}
