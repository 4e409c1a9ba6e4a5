//! Buffers that grow as lanes come, of which every lane has a slice.
//!
//! A pool counts units, such as flies or blocks of pixels, and a lane has the same units in all buffers of the pool.
//! When a pool lacks room for a new lane, it takes larger buffers, up to the limits of the device, and copies what is
//! in the old ones. What a lane leaves goes to the next. Lanes with the same masks share them.

mod shared_masks;
mod slices;

use std::array;
use std::sync::Arc;

pub(super) use self::slices::Slice;

use self::shared_masks::SharedMasks;
use self::slices::Slices;
use crate::error::{Error, Result};
use crate::model::MaskSet;
use crate::model::mask::{TEXELS, Texel};
use crate::vk::{Buffer, BufferUse, Device, Recorder, Residence};

/// Bytes of a layer of masks.
pub(super) const MASK_LAYER_BYTES: usize = size_of::<[Texel; TEXELS]>();

/// A buffer of a pool.
pub(super) struct PartSpec {
    pub name: &'static str,
    /// Index of the pool.
    pub pool: usize,
    pub unit_bytes: usize,
}

/// The buffers of some pools.
pub(super) struct PoolsSpec {
    pub parts: &'static [PartSpec],
    /// Index of the part for masks. A unit of its pool is a layer, and the pool has no other part.
    pub masks: usize,
}

/// What a lane needs.
pub(super) struct Needs<'a, const POOLS: usize> {
    /// Units of each pool. Those of the masks only count if no other lane has the same masks.
    pub units: [u64; POOLS],
    pub masks: &'a Arc<MaskSet>,
}

/// How far pools may grow for a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Growth {
    /// No other lane is on the device, so that waiting for room is of no use. The pools try whatever the lane needs,
    /// and the error of the device says what is too large.
    Alone,
    /// Other lanes are on the device. No buffer may be larger than shaders can see, and all buffers together may not
    /// have more bytes than this.
    Shared { bytes_max: u64 },
}

/// Where in a buffer a lane's slice lies.
pub(super) struct BufferRange {
    pub buffer: Arc<Buffer>,
    pub offset: u64,
    pub size_bytes: u64,
}

/// The buffers, and which units of them are free.
pub(super) struct Pools<const POOLS: usize> {
    device: Arc<Device>,
    spec: PoolsSpec,
    slices: [Slices; POOLS],
    /// By part.
    buffers: Vec<Arc<Buffer>>,
    masks: SharedMasks,
    lane_count: usize,
    version: usize,
}

impl<const POOLS: usize> Pools<POOLS> {
    /// Creates pools without lanes that have so many units each.
    ///
    /// # Errors
    /// [`Error::TooLarge`] or [`Error::OutOfDeviceMemory`] if the device cannot have such buffers.
    pub fn create(device: &Arc<Device>, spec: PoolsSpec, units: [u64; POOLS]) -> Result<Self> {
        let create = |part: &PartSpec| create_buffer(device, part, units[part.pool]);
        let buffers = spec.parts.iter().map(create).collect::<Result<Vec<_>>>()?;
        let mut slices: [Slices; POOLS] = array::from_fn(|_| Slices::default());
        slices.iter_mut().zip(units).for_each(|(slices, units)| slices.grow(units));
        Ok(Self {
            device: Arc::clone(device),
            spec,
            slices,
            buffers,
            masks: SharedMasks::default(),
            lane_count: 0,
            version: 0,
        })
    }

    /// Lets pools grow until a lane fits. If they must not, it is false and nothing changes.
    ///
    /// # Errors
    /// As of [`Pools::create`], or if the device fails. Some of the pools may have grown then.
    pub fn make_room(&mut self, recorder: &mut Recorder, needs: &Needs<'_, POOLS>, growth: Growth) -> Result<bool> {
        let missing = self.missing(needs);
        let units = self.slices.each_ref().map(Slices::capacity);
        let exact: [u64; POOLS] = array::from_fn(|pool| units[pool] + missing[pool]);
        // Twice as large now and then, not a little larger with each lane.
        let ample = array::from_fn(|pool| match missing[pool] {
            0 => units[pool],
            _ => exact[pool].max((2 * units[pool]).min(self.units_max(pool))),
        });
        let units = match growth {
            Growth::Alone => ample,
            Growth::Shared { bytes_max } if self.may_have(&ample, bytes_max) => ample,
            Growth::Shared { bytes_max } if self.may_have(&exact, bytes_max) => exact,
            Growth::Shared { .. } => return Ok(false),
        };
        for (pool, units) in units.into_iter().enumerate() {
            self.grow(recorder, pool, units)?;
        }
        Ok(true)
    }

    /// Takes a lane's slices, for which room was made, and uploads its masks unless another lane has the same.
    ///
    /// # Errors
    /// [`Error::Internal`] if no room was made; or if the device fails.
    pub fn take(&mut self, recorder: &mut Recorder, needs: &Needs<'_, POOLS>) -> Result<[Slice; POOLS]> {
        let shared = self.masks.join(needs.masks);
        let mut taken = [Slice::default(); POOLS];
        for (pool, slice) in taken.iter_mut().enumerate() {
            let free = match shared {
                Some(layers) if pool == self.mask_pool() => Some(layers),
                _ => self.slices[pool].take(needs.units[pool]),
            };
            *slice = free.ok_or_else(|| Error::Internal(format!("pool {pool} has no room for what it grew for")))?;
        }
        if shared.is_none() {
            let layers = taken[self.mask_pool()];
            self.upload_masks(recorder, needs.masks, layers)?;
            self.masks.add(needs.masks, layers);
        }
        self.lane_count += 1;
        Ok(taken)
    }

    /// Frees the slices of a lane with these masks.
    pub fn give_back(&mut self, slices: &[Slice; POOLS], masks: &Arc<MaskSet>) {
        let mask_pool = self.mask_pool();
        for (pool, &slice) in slices.iter().enumerate().filter(|(pool, _)| *pool != mask_pool) {
            self.slices[pool].give_back(slice);
        }
        if let Some(layers) = self.masks.leave(masks) {
            self.slices[mask_pool].give_back(layers);
        }
        self.lane_count -= 1;
    }

    /// The buffer of a part.
    pub fn part(&self, part: usize) -> &Arc<Buffer> {
        &self.buffers[part]
    }

    /// The buffers, by part.
    pub fn parts(&self) -> &[Arc<Buffer>] {
        &self.buffers
    }

    /// Where the slice of a lane lies in the buffer of a part.
    pub fn range(&self, part: usize, slices: &[Slice; POOLS]) -> BufferRange {
        let PartSpec { pool, unit_bytes, .. } = self.spec.parts[part];
        let (slice, unit_bytes) = (slices[pool], unit_bytes as u64);
        let buffer = Arc::clone(self.part(part));
        BufferRange { buffer, offset: slice.first * unit_bytes, size_bytes: slice.count * unit_bytes }
    }

    /// A number that rises whenever buffers are replaced by larger ones. What was bound before is not theirs.
    pub fn version(&self) -> usize {
        self.version
    }

    /// Bytes of all buffers.
    pub fn bytes(&self) -> u64 {
        self.bytes_of(&self.slices.each_ref().map(Slices::capacity))
    }

    /// Whether there are no lanes.
    pub fn is_empty(&self) -> bool {
        self.lane_count == 0
    }

    /// By how many units each pool has to grow.
    fn missing(&self, needs: &Needs<'_, POOLS>) -> [u64; POOLS] {
        let has_masks = self.masks.contains(needs.masks);
        array::from_fn(|pool| match pool {
            pool if has_masks && pool == self.mask_pool() => 0,
            pool => self.slices[pool].missing(needs.units[pool]),
        })
    }

    /// Takes larger buffers for a pool, with what is in the old ones.
    fn grow(&mut self, recorder: &mut Recorder, pool: usize, units: u64) -> Result<()> {
        if units <= self.slices[pool].capacity() {
            return Ok(());
        }
        let mut grown = Vec::new();
        for (place, part) in self.spec.parts.iter().enumerate().filter(|(_, part)| part.pool == pool) {
            grown.push((place, create_buffer(&self.device, part, units)?));
        }
        if self.lane_count > 0 {
            let mut pass = recorder.transfer_pass("grow pools")?;
            for (place, buffer) in &grown {
                let old = &self.buffers[*place];
                pass.copy((old, 0), (buffer, 0), old.size_bytes());
            }
            drop(pass);
            // Writes take effect before the first pass of their submission. If this pass waited for the next
            // submission, its copy would overwrite what is written to the new buffers until then.
            recorder.submit_and_wait()?;
        }
        for (place, buffer) in grown {
            self.buffers[place] = buffer;
        }
        self.slices[pool].grow(units);
        self.version += 1;
        Ok(())
    }

    fn upload_masks(&self, recorder: &mut Recorder, masks: &MaskSet, layers: Slice) -> Result<()> {
        let buffer = self.part(self.spec.masks);
        for (layer, mask) in (layers.first..layers.first + layers.count).zip(masks.layers()) {
            let offset = layer * MASK_LAYER_BYTES as u64;
            recorder.write_buffer(buffer, offset, bytemuck::cast_slice(mask.texels()))?;
        }
        Ok(())
    }

    fn mask_pool(&self) -> usize {
        self.spec.parts[self.spec.masks].pool
    }

    /// Whether pools may have so many units beside other lanes.
    fn may_have(&self, units: &[u64; POOLS], bytes_max: u64) -> bool {
        self.bytes_of(units) <= bytes_max && (0..POOLS).all(|pool| units[pool] <= self.units_max(pool))
    }

    /// Most units of a pool that shaders can see.
    fn units_max(&self, pool: usize) -> u64 {
        let parts = self.spec.parts.iter().filter(|part| part.pool == pool);
        let unit_bytes = parts.map(|part| part.unit_bytes).max().unwrap_or(1);
        self.device.info().limits.largest_storage_buffer_bytes() / unit_bytes as u64
    }

    fn bytes_of(&self, units: &[u64; POOLS]) -> u64 {
        let bytes = |part: &PartSpec| units[part.pool].saturating_mul(part.unit_bytes as u64);
        self.spec.parts.iter().map(bytes).fold(0, u64::saturating_add)
    }
}

fn create_buffer(device: &Arc<Device>, part: &PartSpec, units: u64) -> Result<Arc<Buffer>> {
    let bytes = units.saturating_mul(part.unit_bytes as u64);
    Buffer::create(device, part.name, bytes, BufferUse::Storage, Residence::Device)
}
