//! Memory behind buffers and images: an allocation that returns to the device's allocator when dropped.

use std::sync::{Arc, Mutex};

use ash::vk;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use gpu_allocator::{AllocationError, MemoryLocation};

use super::{Device, lock, refused};
use crate::error::{Error, Result};

/// Memory that the CPU reads as fast as its own. Mapped memory of a discrete GPU is not cached, so it is slower.
const FAST_FOR_HOST: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(
    vk::MemoryPropertyFlags::HOST_VISIBLE.as_raw()
        | vk::MemoryPropertyFlags::HOST_COHERENT.as_raw()
        | vk::MemoryPropertyFlags::HOST_CACHED.as_raw(),
);

/// What the memory is for.
pub(super) struct Purpose<'a> {
    /// Debug name of the buffer or image.
    pub(super) name: &'a str,
    /// Whether the CPU writes it, reads it, or neither.
    pub(super) location: MemoryLocation,
    /// True for a buffer, false for an image, whose layout the driver chooses.
    pub(super) linear: bool,
}

/// A piece of device memory.
pub(super) struct Memory {
    allocation: Mutex<Allocation>,
    device: Arc<Device>,
}

impl Memory {
    /// Takes memory from the device's allocator.
    pub(super) fn allocate(
        device: &Arc<Device>,
        requirements: vk::MemoryRequirements,
        purpose: &Purpose<'_>,
    ) -> Result<Self> {
        let allocation = lock(device.allocator())
            .allocate(&AllocationCreateDesc {
                name: purpose.name,
                requirements,
                location: purpose.location,
                linear: purpose.linear,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            })
            .map_err(|error| match error {
                AllocationError::OutOfMemory => {
                    Error::OutOfDeviceMemory { name: purpose.name.to_owned(), bytes: requirements.size }
                }
                other => refused(format!("allocation of memory for {}", purpose.name), other.to_string()),
            })?;
        // The block has this name only until another allocation in it gives it its own: several share one block.
        // SAFETY: V1; the handle is only named.
        device.set_name(unsafe { allocation.memory() }, &format!("block with {}", purpose.name));
        Ok(Self { allocation: Mutex::new(allocation), device: Arc::clone(device) })
    }

    pub(super) fn bind_buffer(&self, buffer: vk::Buffer) -> Result<(), vk::Result> {
        let allocation = lock(&self.allocation);
        // SAFETY: V1; the memory was allocated for this buffer and is returned after it is destroyed.
        unsafe { self.device.raw().bind_buffer_memory(buffer, allocation.memory(), allocation.offset()) }
    }

    pub(super) fn bind_image(&self, image: vk::Image) -> Result<(), vk::Result> {
        let allocation = lock(&self.allocation);
        // SAFETY: V1; the memory was allocated for this image and is returned after it is destroyed.
        unsafe { self.device.raw().bind_image_memory(image, allocation.memory(), allocation.offset()) }
    }

    /// Whether the CPU reaches the memory directly and reads it at full speed.
    pub(super) fn is_fast_for_host(&self) -> bool {
        lock(&self.allocation).memory_properties().contains(FAST_FOR_HOST)
    }

    /// Copies `bytes` into the memory; `None` if it is not mapped or too short.
    pub(super) fn write(&self, offset: usize, bytes: &[u8]) -> Option<()> {
        let mut allocation = lock(&self.allocation);
        let mapped = allocation.mapped_slice_mut()?;
        mapped.get_mut(offset..offset.checked_add(bytes.len())?)?.copy_from_slice(bytes);
        Some(())
    }

    /// Calls `look` with `size` bytes of the memory; `None` if it is not mapped or too short.
    pub(super) fn look<T>(&self, offset: usize, size: usize, look: impl FnOnce(&[u8]) -> T) -> Option<T> {
        let allocation = lock(&self.allocation);
        let mapped = allocation.mapped_slice()?;
        Some(look(mapped.get(offset..offset.checked_add(size)?)?))
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        if self.device.is_given_up() {
            return;
        }
        let allocation = std::mem::take(&mut *lock(&self.allocation));
        // This fails only if the allocator does not know its own allocation. That would be a bug in it, and nobody
        // could handle it here.
        let _ = lock(self.device.allocator()).free(allocation);
    }
}
