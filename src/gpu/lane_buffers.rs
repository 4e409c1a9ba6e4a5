//! The buffers that all lanes share, and where each lane lies in them. They grow as lanes come, up to the device's limits;
//! what a lane leaves goes to the next.

use std::ops::Range;
use std::sync::Arc;

use super::layout::{LaneRecord, Tile};
use super::slices::{Slice, Slices};
use crate::error::Result;
use crate::model::mask::{TEXELS, Texel};
use crate::model::tile::pack;
use crate::model::{Lane, MaskSet, Scene};
use crate::vk::{Buffer, BufferUse, Device, Recorder, Residence};

/// How much room lanes need together.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Room {
    pub lanes: usize,
    pub flies: usize,
    pub pixels: usize,
}

impl Room {
    /// What these scenes need in blocks of `block_side_px`.
    pub fn of<'a>(scenes: impl Iterator<Item = &'a Scene>, block_side_px: u32) -> Self {
        scenes.fold(Self::default(), |Self { lanes, flies, pixels }, scene| {
            let (columns, rows) =
                (scene.target.width_px().div_ceil(block_side_px), scene.target.height_px().div_ceil(block_side_px));
            let blocks = columns as usize * rows as usize;
            let pixels = pixels + blocks * (block_side_px * block_side_px) as usize;
            Self { lanes: lanes + 1, flies: flies + scene.fly_count, pixels }
        })
    }
}

/// Where a lane lies in the shared buffers.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneSpan {
    /// Index of the lane's record and of its SAE.
    pub number: usize,
    pub first_fly: usize,
    pub fly_count: usize,
    pub first_pixel: usize,
    pub pixel_count: usize,
    first_mask: usize,
}

impl LaneSpan {
    /// Offset and size in bytes of the lane's marginal fitness.
    pub fn marginal_bytes(&self) -> (u64, u64) {
        (self.first_fly as u64 * 8, self.fly_count as u64 * 8)
    }
}

/// Buffers with the same places: whoever has some has them in each.
struct Pool<const COUNT: usize> {
    places: Slices,
    /// Name of each buffer, and the bytes of a place.
    kinds: [(&'static str, usize); COUNT],
    buffers: [Arc<Buffer>; COUNT],
    users: usize,
}

impl<const COUNT: usize> Pool<COUNT> {
    fn create(device: &Arc<Device>, kinds: [(&'static str, usize); COUNT], capacity: usize) -> Result<Self> {
        let mut places = Slices::default();
        places.grow(capacity as u64);
        Ok(Self { places, kinds, buffers: create_all(device, kinds, capacity)?, users: 0 })
    }

    /// Grows until `count` neighbouring places are free; false if that is more than the device's buffers can have.
    fn make_room(&mut self, recorder: &mut Recorder, count: usize) -> Result<bool> {
        let missing = self.places.missing(count as u64) as usize;
        if missing == 0 {
            return Ok(true);
        }
        let needed = self.capacity() + missing;
        let device = Arc::clone(recorder.device());
        let place_bytes = self.kinds.iter().map(|kind| kind.1).max().unwrap_or(1);
        let capacity_max = device.info().limits.storage_buffer_bytes as usize / place_bytes;
        // To the first alone the device itself says what is too large.
        if needed > capacity_max && self.users > 0 {
            return Ok(false);
        }
        let capacity = needed.max((2 * self.capacity()).min(capacity_max));
        let buffers = create_all(&device, self.kinds, capacity)?;
        if self.users > 0 {
            let mut pass = recorder.transfer_pass("grow buffers of lanes")?;
            for (from, to) in self.buffers.iter().zip(&buffers) {
                pass.copy((from, 0), (to, 0), from.size_bytes());
            }
            drop(pass);
            // The copy must not come after what is written next to where it lands.
            recorder.submit_and_wait()?;
        }
        self.buffers = buffers;
        self.places.grow(capacity as u64);
        Ok(true)
    }

    /// Places, free or not.
    fn capacity(&self) -> usize {
        self.places.capacity() as usize
    }

    fn take(&mut self, count: usize) -> Option<usize> {
        let taken = self.places.take(count as u64)?;
        self.users += 1;
        Some(taken.first as usize)
    }

    fn give_back(&mut self, places: Range<usize>) {
        self.places.give_back(Slice { first: places.start as u64, count: places.len() as u64 });
        self.users -= 1;
    }
}

fn create_all<const COUNT: usize>(
    device: &Arc<Device>,
    kinds: [(&'static str, usize); COUNT],
    capacity: usize,
) -> Result<[Arc<Buffer>; COUNT]> {
    let buffers = kinds
        .iter()
        .map(|(name, bytes)| {
            Buffer::create(device, name, (capacity * bytes) as u64, BufferUse::Storage, Residence::Device)
        })
        .collect::<Result<Vec<_>>>()?;
    buffers.try_into().map_err(|_| crate::error::Error::Internal("a pool lost a buffer".to_owned()))
}

/// Masks on the device, for all lanes whose masks are the same.
struct PlacedMasks {
    set: Arc<MaskSet>,
    layers: Range<usize>,
    users: usize,
}

/// The buffers that all lanes share.
pub(super) struct LaneBuffers {
    /// Lane records, sums.
    records: Pool<2>,
    /// Tiles, marginal fitness.
    flies: Pool<2>,
    /// Targets, top layer, under layer, parts.
    pixels: Pool<4>,
    masks: Pool<1>,
    mask_sets: Vec<PlacedMasks>,
}

const LAYER_BYTES: usize = size_of::<[Texel; TEXELS]>();

impl LaneBuffers {
    /// Creates buffers without lanes, with so much room.
    pub fn create(device: &Arc<Device>, room: Room) -> Result<Self> {
        Ok(Self {
            records: Pool::create(device, [("lanes", size_of::<LaneRecord>()), ("sums", 8)], room.lanes)?,
            flies: Pool::create(device, [("tiles", size_of::<Tile>()), ("marginal fitness", 8)], room.flies)?,
            pixels: Pool::create(
                device,
                [("targets", 4), ("top layer", 4), ("under layer", 4), ("parts", 4)],
                room.pixels,
            )?,
            masks: Pool::create(device, [("masks", LAYER_BYTES)], 0)?,
            mask_sets: Vec::new(),
        })
    }

    /// Grows until a lane of `scene` fits, which needs `room`; false if the device's buffers cannot. Buffers that grow are
    /// others afterwards.
    pub fn make_room(&mut self, recorder: &mut Recorder, scene: &Scene, room: Room) -> Result<bool> {
        let layers = if self.placed(&scene.masks).is_some() { 0 } else { scene.masks.layers().len() };
        Ok(self.records.make_room(recorder, room.lanes)?
            && self.flies.make_room(recorder, room.flies)?
            && self.pixels.make_room(recorder, room.pixels)?
            && self.masks.make_room(recorder, layers)?)
    }

    /// Gives `lane` its places, for which room was made, and uploads what never changes: its record, target and masks.
    pub fn place(&mut self, recorder: &mut Recorder, lane: &Lane) -> Result<Option<LaneSpan>> {
        let scene = lane.scene();
        let target = lane.blocked_target();
        let (fly_count, pixel_count) = (scene.fly_count, target.len());
        let Some(first_mask) = self.place_masks(recorder, &scene.masks)? else { return Ok(None) };
        let (Some(number), Some(first_fly), Some(first_pixel)) =
            (self.records.take(1), self.flies.take(fly_count), self.pixels.take(pixel_count))
        else {
            return Ok(None);
        };
        let record = LaneRecord {
            first_fly: first_fly as u32,
            first_mask: first_mask as u32,
            background: pack(scene.background),
            sum: number as u32,
        };
        let offset = (number * size_of::<LaneRecord>()) as u64;
        recorder.write_buffer(self.lanes(), offset, bytemuck::bytes_of(&record))?;
        recorder.write_buffer(&self.pixels.buffers[0], first_pixel as u64 * 4, bytemuck::cast_slice(&target))?;
        Ok(Some(LaneSpan { number, first_fly, fly_count, first_pixel, pixel_count, first_mask }))
    }

    /// Takes a lane's places back.
    pub fn release(&mut self, span: &LaneSpan) {
        self.records.give_back(span.number..span.number + 1);
        self.flies.give_back(span.first_fly..span.first_fly + span.fly_count);
        self.pixels.give_back(span.first_pixel..span.first_pixel + span.pixel_count);
        if let Some(place) = self.mask_sets.iter().position(|placed| placed.layers.start == span.first_mask) {
            self.mask_sets[place].users -= 1;
            if self.mask_sets[place].users == 0 {
                self.masks.give_back(self.mask_sets.swap_remove(place).layers);
            }
        }
    }

    /// A number that rises whenever buffers are replaced by larger ones: what was bound before is not theirs.
    pub fn version(&self) -> usize {
        let Self { records, flies, pixels, masks, .. } = self;
        records.capacity() + flies.capacity() + pixels.capacity() + masks.capacity()
    }

    /// First layer of masks with the same texels as `set`, which are uploaded unless a lane has them already.
    fn place_masks(&mut self, recorder: &mut Recorder, set: &Arc<MaskSet>) -> Result<Option<usize>> {
        if let Some(place) = self.placed(set) {
            self.mask_sets[place].users += 1;
            return Ok(Some(self.mask_sets[place].layers.start));
        }
        let Some(first) = self.masks.take(set.layers().len()) else { return Ok(None) };
        for (layer, mask) in (first..).zip(set.layers()) {
            let offset = (layer * LAYER_BYTES) as u64;
            recorder.write_buffer(self.masks(), offset, bytemuck::cast_slice(mask.texels()))?;
        }
        let layers = first..first + set.layers().len();
        self.mask_sets.push(PlacedMasks { set: Arc::clone(set), layers, users: 1 });
        Ok(Some(first))
    }

    fn placed(&self, set: &Arc<MaskSet>) -> Option<usize> {
        // How texels are read is a matter of the kernel.
        self.mask_sets.iter().position(|placed| Arc::ptr_eq(&placed.set, set) || placed.set.layers() == set.layers())
    }

    pub fn lanes(&self) -> &Arc<Buffer> {
        &self.records.buffers[0]
    }

    pub fn sums(&self) -> &Arc<Buffer> {
        &self.records.buffers[1]
    }

    /// Tiles and marginal fitness.
    pub fn flies(&self) -> &[Arc<Buffer>; 2] {
        &self.flies.buffers
    }

    /// Targets, top layer, under layer, and what each pixel added to the sums.
    pub fn pixels(&self) -> &[Arc<Buffer>; 4] {
        &self.pixels.buffers
    }

    pub fn masks(&self) -> &Arc<Buffer> {
        &self.masks.buffers[0]
    }
}
