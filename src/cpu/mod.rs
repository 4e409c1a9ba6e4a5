//! The CPU twin: evaluates and draws by the same integer steps as the shaders, one file per shader with the same stem.
//!
//! It is both the reference that every device is compared with and the evaluator of machines without a GPU. It is
//! parallel over blocks on the current rayon pool; sums of integers do not depend on the order, so neither does any
//! result. Twin: `gpu/` with `glsl/`.

pub mod cells;
mod evaluate;
mod lane_evaluation;
mod mosaic;
mod rows;
mod translucent;

use crate::error::Result;
use crate::model::{Canvas, Change, Evaluation, Evaluator, Fly, Lane, Layers, Mosaic, Population, Scene};

use lane_evaluation::LaneEvaluation;

/// The evaluator that needs no device.
#[derive(Debug)]
pub struct CpuEvaluator {
    lanes: Vec<LaneEvaluation>,
}

impl CpuEvaluator {
    /// An evaluator with one lane per scene, each empty until it is loaded.
    #[must_use]
    pub fn new(scenes: Vec<Scene>) -> Self {
        Self { lanes: scenes.into_iter().map(LaneEvaluation::new).collect() }
    }
}

impl Evaluator for CpuEvaluator {
    fn lane(&self, lane: usize) -> &Lane {
        self.lanes[lane].lane()
    }

    fn lane_count(&self) -> usize {
        self.lanes.len()
    }

    fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        for &(lane, flies) in populations {
            self.lanes[lane].load(flies);
        }
        Ok(())
    }

    fn replace(&mut self, changes: &[Change]) -> Result<()> {
        for change in changes {
            self.lanes[change.lane].replace(change.index, &change.fly);
        }
        for lane in &mut self.lanes {
            lane.refresh_touched();
        }
        Ok(())
    }

    fn evaluation(&self, lane: usize) -> Evaluation<'_> {
        self.lanes[lane].evaluation()
    }

    fn read_back_layers(&mut self, lane: usize) -> Result<Layers> {
        Ok(self.lanes[lane].layers())
    }

    fn draw(&mut self, population: &Population, canvas: &Canvas, supersampling: u32) -> Result<Mosaic> {
        Ok(mosaic::draw(population, canvas, supersampling))
    }
}
