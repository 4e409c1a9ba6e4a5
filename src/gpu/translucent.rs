//! The compute pass `translucent`: lanes whose tiles show what lies behind them. Twin: `cpu/translucent.rs`.
//!
//! The device answers with what each block adds to the sums; the host keeps the sums. Nothing is capped: a block's
//! scratch holds as many layers as its pixels can have, work that exceeds the buffers takes several submissions, and
//! blocks with long lists or deep stacks take several dispatches.

use std::sync::Arc;

use super::evaluate::{KernelShape, LIST_PIECE};
use super::lane_buffers::{LaneBuffers, Part};
use super::layout::{FLAG_CONTINUED, FLAG_UNFINISHED, StackItem, TranslucentPush};
use super::shaders;
use crate::error::Result;
use crate::model::blocks::index_of;
use crate::model::tally::{BlockParts, Tally};
use crate::model::translucency::LAYERS_MAX;
use crate::model::{Evaluation, Lane};
use crate::vk::{
    Binding, BindingGroup, BindingKind, Buffer, BufferUse, ComputePipeline, ComputeShader, Device, ReadTicket,
    Recorder, Residence,
};

/// Layers that the kernel leaves out side by side.
const CHUNK: usize = 4;
/// Words of scratch per pixel before its layers, and per layer.
const STATE_WORDS: usize = 3;
const LAYER_WORDS: usize = 2;
/// Most turns of all loops of one invocation in one dispatch. Software Vulkan ends them silently after 65,535, counted
/// over nested loops together (Mesa 22.3.6, llvmpipe).
const TURNS_PER_DISPATCH: usize = 60_000;
/// Turns of all items of a submission: a fraction of a watchdog's second, at some 50 ns each.
const TURNS_PER_SUBMISSION: usize = 1 << 22;
/// Words of scratch for ordinary work.
const SCRATCH_WORDS: usize = 1 << 23;

/// Fitness of one lane, kept by the host.
struct Ledger {
    tally: Tally,
    blocks: Vec<BlockParts>,
}

/// A block of the batch: where its parts will be.
struct BatchBlock {
    lane: usize,
    block: u32,
    entries: std::ops::Range<usize>,
    first_part: usize,
}

/// A part of the work on a block.
struct BatchItem {
    item: StackItem,
    /// Most turns of the loops of one invocation.
    turns: usize,
}

/// Work of the next submission.
#[derive(Default)]
struct Batch {
    blocks: Vec<BatchBlock>,
    /// The k-th dispatch works on the k-th item of every block that has so many.
    rounds: Vec<Vec<BatchItem>>,
    item_count: usize,
    entries: Vec<u32>,
    scratch_words: usize,
    part_count: usize,
}

/// How much the translucent lanes have together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// Blocks of all lanes.
    pub block_count: usize,
    /// Flies of the lane that has the most.
    pub fly_count: usize,
}

/// Words in the buffers of the pass, and items in that of the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sizes {
    items: usize,
    entries: usize,
    scratch: usize,
    parts: usize,
}

impl Sizes {
    /// Room for such lanes. A block always fits, whatever the population, so that nothing is ever refused.
    fn of(extent: Extent, block_pixels: usize) -> Self {
        let Extent { block_count, fly_count } = extent;
        let entries = (24 * block_count).clamp(1 << 16, 1 << 22).max(fly_count + 1);
        Self {
            items: block_count.max(8_192),
            entries,
            scratch: SCRATCH_WORDS.max(scratch_words(fly_count, block_pixels)),
            parts: entries + block_count,
        }
    }

    fn max(self, other: Self) -> Self {
        Self {
            items: self.items.max(other.items),
            entries: self.entries.max(other.entries),
            scratch: self.scratch.max(other.scratch),
            parts: self.parts.max(other.parts),
        }
    }
}

/// What the translucent lanes share.
struct Buffers {
    sizes: Sizes,
    work: Arc<Buffer>,
    entries: Arc<Buffer>,
    scratch: Arc<Buffer>,
    parts: Arc<Buffer>,
}

impl Buffers {
    fn create(device: &Arc<Device>, sizes: Sizes) -> Result<Self> {
        let storage = |name: &str, words: usize| {
            Buffer::create(device, name, words as u64 * 4, BufferUse::Storage, Residence::Device)
        };
        Ok(Self {
            sizes,
            work: storage("translucent work", sizes.items * size_of::<StackItem>() / 4)?,
            entries: storage("translucent entries", sizes.entries)?,
            scratch: storage("translucent scratch", sizes.scratch)?,
            parts: storage("translucent parts", sizes.parts)?,
        })
    }
}

/// Pipeline, buffers and sums of the translucent lanes.
pub(super) struct TranslucentPass {
    pixels_per_thread: usize,
    block_pixels: usize,
    /// By the number of the lane.
    ledgers: Vec<Option<Ledger>>,
    batch: Batch,
    buffers: Buffers,
    pipeline: Arc<ComputePipeline>,
    /// What is bound, and [`LaneBuffers::version`] when it was.
    group: Option<(usize, Arc<BindingGroup>)>,
    workgroups_per_row: usize,
}

impl TranslucentPass {
    /// Creates the pass with room for the work of such lanes.
    pub fn create(device: &Arc<Device>, shape: KernelShape, extent: Extent) -> Result<Self> {
        // With more, the deepest stacks would need more turns of a loop than there may be.
        let shape = KernelShape { pixels_per_thread: shape.pixels_per_thread.min(8), ..shape };
        let block_pixels = shape.block_pixels();
        Ok(Self {
            pixels_per_thread: shape.pixels_per_thread as usize,
            block_pixels,
            ledgers: Vec::new(),
            batch: Batch::default(),
            buffers: Buffers::create(device, Sizes::of(extent, block_pixels))?,
            pipeline: create_pipeline(device, shape)?,
            group: None,
            workgroups_per_row: device.info().limits.workgroups[0] as usize,
        })
    }

    /// Makes room for the work of such lanes.
    pub fn make_room(&mut self, device: &Arc<Device>, extent: Extent) -> Result<()> {
        let sizes = |extent| self.buffers.sizes.max(Sizes::of(extent, self.block_pixels));
        if sizes(extent) != self.buffers.sizes {
            // Twice as much now and then, not a little more with each lane.
            let ample = Extent {
                block_count: extent.block_count.next_power_of_two(),
                fly_count: extent.fly_count.next_power_of_two(),
            };
            self.buffers = Buffers::create(device, sizes(ample))?;
            self.group = None;
        }
        Ok(())
    }

    /// Begins to keep the sums of a lane.
    pub fn admit(&mut self, number: usize, lane: &Lane) {
        if self.ledgers.len() <= number {
            self.ledgers.resize_with(number + 1, || None);
        }
        self.ledgers[number] = Some(Ledger {
            tally: Tally::new(lane.tiles().len()),
            blocks: vec![BlockParts::default(); lane.lists().block_count()],
        });
    }

    /// Forgets the sums of a lane, if it is a translucent one.
    pub fn release(&mut self, number: usize) {
        if let Some(ledger) = self.ledgers.get_mut(number) {
            *ledger = None;
        }
    }

    /// Fitness of a translucent lane.
    pub fn evaluation(&self, lane: usize) -> Evaluation<'_> {
        self.ledgers[lane].as_ref().expect("the lane is translucent").tally.evaluation()
    }

    /// Whether the buffers have room for a block with a list of `length` beside the batch so far. An empty batch has
    /// room for any block.
    pub fn has_room(&self, length: usize) -> bool {
        let (batch, sizes) = (&self.batch, self.buffers.sizes);
        batch.blocks.is_empty()
            || (batch.entries.len() + length <= sizes.entries
                && batch.part_count + length < sizes.parts
                && batch.scratch_words + scratch_words(length, self.block_pixels) <= sizes.scratch
                && batch.item_count + plan(length, self.pixels_per_thread).len() <= sizes.items)
    }

    /// Adds the evaluation of a block, whose first pixel has the number `first_pixel` in the layers, to the batch.
    pub fn add(&mut self, lane_number: usize, lane: &Lane, block: u32, first_pixel: usize) {
        let lists = lane.lists();
        let (x, y) = lists.origin(block as usize);
        let origin = (x as i32, y as i32);
        let flies = lists.list(block as usize).iter().map(|&key| index_of(key));
        let batch = &mut self.batch;
        let first_entry = batch.entries.len();
        let side = lists.side_px() as i32;
        batch.entries.extend(flies.filter(|&fly| lane.tiles()[fly as usize].may_cover(origin, side)));
        let length = batch.entries.len() - first_entry;
        let plan = plan(length, self.pixels_per_thread);
        let last = plan.len() - 1;
        for (round, step) in plan.into_iter().enumerate() {
            if batch.rounds.len() == round {
                batch.rounds.push(Vec::new());
            }
            let item = StackItem {
                lane: lane_number as u32,
                first_pixel: first_pixel as u32,
                x: origin.0,
                y: origin.1,
                first_entry: (first_entry + step.entries.start) as u32,
                entry_count: step.entries.len() as u32,
                first_slot: step.entries.start as u32,
                flags: if round > 0 { FLAG_CONTINUED } else { 0 } | if round < last { FLAG_UNFINISHED } else { 0 },
                first_rank: step.ranks.start as u32,
                end_rank: step.ranks.end as u32,
                scratch: batch.scratch_words as u32,
                first_part: batch.part_count as u32,
                error: (batch.part_count + length) as u32,
            };
            batch.rounds[round].push(BatchItem { item, turns: step.turns });
            batch.item_count += 1;
        }
        let entries = first_entry..batch.entries.len();
        batch.blocks.push(BatchBlock { lane: lane_number, block, entries, first_part: batch.part_count });
        batch.scratch_words += scratch_words(length, self.block_pixels);
        batch.part_count += length + 1;
    }

    /// Records the batch, submitting in between if it is much work, and asks for its parts.
    pub fn record(&mut self, recorder: &mut Recorder, lanes: &LaneBuffers) -> Result<Option<ReadTicket>> {
        let group = self.bind(lanes)?;
        let (batch, buffers) = (&self.batch, &self.buffers);
        if batch.blocks.is_empty() {
            return Ok(None);
        }
        let items: Vec<StackItem> = batch.rounds.iter().flatten().map(|part| part.item).collect();
        recorder.write_buffer(&buffers.work, 0, bytemuck::cast_slice(&items))?;
        recorder.write_buffer(&buffers.entries, 0, bytemuck::cast_slice(&batch.entries))?;
        let part_bytes = batch.part_count as u64 * 4;
        recorder.transfer_pass("zero parts")?.fill(&buffers.parts, 0, part_bytes, 0);
        let (mut first, mut turns) = (0, 0);
        for round in &batch.rounds {
            let mut end = first;
            for part in round {
                if turns + part.turns > TURNS_PER_SUBMISSION {
                    self.dispatch(recorder, &group, first..end)?;
                    recorder.submit_and_wait()?;
                    (first, turns) = (end, 0);
                }
                turns += part.turns;
                end += 1;
            }
            self.dispatch(recorder, &group, first..end)?;
            first = end;
        }
        recorder.read_buffer(&buffers.parts, 0, part_bytes).map(Some)
    }

    /// What the kernel works on.
    fn bind(&mut self, lanes: &LaneBuffers) -> Result<Arc<BindingGroup>> {
        if let Some((version, group)) = &self.group
            && *version == lanes.version()
        {
            return Ok(Arc::clone(group));
        }
        let Buffers { work, entries, scratch, parts, .. } = &self.buffers;
        let part = |part| lanes.part(part);
        let buffers = [
            part(Part::Lanes),
            work,
            entries,
            part(Part::Tiles),
            part(Part::Targets),
            part(Part::TopLayer),
            part(Part::UnderLayer),
            scratch,
            parts,
            part(Part::Masks),
        ];
        let group = BindingGroup::create("translucent", self.pipeline.layout(), &buffers.map(Binding::Buffer))?;
        self.group = Some((lanes.version(), Arc::clone(&group)));
        Ok(group)
    }

    /// Takes the parts of the batch that [`TranslucentPass::record`] asked for into the sums, and empties it.
    pub fn absorb(&mut self, recorder: &Recorder, ticket: &ReadTicket) -> Result<()> {
        let mut parts = vec![0_i32; self.batch.part_count];
        recorder.read_into(ticket, bytemuck::cast_slice_mut(&mut parts))?;
        for BatchBlock { lane, block, entries, first_part } in &self.batch.blocks {
            let (marginal, error) = parts[*first_part..].split_at(entries.len());
            let Some(Ledger { tally, blocks }) = &mut self.ledgers[*lane] else { continue };
            let sums = &mut blocks[*block as usize];
            tally.subtract(sums);
            sums.set(self.batch.entries[entries.clone()].iter().copied(), marginal, error[0] as u32);
            tally.add(sums);
        }
        self.batch.clear();
        Ok(())
    }

    /// Records a dispatch of some items of the batch, after what was recorded before it.
    fn dispatch(
        &self,
        recorder: &mut Recorder,
        group: &Arc<BindingGroup>,
        items: std::ops::Range<usize>,
    ) -> Result<()> {
        if items.is_empty() {
            return Ok(());
        }
        let mut pass = recorder.compute_pass("translucent")?;
        pass.bind(&self.pipeline, group);
        let push = TranslucentPush { first_item: items.start as u32, item_count: items.len() as u32 };
        pass.push_constants(bytemuck::bytes_of(&push));
        let columns = items.len().min(self.workgroups_per_row);
        pass.dispatch(columns as u32, items.len().div_ceil(columns) as u32, 1);
        Ok(())
    }
}

impl Batch {
    fn clear(&mut self) {
        self.blocks.clear();
        self.rounds.iter_mut().for_each(Vec::clear);
        self.item_count = 0;
        self.entries.clear();
        self.scratch_words = 0;
        self.part_count = 0;
    }
}

/// What one dispatch does for a block.
#[derive(Debug, PartialEq, Eq)]
struct Step {
    /// Entries of the list to collect.
    entries: std::ops::Range<usize>,
    /// Layers to leave out.
    ranks: std::ops::Range<usize>,
    /// Most turns of the loops of one invocation.
    turns: usize,
}

/// How to evaluate a block with a list of `length` so that no invocation turns its loops too often.
fn plan(length: usize, pixels_per_thread: usize) -> Vec<Step> {
    let depth = length.min(LAYERS_MAX);
    let mut steps = Vec::new();
    let mut from = 0;
    while length - from > LIST_PIECE {
        steps.push(Step { entries: from..from + LIST_PIECE, ranks: 0..0, turns: LIST_PIECE });
        from += LIST_PIECE;
    }
    let mut entries = from..length;
    let mut rank = 0;
    loop {
        // Each pixel composites all of its layers once.
        let mut turns = entries.len() + pixels_per_thread * (depth + 1);
        let first = rank;
        while rank < depth {
            let more = pixels_per_thread * (depth.saturating_sub(rank + CHUNK) + 2);
            if rank > first && turns + more > TURNS_PER_DISPATCH {
                break;
            }
            turns += more;
            rank += CHUNK;
        }
        // A block without tiles still has an error.
        steps.push(Step { entries, ranks: first..rank.max(1), turns });
        if rank >= depth {
            return steps;
        }
        entries = length..length;
    }
}

/// Words of scratch for a block with a list of `length`.
fn scratch_words(length: usize, block_pixels: usize) -> usize {
    (STATE_WORDS + LAYER_WORDS * length.min(LAYERS_MAX)) * block_pixels
}

fn create_pipeline(device: &Arc<Device>, shape: KernelShape) -> Result<Arc<ComputePipeline>> {
    ComputePipeline::create(
        device,
        &ComputeShader {
            name: "translucent",
            spirv: &shaders::words(shaders::TRANSLUCENT.for_device(device.info())),
            specialization: &shape.specialization(),
            bindings: &[BindingKind::StorageBuffer; 10],
            push_constant_bytes: size_of::<TranslucentPush>() as u32,
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_cover_every_entry_and_layer_once_and_never_turn_too_often() {
        for pixels_per_thread in [1, 2, 4, 8] {
            for length in [0, 1, 3, 4, 5, 100, 700, 1_566, 1_567, LIST_PIECE, LIST_PIECE + 1, 1_000_000] {
                let steps = plan(length, pixels_per_thread);
                let (mut entry, mut rank) = (0, 0);
                for step in &steps {
                    assert!(step.turns <= TURNS_PER_DISPATCH, "{length}: {step:?}");
                    assert_eq!(step.entries.start, if step.entries.is_empty() { length } else { entry });
                    entry = step.entries.end;
                    if !step.ranks.is_empty() {
                        assert!(step.ranks.start == rank && rank % CHUNK == 0 && entry == length);
                        rank = step.ranks.end;
                    }
                }
                assert!(entry == length && rank >= length.clamp(1, LAYERS_MAX), "{length}: {steps:?}");
            }
        }
    }
}
