//! The compute passes of a cells search: deal, scan, scatter, sort, then the steps of all cells, and among
//! translucent tiles marginal fitness. Twin: `cpu/cells/`.

use std::sync::Arc;

use super::cells_layout::{CellRecord, CellsPush, FlyRecord, SearchHeader, SearchRules};
use super::cells_state::{PIXEL_WORDS, Plan, rules_record};
use super::evaluate_pass::create_mask_buffer;
use super::shaders;
use crate::error::{Error, Result};
use crate::model::cells::Course;
use crate::model::cells::pixel::TRANSLUCENT_DEPTH;
use crate::model::cells::rules::{BirthDepth, BirthKind};
use crate::model::tables;
use crate::vk::{
    Binding, BindingGroup, BindingKind, Buffer, BufferUse, ComputePass, ComputePipeline, ComputeShader, Device,
    DeviceInfo, DeviceKind, Recorder, Residence,
};

/// Invocations of a workgroup of the passes that work fly by fly.
const FLIES_PER_GROUP: u32 = 64;
/// Turns of loops that software Vulkan grants an invocation, less a margin. On hardware it bounds a dispatch to some
/// milliseconds.
const BUDGET: u32 = 60_000;
/// Most invocations of a workgroup that is chosen here.
const LANES_MAX: u32 = 1_024;
/// Invocations of a workgroup on hardware.
const LANES_WIDE: u32 = 64;

/// How the invocations of a cell work together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellForm {
    /// A workgroup is one subgroup, which needs no barrier: best on software Vulkan.
    Narrow = 0,
    /// A workgroup may have several subgroups.
    Wide = 1,
}

/// How the work of a cell is cut; it never changes a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellShape {
    /// Invocations of a workgroup, a power of two; in the narrow form those of a subgroup.
    pub lanes: u32,
    /// How they work together.
    pub form: CellForm,
    /// Most turns of loops in an invocation of one dispatch. Software Vulkan ends all loops of an invocation silently after 65,535
    /// turns (Mesa 22.3.6, llvmpipe).
    pub budget: u32,
}

impl CellShape {
    /// The shape for a device: the fewest invocations whose longest step fits the budget.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if the steps of this search are too long for any.
    pub fn for_device(info: &DeviceInfo, course: &Course) -> Result<Self> {
        // All flies may lie in one cell, whose members are ranked eight in a turn of a loop.
        if info.kind == DeviceKind::Cpu && course.fly_count as u64 > 8 * u64::from(BUDGET) {
            return Err(Error::TooLarge(format!(
                "{} tiles are too many for one dispatch of software Vulkan; use fewer --tiles, or --device cpu",
                course.fly_count
            )));
        }
        let narrow = Self { lanes: info.subgroup_size, form: CellForm::Narrow, budget: BUDGET };
        let wide = |lanes| Self { lanes, form: CellForm::Wide, budget: BUDGET };
        let most = LANES_MAX.min(info.limits.workgroup_invocations);
        let first = if info.kind == DeviceKind::Cpu { Some(narrow) } else { None };
        let lanes = (LANES_WIDE.ilog2()..=most.ilog2()).map(|power| 1 << power);
        let mut shapes = first.into_iter().chain(lanes.map(wide));
        shapes.find(|shape| shape.longest_step(course) <= u64::from(BUDGET)).ok_or_else(|| {
            Error::TooLarge(format!(
                "one step of {} candidates with tiles this large is too long for a dispatch of the Vulkan device; use more --tiles, fewer --candidates, or --device cpu",
                course.rules.candidates
            ))
        })
    }

    /// Most turns of loops that one step may take; counted as `glsl/cells.comp` and `glsl/cells_glazed.comp` do.
    fn longest_step(self, course: &Course) -> u64 {
        let plan = Plan::new(course);
        let (columns, rows) = (self.lanes.min(8), self.lanes / self.lanes.min(8));
        let turns = |(across, down): (u64, u64), inner: u64| 3 + 3 * down + across * down * (1 + inner);
        // A box begins anywhere in a patch; two boxes of an exchange, or the one around both, need one patch more each way.
        let patches = |(width, height): (u32, u32), more: u64| {
            (u64::from(width.div_ceil(columns)) + 1 + more, u64::from(height.div_ceil(rows)) + more)
        };
        let rules = &course.rules;
        let (width, height) = plan.largest_box(rules);
        let (across, down) = patches((width, height), 0);
        // Points of a lattice in a convex shape: at most its area and half the outline of its box, in cells of the lattice.
        let side = u64::from(plan.largest_side_px(rules));
        let own = (across * down).min(side * side / u64::from(self.lanes) + across + down + 1);
        let tournaments = u64::from(rules.births.place_tournament + rules.births.victim_tournament);
        let making = 2 * 40 + u64::from(rules.candidates.div_ceil(self.lanes.min(64))) * (12 + tournaments);
        let side = plan.cell_side_px;
        let both = ((2 * width).min(side).min(plan.width_px), (2 * height).min(side).min(plan.height_px));
        let exchange = |inner: u64| 3 + 3 * patches(both, 2).1 + turns(patches(both, 2), inner);
        let candidates = u64::from(rules.candidates);
        if course.is_translucent() {
            // A pass over both boxes with four layers of a stack in a turn, for each candidate as for the exchange.
            let pass = exchange(TRANSLUCENT_DEPTH as u64 / 4 + 1);
            return making + candidates * (48 + pass + own) + pass;
        }
        let candidate = 28 + turns((across, down), 0) + 9 * own;
        making + candidates * candidate + turns((across, down), 0) + exchange(17)
    }
}

/// The buffers of a search, in the order of their bindings.
pub(super) struct CellBuffers {
    pub rules: Arc<Buffer>,
    pub header: Arc<Buffer>,
    pub flies: Arc<Buffer>,
    pub cells: Arc<Buffer>,
    deals: Arc<Buffer>,
    pub pixels: Arc<Buffer>,
    tables: Arc<Buffer>,
    pub steps: Arc<Buffer>,
    pub fitness: Arc<Buffer>,
    guide: Arc<Buffer>,
    pub stacks: Arc<Buffer>,
    scratch: Arc<Buffer>,
    masks: Arc<Buffer>,
}

/// What the sizes of the buffers depend on, besides the flies.
#[derive(Clone, Copy)]
struct Sizes {
    plan: Plan,
    scratch_words: u32,
}

/// The pipelines of a round, in their order.
struct Pipelines {
    deal: Arc<ComputePipeline>,
    scan: Arc<ComputePipeline>,
    scatter: Arc<ComputePipeline>,
    sort: Arc<ComputePipeline>,
    cells: Arc<ComputePipeline>,
    /// What begins marginal fitness fly by fly and adds to it pixel by pixel, if the cells do not bring it up to date.
    fitness: Option<[Arc<ComputePipeline>; 2]>,
}

/// Pipelines and buffers of a search.
pub(super) struct CellsPass {
    pub buffers: CellBuffers,
    budget: u32,
    fly_groups: u32,
    cell_count: u32,
    block_count: u32,
    workgroups_per_row: u32,
    pipelines: Pipelines,
    group: Arc<BindingGroup>,
}

impl CellsPass {
    /// Creates pipelines and buffers, and uploads what never changes: rules, tables and the guide.
    pub fn create(device: &Arc<Device>, recorder: &mut Recorder, course: &Course, shape: CellShape) -> Result<Self> {
        let info = device.info();
        if shape.form == CellForm::Narrow && shape.lanes != info.subgroup_size {
            return Err(Error::Usage(format!(
                "a narrow workgroup has the {} invocations of a subgroup, not {}",
                info.subgroup_size, shape.lanes
            )));
        }
        let plan = Plan::new(course);
        let rows = shape.lanes / shape.lanes.min(8);
        let side = plan.cell_side_px;
        let words = match course.is_translucent() {
            true => 4,
            false => 1 + u32::from(!course.is_plain()),
        };
        let scratch_words = words * side.min(plan.block_columns * 8) * (side.min(plan.height_px) + rows);
        let buffers = CellBuffers::create(device, recorder, course, &Sizes { plan, scratch_words })?;
        buffers.upload(recorder, course, &rules_record(course, &plan, scratch_words))?;
        let pipelines = Pipelines::create(device, course, shape)?;
        let group = buffers.bind(&pipelines.cells)?;
        Ok(Self {
            buffers,
            budget: shape.budget,
            fly_groups: (course.fly_count as u32).div_ceil(FLIES_PER_GROUP).max(1),
            cell_count: plan.cell_count,
            block_count: plan.block_columns * plan.block_rows,
            workgroups_per_row: info.limits.workgroups[0],
            pipelines,
            group,
        })
    }

    /// Records so many iterations: each begins a round unless one is under way, and takes each cell as far as the budget allows.
    pub fn record(&self, recorder: &mut Recorder, iterations: u32) -> Result<()> {
        let push = CellsPush { budget: self.budget };
        let Pipelines { deal, scan, scatter, sort, cells, fitness } = &self.pipelines;
        let mut stages = vec![
            ("cells_deal", deal, self.fly_groups),
            ("cells_scan", scan, 1),
            ("cells_scatter", scatter, self.fly_groups),
            ("cells_sort", sort, self.fly_groups),
            (if fitness.is_some() { "cells_glazed" } else { "cells" }, cells, self.cell_count),
        ];
        if let Some([of_flies, of_pixels]) = fitness {
            let name = "cells_fitness";
            stages.extend([(name, of_flies, self.fly_groups), (name, of_pixels, self.block_count)]);
        }
        for _ in 0..iterations {
            for &(name, pipeline, count) in &stages {
                let mut pass = recorder.compute_pass(name)?;
                pass.bind(pipeline, &self.group);
                pass.push_constants(bytemuck::bytes_of(&push));
                self.dispatch(&mut pass, count);
            }
        }
        Ok(())
    }

    /// Most turns of loops in an invocation of one dispatch.
    pub fn budget(&self) -> u32 {
        self.budget
    }

    fn dispatch(&self, pass: &mut ComputePass<'_>, count: u32) {
        let columns = count.min(self.workgroups_per_row);
        pass.dispatch(columns, count.div_ceil(columns), 1);
    }
}

impl Pipelines {
    fn create(device: &Arc<Device>, course: &Course, shape: CellShape) -> Result<Self> {
        let constants = specialization(course, shape);
        let create = |name, module, constants: &[(u32, u32)]| create_pipeline(device, name, module, constants);
        let fitness =
            |part: u32| create("cells_fitness", shaders::CELLS_FITNESS, &[&constants[..], &[(9, part)]].concat());
        let is_translucent = course.is_translucent();
        let (name, module) =
            if is_translucent { ("cells_glazed", shaders::CELLS_GLAZED) } else { ("cells", shaders::CELLS) };
        Ok(Self {
            deal: create("cells_deal", shaders::CELLS_DEAL, &[])?,
            scan: create("cells_scan", shaders::CELLS_SCAN, &[])?,
            scatter: create("cells_scatter", shaders::CELLS_SCATTER, &[])?,
            sort: create("cells_sort", shaders::CELLS_SORT, &[])?,
            cells: create(name, module, &constants)?,
            fitness: if is_translucent { Some([fitness(0)?, fitness(1)?]) } else { None },
        })
    }
}

/// The specialisation constants of `glsl/cells.comp` and `glsl/cells_glazed.comp`.
fn specialization(course: &Course, shape: CellShape) -> [(u32, u32); 9] {
    let rules = &course.rules;
    [
        (0, shape.lanes),
        (1, shape.form as u32),
        (2, rules.color as u32),
        (3, u32::from(rules.births.kind == BirthKind::Mutant)),
        (4, u32::from(rules.births.depth == BirthDepth::Random)),
        (5, u32::from(rules.penalties.turn > 0)),
        (6, u32::from(rules.bounds.local_size != 0)),
        (7, u32::from(!course.is_plain())),
        (8, rules.background),
    ]
}

fn create_pipeline(
    device: &Arc<Device>,
    name: &str,
    module: &[u8],
    specialization: &[(u32, u32)],
) -> Result<Arc<ComputePipeline>> {
    ComputePipeline::create(
        device,
        &ComputeShader {
            name,
            spirv: &shaders::words(module),
            specialization,
            bindings: &[BindingKind::StorageBuffer; 13],
            push_constant_bytes: size_of::<CellsPush>() as u32,
        },
    )
}

impl CellBuffers {
    fn create(device: &Arc<Device>, recorder: &mut Recorder, course: &Course, sizes: &Sizes) -> Result<Self> {
        let Sizes { plan, scratch_words } = *sizes;
        let (flies, cells) = (course.fly_count, plan.cell_count as usize);
        let storage = |name: &str, bytes: usize| {
            Buffer::create(device, name, bytes as u64, BufferUse::Storage, Residence::Device)
        };
        Ok(Self {
            rules: storage("search rules", size_of::<SearchRules>())?,
            header: storage("search header", size_of::<SearchHeader>())?,
            flies: storage("flies", flies * size_of::<FlyRecord>())?,
            cells: storage("cells", cells * size_of::<CellRecord>())?,
            deals: storage("deals", flies * 12)?,
            pixels: storage("pixels", plan.pixel_count() * PIXEL_WORDS * 4)?,
            tables: storage("tables", tables::device_words().len() * 4)?,
            steps: storage("steps", flies * 4)?,
            fitness: storage("marginal fitness", flies * 4)?,
            guide: storage("guide", course.guide.samples.len() * 8)?,
            stacks: storage("stacks", plan.stack_words() * 4)?,
            scratch: storage("shown pixels", cells * scratch_words as usize * 4)?,
            masks: create_mask_buffer(device, recorder, std::iter::once(&*course.masks))?,
        })
    }

    fn upload(&self, recorder: &mut Recorder, course: &Course, rules: &SearchRules) -> Result<()> {
        recorder.write_buffer(&self.rules, 0, bytemuck::bytes_of(rules))?;
        recorder.write_buffer(&self.tables, 0, bytemuck::cast_slice(&tables::device_words()))?;
        recorder.write_buffer(&self.guide, 0, bytemuck::cast_slice(&course.guide.samples))
    }

    fn bind(&self, pipeline: &ComputePipeline) -> Result<Arc<BindingGroup>> {
        let Self { rules, header, flies, cells, deals, pixels, tables, steps, fitness, guide, stacks, .. } = self;
        let buffers = [
            rules,
            header,
            flies,
            cells,
            deals,
            pixels,
            tables,
            steps,
            fitness,
            guide,
            stacks,
            &self.scratch,
            &self.masks,
        ];
        BindingGroup::create("cells", pipeline.layout(), &buffers.map(Binding::Buffer))
    }
}
