//! The buffers that all lanes of the evaluator share, and where each lane lies in them. Searches in cells have others,
//! in `cells/buffers.rs`.

use std::iter;
use std::sync::Arc;

use super::layout::{LaneRecord, Tile};
use super::pools::{BufferRange, Growth, MASK_LAYER_BYTES, Needs, PartSpec, Pools, PoolsSpec, Slice};
use crate::error::Result;
use crate::model::tile::pack;
use crate::model::{Lane, MaskSet, Scene};
use crate::vk::{Buffer, Device, Recorder};

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

    /// Units of each pool.
    fn units(self, mask_layers: usize) -> [u64; POOLS] {
        [self.lanes, self.flies, self.pixels, mask_layers].map(|units| units as u64)
    }
}

/// What a lane has a slice of.
#[derive(Clone, Copy)]
enum Pool {
    Lanes,
    Flies,
    /// Pixels of all blocks.
    Pixels,
    /// Layers.
    Masks,
}

const POOLS: usize = 4;

/// The buffers.
#[derive(Clone, Copy)]
pub(super) enum Part {
    /// Records of lanes.
    Lanes,
    /// The SAE of each lane.
    Sums,
    Tiles,
    Marginal,
    Targets,
    TopLayer,
    UnderLayer,
    /// What each pixel added to the sums.
    PixelParts,
    Masks,
}

const fn part(name: &'static str, pool: Pool, unit_bytes: usize) -> PartSpec {
    PartSpec { name, pool: pool as usize, unit_bytes }
}

/// All buffers, in the order of [`Part`].
static PARTS: [PartSpec; Part::Masks as usize + 1] = [
    part("lanes", Pool::Lanes, size_of::<LaneRecord>()),
    part("sums", Pool::Lanes, 8),
    part("tiles", Pool::Flies, size_of::<Tile>()),
    part("marginal fitness", Pool::Flies, 8),
    part("targets", Pool::Pixels, 4),
    part("top layer", Pool::Pixels, 4),
    part("under layer", Pool::Pixels, 4),
    part("parts", Pool::Pixels, 4),
    part("masks", Pool::Masks, MASK_LAYER_BYTES),
];

/// Where a lane lies in the shared buffers.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneSpan {
    /// Index of the lane's record and of its SAE.
    pub number: usize,
    pub fly_count: usize,
    pub first_pixel: usize,
    pub pixel_count: usize,
    slices: [Slice; POOLS],
}

impl LaneSpan {
    fn new(slices: [Slice; POOLS]) -> Self {
        let [lane, flies, pixels, _] = slices;
        Self {
            number: lane.first as usize,
            fly_count: flies.count as usize,
            first_pixel: pixels.first as usize,
            pixel_count: pixels.count as usize,
            slices,
        }
    }
}

/// The buffers that all lanes share.
pub(super) struct LaneBuffers {
    pools: Pools<POOLS>,
}

impl LaneBuffers {
    /// Creates buffers without lanes that have `room`.
    pub fn create(device: &Arc<Device>, room: Room) -> Result<Self> {
        let spec = PoolsSpec { parts: &PARTS, masks: Part::Masks as usize };
        Ok(Self { pools: Pools::create(device, spec, room.units(0))? })
    }

    /// Makes room for a lane of `scene` in blocks of `block_side_px`; false if it does not fit beside the other lanes.
    ///
    /// # Errors
    /// [`crate::error::Error::TooLarge`] if a lane without others does not fit,
    /// [`crate::error::Error::OutOfDeviceMemory`] if the device has no memory left; or if the device fails.
    pub fn make_room(&mut self, recorder: &mut Recorder, scene: &Scene, block_side_px: u32) -> Result<bool> {
        let growth = match self.pools.is_empty() {
            true => Growth::Alone,
            false => Growth::Shared { bytes_max: u64::MAX },
        };
        self.pools.make_room(recorder, &needs(scene, block_side_px), growth)
    }

    /// Gives `lane` its slices, for which room was made, and uploads what never changes: its record, target and masks.
    pub fn place(&mut self, recorder: &mut Recorder, lane: &Lane) -> Result<LaneSpan> {
        let scene = lane.scene();
        let slices = self.pools.take(recorder, &needs(scene, lane.lists().side_px()))?;
        let first = |pool: Pool| slices[pool as usize].first as u32;
        let record = LaneRecord {
            first_fly: first(Pool::Flies),
            first_mask: first(Pool::Masks),
            background: pack(scene.background),
            sum: first(Pool::Lanes),
        };
        let target = lane.blocked_target();
        for (part, bytes) in
            [(Part::Lanes, bytemuck::bytes_of(&record)), (Part::Targets, bytemuck::cast_slice(&target))]
        {
            let range = self.pools.range(part as usize, &slices);
            recorder.write_buffer(&range.buffer, range.offset, bytes)?;
        }
        Ok(LaneSpan::new(slices))
    }

    /// Takes the slices of a lane with these masks back.
    pub fn release(&mut self, span: &LaneSpan, masks: &Arc<MaskSet>) {
        self.pools.give_back(&span.slices, masks);
    }

    /// Where a lane's slice lies in a buffer.
    pub fn range(&self, part: Part, span: &LaneSpan) -> BufferRange {
        self.pools.range(part as usize, &span.slices)
    }

    /// As [`Pools::version`].
    pub fn version(&self) -> usize {
        self.pools.version()
    }

    /// One of the buffers.
    pub fn part(&self, part: Part) -> &Arc<Buffer> {
        self.pools.part(part as usize)
    }
}

fn needs(scene: &Scene, block_side_px: u32) -> Needs<'_, POOLS> {
    let room = Room::of(iter::once(scene), block_side_px);
    Needs { units: room.units(scene.masks.layers().len()), masks: &scene.masks }
}
