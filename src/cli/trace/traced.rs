//! Evaluators, painters and searches that record their calls in the trace, and the observer that records the course of
//! an evolution.

use std::time::Duration;

use serde_json::{Map, Value};

use super::tracer::{Tracer, Weight};
use crate::error::Result;
use crate::evolve::objective::lowers_sae_alone;
use crate::evolve::{Observer, Seen, Stage, StopReason};
use crate::model::cells::{Ask, Course, Search, SearchState, Stacks, Standing};
use crate::model::{Canvas, Change, Evaluation, Evaluator, Fly, Lane, Layers, Mosaic, Painter, Population, Scene};
use crate::studio::{Instruments, Running};

/// Generations share a span until they took this long together, since one takes only microseconds on the CPU.
const SPAN_LEAST: Duration = Duration::from_millis(5);
/// Time between two values of a counter.
const COUNTER_LEAST: Duration = Duration::from_millis(50);

/// An evaluator that records its calls in the trace, except those of every generation.
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
}

/// A painter that records its calls in the trace.
struct TracedPainter {
    painter: Box<dyn Painter>,
    tracer: Tracer,
}

impl Painter for TracedPainter {
    fn draw_watched(
        &mut self,
        population: &Population,
        canvas: &Canvas,
        supersampling: u32,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Mosaic> {
        let _span = self.tracer.span("draw").tell("width_px", canvas.width_px).tell("height_px", canvas.height_px);
        self.painter.draw_watched(population, canvas, supersampling, watch)
    }
}

/// A search that records its calls in the trace.
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

    fn advance_until(&mut self, rounds: u32, is_over: Ask<'_>) -> Result<bool> {
        let _span = self.tracer.frequent_span("rounds").tell("rounds", rounds);
        self.search.advance_until(rounds, is_over)
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

    fn into_state(self: Box<Self>) -> Result<SearchState> {
        let Self { search, tracer } = *self;
        let _span = tracer.frequent_span("read back");
        search.into_state()
    }

    fn sae(&mut self) -> Result<u64> {
        let _span = self.tracer.frequent_span("SAE");
        self.search.sae()
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
        let _span = self.tracer.frequent_span("read back stacks");
        self.search.read_back_stacks()
    }
}

impl Tracer {
    /// The evaluator, which records its calls if there is a trace.
    pub(crate) fn evaluator(&self, evaluator: Box<dyn Evaluator>) -> Box<dyn Evaluator> {
        if self.is_on() { Box::new(TracedEvaluator { evaluator, tracer: self.clone() }) } else { evaluator }
    }

    /// The painter, which records its calls if there is a trace.
    pub(crate) fn painter(&self, painter: Box<dyn Painter>) -> Box<dyn Painter> {
        if self.is_on() { Box::new(TracedPainter { painter, tracer: self.clone() }) } else { painter }
    }

    /// The search, which records its calls if there is a trace.
    pub(crate) fn search(&self, search: Box<dyn Search>) -> Box<dyn Search> {
        if self.is_on() { Box::new(TracedSearch { search, tracer: self.clone() }) } else { search }
    }

    /// The observer that records the course of an evolution, if there is a trace. Among several observers it must be
    /// the last.
    pub(crate) fn course(&self) -> Option<CourseTrace> {
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

/// Records the course of an evolution: generations or epochs as spans, error and speed as counters.
#[derive(Debug)]
pub(crate) struct CourseTrace {
    tracer: Tracer,
    /// When the current span began.
    began: Duration,
    last: Duration,
    steps: u64,
    /// Births or evals at the beginning of the span.
    count_told: u64,
    /// When the counters were last written, and the births or evals at that time.
    counted: (Duration, u64),
}

impl CourseTrace {
    fn begin(&mut self, count: u64) {
        (self.began, self.steps) = (self.tracer.now(), 0);
        self.last = self.began;
        self.count_told = count;
        self.counted = (self.began, count);
    }

    /// Ends the current span at the last step.
    fn end_span(&mut self, name: &'static str, unit: &str, count: u64, told: Map<String, Value>) {
        let made = count.saturating_sub(self.count_told);
        let mut told = told;
        told.insert(unit.to_owned(), made.into());
        self.tracer.note(name, Weight::Frequent, self.began..self.last, told);
        (self.began, self.steps, self.count_told) = (self.last, 0, count);
    }

    fn count(&mut self, unit: &str, count: u64, measure: &str, error: f64) {
        let (at, before) = self.counted;
        let elapsed = self.last.saturating_sub(at);
        if elapsed >= COUNTER_LEAST {
            self.counted = (self.last, count);
            self.tracer.counter(measure, error);
            self.tracer.counter(unit, count.saturating_sub(before) as f64 / elapsed.as_secs_f64());
        }
    }

    fn end_generations(&mut self, stage: Stage) {
        let told = Map::from_iter([("generations".to_owned(), self.steps.into())]);
        self.end_span("generations", "births", stage.births, told);
        self.count("births/s", stage.births, "SAE", stage.error as f64);
    }

    fn end_epoch(&mut self, standing: Standing, is_sae: bool) {
        let Standing { rounds, evals, births, accepted, objective } = standing;
        let told = [("round", rounds.into()), ("births_so_far", births.into()), ("accepted_so_far", accepted.into())];
        let told = told.into_iter().map(|(key, value): (&str, Value)| (key.to_owned(), value)).collect();
        self.end_span("epoch", "evals", evals, told);
        let measure = if is_sae { "SAE" } else { "objective" };
        self.count("evals/s", evals, measure, objective as f64);
    }
}

impl Observer for CourseTrace {
    fn at_start(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        self.begin(seen.stage().evals);
        Ok(())
    }

    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        self.last = self.tracer.now();
        match seen {
            Seen::Evolutions(_) => {
                self.steps += 1;
                if self.last.saturating_sub(self.began) >= SPAN_LEAST {
                    self.end_generations(seen.stage());
                }
            }
            Seen::Search(search) => {
                let (standing, is_sae) = (search.standing(), lowers_sae_alone(search.course()));
                self.end_epoch(standing, is_sae);
            }
        }
        Ok(None)
    }

    fn at_end(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        if self.steps > 0 {
            self.end_generations(seen.stage());
        }
        Ok(())
    }
}

/// Records all work on one picture in the trace, and remembers why the CPU replaced a device.
pub(crate) struct TraceInstruments<'a> {
    tracer: &'a Tracer,
    stand_in: Option<String>,
}

impl<'a> TraceInstruments<'a> {
    pub(crate) fn new(tracer: &'a Tracer) -> Self {
        Self { tracer, stand_in: None }
    }

    /// Why the CPU searched in place of a device that the user did not name, as a clause after "since".
    pub(crate) fn stand_in(&self) -> Option<&str> {
        self.stand_in.as_deref()
    }
}

impl Instruments for TraceInstruments<'_> {
    fn search(&self, search: Box<dyn Search>) -> Box<dyn Search> {
        self.tracer.search(search)
    }

    fn evaluator(&self, evaluator: Box<dyn Evaluator>) -> Box<dyn Evaluator> {
        self.tracer.evaluator(evaluator)
    }

    fn span(&self, name: &'static str) -> Box<dyn Running + '_> {
        Box::new(self.tracer.span(name))
    }

    fn note_stand_in(&mut self, reason: &str) {
        self.stand_in = Some(reason.to_owned());
    }
}
