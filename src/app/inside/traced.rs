//! Evaluators and searches whose calls are in the trace, and observers that put the course of an evolution into it.

use std::time::Duration;

use serde_json::{Map, Value};

use super::tracer::{Tracer, Weight};
use crate::engine;
use crate::error::Result;
use crate::evolve::{Evolution, StopReason, cells};
use crate::model::cells::{Course, Search, SearchState, Stacks, Standing};
use crate::model::{Canvas, Change, Evaluation, Evaluator, Fly, Lane, Layers, Mosaic, Population, Scene};

/// Generations are told together until they took as long as this: one takes microseconds on the CPU.
const SPAN_LEAST: Duration = Duration::from_millis(5);
/// Between two values of a counter.
const COUNTER_LEAST: Duration = Duration::from_millis(50);

/// An evaluator whose calls are in the trace, but for those that come with every generation.
struct TracedEvaluator {
    evaluator: Box<dyn Evaluator>,
    tracer: Tracer,
}

impl Evaluator for TracedEvaluator {
    fn lane(&self, lane: usize) -> &Lane {
        self.evaluator.lane(lane)
    }

    fn lane_count(&self) -> usize {
        self.evaluator.lane_count()
    }

    fn admit(&mut self, scene: Scene) -> Result<Option<usize>> {
        let _span = self.tracer.frequent_span("admit lane");
        self.evaluator.admit(scene)
    }

    fn release(&mut self, lane: usize) {
        self.evaluator.release(lane);
    }

    fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        let _span = self.tracer.frequent_span("load population");
        self.evaluator.load(populations)
    }

    fn replace(&mut self, changes: &[Change]) -> Result<()> {
        self.evaluator.replace(changes)
    }

    fn evaluation(&self, lane: usize) -> Evaluation<'_> {
        self.evaluator.evaluation(lane)
    }

    fn read_back_layers(&mut self, lane: usize) -> Result<Layers> {
        let _span = self.tracer.frequent_span("read back layers");
        self.evaluator.read_back_layers(lane)
    }

    fn draw(&mut self, population: &Population, canvas: &Canvas, supersampling: u32) -> Result<Mosaic> {
        let _span = self.tracer.span("draw").tell("width_px", canvas.width_px).tell("height_px", canvas.height_px);
        self.evaluator.draw(population, canvas, supersampling)
    }
}

/// A search whose calls are in the trace.
struct TracedSearch {
    search: Box<dyn Search>,
    tracer: Tracer,
}

impl Search for TracedSearch {
    fn course(&self) -> &Course {
        self.search.course()
    }

    fn load(&mut self, flies: &[Fly]) -> Result<()> {
        let _span = self.tracer.span("load population");
        self.search.load(flies)
    }

    fn advance(&mut self, rounds: u32) -> Result<()> {
        let _span = self.tracer.frequent_span("rounds").tell("rounds", rounds);
        self.search.advance(rounds)
    }

    fn renormalise(&mut self) -> Result<()> {
        let _span = self.tracer.frequent_span("spread depths");
        self.search.renormalise()
    }

    fn standing(&self) -> Standing {
        self.search.standing()
    }

    fn read_back(&mut self) -> Result<SearchState> {
        let _span = self.tracer.frequent_span("read back");
        self.search.read_back()
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
        let _span = self.tracer.frequent_span("read back stacks");
        self.search.read_back_stacks()
    }
}

impl Tracer {
    /// The evaluator, its calls in the trace if there is one.
    pub(in crate::app) fn evaluator(&self, evaluator: Box<dyn Evaluator>) -> Box<dyn Evaluator> {
        if self.is_on() { Box::new(TracedEvaluator { evaluator, tracer: self.clone() }) } else { evaluator }
    }

    /// The search, its calls in the trace if there is one.
    pub(in crate::app) fn search(&self, search: Box<dyn Search>) -> Box<dyn Search> {
        if self.is_on() { Box::new(TracedSearch { search, tracer: self.clone() }) } else { search }
    }

    /// What draws the course of an evolution into the trace, if there is one. It must be the last of several observers.
    pub(in crate::app) fn course(&self) -> Option<CourseTrace> {
        self.is_on().then(|| CourseTrace {
            tracer: self.clone(),
            began: self.now(),
            last: self.now(),
            steps: 0,
            count_told: 0,
            counted: (self.now(), 0),
        })
    }
}

/// Draws the course of an evolution: its generations or epochs as spans, error and speed as counters.
#[derive(Debug)]
pub(in crate::app) struct CourseTrace {
    tracer: Tracer,
    /// Of the span under way.
    began: Duration,
    last: Duration,
    steps: u64,
    /// Births or evals at its beginning.
    count_told: u64,
    /// When the counters were written, and births or evals then.
    counted: (Duration, u64),
}

impl CourseTrace {
    fn begin(&mut self, count: u64) {
        (self.began, self.steps) = (self.tracer.now(), 0);
        self.last = self.began;
        self.count_told = count;
        self.counted = (self.began, count);
    }

    /// Ends the span under way at the last step.
    fn end_span(&mut self, name: &'static str, (unit, count): (&str, u64), told: Map<String, Value>) {
        let made = count.saturating_sub(self.count_told);
        let mut told = told;
        told.insert(unit.to_owned(), made.into());
        self.tracer.note((name, Weight::Frequent), (self.began, self.last), told);
        (self.began, self.steps, self.count_told) = (self.last, 0, count);
    }

    fn count(&mut self, (unit, count): (&str, u64), (measure, error): (&str, f64)) {
        let (at, before) = self.counted;
        let elapsed = self.last.saturating_sub(at);
        if elapsed >= COUNTER_LEAST {
            self.counted = (self.last, count);
            self.tracer.counter(measure, error);
            self.tracer.counter(unit, count.saturating_sub(before) as f64 / elapsed.as_secs_f64());
        }
    }

    fn end_generations(&mut self, evolutions: &[Evolution]) {
        let births = evolutions.iter().map(|evolution| evolution.outcome().births).sum();
        let told = Map::from_iter([("generations".to_owned(), self.steps.into())]);
        self.end_span("generations", ("births", births), told);
        let sae: u64 = evolutions.iter().filter_map(Evolution::best_sae).sum();
        self.count(("births/s", births), ("SAE", sae as f64));
    }

    /// Ends the last span.
    pub(in crate::app) fn finish(mut self, evolutions: &[Evolution]) {
        if self.steps > 0 {
            self.end_generations(evolutions);
        }
    }
}

impl engine::Observer for CourseTrace {
    fn at_start(&mut self, _evolutions: &[Evolution]) {
        self.begin(0);
    }

    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        self.steps += 1;
        self.last = self.tracer.now();
        if self.last.saturating_sub(self.began) >= SPAN_LEAST {
            self.end_generations(evolutions);
        }
        None
    }
}

impl cells::Observer for CourseTrace {
    fn at_start(&mut self, search: &mut dyn Search) -> Result<()> {
        self.begin(search.standing().evals);
        Ok(())
    }

    fn after_epoch(&mut self, search: &mut dyn Search) -> Result<Option<StopReason>> {
        self.last = self.tracer.now();
        let Standing { rounds, evals, births, accepted, objective } = search.standing();
        let told = [("round", rounds.into()), ("births_so_far", births.into()), ("accepted_so_far", accepted.into())];
        let told = told.into_iter().map(|(key, value): (&str, Value)| (key.to_owned(), value)).collect();
        self.end_span("epoch", ("evals", evals), told);
        let measure = if cells::lowers_sae_alone(search.course()) { "SAE" } else { "objective" };
        self.count(("evals/s", evals), (measure, objective as f64));
        Ok(None)
    }
}
