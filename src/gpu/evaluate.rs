//! The compute pass `evaluate`: its pipelines, and the work of a dispatch. Twin: `cpu/evaluate.rs`.

use std::sync::Arc;

use super::lane_buffers::{LaneBuffers, Part, Room};
use super::layout::{EvaluatePush, FLAG_CONTINUED, FLAG_UNFINISHED, WorkItem};
use super::shaders::{self, Flavours};
use crate::error::Result;
use crate::model::mask::{TEXELS, Texel};
use crate::model::{Blend, MaskSet, Scene};
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
    /// Whether any opaque lane has masks besides the square.
    pub masked: bool,
    /// Whether any sum of an opaque lane may need more than 32 bits.
    pub wide_sums: bool,
    /// Whether any list is looked at in pieces.
    pub pieces: bool,
}

impl Variant {
    /// The leanest variant that is right for lanes of these scenes.
    fn for_scenes<'a>(scenes: impl Iterator<Item = &'a Scene>, shape: KernelShape) -> Self {
        let lean = Self { shape, masked: false, wide_sums: false, pieces: false };
        scenes.filter(|scene| scene.masks.blend() == Blend::Opaque).fold(lean, |variant, scene| Self {
            masked: variant.masked || scene.masks.layers().len() > 1,
            wide_sums: variant.wide_sums || needs_wide_sums(scene),
            ..variant
        })
    }

    pub fn specialization(self) -> [(u32, u32); 6] {
        let [threads, side, pixels] = self.shape.specialization();
        let [masked, wide_sums, pieces] = [self.masked, self.wide_sums, self.pieces].map(u32::from);
        [threads, side, pixels, (4, masked), (5, wide_sums), (6, pieces)]
    }
}

/// Whether sums of a lane may need more than 32 bits. If not, their high words mean nothing.
pub(super) fn needs_wide_sums(scene: &Scene) -> bool {
    /// A pixel adds at most 3 * 255 to a sum.
    const NARROW_PIXELS: u64 = (1 << 31) / 765;
    u64::from(scene.target.width_px()) * u64::from(scene.target.height_px()) > NARROW_PIXELS
}

/// Pipelines of the pass, the buffers of all lanes, and those of the work.
pub(super) struct EvaluatePass {
    pub variant: Variant,
    pub buffers: LaneBuffers,
    work: Arc<Buffer>,
    entries: Arc<Buffer>,
    /// Each variant is compiled once, when it is first needed.
    pipelines: Vec<(Variant, Arc<ComputePipeline>)>,
    /// What is bound, and [`LaneBuffers::version`] when it was.
    group: Option<(usize, Arc<BindingGroup>)>,
    device: Arc<Device>,
}

impl EvaluatePass {
    /// Creates buffers without lanes that have `room`.
    pub fn create(device: &Arc<Device>, room: Room, shape: KernelShape) -> Result<Self> {
        let sizes = WorkSizes::of(room, shape);
        Ok(Self {
            variant: Variant::for_scenes(std::iter::empty(), shape),
            buffers: LaneBuffers::create(device, room)?,
            work: storage(device, "work", sizes.items * size_of::<WorkItem>())?,
            entries: storage(device, "entries", sizes.entries * 4)?,
            pipelines: Vec::new(),
            group: None,
            device: Arc::clone(device),
        })
    }

    /// Makes room for the work of lanes that need `room` together, as far as a buffer may be that large. Work that
    /// exceeds it takes several submissions.
    pub fn make_room_for_work(&mut self, room: Room) -> Result<()> {
        let WorkSizes { items, entries } = WorkSizes::of(room, self.variant.shape);
        if items <= self.item_capacity() && entries <= self.entry_capacity() {
            return Ok(());
        }
        let larger = |needed: usize, capacity: usize, bytes: usize| {
            let limit = self.device.info().limits.largest_storage_buffer_bytes() as usize / bytes;
            if needed <= capacity { capacity } else { needed.max(2 * capacity).min(limit) }
        };
        let items = larger(items, self.item_capacity(), size_of::<WorkItem>());
        let entries = larger(entries, self.entry_capacity(), 4);
        let work = storage(&self.device, "work", items * size_of::<WorkItem>())?;
        self.entries = storage(&self.device, "entries", entries * 4)?;
        self.work = work;
        self.group = None;
        Ok(())
    }

    /// Chooses the kernel for lanes of these scenes.
    pub fn choose_variant<'a>(&mut self, scenes: impl Iterator<Item = &'a Scene>) {
        self.variant = Variant::for_scenes(scenes, self.variant.shape);
    }

    /// Work items that fit one dispatch.
    pub fn item_capacity(&self) -> usize {
        self.work.size_bytes() as usize / size_of::<WorkItem>()
    }

    /// List entries that fit one dispatch.
    pub fn entry_capacity(&self) -> usize {
        self.entries.size_bytes() as usize / 4
    }

    /// Uploads work items and their lists, and records their dispatch.
    pub fn record(&mut self, recorder: &mut Recorder, items: &[WorkItem], entries: &[u32]) -> Result<()> {
        recorder.write_buffer(&self.work, 0, bytemuck::cast_slice(items))?;
        recorder.write_buffer(&self.entries, 0, bytemuck::cast_slice(entries))?;
        let pieces = items.iter().any(|item| item.flags & (FLAG_CONTINUED | FLAG_UNFINISHED) != 0);
        let pipeline = self.pipeline(Variant { pieces, ..self.variant })?;
        let group = match &self.group {
            Some((version, group)) if *version == self.buffers.version() => Arc::clone(group),
            _ => {
                let group = self.bind_with_sums(&pipeline, self.buffers.part(Part::Sums))?;
                self.group = Some((self.buffers.version(), Arc::clone(&group)));
                group
            }
        };
        let mut pass = recorder.compute_pass("evaluate")?;
        pass.bind(&pipeline, &group);
        pass.push_constants(bytemuck::bytes_of(&EvaluatePush { item_count: items.len() as u32 }));
        self.dispatch(&mut pass, items.len() as u32);
        Ok(())
    }

    fn pipeline(&mut self, variant: Variant) -> Result<Arc<ComputePipeline>> {
        if let Some((_, pipeline)) = self.pipelines.iter().find(|(of, _)| *of == variant) {
            return Ok(Arc::clone(pipeline));
        }
        let pipeline = create_pipeline(&self.device, variant)?;
        self.pipelines.push((variant, Arc::clone(&pipeline)));
        Ok(pipeline)
    }

    /// Dispatches one workgroup per work item.
    pub fn dispatch(&self, pass: &mut ComputePass<'_>, item_count: u32) {
        let columns = item_count.min(self.device.info().limits.workgroups[0]);
        pass.dispatch(columns, item_count.div_ceil(columns), 1);
    }

    /// This pass's bindings with these sums.
    pub fn bind_with_sums(&self, pipeline: &ComputePipeline, sums: &Arc<Buffer>) -> Result<Arc<BindingGroup>> {
        let part = |part| self.buffers.part(part);
        let buffers = [
            part(Part::Lanes),
            &self.work,
            &self.entries,
            part(Part::Tiles),
            part(Part::Targets),
            part(Part::TopLayer),
            part(Part::UnderLayer),
            part(Part::PixelParts),
            part(Part::Marginal),
            sums,
            part(Part::Masks),
        ];
        BindingGroup::create("evaluate", pipeline.layout(), &buffers.map(Binding::Buffer))
    }
}

/// How much work fits a dispatch.
struct WorkSizes {
    items: usize,
    /// Entries of their lists.
    entries: usize,
}

impl WorkSizes {
    /// Enough to evaluate whole populations of ordinary depth at once. Longer work takes several submissions.
    fn of(room: Room, shape: KernelShape) -> Self {
        let block_count = room.pixels / shape.block_pixels();
        Self { items: block_count, entries: (16 * room.flies + 8 * block_count).clamp(1 << 16, 1 << 22) }
    }
}

fn storage(device: &Arc<Device>, name: &str, bytes: usize) -> Result<Arc<Buffer>> {
    Buffer::create(device, name, bytes as u64, BufferUse::Storage, Residence::Device)
}

/// The kernel in one of its variants.
fn create_pipeline(device: &Arc<Device>, variant: Variant) -> Result<Arc<ComputePipeline>> {
    create_kernel(device, "evaluate", &shaders::EVALUATE, &variant.specialization(), size_of::<EvaluatePush>())
}

/// A kernel with this pass's bindings, by its stem and its module.
pub(super) fn create_kernel(
    device: &Arc<Device>,
    name: &str,
    module: &Flavours,
    specialization: &[(u32, u32)],
    push_constant_bytes: usize,
) -> Result<Arc<ComputePipeline>> {
    ComputePipeline::create(
        device,
        &ComputeShader {
            name,
            spirv: &shaders::words(module.for_device(device.info())),
            specialization,
            bindings: &[BindingKind::StorageBuffer; 11],
            push_constant_bytes: push_constant_bytes as u32,
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
