//! The buffers that lanes of cells searches share, and where each lane lies in them.

use std::sync::Arc;

use super::layout::{CellRecord, FlyRecord, SearchHeader, SearchRules};
use super::plan::{BLOCK_PIXELS, PIXEL_WORDS, Plan};
use super::shape::CellShape;
use crate::error::{Error, Result};
use crate::gpu::pools::{BufferRange, Growth, MASK_LAYER_BYTES, Needs, PartSpec, Pools, PoolsSpec, Slice};
use crate::model::MaskSet;
use crate::model::cells::Course;
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

const ALL_POOLS: [Pool; 9] = [
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

/// How many pools there are.
pub(super) const POOLS: usize = ALL_POOLS.len();

/// The buffers, in the order in which they are bound. The first two hold records of lanes: rules in the order of
/// dispatches, headers by lane.
#[expect(dead_code, reason = "the host never names those that only shaders use")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Rules,
    Header,
    Flies,
    Cells,
    Deals,
    Pixels,
    Steps,
    Fitness,
    Guide,
    Stacks,
    Scratch,
    Masks,
    Origins,
}

/// The tables, which are the same for all lanes, are bound before this part.
const PART_AFTER_TABLES: Part = Part::Steps;

const fn part(name: &'static str, pool: Pool, unit_bytes: usize) -> PartSpec {
    PartSpec { name, pool: pool as usize, unit_bytes }
}

/// All buffers, in the order of [`Part`].
static PARTS: [PartSpec; Part::Origins as usize + 1] = [
    part("search rules", Pool::Lanes, size_of::<SearchRules>()),
    part("search headers", Pool::Lanes, size_of::<SearchHeader>()),
    part("flies", Pool::Flies, size_of::<FlyRecord>()),
    part("cells", Pool::Cells, size_of::<CellRecord>()),
    part("deals", Pool::Flies, 12),
    part("pixels", Pool::Blocks, BLOCK_PIXELS * PIXEL_WORDS * 4),
    part("steps", Pool::Flies, 4),
    part("marginal fitness", Pool::Flies, 4),
    part("guide", Pool::Guide, 8),
    part("stacks", Pool::Stacks, BLOCK_PIXELS * 8),
    part("shown pixels", Pool::Scratch, 4),
    part("masks", Pool::Masks, MASK_LAYER_BYTES),
    part("origins", Pool::Origins, size_of::<FlyRecord>()),
];

/// The slices of a lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneSlices([Slice; POOLS]);

impl LaneSlices {
    /// The lane's slice of a pool.
    pub fn of(&self, pool: Pool) -> Slice {
        self.0[pool as usize]
    }

    /// The first unit of the lane's slice of a pool. It is below 2^32, since no buffer has that many bytes.
    pub fn first(&self, pool: Pool) -> u32 {
        self.of(pool).first as u32
    }
}

/// The buffers.
pub(super) struct SearchBuffers {
    pools: Pools<POOLS>,
    tables: Arc<Buffer>,
    /// What is bound, unless buffers may have grown since.
    group: Option<Arc<BindingGroup>>,
}

impl SearchBuffers {
    /// Creates buffers without room for lanes, and uploads the tables.
    pub fn create(device: &Arc<Device>, recorder: &mut Recorder) -> Result<Self> {
        let spec = PoolsSpec { parts: &PARTS, masks: Part::Masks as usize };
        let pools = Pools::create(device, spec, [0; POOLS])?;
        let words = tables::device_words();
        let bytes = words.len() as u64 * 4;
        let tables = Buffer::create(device, "tables", bytes, BufferUse::Storage, Residence::Device)?;
        recorder.write_buffer(&tables, 0, bytemuck::cast_slice(&words))?;
        Ok(Self { pools, tables, group: None })
    }

    /// Takes slices for a lane; none if there is no room until other lanes leave.
    ///
    /// # Errors
    /// [`Error::TooLarge`] or [`Error::OutOfDeviceMemory`] if a lane alone does not fit; or if the device fails.
    pub fn admit(
        &mut self,
        recorder: &mut Recorder,
        needs: &Needs<'_, POOLS>,
        growth: Growth,
    ) -> Result<Option<LaneSlices>> {
        // The group would keep buffers alive that growth replaces.
        self.group = None;
        let has_room = match self.pools.make_room(recorder, needs, growth) {
            Err(Error::OutOfDeviceMemory { .. }) if growth != Growth::Alone => false,
            made => made?,
        };
        if !has_room {
            return Ok(None);
        }
        self.pools.take(recorder, needs).map(LaneSlices).map(Some)
    }

    /// Frees the slices of a lane with these masks.
    pub fn dismiss(&mut self, slices: &LaneSlices, masks: &Arc<MaskSet>) {
        self.pools.give_back(&slices.0, masks);
    }

    /// One of the buffers.
    pub fn part(&self, part: Part) -> &Arc<Buffer> {
        self.pools.part(part as usize)
    }

    /// Where a lane's slice lies in a buffer.
    pub fn range(&self, part: Part, slices: &LaneSlices) -> BufferRange {
        self.pools.range(part as usize, &slices.0)
    }

    /// Bytes of all buffers that grow with the lanes.
    pub fn bytes(&self) -> u64 {
        self.pools.bytes()
    }

    /// Whether there are no lanes.
    pub fn is_empty(&self) -> bool {
        self.pools.is_empty()
    }

    /// The buffers as a pipeline of the search sees them.
    pub fn bind(&mut self, pipeline: &ComputePipeline) -> Result<Arc<BindingGroup>> {
        if let Some(group) = &self.group {
            return Ok(Arc::clone(group));
        }
        let mut bindings: Vec<Binding<'_>> = self.pools.parts().iter().map(Binding::Buffer).collect();
        bindings.insert(PART_AFTER_TABLES as usize, Binding::Buffer(&self.tables));
        let group = BindingGroup::create("cells", pipeline.layout(), &bindings)?;
        Ok(Arc::clone(self.group.insert(group)))
    }
}

/// What a lane needs.
pub(super) fn needs<'a>(course: &'a Course, plan: &Plan, shape: CellShape) -> Needs<'a, POOLS> {
    let fly_count = course.fly_count as u64;
    let cells = u64::from(plan.cell_count);
    let units = ALL_POOLS.map(|pool| match pool {
        Pool::Lanes => 1,
        Pool::Flies => fly_count,
        Pool::Cells => cells,
        Pool::Blocks => plan.block_count(),
        Pool::Stacks => plan.block_count() * plan.stack_depth as u64,
        Pool::Scratch => cells * shape.scratch_words(course, plan),
        Pool::Guide => course.guide.samples.len() as u64,
        Pool::Origins if course.rules.leash > 0 => fly_count,
        Pool::Origins => 0,
        // Shaders know the square without its mask.
        Pool::Masks => match course.masks.layers().len() as u64 {
            1 => 0,
            layers => layers,
        },
    });
    Needs { units, masks: &course.masks }
}
