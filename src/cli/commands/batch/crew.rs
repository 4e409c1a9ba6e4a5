//! A Vulkan device that works on many pictures. Each picture is a lane, and one submission serves all lanes. When a
//! picture is done, the next one gets its lane at once.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use super::queue::Queue;
use super::stages::{Done, Outlets, Pipeline, Ready, Report};
use crate::cli::args::computing::OnDeviceLost;
use crate::cli::jobs::prepared::Evolved;
use crate::cli::terminal::advice::why_no_vulkan;
use crate::cli::terminal::aside::unless_it_panics;
use crate::cli::terminal::milliseconds;
use crate::engine::{self, Finished};
use crate::error::{Error, Result};
use crate::model::Painter;
use crate::studio::Device;

/// The pictures that evolve on a device.
pub(super) struct Crew<'a, 'p> {
    pub pipeline: &'p Pipeline<'a>,
    pub device: &'p Device,
    /// Most pictures at the same time.
    pub in_flight: usize,
    pub outlets: Outlets<'a>,
    lanes: engine::Crew,
    painter: Box<dyn Painter>,
    /// The pictures on board by their tickets.
    aboard: HashMap<u64, Aboard<'a>>,
    /// The next picture, if there was no room for it yet.
    held: Option<Ready<'a>>,
    /// Whether there is no room until a picture is done.
    is_full: bool,
    tickets: u64,
    counted: Counted,
}

/// A picture on board.
struct Aboard<'a> {
    picture: Ready<'a>,
    began: Instant,
}

/// When the counters of the trace were last written, and the evals of all pictures on board at that time.
struct Counted {
    at: Instant,
    evals: u64,
}

/// Time between two values of a counter.
const COUNTER_LEAST: Duration = Duration::from_millis(50);

/// What became of a picture that was to come on board.
enum Admitted {
    Aboard,
    /// There is no room until another one is done.
    Later,
}

impl<'a, 'p> Crew<'a, 'p> {
    /// A crew of a Vulkan device; none on the CPU.
    pub(super) fn muster(
        pipeline: &'p Pipeline<'a>,
        device: &'p Device,
        in_flight: usize,
        outlets: Outlets<'a>,
    ) -> Result<Option<Self>> {
        let Some(lanes) = device.open_crew()? else { return Ok(None) };
        Ok(Some(Self {
            pipeline,
            device,
            in_flight,
            outlets,
            lanes,
            painter: device.open_painter()?,
            aboard: HashMap::new(),
            held: None,
            is_full: false,
            tickets: 0,
            counted: Counted { at: Instant::now(), evals: 0 },
        }))
    }

    /// Evolves all pictures of the queue. Returns those that are left to the CPU, since the device is lost and nobody
    /// else is there.
    pub(super) fn work(&mut self, queue: &Queue<Ready<'a>>) -> Vec<Ready<'a>> {
        loop {
            let worked = self.fill(queue).and_then(|()| self.step());
            if let Err(error) = worked {
                return self.give_up(error);
            }
            self.count();
            if self.pipeline.interrupt.is_requested() {
                self.abandon(queue);
                return Vec::new();
            }
            if self.aboard.is_empty() && self.held.is_none() && queue.is_ended() {
                match self.outlets.orphans.wait() {
                    Some(orphan) => self.held = Some(orphan),
                    None => return Vec::new(),
                }
            }
        }
    }

    /// Takes pictures on board until there is no room or none is ready. Waits for one only if there is nothing else to
    /// do.
    fn fill(&mut self, queue: &Queue<Ready<'a>>) -> Result<()> {
        while self.aboard.len() < self.in_flight && !self.is_full {
            let next = match self.held.take() {
                Some(held) => Some(held),
                None if self.aboard.is_empty() => queue.take_or(|| self.outlets.orphans.take()),
                None => self.outlets.orphans.take().or_else(|| queue.take_if_ready()),
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
        if picture.work.options.settings.time_limit.is_some() {
            // A picture with a time limit evolves alone: with neighbours, the clock would decide even more of its
            // result.
            if let Some((picture, error)) = self.pipeline.evolve_one(self.device, None, picture, &self.outlets) {
                self.held = Some(picture);
                return Err(error);
            }
            return Ok(Admitted::Aboard);
        }
        picture.row.device = Some(self.device.label().to_owned());
        match self.begin(ticket, &picture) {
            Ok(true) => {
                self.tickets += 1;
                self.aboard.insert(ticket, Aboard { picture, began: Instant::now() });
                Ok(Admitted::Aboard)
            }
            Ok(false) => {
                self.held = Some(picture);
                self.is_full = true;
                Ok(Admitted::Later)
            }
            Err(error @ Error::DeviceLost { .. }) => {
                self.held = Some(picture);
                Err(error)
            }
            Err(error) if self.device.is_asked_for() => {
                self.pipeline.fail(picture.row, error, &self.outlets.reports);
                Ok(Admitted::Aboard)
            }
            // The user did not name this device, so the CPU may replace it: the bytes are the same.
            Err(error) => {
                let warning = format!("{}: on the CPU, since {}", picture.item.input.display(), why_no_vulkan(&error));
                let _ = self.outlets.reports.send(Report::Warning(warning));
                self.pipeline.evolve_on_cpu(None, picture, &self.outlets);
                Ok(Admitted::Aboard)
            }
        }
    }

    /// Gives a picture a lane; false if there is no room yet.
    fn begin(&mut self, ticket: u64, picture: &Ready<'a>) -> Result<bool> {
        let _span = self.pipeline.tracer.span("admit").tell("picture", picture.row.id.as_str());
        self.lanes.admit(ticket, picture.work.prepared.job.task())
    }

    /// Works on all pictures for a few milliseconds, and passes on those that are done.
    fn step(&mut self) -> Result<()> {
        let _span = self.pipeline.tracer.frequent_span("step").tell("pictures", self.aboard.len() as u64);
        for finished in self.lanes.step()? {
            if let Some(picture) = self.aboard.remove(&finished.ticket) {
                self.send_on(picture, finished)?;
            }
        }
        Ok(())
    }

    /// Records how many pictures are on board and how fast they evolve, if there is a trace.
    fn count(&mut self) {
        let elapsed = self.counted.at.elapsed();
        if !self.pipeline.tracer.is_on() || elapsed < COUNTER_LEAST {
            return;
        }
        let evals = self.lanes.evals();
        // The sum may have fallen, since the evals of a picture that ended no longer count.
        if evals >= self.counted.evals {
            let per_s = (evals - self.counted.evals) as f64 / elapsed.as_secs_f64();
            self.pipeline.tracer.counter("evals/s", per_s);
        }
        self.pipeline.tracer.counter("pictures", self.aboard.len() as f64);
        self.counted = Counted { at: Instant::now(), evals };
    }

    /// Draws a picture that is done, and hands it to the threads that save. If the device is lost, it stays on board.
    fn send_on(&mut self, Aboard { mut picture, began }: Aboard<'a>, finished: Finished) -> Result<()> {
        let ticket = finished.ticket;
        self.is_full = false;
        picture.row.evolve_ms = milliseconds(began.elapsed());
        let _span = self.pipeline.tracer.span("finish").tell("picture", picture.row.id.as_str());
        let Ready { work, row, .. } = &mut picture;
        let drawn = unless_it_panics(|| work.prepared.draw(&work.options, finished.outcome?, &mut *self.painter));
        let evolved = drawn.inspect(|evolved| row.note_evolved(evolved));
        match evolved.and_then(|evolved| self.device.check_validation().map(|()| evolved)) {
            Ok(Evolved { ending, drawn, .. }) => {
                drop(self.outlets.done.send(Done { ready: picture, ending, drawn }));
            }
            Err(error @ Error::DeviceLost { .. }) => {
                self.aboard.insert(ticket, Aboard { picture, began });
                return Err(error);
            }
            Err(error) => self.pipeline.fail(picture.row, error, &self.outlets.reports),
        }
        Ok(())
    }

    /// The device failed for all its pictures. Where it is lost, another device takes them, or else the CPU, if that
    /// was asked for: then they are returned. Otherwise the batch ends.
    fn give_up(&mut self, error: Error) -> Vec<Ready<'a>> {
        let aboard = self.aboard.drain().map(|(_, aboard)| aboard.picture);
        let pictures: Vec<Ready<'a>> = aboard.chain(self.held.take()).collect();
        let Pipeline { on_device_lost, schedule, .. } = self.pipeline;
        let told = |rest: &str| {
            let told = format!("{}: {error}; {rest}", self.device.label());
            let _ = self.outlets.reports.send(Report::Warning(told));
        };
        if matches!(error, Error::DeviceLost { .. }) {
            match self.outlets.orphans.give(pictures) {
                Ok(()) => {
                    told("the other devices take its pictures");
                    return Vec::new();
                }
                Err(pictures) if *on_device_lost == OnDeviceLost::Cpu => {
                    told("the CPU makes the rest");
                    return pictures;
                }
                Err(_) => {}
            }
        }
        schedule.end();
        let _ = self.outlets.reports.send(Report::Fatal(error));
        self.outlets.orphans.quit();
        Vec::new()
    }

    /// Abandons all pictures. Those that are not finished leave no files.
    fn abandon(&mut self, queue: &Queue<Ready<'a>>) {
        self.lanes.cancel_all();
        self.aboard.clear();
        self.held = None;
        self.pipeline.schedule.end();
        // Threads that read may be waiting for room.
        while queue.take_or(|| self.outlets.orphans.take()).is_some() {}
        self.outlets.orphans.quit();
    }
}
