//! A Vulkan device at work on many pictures: each is a lane, one submission serves all lanes, and the lane of a picture that is
//! done goes to the next at once.

use std::collections::HashMap;
use std::sync::mpsc::{Sender, SyncSender};
use std::time::{Duration, Instant};

use super::pipeline::{Done, Pipeline, Ready, Told, unless_it_panics};
use super::queue::Queue;
use crate::app::advice::why_no_vulkan;
use crate::app::cells;
use crate::app::device::Selected;
use crate::app::options::SchemeOptions;
use crate::app::outputs::Drawn;
use crate::app::prepared;
use crate::app::provenance::Ending;
use crate::app::report;
use crate::engine::{PaperCrew, PaperTask, SearchCrew};
use crate::error::{Error, Result};
use crate::model::Evaluator;

/// The pictures that evolve on a device.
pub(super) struct Crew<'a, 'p> {
    pub pipeline: &'p Pipeline<'a>,
    pub selected: &'p Selected,
    /// Most pictures at once.
    pub in_flight: usize,
    pub done: SyncSender<Done<'a>>,
    pub told: Sender<Told>,
    searches: SearchCrew,
    evolutions: PaperCrew,
    /// By their tickets, each with when it began.
    aboard: HashMap<u64, (Ready<'a>, Instant)>,
    /// The next one, for which there was no room yet.
    held: Option<Ready<'a>>,
    /// Whether there is none until a picture is done.
    is_full: bool,
    tickets: u64,
    counted: Counted,
}

/// When the counters of the trace were written, and the evals of all pictures aboard then.
struct Counted {
    at: Instant,
    evals: u64,
}

/// Between two values of a counter.
const COUNTER_LEAST: Duration = Duration::from_millis(50);

/// What became of a picture that was to come aboard.
enum Admitted {
    Aboard,
    /// There is no room before others are done.
    Later,
}

impl<'a, 'p> Crew<'a, 'p> {
    /// A crew of a Vulkan device; none on the CPU.
    pub(super) fn muster(
        (pipeline, selected): (&'p Pipeline<'a>, &'p Selected),
        in_flight: usize,
        (done, told): (SyncSender<Done<'a>>, Sender<Told>),
    ) -> Result<Option<Self>> {
        let Some((searches, evolutions)) = selected.crews()? else { return Ok(None) };
        Ok(Some(Self {
            pipeline,
            selected,
            in_flight,
            done,
            told,
            searches,
            evolutions,
            aboard: HashMap::new(),
            held: None,
            is_full: false,
            tickets: 0,
            counted: Counted { at: Instant::now(), evals: 0 },
        }))
    }

    /// Evolves all pictures of the queue.
    pub(super) fn work(&mut self, queue: &Queue<Ready<'a>>) {
        loop {
            let worked = self.fill(queue).and_then(|()| self.step());
            if let Err(error) = worked {
                return self.give_up(error);
            }
            self.count();
            if self.pipeline.interrupt.is_requested() {
                return self.abandon(queue);
            }
            if self.aboard.is_empty() && self.held.is_none() && queue.is_ended() {
                return;
            }
        }
    }

    /// Takes pictures aboard until there is no room, or none is ready; waits for one only if there is nothing else to do.
    fn fill(&mut self, queue: &Queue<Ready<'a>>) -> Result<()> {
        while self.aboard.len() < self.in_flight && !self.is_full {
            let next = match self.held.take() {
                Some(held) => Some(held),
                None if self.aboard.is_empty() => queue.take(),
                None => queue.take_if_ready(),
            };
            let Some(picture) = next else { break };
            match self.admit(picture)? {
                Admitted::Aboard => {}
                Admitted::Later => break,
            }
        }
        Ok(())
    }

    fn admit(&mut self, mut picture: Ready<'a>) -> Result<Admitted> {
        let ticket = self.tickets;
        if picture.work.options.time_limit.is_some() {
            // Alone, or what it comes to by the clock would depend on its neighbours even more.
            self.pipeline.evolve_one((self.selected, None), picture, &self.done, &self.told);
            return Ok(Admitted::Aboard);
        }
        picture.row.device = Some(self.selected.label().to_owned());
        match self.begin(ticket, &picture) {
            Ok(true) => {
                self.tickets += 1;
                self.aboard.insert(ticket, (picture, Instant::now()));
                Ok(Admitted::Aboard)
            }
            Ok(false) => {
                self.held = Some(picture);
                self.is_full = true;
                Ok(Admitted::Later)
            }
            Err(error @ Error::DeviceLost { .. }) => Err(error),
            Err(error) if self.selected.is_asked_for() => {
                self.pipeline.fail(picture.row, error, &self.told);
                Ok(Admitted::Aboard)
            }
            // Nobody asked for the device: the CPU comes to the same bytes.
            Err(error) => {
                let warning = format!("{}: on the CPU, since {}", picture.item.input.display(), why_no_vulkan(&error));
                let _ = self.told.send(Told::Warning(warning));
                let on_cpu = Selected::Cpu { reason: None };
                self.pipeline.evolve_one((&on_cpu, None), picture, &self.done, &self.told);
                Ok(Admitted::Aboard)
            }
        }
    }

    /// Gives a picture to the crew of its scheme; false if there is no room yet.
    fn begin(&mut self, ticket: u64, picture: &Ready<'a>) -> Result<bool> {
        let job = &picture.work.prepared.job;
        let _span = self.pipeline.tracer.span("admit").tell("picture", picture.row.id.as_str());
        match &job.scheme {
            SchemeOptions::Cells(cells) => {
                let given = job.given_flies(cells.seed);
                self.searches.admit(ticket, job.course(cells), (given.as_deref(), cells.budget(job.fly_count)))
            }
            SchemeOptions::Paper(scheme) => {
                let task = PaperTask { scheme: scheme.clone(), first_flies: job.first_flies(scheme) };
                self.evolutions.admit(ticket, &job.scene(), &task)
            }
        }
    }

    /// Brings all pictures on by a few milliseconds of work, and sends on those that are done.
    fn step(&mut self) -> Result<()> {
        let _span = self.pipeline.tracer.frequent_span("step").tell("pictures", self.aboard.len() as u64);
        let searched = if self.searches.is_empty() { Vec::new() } else { self.searches.step()? };
        for finished in searched {
            let Some(picture) = self.aboard.remove(&finished.ticket) else { continue };
            let scheme_done = |picture: &mut Ready<'a>, evaluator: &mut dyn Evaluator| {
                let job = (&picture.work.options, &picture.work.prepared.job);
                cells::finish_search(job, finished.outcome?, evaluator, &mut picture.row)
            };
            self.send_on(picture, scheme_done)?;
        }
        let evolved = if self.evolutions.is_empty() { Vec::new() } else { self.evolutions.step()? };
        for result in evolved {
            let Some(picture) = self.aboard.remove(&result.ticket) else { continue };
            let scored = (result.sae, result.marginal);
            let scheme_done = |picture: &mut Ready<'a>, evaluator: &mut dyn Evaluator| {
                let job = (&picture.work.options, &picture.work.prepared.job);
                prepared::finish_evolution(job, (&result.evolution, scored), evaluator, &mut picture.row)
            };
            self.send_on(picture, scheme_done)?;
        }
        Ok(())
    }

    /// Writes how many pictures are aboard, and how fast they evolve, into the trace if there is one.
    fn count(&mut self) {
        let elapsed = self.counted.at.elapsed();
        if !self.pipeline.tracer.is_on() || elapsed < COUNTER_LEAST {
            return;
        }
        let births: u64 = self.evolutions.evolutions().map(|(_, evolution)| evolution.outcome().births).sum();
        let evals = births + self.searches.standings().map(|standing| standing.evals).sum::<u64>();
        // Who leaves takes evals along.
        if evals >= self.counted.evals {
            let per_s = (evals - self.counted.evals) as f64 / elapsed.as_secs_f64();
            self.pipeline.tracer.counter("evals/s", per_s);
        }
        self.pipeline.tracer.counter("pictures", self.aboard.len() as f64);
        self.counted = Counted { at: Instant::now(), evals };
    }

    /// Draws a picture that is done, and hands it to those that save.
    fn send_on(
        &mut self,
        (mut picture, began): (Ready<'a>, Instant),
        finish: impl FnOnce(&mut Ready<'a>, &mut dyn Evaluator) -> Result<(Ending, Drawn)>,
    ) -> Result<()> {
        self.is_full = false;
        picture.row.evolve_ms = report::milliseconds(began.elapsed());
        let _span = self.pipeline.tracer.span("finish").tell("picture", picture.row.id.as_str());
        let finished = unless_it_panics(|| finish(&mut picture, self.evolutions.evaluator()));
        match finished.and_then(|finished| self.selected.check_validation().map(|()| finished)) {
            Ok((ending, drawn)) => drop(self.done.send(Done { ready: picture, ending, drawn })),
            Err(error @ Error::DeviceLost { .. }) => {
                self.pipeline.fail(picture.row, Error::DeviceLost { last_pass: "draw".to_owned() }, &self.told);
                return Err(error);
            }
            Err(error) => self.pipeline.fail(picture.row, error, &self.told),
        }
        Ok(())
    }

    /// Ends the batch, since the device failed all its pictures.
    fn give_up(&mut self, error: Error) {
        self.aboard.clear();
        self.held = None;
        self.pipeline.schedule.end();
        let _ = self.told.send(Told::Fatal(error));
    }

    /// Leaves all pictures as they are: what is not finished leaves nothing.
    fn abandon(&mut self, queue: &Queue<Ready<'a>>) {
        self.searches.cancel_all();
        self.evolutions.cancel_all();
        self.aboard.clear();
        self.held = None;
        self.pipeline.schedule.end();
        // Those that read may be waiting for room.
        while queue.take().is_some() {}
    }
}
