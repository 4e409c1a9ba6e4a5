//! The CPU twin: evaluates and draws by the same integer steps as the shaders, one file per shader with the same stem.
//!
//! Every device is compared with the twin, and machines without a GPU use it as their evaluator. It works on blocks in
//! parallel, on the current rayon pool. Sums of integers do not depend on their order, so neither does any result.
//! Twin: `gpu/` with `glsl/`.

mod block;
pub mod cells;
mod coverage;
mod error;
mod evaluate;
mod lane_evaluation;
mod mosaic;
mod translucent;

use crate::error::Result;
use crate::model::{Canvas, Change, Evaluation, Evaluator, Fly, Lane, Layers, Mosaic, Painter, Population, Scene};

use lane_evaluation::LaneEvaluation;

/// The evaluator that needs no device.
#[derive(Debug)]
pub struct CpuEvaluator {
    lanes: Vec<Option<LaneEvaluation>>,
}

impl CpuEvaluator {
    /// An evaluator with one lane per scene, each empty until it is loaded.
    #[must_use]
    pub fn new(scenes: Vec<Scene>) -> Self {
        Self { lanes: scenes.into_iter().map(LaneEvaluation::new).map(Some).collect() }
    }

    fn known(&self, lane: usize) -> &LaneEvaluation {
        self.lanes[lane].as_ref().expect("the lane was released")
    }

    fn known_mut(&mut self, lane: usize) -> &mut LaneEvaluation {
        self.lanes[lane].as_mut().expect("the lane was released")
    }
}

impl Evaluator for CpuEvaluator {
    fn lane(&self, lane: usize) -> &Lane {
        self.known(lane).lane()
    }

    fn lane_count(&self) -> usize {
        self.lanes.iter().flatten().count()
    }

    fn admit(&mut self, scene: Scene) -> Result<Option<usize>> {
        let number = self.lanes.iter().position(Option::is_none).unwrap_or(self.lanes.len());
        if number == self.lanes.len() {
            self.lanes.push(None);
        }
        self.lanes[number] = Some(LaneEvaluation::new(scene));
        Ok(Some(number))
    }

    fn release(&mut self, lane: usize) {
        self.lanes[lane] = None;
    }

    fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        for &(lane, flies) in populations {
            self.known_mut(lane).load(flies);
        }
        Ok(())
    }

    fn replace(&mut self, changes: &[Change]) -> Result<()> {
        for change in changes {
            self.known_mut(change.lane).replace(change.index, &change.fly);
        }
        for lane in self.lanes.iter_mut().flatten() {
            lane.refresh_touched();
        }
        Ok(())
    }

    fn evaluation(&self, lane: usize) -> Evaluation<'_> {
        self.known(lane).evaluation()
    }

    fn read_back_layers(&mut self, lane: usize) -> Result<Layers> {
        Ok(self.known(lane).layers())
    }
}

/// The painter that needs no device.
#[derive(Clone, Copy, Debug, Default)]
pub struct CpuPainter;

impl Painter for CpuPainter {
    fn draw_watched(
        &mut self,
        population: &Population,
        canvas: &Canvas,
        supersampling: u32,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Mosaic> {
        Ok(mosaic::draw(population, canvas, supersampling, watch))
    }
}
