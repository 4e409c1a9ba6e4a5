//! The CPU twin in the place of a device that is lost in the middle of the work. It knows from a short account what was
//! asked for so far, and comes to the same bytes.

mod lanes;

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

pub(super) use self::lanes::{LanesOrTwins, search_or_twin};

use crate::cpu::{CpuEvaluator, CpuPainter};
use crate::error::{Error, Result};
use crate::model::{Canvas, Change, Evaluation, Evaluator, Fly, Lane, Layers, Mosaic, Painter, Population, Scene};

/// Tells the user that the device is lost, and why.
pub(crate) type Tell = dyn Fn(&Error) + Send + Sync;

/// What becomes of a device that is lost: the CPU makes the rest.
#[derive(Clone)]
pub(crate) struct StandIn(Arc<Inner>);

struct Inner {
    tell: Arc<Tell>,
    is_needed: AtomicBool,
}

impl fmt::Debug for StandIn {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_tuple("StandIn").field(&self.is_needed()).finish()
    }
}

impl StandIn {
    /// A stand-in that calls `tell` when the device is lost, once.
    pub(crate) fn new(tell: Arc<Tell>) -> Self {
        Self(Arc::new(Inner { tell, is_needed: AtomicBool::new(false) }))
    }

    /// Whether the device was lost.
    pub(crate) fn is_needed(&self) -> bool {
        self.0.is_needed.load(Ordering::Relaxed)
    }

    /// Whether the CPU takes over after such a failure.
    pub(crate) fn takes_over(&self, error: &Error) -> bool {
        let is_lost = matches!(error, Error::DeviceLost { .. });
        if is_lost && !self.0.is_needed.swap(true, Ordering::Relaxed) {
            (self.0.tell)(error);
        }
        is_lost
    }
}

/// An evaluator of a device, or of the CPU once the device is lost.
pub(super) struct EvaluatorOrTwin {
    evaluator: Box<dyn Evaluator>,
    /// What each lane holds, by number.
    lanes: Vec<Option<(Scene, Vec<Fly>)>>,
    stand_in: StandIn,
}

impl EvaluatorOrTwin {
    /// Takes over an evaluator with one lane per scene.
    pub(super) fn new(evaluator: Box<dyn Evaluator>, scenes: Vec<Scene>, stand_in: StandIn) -> Self {
        let lanes = scenes.into_iter().map(|scene| Some((scene, Vec::new()))).collect();
        Self { evaluator, lanes, stand_in }
    }

    /// Does something; after the loss of the device, on the twin.
    fn surely<T>(&mut self, mut act: impl FnMut(&mut dyn Evaluator) -> Result<T>) -> Result<T> {
        match act(&mut *self.evaluator) {
            Err(error) if self.stand_in.takes_over(&error) => {
                self.evaluator = Box::new(self.twin()?);
                act(&mut *self.evaluator)
            }
            outcome => outcome,
        }
    }

    /// The twin, with what each lane holds.
    fn twin(&self) -> Result<CpuEvaluator> {
        let Some(any) = self.lanes.iter().flatten().next() else { return Ok(CpuEvaluator::new(Vec::new())) };
        // A lane that is free has the scene of another one until it is released.
        let scenes = self.lanes.iter().map(|lane| lane.as_ref().unwrap_or(any).0.clone()).collect();
        let mut twin = CpuEvaluator::new(scenes);
        let numbered = || self.lanes.iter().enumerate();
        numbered().filter(|(_, lane)| lane.is_none()).for_each(|(number, _)| twin.release(number));
        let held = numbered().filter_map(|(number, lane)| Some((number, &lane.as_ref()?.1[..])));
        let loaded: Vec<(usize, &[Fly])> = held.filter(|(_, flies)| !flies.is_empty()).collect();
        twin.load(&loaded)?;
        Ok(twin)
    }
}

impl Evaluator for EvaluatorOrTwin {
    fn lane(&self, lane: usize) -> &Lane {
        self.evaluator.lane(lane)
    }

    fn lane_count(&self) -> usize {
        self.evaluator.lane_count()
    }

    fn admit(&mut self, scene: Scene) -> Result<Option<usize>> {
        let lane = self.surely(|evaluator| evaluator.admit(scene.clone()))?;
        if let Some(lane) = lane {
            if self.lanes.len() <= lane {
                self.lanes.resize_with(lane + 1, || None);
            }
            self.lanes[lane] = Some((scene, Vec::new()));
        }
        Ok(lane)
    }

    fn release(&mut self, lane: usize) {
        self.evaluator.release(lane);
        self.lanes[lane] = None;
    }

    fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        self.surely(|evaluator| evaluator.load(populations))?;
        for (lane, flies) in populations {
            if let Some((_, held)) = &mut self.lanes[*lane] {
                *held = flies.to_vec();
            }
        }
        Ok(())
    }

    fn replace(&mut self, changes: &[Change]) -> Result<()> {
        self.surely(|evaluator| evaluator.replace(changes))?;
        for change in changes {
            if let Some((_, held)) = &mut self.lanes[change.lane] {
                held[change.index as usize] = change.fly;
            }
        }
        Ok(())
    }

    fn evaluation(&self, lane: usize) -> Evaluation<'_> {
        self.evaluator.evaluation(lane)
    }

    fn read_back_layers(&mut self, lane: usize) -> Result<Layers> {
        self.surely(|evaluator| evaluator.read_back_layers(lane))
    }
}

/// A painter of a device, or of the CPU once the device is lost.
pub(super) struct PainterOrTwin {
    painter: Box<dyn Painter>,
    stand_in: StandIn,
}

impl PainterOrTwin {
    pub(super) fn new(painter: Box<dyn Painter>, stand_in: StandIn) -> Self {
        Self { painter, stand_in }
    }
}

impl Painter for PainterOrTwin {
    fn draw_watched(
        &mut self,
        population: &Population,
        canvas: &Canvas,
        supersampling: u32,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Mosaic> {
        match self.painter.draw_watched(population, canvas, supersampling, watch) {
            Err(error) if self.stand_in.takes_over(&error) => {
                self.painter = Box::new(CpuPainter);
                self.painter.draw_watched(population, canvas, supersampling, watch)
            }
            outcome => outcome,
        }
    }
}
