//! Memory for the interface: its buffers and textures come from the device's allocator, with names, as all others do.

use std::sync::Arc;

use ash::vk;
use egui_ash_renderer::allocator::Allocator;
use egui_ash_renderer::{RendererError, RendererResult};
use gpu_allocator::MemoryLocation;

use crate::error::Error;
use crate::vk::Device;
use crate::vk::handle::Owned;
use crate::vk::memory::{Memory, Purpose};

const NAME: &str = "interface";

/// Makes the buffers and textures of the interface.
pub(super) struct InterfaceMemory {
    device: Arc<Device>,
}

/// What the handle of a buffer or texture needs to live; dropping it destroys both.
pub(super) struct Backing {
    // Destroyed before its memory is returned.
    _handle: Handle,
    memory: Memory,
}

/// Owns a handle that the renderer uses.
enum Handle {
    Buffer { _owned: Owned<vk::Buffer> },
    Image { _owned: Owned<vk::Image> },
}

impl InterfaceMemory {
    pub(super) fn new(device: &Arc<Device>) -> Self {
        Self { device: Arc::clone(device) }
    }

    fn allocate(
        &self,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> RendererResult<Memory> {
        Memory::allocate(&self.device, requirements, &Purpose { name: NAME, location, linear }).map_err(|error| {
            match error {
                Error::OutOfDeviceMemory { .. } => RendererError::Vulkan(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY),
                other => RendererError::Allocator(other.to_string()),
            }
        })
    }
}

impl Allocator for InterfaceMemory {
    type Allocation = Backing;

    fn create_buffer(
        &mut self,
        device: &ash::Device,
        size: usize,
        usage: vk::BufferUsageFlags,
    ) -> RendererResult<(vk::Buffer, Backing)> {
        let info = vk::BufferCreateInfo::default().size(size.max(4) as u64).usage(usage);
        // SAFETY: V1.
        let owned = Owned::new(&self.device, unsafe { device.create_buffer(&info, None) }?, NAME);
        let buffer = owned.get();
        // SAFETY: V1.
        let requirements = unsafe { device.get_buffer_memory_requirements(buffer) };
        let memory = self.allocate(requirements, MemoryLocation::CpuToGpu, true)?;
        memory.bind_buffer(buffer)?;
        Ok((buffer, Backing { _handle: Handle::Buffer { _owned: owned }, memory }))
    }

    fn create_image(&mut self, device: &ash::Device, width: u32, height: u32) -> RendererResult<(vk::Image, Backing)> {
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::R8G8B8A8_SRGB)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::SAMPLED);
        // SAFETY: V1.
        let owned = Owned::new(&self.device, unsafe { device.create_image(&info, None) }?, NAME);
        let image = owned.get();
        // SAFETY: V1.
        let requirements = unsafe { device.get_image_memory_requirements(image) };
        let memory = self.allocate(requirements, MemoryLocation::GpuOnly, false)?;
        memory.bind_image(image)?;
        Ok((image, Backing { _handle: Handle::Image { _owned: owned }, memory }))
    }

    fn destroy_buffer(&mut self, _: &ash::Device, _: vk::Buffer, backing: Backing) -> RendererResult<()> {
        drop(backing);
        Ok(())
    }

    fn destroy_image(&mut self, _: &ash::Device, _: vk::Image, backing: Backing) -> RendererResult<()> {
        drop(backing);
        Ok(())
    }

    fn update_buffer<T: Copy>(&mut self, _: &ash::Device, backing: &mut Backing, data: &[T]) -> RendererResult<()> {
        // SAFETY: V4; the renderer writes vertices, indices and texels: none has bytes between its fields.
        let bytes = unsafe { std::slice::from_raw_parts(data.as_ptr().cast::<u8>(), size_of_val(data)) };
        let unreachable = || RendererError::Allocator("the CPU has no access to a buffer".to_owned());
        backing.memory.write(0, bytes).ok_or_else(unreachable)
    }
}
