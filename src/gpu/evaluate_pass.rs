//! The compute pass `evaluate`: its pipeline, and the buffers that all lanes share. Twin: `cpu/evaluate.rs`.

use std::sync::Arc;

use super::layout::{EvaluatePush, LaneRecord, Tile, WorkItem};
use super::shaders;
use crate::error::{Error, Result};
use crate::model::mask::{TEXELS, Texel};
use crate::model::tile::pack;
use crate::model::{Lane, MaskSet};
use crate::vk::{
    Binding, BindingGroup, BindingKind, Buffer, BufferUse, ComputePass, ComputePipeline, ComputeShader, Device,
    DeviceKind, Recorder, Residence,
};

/// Most tiles that one dispatch looks at in a block. Software Vulkan ends a loop silently after 65,535 turns (Mesa
/// 22.3.6, llvmpipe); longer lists are continued by the next dispatch.
pub(super) const LIST_PIECE: usize = 16_384;

/// How the work of a block is cut; it never changes a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelShape {
    /// Pixels along each side of a block.
    pub block_side_px: u32,
    /// Pixels of one column that an invocation works on; divides the side.
    pub pixels_per_thread: u32,
}

impl KernelShape {
    /// The shape for a class of devices. On software Vulkan small blocks make births cheapest (`cargo bench --bench
    /// paper_run`; `kernel_shape` for whole pictures). For hardware, a shape that fills a warp or a wave, not yet tuned
    /// on one.
    #[must_use]
    pub fn for_device(kind: DeviceKind) -> Self {
        match kind {
            DeviceKind::Cpu => Self { block_side_px: 8, pixels_per_thread: 8 },
            _ => Self { block_side_px: 16, pixels_per_thread: 4 },
        }
    }

    /// Pixels of a block.
    #[must_use]
    pub fn block_pixels(self) -> usize {
        (self.block_side_px * self.block_side_px) as usize
    }

    /// The specialisation constants 0, 1 and 2 of every kernel that works block by block.
    pub(super) fn specialization(self) -> [(u32, u32); 3] {
        let Self { block_side_px, pixels_per_thread } = self;
        [(0, block_side_px * block_side_px / pixels_per_thread), (1, block_side_px), (2, pixels_per_thread)]
    }
}

/// A variant of the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Variant {
    pub shape: KernelShape,
    pub mode: Mode,
    /// Whether any lane has masks besides the square.
    pub masked: bool,
    /// Whether any sum may not fit 32 bits.
    pub wide_sums: bool,
}

impl Variant {
    /// The leanest variant that is right for these lanes.
    fn for_lanes(lanes: &[Lane], shape: KernelShape) -> Self {
        /// A pixel adds at most 3 * 255 to a sum.
        const NARROW_PIXELS: u64 = (1 << 31) / 765;
        let pixels = |lane: &Lane| {
            let target = &lane.scene().target;
            u64::from(target.width_px()) * u64::from(target.height_px())
        };
        Self {
            shape,
            mode: Mode::Evaluate,
            masked: lanes.iter().any(|lane| lane.scene().masks.layers().len() > 1),
            wide_sums: lanes.iter().any(|lane| pixels(lane) > NARROW_PIXELS),
        }
    }

    fn specialization(self) -> [(u32, u32); 6] {
        let [threads, side, pixels] = self.shape.specialization();
        [threads, side, pixels, (3, self.mode as u32), (4, u32::from(self.masked)), (5, u32::from(self.wide_sums))]
    }
}

/// What the kernel computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// Layers, marginal fitness, SAE.
    Evaluate = 0,
    /// Only the SAE, with one fly left out.
    ReRender = 1,
}

/// Where a lane lies in the shared buffers.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneSpan {
    pub first_fly: usize,
    pub fly_count: usize,
    pub first_pixel: usize,
    pub pixel_count: usize,
}

/// Pipeline and buffers of the pass.
pub(super) struct EvaluatePass {
    pub variant: Variant,
    pub spans: Vec<LaneSpan>,
    pub tiles: Arc<Buffer>,
    pub top: Arc<Buffer>,
    pub under: Arc<Buffer>,
    pub marginal: Arc<Buffer>,
    pub sums: Arc<Buffer>,
    pub lanes: Arc<Buffer>,
    pub targets: Arc<Buffer>,
    pub masks: Arc<Buffer>,
    work: Arc<Buffer>,
    entries: Arc<Buffer>,
    parts: Arc<Buffer>,
    pipeline: Arc<ComputePipeline>,
    group: Arc<BindingGroup>,
    workgroups_per_row: u32,
}

impl EvaluatePass {
    /// Creates the buffers for these lanes and uploads what never changes: lane records, targets and masks.
    pub fn create(device: &Arc<Device>, recorder: &mut Recorder, lanes: &[Lane], shape: KernelShape) -> Result<Self> {
        let spans = spans(lanes, shape);
        let fly_count: usize = spans.iter().map(|span| span.fly_count).sum();
        let pixel_count: usize = spans.iter().map(|span| span.pixel_count).sum();
        if u32::try_from(pixel_count).is_err() {
            return Err(Error::TooLarge(format!(
                "{pixel_count} pixels are more than one Vulkan device evaluates at once; use a smaller --size, or --device cpu"
            )));
        }
        let buffers = create_buffers(device, lanes.len(), fly_count, pixel_count, shape)?;
        let masks = create_mask_buffer(device, recorder, lanes.iter().map(|lane| &*lane.scene().masks))?;
        let variant = Variant::for_lanes(lanes, shape);
        let pipeline = create_pipeline(device, variant)?;
        let group = bind(&pipeline, &buffers, &masks)?;
        let [lane_records, work, entries, tiles, targets, top, under, parts, marginal, sums] = buffers;
        upload_lanes(recorder, &lane_records, lanes, &spans)?;
        for (lane, span) in lanes.iter().zip(&spans) {
            recorder.write_buffer(
                &targets,
                span.first_pixel as u64 * 4,
                bytemuck::cast_slice(&lane.blocked_target()),
            )?;
        }
        Ok(Self {
            variant,
            spans,
            tiles,
            top,
            under,
            marginal,
            sums,
            lanes: lane_records,
            work,
            entries,
            targets,
            parts,
            masks,
            pipeline,
            group,
            workgroups_per_row: device.info().limits.workgroups[0],
        })
    }

    /// Work items that fit one dispatch.
    pub fn item_capacity(&self) -> usize {
        self.work.size_bytes() as usize / size_of::<WorkItem>()
    }

    /// List entries that fit one dispatch.
    pub fn entry_capacity(&self) -> usize {
        self.entries.size_bytes() as usize / 4
    }

    /// Uploads work items and their lists for the next dispatch.
    pub fn write_work(&self, recorder: &mut Recorder, items: &[WorkItem], entries: &[u32]) -> Result<()> {
        recorder.write_buffer(&self.work, 0, bytemuck::cast_slice(items))?;
        recorder.write_buffer(&self.entries, 0, bytemuck::cast_slice(entries))
    }

    /// Records the dispatch of `item_count` work items.
    pub fn record(&self, recorder: &mut Recorder, item_count: usize) -> Result<()> {
        let mut pass = recorder.compute_pass("evaluate")?;
        let push = EvaluatePush { item_count: item_count as u32, left_out_fly: u32::MAX, sum_offset: 0 };
        self.dispatch(&mut pass, &self.pipeline, &self.group, push);
        Ok(())
    }

    /// Dispatches one workgroup per work item with any kernel that has this pass's bindings.
    pub fn dispatch(
        &self,
        pass: &mut ComputePass<'_>,
        pipeline: &Arc<ComputePipeline>,
        group: &Arc<BindingGroup>,
        push: EvaluatePush,
    ) {
        pass.bind(pipeline, group);
        pass.push_constants(bytemuck::bytes_of(&push));
        let columns = push.item_count.min(self.workgroups_per_row);
        pass.dispatch(columns, push.item_count.div_ceil(columns), 1);
    }

    /// This pass's bindings with other sums.
    pub fn bind_with_sums(&self, pipeline: &ComputePipeline, sums: &Arc<Buffer>) -> Result<Arc<BindingGroup>> {
        let Self { lanes, work, entries, tiles, targets, top, under, parts, marginal, masks, .. } = self;
        let buffers = [lanes, work, entries, tiles, targets, top, under, parts, marginal, sums].map(Arc::clone);
        bind(pipeline, &buffers, masks)
    }
}

/// The storage buffers, in the order of their bindings.
fn create_buffers(
    device: &Arc<Device>,
    lane_count: usize,
    fly_count: usize,
    pixel_count: usize,
    shape: KernelShape,
) -> Result<[Arc<Buffer>; 10]> {
    let block_count = pixel_count / shape.block_pixels();
    // Room for the lists of a whole population of ordinary depth; longer work takes several submissions.
    let entry_count = (16 * fly_count + 8 * block_count).clamp(1 << 16, 1 << 22);
    let storage =
        |name: &str, bytes: usize| Buffer::create(device, name, bytes as u64, BufferUse::Storage, Residence::Device);
    Ok([
        storage("lanes", lane_count * size_of::<LaneRecord>())?,
        storage("work", block_count * size_of::<WorkItem>())?,
        storage("entries", entry_count * 4)?,
        storage("tiles", fly_count * size_of::<Tile>())?,
        storage("targets", pixel_count * 4)?,
        storage("top layer", pixel_count * 4)?,
        storage("under layer", pixel_count * 4)?,
        storage("parts", pixel_count * 4)?,
        storage("marginal fitness", fly_count * 8)?,
        storage("sums", lane_count * 8)?,
    ])
}

/// The kernel in one of its variants.
pub(super) fn create_pipeline(device: &Arc<Device>, variant: Variant) -> Result<Arc<ComputePipeline>> {
    ComputePipeline::create(
        device,
        &ComputeShader {
            name: "evaluate",
            spirv: &shaders::words(shaders::EVALUATE),
            specialization: &variant.specialization(),
            bindings: &[BindingKind::StorageBuffer; 11],
            push_constant_bytes: size_of::<EvaluatePush>() as u32,
        },
    )
}

/// All layers of all mask sets, one set after the other, texel by texel.
pub(super) fn create_mask_buffer<'a>(
    device: &Arc<Device>,
    recorder: &mut Recorder,
    sets: impl Iterator<Item = &'a MaskSet> + Clone,
) -> Result<Arc<Buffer>> {
    let layer_bytes = size_of::<[Texel; TEXELS]>() as u64;
    let bytes = layer_bytes * sets.clone().map(|set| set.layers().len() as u64).sum::<u64>();
    let buffer = Buffer::create(device, "masks", bytes, BufferUse::Storage, Residence::Device)?;
    for (layer, mask) in (0..).zip(sets.flat_map(MaskSet::layers)) {
        recorder.write_buffer(&buffer, layer * layer_bytes, bytemuck::cast_slice(mask.texels()))?;
    }
    Ok(buffer)
}

fn bind(pipeline: &ComputePipeline, buffers: &[Arc<Buffer>; 10], masks: &Arc<Buffer>) -> Result<Arc<BindingGroup>> {
    let mut bindings: Vec<Binding<'_>> = buffers.iter().map(Binding::Buffer).collect();
    bindings.push(Binding::Buffer(masks));
    BindingGroup::create("evaluate", pipeline.layout(), &bindings)
}

fn spans(lanes: &[Lane], shape: KernelShape) -> Vec<LaneSpan> {
    let (mut first_fly, mut first_pixel) = (0, 0);
    let span = |lane: &Lane| {
        let (fly_count, pixel_count) = (lane.tiles().len(), lane.lists().block_count() * shape.block_pixels());
        let span = LaneSpan { first_fly, fly_count, first_pixel, pixel_count };
        first_fly += fly_count;
        first_pixel += pixel_count;
        span
    };
    lanes.iter().map(span).collect()
}

fn upload_lanes(recorder: &mut Recorder, buffer: &Arc<Buffer>, lanes: &[Lane], spans: &[LaneSpan]) -> Result<()> {
    let mut first_mask = 0;
    let record = |(sum, (lane, span)): (u32, (&Lane, &LaneSpan))| {
        let background = pack(lane.scene().background);
        let record = LaneRecord { first_fly: span.first_fly as u32, first_mask, background, sum };
        first_mask += lane.scene().masks.layers().len() as u32;
        record
    };
    let records: Vec<LaneRecord> = (0..).zip(lanes.iter().zip(spans)).map(record).collect();
    recorder.write_buffer(buffer, 0, bytemuck::cast_slice(&records))
}
