//! Buffers: named ranges of bytes in the device's memory, or in the host's for transfers to and from the device.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::handle::Owned;
use super::memory::{Memory, Purpose};
use super::{Device, Staging, call_failed, refused};
use crate::error::{Error, Remedy, Result};

/// What a buffer is for, apart from copies to and from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BufferUse {
    /// Shaders read and write it as a storage buffer.
    Storage,
    /// It is only copied from and to.
    Transfer,
}

/// Where a buffer lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Residence {
    /// In the memory that is fastest for the device. [`super::Recorder::write_buffer`] writes it and
    /// [`super::Recorder::read_buffer`] reads it.
    Device,
    /// In host memory, mapped: the CPU writes, the device reads.
    Upload,
    /// In host memory, mapped: the device writes, the CPU reads.
    ReadBack,
}

/// A named range of bytes. Its contents are undefined until they are written.
pub struct Buffer {
    handle: Owned<vk::Buffer>,
    memory: Memory,
    name: String,
    size_bytes: u64,
    host_access: bool,
}

impl Buffer {
    /// Creates a buffer of `size_bytes`.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if shaders could not see the whole buffer, [`Error::OutOfDeviceMemory`] if it does not fit.
    pub fn create(
        device: &Arc<Device>,
        name: &str,
        size_bytes: u64,
        usage: BufferUse,
        residence: Residence,
    ) -> Result<Arc<Self>> {
        if usage == BufferUse::Storage {
            check_storage_size(name, size_bytes, device.info().limits.largest_storage_buffer_bytes())?;
        }
        let mut flags = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        if usage == BufferUse::Storage {
            flags |= vk::BufferUsageFlags::STORAGE_BUFFER;
        }
        // Vulkan has no empty buffers, but a list without entries is normal.
        let info = vk::BufferCreateInfo::default().size(size_bytes.max(4)).usage(flags);
        // SAFETY: V1.
        let handle = unsafe { device.raw().create_buffer(&info, None) }
            .map_err(|result| creation_failed(name, size_bytes, result))?;
        let handle = Owned::new(device, handle, name);
        // SAFETY: V1.
        let requirements = unsafe { device.raw().get_buffer_memory_requirements(handle.get()) };
        let location = match residence {
            Residence::Device => MemoryLocation::GpuOnly,
            Residence::Upload => MemoryLocation::CpuToGpu,
            Residence::ReadBack => MemoryLocation::GpuToCpu,
        };
        let memory = Memory::allocate(device, requirements, &Purpose { name, location, linear: true })?;
        memory.bind_buffer(handle.get()).map_err(|result| creation_failed(name, size_bytes, result))?;
        let host_access = match residence {
            Residence::Device => device.staging() == Staging::Auto && memory.is_fast_for_host(),
            Residence::Upload | Residence::ReadBack => true,
        };
        Ok(Arc::new(Self { handle, memory, name: name.to_owned(), size_bytes, host_access }))
    }

    /// The debug name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The size that was asked for, in bytes.
    #[must_use]
    pub fn size_bytes(&self) -> u64 {
        self.size_bytes
    }

    /// Whether the CPU can access the bytes directly, by [`Self::write`] and [`Self::read`].
    #[must_use]
    pub fn has_host_access(&self) -> bool {
        self.host_access
    }

    /// Writes `bytes` at `offset` immediately. Nothing that uses the buffer may be running on the device.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the range is outside the buffer or the CPU cannot reach it.
    pub fn write(&self, offset: u64, bytes: &[u8]) -> Result<()> {
        self.check_range("write to", offset, bytes.len() as u64)?;
        self.host_offset(offset).and_then(|offset| self.memory.write(offset, bytes)).ok_or_else(|| self.unreachable())
    }

    /// Reads the bytes at `offset` into `bytes`. Nothing that writes the buffer may be running on the device.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the range is outside the buffer or the CPU cannot reach it.
    pub fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        self.look(offset, bytes.len() as u64, |read| bytes.copy_from_slice(read))
    }

    /// Calls `look` with the bytes where they lie; otherwise as [`Self::read`].
    pub(super) fn look<T>(&self, offset: u64, size_bytes: u64, look: impl FnOnce(&[u8]) -> T) -> Result<T> {
        self.check_range("read of", offset, size_bytes)?;
        let range = self.host_offset(offset).zip(usize::try_from(size_bytes).ok());
        range.and_then(|(offset, size)| self.memory.look(offset, size, look)).ok_or_else(|| self.unreachable())
    }

    pub(super) fn raw(&self) -> vk::Buffer {
        self.handle.get()
    }

    /// Returns an error that names `verb`, unless `size` bytes at `offset` lie inside the buffer.
    pub(super) fn check_range(&self, verb: &str, offset: u64, size: u64) -> Result<()> {
        if offset.checked_add(size).is_some_and(|end| end <= self.size_bytes) {
            return Ok(());
        }
        Err(refused(
            format!("{verb} buffer {}", self.name),
            format!("{size} bytes at {offset} reach past its {} bytes", self.size_bytes),
        ))
    }

    fn host_offset(&self, offset: u64) -> Option<usize> {
        if self.host_access { usize::try_from(offset).ok() } else { None }
    }

    fn unreachable(&self) -> Error {
        refused(format!("mapping of buffer {}", self.name), "the CPU has no access to its memory")
    }
}

fn check_storage_size(name: &str, size_bytes: u64, limit: u64) -> Result<()> {
    if size_bytes <= limit {
        return Ok(());
    }
    let what = format!("buffer {name} needs {size_bytes} bytes and the device's storage buffers end at {limit}");
    Err(Error::TooLarge { what, remedies: &[Remedy::SmallerPicture, Remedy::FewerTiles, Remedy::Cpu] })
}

fn creation_failed(name: &str, bytes: u64, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            Error::OutOfDeviceMemory { name: name.to_owned(), bytes }
        }
        other => call_failed(format!("creation of buffer {name}"), other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_storage_buffer_past_the_limit_is_refused_by_name_and_size() {
        assert!(check_storage_size("tiles", 128, 128).is_ok());
        let error = check_storage_size("tiles", 129, 128).expect_err("one byte too many");
        let message = error.to_string();
        for part in ["tiles", "129", "128"] {
            assert!(message.contains(part), "{message}");
        }
    }
}
