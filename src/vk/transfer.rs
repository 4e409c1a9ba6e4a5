//! Transfers between the host and the device: writes are collected for the start of a submission, reads for its end.
//!
//! Each direction reuses one staging buffer, which grows geometrically, so the steady state creates nothing.

use std::sync::Arc;

use ash::vk;

use super::commands::record_barrier;
use super::scope::Scope;
use super::{Buffer, BufferUse, Device, Image, Residence};
use crate::error::Result;

/// Smallest staging buffer, in bytes.
const FIRST_STAGING_BYTES: u64 = 64 << 10;

/// Offsets of image copies are multiples of this, which every pixel size divides.
const IMAGE_ALIGNMENT: usize = 16;

/// Stands for bytes that a submission reads back. [`super::Recorder::read_into`] returns them until the next recording.
#[derive(Clone)]
pub struct ReadTicket {
    pub(super) recording: u64,
    pub(super) buffer: Option<Arc<Buffer>>,
    pub(super) offset: u64,
    pub(super) size_bytes: u64,
}

impl ReadTicket {
    /// The number of bytes that it stands for.
    #[must_use]
    pub fn size_bytes(&self) -> u64 {
        self.size_bytes
    }
}

/// The staging buffer of one direction.
struct StagingBuffer {
    buffer: Option<Arc<Buffer>>,
    name: &'static str,
    residence: Residence,
}

impl StagingBuffer {
    /// The buffer, replaced by a larger one if it holds less than `size_bytes`. Nothing may be in flight.
    fn ensure(&mut self, device: &Arc<Device>, size_bytes: u64) -> Result<&Arc<Buffer>> {
        let buffer = match self.buffer.take() {
            Some(buffer) if buffer.size_bytes() >= size_bytes => buffer,
            _ => {
                let size_bytes = size_bytes.next_power_of_two().max(FIRST_STAGING_BYTES);
                Buffer::create(device, self.name, size_bytes, BufferUse::Transfer, self.residence)?
            }
        };
        Ok(self.buffer.insert(buffer))
    }
}

/// One write to a buffer: its index in [`Uploads::targets`], and the copy from staging.
#[derive(Clone, Copy)]
struct Region {
    target: usize,
    copy: vk::BufferCopy,
}

/// Writes that take effect before the first pass of a submission.
pub(super) struct Uploads {
    staging: StagingBuffer,
    bytes: Vec<u8>,
    targets: Vec<Arc<Buffer>>,
    regions: Vec<Region>,
    images: Vec<(Arc<Image>, vk::BufferImageCopy)>,
    batch: Vec<vk::BufferCopy>,
}

impl Uploads {
    pub(super) fn new() -> Self {
        Self {
            staging: StagingBuffer { buffer: None, name: "upload staging", residence: Residence::Upload },
            bytes: Vec::new(),
            targets: Vec::new(),
            regions: Vec::new(),
            images: Vec::new(),
            batch: Vec::new(),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.regions.is_empty() && self.images.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.bytes.clear();
        self.targets.clear();
        self.regions.clear();
        self.images.clear();
    }

    /// Adds a write of `bytes` at `offset`; later writes win over earlier ones.
    pub(super) fn add_buffer(&mut self, buffer: &Arc<Buffer>, offset: u64, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        let target = self.target_of(buffer);
        let size = bytes.len() as u64;
        let src_offset = self.bytes.len() as u64;
        self.bytes.extend_from_slice(bytes);
        if let Some(Region { target: last_target, copy }) = self.regions.last_mut()
            && *last_target == target
            && copy.dst_offset + copy.size == offset
            && copy.src_offset + copy.size == src_offset
        {
            copy.size += size;
            return;
        }
        self.regions.push(Region { target, copy: vk::BufferCopy { src_offset, dst_offset: offset, size } });
    }

    /// Adds a write of a whole layer; a later write of the same layer replaces it.
    pub(super) fn add_image_layer(&mut self, image: &Arc<Image>, layer: u32, bytes: &[u8]) {
        let same = |copy: &vk::BufferImageCopy| copy.image_subresource.base_array_layer == layer;
        if let Some((_, copy)) = self.images.iter().find(|(other, copy)| Arc::ptr_eq(other, image) && same(copy)) {
            let start = copy.buffer_offset as usize;
            self.bytes[start..start + bytes.len()].copy_from_slice(bytes);
            return;
        }
        self.bytes.resize(self.bytes.len().next_multiple_of(IMAGE_ALIGNMENT), 0);
        let copy = image.layer_copy(layer, self.bytes.len() as u64);
        self.bytes.extend_from_slice(bytes);
        self.images.push((Arc::clone(image), copy));
    }

    /// Adds a write of the upper left corner of an image.
    pub(super) fn add_image_corner(&mut self, image: &Arc<Image>, size_px: [u32; 2], bytes: &[u8]) {
        self.bytes.resize(self.bytes.len().next_multiple_of(IMAGE_ALIGNMENT), 0);
        let copy = image.corner_copy(size_px, self.bytes.len() as u64);
        self.bytes.extend_from_slice(bytes);
        self.images.push((Arc::clone(image), copy));
    }

    fn target_of(&mut self, buffer: &Arc<Buffer>) -> usize {
        // From the end, since consecutive writes often go to the same buffer.
        if let Some(target) = self.targets.iter().rposition(|target| Arc::ptr_eq(target, buffer)) {
            return target;
        }
        self.targets.push(Arc::clone(buffer));
        self.targets.len() - 1
    }

    /// Moves the bytes to the staging buffer and records the copies from there.
    pub(super) fn record(&mut self, device: &Arc<Device>, commands: vk::CommandBuffer) -> Result<()> {
        let staging = self.staging.ensure(device, self.bytes.len() as u64)?;
        staging.write(0, &self.bytes)?;
        let source = staging.raw();
        record_barrier(device, commands, Scope::Earlier, Scope::Transfer);
        self.regions.sort_unstable_by_key(|region| (region.target, region.copy.dst_offset));
        for regions in self.regions.chunk_by_mut(|one, next| one.target == next.target) {
            let target = self.targets[regions[0].target].raw();
            self.batch.clear();
            if overlap(regions) {
                // Copies within one call run in any order, so each gets a call of its own. Bytes were staged in call
                // order.
                regions.sort_unstable_by_key(|region| region.copy.src_offset);
                for region in regions {
                    record_copies(device, commands, source, target, &[region.copy]);
                    record_barrier(device, commands, Scope::Transfer, Scope::Transfer);
                }
            } else {
                self.batch.extend(regions.iter().map(|region| region.copy));
                record_copies(device, commands, source, target, &self.batch);
            }
        }
        for (image, copy) in &self.images {
            // SAFETY: V1, V2, V3, V5.
            unsafe {
                device.raw().cmd_copy_buffer_to_image(
                    commands,
                    source,
                    image.raw(),
                    vk::ImageLayout::GENERAL,
                    &[*copy],
                );
            }
        }
        Ok(())
    }
}

/// Whether any two of the regions, sorted by their target's offset, write the same byte.
fn overlap(regions: &[Region]) -> bool {
    regions.windows(2).any(|pair| pair[0].copy.dst_offset + pair[0].copy.size > pair[1].copy.dst_offset)
}

fn record_copies(
    device: &Device,
    commands: vk::CommandBuffer,
    source: vk::Buffer,
    target: vk::Buffer,
    copies: &[vk::BufferCopy],
) {
    // SAFETY: V1, V2, V3, V5.
    unsafe { device.raw().cmd_copy_buffer(commands, source, target, copies) };
}

/// What a read-back copies from.
enum Source {
    Buffer(Arc<Buffer>, vk::BufferCopy),
    Image(Arc<Image>, vk::BufferImageCopy),
}

/// Reads that take effect after the last pass of a submission.
pub(super) struct ReadBacks {
    staging: StagingBuffer,
    sources: Vec<Source>,
    size_bytes: u64,
    reads_mapped: bool,
}

impl ReadBacks {
    pub(super) fn new() -> Self {
        Self {
            staging: StagingBuffer { buffer: None, name: "read-back staging", residence: Residence::ReadBack },
            sources: Vec::new(),
            size_bytes: 0,
            reads_mapped: false,
        }
    }

    /// Whether the host reads anything after the submission.
    pub(super) fn is_empty(&self) -> bool {
        self.sources.is_empty() && !self.reads_mapped
    }

    /// Whether anything has to be copied for the host.
    pub(super) fn has_copies(&self) -> bool {
        !self.sources.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.sources.clear();
        self.size_bytes = 0;
        self.reads_mapped = false;
    }

    /// Adds a read; returns what the ticket needs: the buffer to read directly, if any, and the offset in it or in the
    /// staging buffer.
    pub(super) fn add_buffer(
        &mut self,
        buffer: &Arc<Buffer>,
        offset: u64,
        size_bytes: u64,
    ) -> (Option<Arc<Buffer>>, u64) {
        if buffer.has_host_access() {
            self.reads_mapped = true;
            return (Some(Arc::clone(buffer)), offset);
        }
        let dst_offset = self.reserve(size_bytes);
        if size_bytes > 0 {
            let copy = vk::BufferCopy { src_offset: offset, dst_offset, size: size_bytes };
            self.sources.push(Source::Buffer(Arc::clone(buffer), copy));
        }
        (None, dst_offset)
    }

    /// Adds a read of the first layer; returns the offset in the staging buffer.
    pub(super) fn add_image(&mut self, image: &Arc<Image>) -> u64 {
        let offset = self.reserve(image.layer_bytes());
        self.sources.push(Source::Image(Arc::clone(image), image.layer_copy(0, offset)));
        offset
    }

    fn reserve(&mut self, size_bytes: u64) -> u64 {
        let offset = self.size_bytes.next_multiple_of(IMAGE_ALIGNMENT as u64);
        self.size_bytes = offset + size_bytes;
        offset
    }

    /// Records the copies to the staging buffer.
    pub(super) fn record(&mut self, device: &Arc<Device>, commands: vk::CommandBuffer) -> Result<()> {
        let target = self.staging.ensure(device, self.size_bytes)?.raw();
        for source in &self.sources {
            match source {
                Source::Buffer(buffer, copy) => record_copies(device, commands, buffer.raw(), target, &[*copy]),
                // SAFETY: V1, V2, V3, V5.
                Source::Image(image, copy) => unsafe {
                    device.raw().cmd_copy_image_to_buffer(
                        commands,
                        image.raw(),
                        vk::ImageLayout::GENERAL,
                        target,
                        &[*copy],
                    );
                },
            }
        }
        Ok(())
    }

    /// Calls `look` with bytes in the staging buffer that the last submission read back.
    pub(super) fn look<T>(&self, offset: u64, size_bytes: u64, look: impl FnOnce(&[u8]) -> T) -> Result<T> {
        match &self.staging.buffer {
            Some(staging) => staging.look(offset, size_bytes, look),
            // Without a staging buffer nothing was copied, so the read must be empty.
            None => Ok(look(&[])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(dst_offset: u64, size: u64) -> Region {
        Region { target: 0, copy: vk::BufferCopy { src_offset: 0, dst_offset, size } }
    }

    #[test]
    fn regions_overlap_only_if_they_share_a_byte() {
        assert!(!overlap(&[region(0, 4), region(4, 4), region(9, 1)]));
        assert!(overlap(&[region(0, 5), region(4, 4)]));
        assert!(overlap(&[region(8, 1), region(8, 1)]));
    }
}
