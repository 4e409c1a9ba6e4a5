//! The buffers that lanes of cells searches share. Each is a pool of units, such as flies or blocks of pixels, of which every lane has a
//! slice; a pool grows while lanes are in it.

use std::sync::Arc;

use super::cells_layout::{CellRecord, FlyRecord, SearchHeader, SearchRules};
use super::cells_shape::CellShape;
use super::cells_state::{BLOCK_PIXELS, PIXEL_WORDS, Plan};
use super::slices::{Slice, Slices};
use crate::error::{Error, Result};
use crate::model::MaskSet;
use crate::model::cells::Course;
use crate::model::mask::{TEXELS, Texel};
use crate::model::tables;
use crate::vk::{Binding, BindingGroup, Buffer, BufferUse, ComputePipeline, Device, Recorder, Residence};

/// What a lane has a slice of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pool {
    /// One for each lane.
    Lanes,
    Flies,
    /// The most cells of a round.
    Cells,
    /// 8x8 pixels.
    Blocks,
    /// 64 entries: one of each pixel of a block.
    Stacks,
    /// Words.
    Scratch,
    /// Samples.
    Guide,
    /// Layers of masks.
    Masks,
    /// Flies, if they have a leash.
    Origins,
}

const POOLS: [Pool; 9] = [
    Pool::Lanes,
    Pool::Flies,
    Pool::Cells,
    Pool::Blocks,
    Pool::Stacks,
    Pool::Scratch,
    Pool::Guide,
    Pool::Masks,
    Pool::Origins,
];

/// A number for each pool.
pub(super) type PerPool<T> = [T; POOLS.len()];

/// The buffers, as they are bound. The first two hold records of lanes: rules in the order of dispatches, headers by lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Rules,
    Header,
    Flies,
    Cells,
    Deals,
    Pixels,
    Tables,
    Steps,
    Fitness,
    Guide,
    Stacks,
    Scratch,
    Masks,
    Origins,
}

/// A buffer: its name, the pool that it is for and the bytes of a unit.
type PartSpec = (Part, &'static str, Option<Pool>, usize);

/// All buffers, in the order of [`Part`].
const PARTS: [PartSpec; 14] = [
    (Part::Rules, "search rules", Some(Pool::Lanes), size_of::<SearchRules>()),
    (Part::Header, "search headers", Some(Pool::Lanes), size_of::<SearchHeader>()),
    (Part::Flies, "flies", Some(Pool::Flies), size_of::<FlyRecord>()),
    (Part::Cells, "cells", Some(Pool::Cells), size_of::<CellRecord>()),
    (Part::Deals, "deals", Some(Pool::Flies), 12),
    (Part::Pixels, "pixels", Some(Pool::Blocks), BLOCK_PIXELS * PIXEL_WORDS * 4),
    (Part::Tables, "tables", None, 0),
    (Part::Steps, "steps", Some(Pool::Flies), 4),
    (Part::Fitness, "marginal fitness", Some(Pool::Flies), 4),
    (Part::Guide, "guide", Some(Pool::Guide), 8),
    (Part::Stacks, "stacks", Some(Pool::Stacks), BLOCK_PIXELS * 8),
    (Part::Scratch, "shown pixels", Some(Pool::Scratch), 4),
    (Part::Masks, "masks", Some(Pool::Masks), size_of::<[Texel; TEXELS]>()),
    (Part::Origins, "origins", Some(Pool::Origins), size_of::<FlyRecord>()),
];

/// Masks on the device, and how many lanes wear them.
struct Worn {
    masks: Arc<MaskSet>,
    slice: Slice,
    lanes: usize,
}

/// The slices of a lane.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LaneSlices(PerPool<Slice>);

impl LaneSlices {
    /// The lane's slice of a pool.
    pub fn of(&self, pool: Pool) -> Slice {
        self.0[pool as usize]
    }

    /// The first unit of the lane's slice of a pool; below 2^32, since that many bytes are more than a buffer has.
    pub fn first(&self, pool: Pool) -> u32 {
        self.of(pool).first as u32
    }
}

/// The buffers, and which parts of them are free.
pub(super) struct Pools {
    device: Arc<Device>,
    slices: PerPool<Slices>,
    buffers: Vec<Arc<Buffer>>,
    worn: Vec<Worn>,
    lane_count: usize,
    group: Option<Arc<BindingGroup>>,
}

impl Pools {
    /// Creates pools without room, and uploads the tables.
    pub fn create(device: &Arc<Device>, recorder: &mut Recorder) -> Result<Self> {
        let words = tables::device_words();
        let create = |(_, name, pool, _): &PartSpec| {
            create_buffer(device, name, if pool.is_none() { words.len() as u64 * 4 } else { 0 })
        };
        let buffers = PARTS.iter().map(create).collect::<Result<Vec<_>>>()?;
        recorder.write_buffer(&buffers[Part::Tables as usize], 0, bytemuck::cast_slice(&words))?;
        Ok(Self {
            device: Arc::clone(device),
            slices: PerPool::default(),
            buffers,
            worn: Vec::new(),
            lane_count: 0,
            group: None,
        })
    }

    /// Takes slices for a lane; none if there is no room before others leave. `share` are the bytes that these pools may take; a lane
    /// that is alone on its device has none to heed, and tries.
    ///
    /// # Errors
    /// [`Error::TooLarge`] or [`Error::OutOfDeviceMemory`] if there is no room for a lane alone; or if the device fails.
    pub fn admit(
        &mut self,
        recorder: &mut Recorder,
        course: &Course,
        (plan, shape): (&Plan, CellShape),
        share: Option<u64>,
    ) -> Result<Option<LaneSlices>> {
        let worn = self.worn.iter().position(|worn| *worn.masks == *course.masks);
        let mut needs = needs(course, plan, shape);
        if worn.is_some() {
            needs[Pool::Masks as usize] = 0;
        }
        if !self.make_room(recorder, &needs, share)? {
            return Ok(None);
        }
        let mut slices = LaneSlices::default();
        for (pool, slice) in slices.0.iter_mut().enumerate() {
            let taken = self.slices[pool].take(needs[pool]);
            *slice = taken.ok_or_else(|| Error::Internal(format!("pool {pool} has no room for what it grew for")))?;
        }
        let worn = worn.unwrap_or(self.worn.len());
        if worn == self.worn.len() {
            self.put_on(recorder, &course.masks, slices.of(Pool::Masks))?;
        }
        self.worn[worn].lanes += 1;
        slices.0[Pool::Masks as usize] = self.worn[worn].slice;
        self.lane_count += 1;
        Ok(Some(slices))
    }

    fn put_on(&mut self, recorder: &mut Recorder, masks: &Arc<MaskSet>, slice: Slice) -> Result<()> {
        let layer_bytes = size_of::<[Texel; TEXELS]>() as u64;
        for (layer, mask) in (slice.first..slice.first + slice.count).zip(masks.layers()) {
            recorder.write_buffer(self.part(Part::Masks), layer * layer_bytes, bytemuck::cast_slice(mask.texels()))?;
        }
        self.worn.push(Worn { masks: Arc::clone(masks), slice, lanes: 0 });
        Ok(())
    }

    /// Frees the slices of a lane.
    pub fn dismiss(&mut self, slices: &LaneSlices, masks: &MaskSet) {
        for pool in POOLS.into_iter().filter(|&pool| pool != Pool::Masks) {
            self.slices[pool as usize].give_back(slices.of(pool));
        }
        if let Some(place) = self.worn.iter().position(|worn| *worn.masks == *masks) {
            self.worn[place].lanes -= 1;
            if self.worn[place].lanes == 0 {
                let worn = self.worn.swap_remove(place);
                self.slices[Pool::Masks as usize].give_back(worn.slice);
            }
        }
        self.lane_count -= 1;
    }

    /// Lets the pools grow until a lane fits; false if they must not.
    fn make_room(&mut self, recorder: &mut Recorder, needs: &PerPool<u64>, share: Option<u64>) -> Result<bool> {
        let mut exact = self.slices.each_ref().map(Slices::capacity);
        let mut ample = exact;
        for pool in 0..POOLS.len() {
            let missing = self.slices[pool].missing(needs[pool]);
            if missing > 0 {
                exact[pool] += missing;
                ample[pool] = exact[pool].max((2 * ample[pool]).min(self.most(pool)));
            }
        }
        let fits = |units: &PerPool<u64>, share: u64| {
            total_bytes(units) <= share && (0..POOLS.len()).all(|pool| units[pool] <= self.most(pool))
        };
        let units = match share {
            None => exact,
            Some(share) if fits(&ample, share) => ample,
            Some(share) if fits(&exact, share) => exact,
            Some(_) => return Ok(false),
        };
        match self.grow(recorder, &units) {
            Err(Error::OutOfDeviceMemory { .. }) if share.is_some() => Ok(false),
            grown => grown.map(|()| true),
        }
    }

    /// Most units of a pool that shaders see.
    fn most(&self, pool: usize) -> u64 {
        let bytes =
            PARTS.iter().filter(|(_, _, of, _)| of.is_some_and(|of| of as usize == pool)).map(|(_, _, _, bytes)| bytes);
        let unit_bytes = bytes.copied().max().unwrap_or(1);
        self.device.info().limits.storage_buffer_bytes / unit_bytes as u64
    }

    /// Takes larger buffers where pools have more units than before, with what is in the old ones.
    fn grow(&mut self, recorder: &mut Recorder, units: &PerPool<u64>) -> Result<()> {
        let mut grown = Vec::new();
        for (place, (_, name, pool, unit_bytes)) in PARTS.iter().enumerate() {
            if let Some(pool) =
                pool.map(|pool| pool as usize).filter(|&pool| units[pool] > self.slices[pool].capacity())
            {
                grown.push((place, create_buffer(&self.device, name, units[pool].saturating_mul(*unit_bytes as u64))?));
            }
        }
        if grown.is_empty() {
            return Ok(());
        }
        // What was written before belongs into the old buffers.
        recorder.submit_and_wait()?;
        if self.lane_count > 0 {
            let mut pass = recorder.transfer_pass("cells growth")?;
            for (place, buffer) in &grown {
                let old = &self.buffers[*place];
                pass.copy((old, 0), (buffer, 0), old.size_bytes());
            }
            drop(pass);
            recorder.submit_and_wait()?;
        }
        for (place, buffer) in grown {
            self.buffers[place] = buffer;
        }
        self.slices.iter_mut().zip(units).for_each(|(slices, &units)| slices.grow(units));
        self.group = None;
        Ok(())
    }

    /// One of the buffers.
    pub fn part(&self, part: Part) -> &Arc<Buffer> {
        &self.buffers[part as usize]
    }

    /// The buffer, and where a lane's slice begins in it and how long it is, in bytes.
    pub fn range(&self, part: Part, slices: &LaneSlices) -> (Arc<Buffer>, u64, u64) {
        let (_, _, pool, unit_bytes) = PARTS[part as usize];
        let slice = pool.map_or(Slice::default(), |pool| slices.of(pool));
        let unit_bytes = unit_bytes as u64;
        (Arc::clone(self.part(part)), slice.first * unit_bytes, slice.count * unit_bytes)
    }

    /// Bytes of all buffers.
    pub fn bytes(&self) -> u64 {
        total_bytes(&self.slices.each_ref().map(Slices::capacity))
    }

    /// Whether no lane is there.
    pub fn is_empty(&self) -> bool {
        self.lane_count == 0
    }

    /// The buffers as a pipeline of the search sees them.
    pub fn bind(&mut self, pipeline: &ComputePipeline) -> Result<Arc<BindingGroup>> {
        if let Some(group) = &self.group {
            return Ok(Arc::clone(group));
        }
        let bindings: Vec<Binding<'_>> = self.buffers.iter().map(Binding::Buffer).collect();
        let group = BindingGroup::create("cells", pipeline.layout(), &bindings)?;
        Ok(Arc::clone(self.group.insert(group)))
    }
}

/// Units that a lane needs.
fn needs(course: &Course, plan: &Plan, shape: CellShape) -> PerPool<u64> {
    let layers = course.masks.layers().len() as u64;
    let cells = u64::from(plan.cell_count);
    POOLS.map(|pool| match pool {
        Pool::Lanes => 1,
        Pool::Flies => course.fly_count as u64,
        Pool::Cells => cells,
        Pool::Blocks => plan.block_count(),
        Pool::Stacks => plan.block_count() * plan.stack_depth as u64,
        Pool::Scratch => cells * shape.scratch_words(course, plan),
        Pool::Guide => course.guide.samples.len() as u64,
        Pool::Origins if course.rules.leash > 0 => course.fly_count as u64,
        Pool::Origins => 0,
        // The square needs none.
        Pool::Masks => {
            if layers > 1 {
                layers
            } else {
                0
            }
        }
    })
}

fn total_bytes(units: &PerPool<u64>) -> u64 {
    let bytes = |(_, _, pool, unit_bytes): &PartSpec| {
        pool.map_or(0, |pool| units[pool as usize].saturating_mul(*unit_bytes as u64))
    };
    PARTS.iter().map(bytes).fold(0, u64::saturating_add)
}

fn create_buffer(device: &Arc<Device>, name: &str, bytes: u64) -> Result<Arc<Buffer>> {
    Buffer::create(device, name, bytes, BufferUse::Storage, Residence::Device)
}
