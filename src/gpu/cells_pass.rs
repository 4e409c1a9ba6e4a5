//! The compute passes of the cells searches of all lanes: deal, scan, scatter, sort, then the steps of all cells, and among translucent
//! tiles marginal fitness. Twin: `cpu/cells/`.
//!
//! A dispatch serves all lanes that its shader is compiled alike for: workgroups with the same z work for the same lane, and those
//! beyond what their lane needs return at once.

use std::sync::Arc;

use super::cells_layout::CellsPush;
use super::cells_shape::CellShape;
use super::cells_state::Plan;
use super::shaders;
use crate::error::Result;
use crate::model::cells::Course;
use crate::model::cells::rules::{BirthDepth, BirthKind};
use crate::vk::{BindingGroup, BindingKind, ComputePass, ComputePipeline, ComputeShader, Device, Recorder};

/// Invocations of a workgroup of the passes that work fly by fly or pixel by pixel.
const ITEMS_PER_GROUP: u32 = 64;

/// What the steps of cells are compiled for. Lanes that are alike in it share their dispatches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Variant {
    is_translucent: bool,
    shape: CellShape,
    /// Specialisation constants 2 to 7.
    constants: [u32; 6],
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
            ],
        }
    }

    fn specialization(&self) -> Vec<(u32, u32)> {
        let shape = [(0, self.shape.lanes), (1, self.shape.form as u32)];
        shape.into_iter().chain((2..).zip(self.constants)).collect()
    }
}

/// A lane that works, as dispatches see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Worker {
    pub variant: Variant,
    pub plan: Plan,
    pub fly_count: usize,
}

/// A shader for some of the lanes that work, side by side in their order.
struct Dispatch {
    pipeline: Arc<ComputePipeline>,
    push: CellsPush,
    lanes: u32,
    /// Most workgroups that one of them needs.
    workgroups: u32,
}

/// Dispatches that need not wait for each other, under the stem of their shader.
struct Stage {
    name: &'static str,
    dispatches: Vec<Dispatch>,
}

/// The pipelines for lanes of one variant.
struct Steps {
    variant: Variant,
    cells: Arc<ComputePipeline>,
    /// What begins marginal fitness fly by fly and adds to it pixel by pixel, if the cells do not bring it up to date.
    fitness: Option<[Arc<ComputePipeline>; 2]>,
}

/// The pipelines, and what an iteration of the lanes at work is made of.
pub(super) struct CellsPass {
    device: Arc<Device>,
    /// Deal, scan, scatter and sort.
    dealing: [Arc<ComputePipeline>; 4],
    depths: Arc<ComputePipeline>,
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
            steps: Vec::new(),
            stages: Vec::new(),
        })
    }

    /// A pipeline of the search: all bind the same.
    pub fn any_pipeline(&self) -> &Arc<ComputePipeline> {
        &self.depths
    }

    /// Says which lanes work from now on, in the order of their rules; those of a variant lie side by side.
    pub fn arrange(&mut self, workers: &[Worker]) -> Result<()> {
        let of_flies = |workers: &[Worker]| most(workers, |worker| items(worker.fly_count as u64));
        let of_pixels = |workers: &[Worker]| most(workers, |worker| worker.plan.block_count() as u32);
        let [deal, scan, scatter, sort] = &self.dealing;
        let all = |pipeline: &Arc<ComputePipeline>, workgroups| Dispatch {
            pipeline: Arc::clone(pipeline),
            push: CellsPush { first_lane: 0, budget: 0 },
            lanes: workers.len() as u32,
            workgroups,
        };
        let fly_groups = of_flies(workers);
        let stage = |name, pipeline, workgroups| Stage { name, dispatches: vec![all(pipeline, workgroups)] };
        let mut stages = vec![
            stage("cells_deal", deal, fly_groups),
            stage("cells_scan", scan, 1),
            stage("cells_scatter", scatter, fly_groups),
            stage("cells_sort", sort, fly_groups),
        ];
        let (mut cells, mut fitness) = (Vec::new(), [Vec::new(), Vec::new()]);
        let mut first_lane = 0;
        for alike in workers.chunk_by(|one, next| one.variant == next.variant) {
            let steps = self.steps_of(alike[0].variant)?;
            let push = CellsPush { first_lane, budget: alike[0].variant.shape.budget };
            let lanes = alike.len() as u32;
            let dispatch = |pipeline: &Arc<ComputePipeline>, workgroups| Dispatch {
                pipeline: Arc::clone(pipeline),
                push,
                lanes,
                workgroups,
            };
            cells.push(dispatch(&steps.cells, most(alike, |worker| worker.plan.cell_count)));
            if let Some([begin, add]) = &steps.fitness {
                fitness[0].push(dispatch(begin, of_flies(alike)));
                fitness[1].push(dispatch(add, of_pixels(alike)));
            }
            first_lane += lanes;
        }
        let is_translucent = |worker: &Worker| worker.variant.is_translucent;
        let name = match (workers.iter().any(is_translucent), workers.iter().all(is_translucent)) {
            (false, _) => "cells",
            (true, true) => "cells_glazed",
            (true, false) => "cells, cells_glazed",
        };
        stages.push(Stage { name, dispatches: cells });
        stages.extend(fitness.map(|dispatches| Stage { name: "cells_fitness", dispatches }));
        stages.retain(|stage| !stage.dispatches.is_empty());
        self.stages = stages;
        Ok(())
    }

    fn steps_of(&mut self, variant: Variant) -> Result<&Steps> {
        let place = self.steps.iter().position(|steps| steps.variant == variant);
        if place.is_none() {
            self.steps.push(Steps::create(&self.device, variant)?);
        }
        Ok(&self.steps[place.unwrap_or(self.steps.len() - 1)])
    }

    /// Records the depths of the pixels of lanes, by their places in the order of rules.
    pub fn record_depths(
        &self,
        recorder: &mut Recorder,
        group: &Arc<BindingGroup>,
        lanes: &[(u32, Plan)],
    ) -> Result<()> {
        if lanes.is_empty() {
            return Ok(());
        }
        let mut pass = recorder.compute_pass("cells_depths")?;
        for &(first_lane, plan) in lanes {
            let push = CellsPush { first_lane, budget: 0 };
            let workgroups = plan.block_count() as u32;
            let dispatch = Dispatch { pipeline: Arc::clone(&self.depths), push, lanes: 1, workgroups };
            self.dispatch(&mut pass, group, &dispatch);
        }
        Ok(())
    }

    /// Records so many iterations: each begins a round in every lane that wants one and has none under way, and takes each cell as far
    /// as the budget allows.
    pub fn record(&self, recorder: &mut Recorder, group: &Arc<BindingGroup>, iterations: u32) -> Result<()> {
        for _ in 0..iterations {
            for stage in &self.stages {
                let mut pass = recorder.compute_pass(stage.name)?;
                for dispatch in &stage.dispatches {
                    self.dispatch(&mut pass, group, dispatch);
                }
            }
        }
        Ok(())
    }

    fn dispatch(&self, pass: &mut ComputePass<'_>, group: &Arc<BindingGroup>, dispatch: &Dispatch) {
        pass.bind(&dispatch.pipeline, group);
        pass.push_constants(bytemuck::bytes_of(&dispatch.push));
        let columns = dispatch.workgroups.min(self.device.info().limits.workgroups[0]);
        pass.dispatch(columns, dispatch.workgroups.div_ceil(columns), dispatch.lanes);
    }
}

impl Steps {
    fn create(device: &Arc<Device>, variant: Variant) -> Result<Self> {
        let constants = variant.specialization();
        let fitness = |part: u32| {
            let constants = [&constants[..], &[(9, part)]].concat();
            create_pipeline(device, "cells_fitness", shaders::CELLS_FITNESS, &constants)
        };
        let is_translucent = variant.is_translucent;
        let (name, module) =
            if is_translucent { ("cells_glazed", shaders::CELLS_GLAZED) } else { ("cells", shaders::CELLS) };
        Ok(Self {
            variant,
            cells: create_pipeline(device, name, module, &constants)?,
            fitness: if is_translucent { Some([fitness(0)?, fitness(1)?]) } else { None },
        })
    }
}

fn items(count: u64) -> u32 {
    count.div_ceil(u64::from(ITEMS_PER_GROUP)).max(1) as u32
}

fn most(workers: &[Worker], of: impl Fn(&Worker) -> u32) -> u32 {
    workers.iter().map(of).max().unwrap_or(1)
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
