//! The compute passes of the cells searches of all lanes: deal, scan, scatter, sort, then the steps of all cells, and
//! for translucent tiles marginal fitness. Twin: `cpu/cells/`.
//!
//! A dispatch serves all lanes of a variant. The z of a workgroup is the lane that it works for; a workgroup that its
//! lane does not need returns at once. Lanes of another variant have other buffers, so their dispatches need not wait
//! for these.

use std::ops::Range;
use std::sync::Arc;

use super::layout::CellsPush;
use super::plan::Plan;
use super::shape::CellShape;
use crate::error::Result;
use crate::gpu::shaders;
use crate::model::cells::Course;
use crate::model::cells::rules::{BirthDepth, BirthKind};
use crate::vk::{BindingGroup, BindingKind, ComputePass, ComputePipeline, ComputeShader, Device, Recorder};

/// Invocations of a workgroup of the passes that work fly by fly or pixel by pixel.
const ITEMS_PER_GROUP: u64 = 64;
/// Flies of a workgroup of the passes that spread depths.
pub(super) const FLIES_PER_SPREAD: u32 = 256;

/// What the steps of cells are compiled for. Lanes with the same variant share their dispatches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Variant {
    is_translucent: bool,
    pub shape: CellShape,
    /// Specialisation constants 2 to 8; 0 and 11 are the invocations of a workgroup.
    constants: [u32; 7],
}

impl Variant {
    pub fn new(course: &Course, shape: CellShape) -> Self {
        let rules = &course.rules;
        Self {
            is_translucent: course.is_translucent(),
            shape,
            constants: [
                rules.color as u32,
                u32::from(rules.births.kind == BirthKind::Mutant),
                u32::from(rules.births.depth == BirthDepth::Random),
                u32::from(rules.penalties.turn > 0),
                u32::from(rules.bounds.local_size != 0),
                u32::from(!course.is_plain()),
                u32::from(rules.leash > 0),
            ],
        }
    }

    fn specialization(&self) -> Vec<(u32, u32)> {
        let CellShape { lanes, form, .. } = self.shape;
        let shape = [(0, lanes), (11, lanes), (1, form as u32)];
        shape.into_iter().chain((2..).zip(self.constants)).collect()
    }
}

/// Lanes of one variant, and their buffers.
pub(super) struct Team {
    pub variant: Variant,
    pub group: Arc<BindingGroup>,
    /// In the order of their rules.
    pub lanes: Vec<LaneSize>,
}

/// What decides how many workgroups a lane needs.
pub(super) struct LaneSize {
    fly_count: u64,
    block_count: u64,
    /// Most cells of a round.
    cell_count: u64,
}

impl LaneSize {
    pub fn new(plan: &Plan, fly_count: usize) -> Self {
        Self { fly_count: fly_count as u64, block_count: plan.block_count(), cell_count: u64::from(plan.cell_count) }
    }
}

/// A lane among those that share its buffers.
pub(super) struct Placed {
    pub group: Arc<BindingGroup>,
    /// Its place in the order of rules.
    pub first_lane: u32,
    /// Workgroups that it needs.
    pub workgroups: u32,
}

impl Team {
    /// The most that any lane needs of something.
    fn most(&self, of: impl Fn(&LaneSize) -> u64) -> u32 {
        self.lanes.iter().map(of).max().unwrap_or(1).max(1) as u32
    }
}

/// Cells of a part of an iteration, and the lanes in whose pictures they lie: numbers in the order of dispatches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct CellsPart {
    pub cells: Range<u32>,
    pub lanes: Range<u32>,
}

impl CellsPart {
    /// Whether its iteration begins with it.
    fn is_first(&self) -> bool {
        self.cells.start == 0 && self.lanes.start == 0
    }
}

/// A shader for some of the lanes that share buffers, side by side in their order.
#[derive(Clone)]
struct Dispatch {
    pipeline: Arc<ComputePipeline>,
    group: Arc<BindingGroup>,
    push: CellsPush,
    lanes: u32,
    /// Most workgroups that one of them needs.
    workgroups: u32,
}

impl Dispatch {
    /// What of it belongs to a part; its lanes have these numbers.
    fn cut(&self, numbers: Range<u32>, CellsPart { cells, lanes }: &CellsPart) -> Option<Self> {
        let lanes = lanes.start.max(numbers.start)..lanes.end.min(numbers.end);
        let cells = cells.start..cells.end.min(self.workgroups);
        if lanes.is_empty() || cells.is_empty() {
            return None;
        }
        let first_lane = self.push.first_lane + lanes.start - numbers.start;
        let push = CellsPush { first_lane, first_cell: cells.start, ..self.push };
        Some(Self { push, lanes: lanes.len() as u32, workgroups: cells.len() as u32, ..self.clone() })
    }
}

/// When in an iteration a stage has its turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Turn {
    /// Before the cells.
    Dealing,
    /// A workgroup is a cell.
    Cells,
    /// After a round.
    Fitness,
}

/// Dispatches that need not wait for each other, under the stem of their shader.
struct Stage {
    name: &'static str,
    turn: Turn,
    dispatches: Vec<Dispatch>,
}

impl Stage {
    fn new(name: &'static str, turn: Turn) -> Self {
        Self { name, turn, dispatches: Vec::new() }
    }

    /// Adds a dispatch for all lanes of a team, with the most workgroups that one of them needs.
    fn add(&mut self, team: &Team, pipeline: &Arc<ComputePipeline>, workgroups: u32) {
        self.dispatches.push(Dispatch {
            pipeline: Arc::clone(pipeline),
            group: Arc::clone(&team.group),
            push: CellsPush { first_lane: 0, budget: team.variant.shape.budget, first_cell: 0 },
            lanes: team.lanes.len() as u32,
            workgroups,
        });
    }
}

/// How many lanes a dispatch serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Crowd {
    One = 0,
    Many = 1,
}

/// The pipelines for lanes of one variant.
struct Steps {
    variant: Variant,
    crowd: Crowd,
    cells: Arc<ComputePipeline>,
    /// Only for translucent tiles, whose marginal fitness the cells leave: one sets it for each fly, and the other adds
    /// what each pixel gives.
    fitness: Option<[Arc<ComputePipeline>; 2]>,
}

/// The pipelines, and the stages of an iteration.
pub(super) struct CellsPass {
    device: Arc<Device>,
    /// Deal, scan, scatter and sort.
    dealing: [Arc<ComputePipeline>; 4],
    depths: Arc<ComputePipeline>,
    /// One finds new depths, and the other takes them.
    spread: [Arc<ComputePipeline>; 2],
    steps: Vec<Steps>,
    stages: Vec<Stage>,
}

impl CellsPass {
    pub fn create(device: &Arc<Device>) -> Result<Self> {
        let create = |name, module| create_pipeline(device, name, module, &[]);
        Ok(Self {
            device: Arc::clone(device),
            dealing: [
                create("cells_deal", shaders::CELLS_DEAL)?,
                create("cells_scan", shaders::CELLS_SCAN)?,
                create("cells_scatter", shaders::CELLS_SCATTER)?,
                create("cells_sort", shaders::CELLS_SORT)?,
            ],
            depths: create("cells_depths", shaders::CELLS_DEPTHS)?,
            spread: [
                create_pipeline(device, "cells_spread", shaders::CELLS_SPREAD, &[(9, 0)])?,
                create_pipeline(device, "cells_spread", shaders::CELLS_SPREAD, &[(9, 1)])?,
            ],
            steps: Vec::new(),
            stages: Vec::new(),
        })
    }

    /// One of the pipelines, to bind buffers for: all have the same bindings.
    pub fn any_pipeline(&self) -> &Arc<ComputePipeline> {
        &self.depths
    }

    /// Drops the stages, and with them the buffers of all lanes, until [`CellsPass::arrange`].
    pub fn disband(&mut self) {
        self.stages.clear();
    }

    /// Prepares the stages for these lanes.
    pub fn arrange(&mut self, teams: &[Team]) -> Result<()> {
        const STEMS: [&str; 4] = ["cells_deal", "cells_scan", "cells_scatter", "cells_sort"];
        let mut stages: Vec<Stage> = STEMS.map(|stem| Stage::new(stem, Turn::Dealing)).into();
        const STEPS: [(&str, Turn); 4] = [
            ("cells", Turn::Cells),
            ("cells_glazed", Turn::Cells),
            ("cells_fitness", Turn::Fitness),
            ("cells_fitness", Turn::Fitness),
        ];
        let mut steps = STEPS.map(|(stem, turn)| Stage::new(stem, turn));
        for team in teams {
            let flies = team.most(|lane| lane.fly_count.div_ceil(ITEMS_PER_GROUP));
            let pixels = team.most(|lane| lane.block_count);
            for ((stage, pipeline), workgroups) in stages.iter_mut().zip(&self.dealing).zip([flies, 1, flies, flies]) {
                stage.add(team, pipeline, workgroups);
            }
            let crowd = if team.lanes.len() == 1 { Crowd::One } else { Crowd::Many };
            let Steps { cells, fitness, .. } = self.steps_of(team.variant, crowd)?;
            let step = usize::from(team.variant.is_translucent);
            steps[step].add(team, cells, team.most(|lane| lane.cell_count));
            if let Some([begin, add]) = fitness {
                steps[2].add(team, begin, flies);
                steps[3].add(team, add, pixels);
            }
        }
        stages.extend(steps);
        stages.retain(|stage| !stage.dispatches.is_empty());
        self.stages = stages;
        Ok(())
    }

    fn steps_of(&mut self, variant: Variant, crowd: Crowd) -> Result<&Steps> {
        let place = self.steps.iter().position(|steps| (steps.variant, steps.crowd) == (variant, crowd));
        if place.is_none() {
            self.steps.push(Steps::create(&self.device, variant, crowd)?);
        }
        Ok(&self.steps[place.unwrap_or(self.steps.len() - 1)])
    }

    /// Records the pass that brings the depths of pixels up to date; a workgroup is a block of pixels.
    pub fn record_depths(&self, recorder: &mut Recorder, lanes: &[Placed]) -> Result<()> {
        self.record_for(recorder, "cells_depths", &self.depths, lanes)
    }

    /// Records the passes that spread the depths of flies evenly.
    pub fn record_spread(&self, recorder: &mut Recorder, lanes: &[Placed]) -> Result<()> {
        self.spread.iter().try_for_each(|pipeline| self.record_for(recorder, "cells_spread", pipeline, lanes))
    }

    fn record_for(
        &self,
        recorder: &mut Recorder,
        name: &'static str,
        pipeline: &Arc<ComputePipeline>,
        lanes: &[Placed],
    ) -> Result<()> {
        if lanes.is_empty() {
            return Ok(());
        }
        let mut pass = recorder.compute_pass(name)?;
        for Placed { group, first_lane, workgroups } in lanes {
            let dispatch = Dispatch {
                pipeline: Arc::clone(pipeline),
                group: Arc::clone(group),
                push: CellsPush { first_lane: *first_lane, budget: 0, first_cell: 0 },
                lanes: 1,
                workgroups: *workgroups,
            };
            self.dispatch(&mut pass, &dispatch);
        }
        Ok(())
    }

    /// Records so many iterations. Each begins a round in every lane that wants one and has none under way, and takes
    /// each cell as far as the budget allows.
    pub fn record(&self, recorder: &mut Recorder, iterations: u32) -> Result<()> {
        for _ in 0..iterations {
            for stage in &self.stages {
                let mut pass = recorder.compute_pass(stage.name)?;
                for dispatch in &stage.dispatches {
                    self.dispatch(&mut pass, dispatch);
                }
            }
        }
        Ok(())
    }

    /// The most cells of a lane in a round, and how many lanes there are.
    pub fn cells(&self) -> (u32, u32) {
        let steps = self.stages.iter().filter(|stage| stage.turn == Turn::Cells).flat_map(|stage| &stage.dispatches);
        steps.fold((0, 0), |(cells, lanes), step| (cells.max(step.workgroups), lanes + step.lanes))
    }

    /// Records a part of an iteration: it takes some cells of some lanes as far as the budget allows. A round begins
    /// with the first part.
    pub fn record_part(&self, recorder: &mut Recorder, part: &CellsPart) -> Result<()> {
        let mut first_lane = 0;
        for stage in self.stages.iter().filter(|stage| stage.turn != Turn::Dealing || part.is_first()) {
            let mut pass = recorder.compute_pass(stage.name)?;
            for dispatch in &stage.dispatches {
                if stage.turn == Turn::Cells {
                    let lanes = first_lane..first_lane + dispatch.lanes;
                    first_lane = lanes.end;
                    if let Some(dispatch) = dispatch.cut(lanes, part) {
                        self.dispatch(&mut pass, &dispatch);
                    }
                } else {
                    self.dispatch(&mut pass, dispatch);
                }
            }
        }
        Ok(())
    }

    fn dispatch(&self, pass: &mut ComputePass<'_>, dispatch: &Dispatch) {
        pass.bind(&dispatch.pipeline, &dispatch.group);
        pass.push_constants(bytemuck::bytes_of(&dispatch.push));
        let columns = dispatch.workgroups.min(self.device.info().limits.workgroups[0]);
        pass.dispatch(columns, dispatch.workgroups.div_ceil(columns), dispatch.lanes);
    }
}

impl Steps {
    fn create(device: &Arc<Device>, variant: Variant, crowd: Crowd) -> Result<Self> {
        let constants = [variant.specialization(), vec![(10, crowd as u32)]].concat();
        let fitness = |part: u32| {
            let constants = [&constants[..], &[(9, part)]].concat();
            create_pipeline(device, "cells_fitness", shaders::CELLS_FITNESS, &constants)
        };
        let is_translucent = variant.is_translucent;
        let (name, module) =
            if is_translucent { ("cells_glazed", &shaders::CELLS_GLAZED) } else { ("cells", &shaders::CELLS) };
        Ok(Self {
            variant,
            crowd,
            cells: create_pipeline(device, name, module.for_device(device.info()), &constants)?,
            fitness: if is_translucent { Some([fitness(0)?, fitness(1)?]) } else { None },
        })
    }
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
            bindings: &[BindingKind::StorageBuffer; 14],
            push_constant_bytes: size_of::<CellsPush>() as u32,
        },
    )
}
