//! Reading, evolving and saving side by side: pictures are read ahead of those that evolve, and saved behind them.
//!
//! Every stage has its threads, and hands over through queues that hold no more than the next stage can take at once, so the
//! memory that is in use does not grow with the batch. A picture that fails, or a decoder that panics, ends its own row and
//! nothing else.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::Scope;
use std::time::Instant;

use rayon::ThreadPool;

use super::crew::Crew;
use super::existing::{self, OnExists, Verdict};
use super::gate::{Gate, Permit};
use super::items::Item;
use super::queue::Queue;
use super::schedule::Schedule;
use crate::app::advice::why_no_vulkan;
use crate::app::destination::Destination;
use crate::app::device::Selected;
use crate::app::inside::Tracer;
use crate::app::interrupt::Interrupt;
use crate::app::options::EvolveOptions;
use crate::app::outputs::{self, Drawn};
use crate::app::prepared::Prepared;
use crate::app::provenance::Ending;
use crate::app::report::{self, Row, Status};
use crate::app::result::Evolved;
use crate::app::shard::Shard;
use crate::app::watch::Watchers;
use crate::error::{Error, Result};
use crate::{output, photo};

/// Most pictures that wait to be evolved.
const READ_AHEAD_MAX: usize = 16;

/// What evolves pictures: a device, and how it does several at the same time.
pub(super) struct Worker {
    pub selected: Selected,
    pub in_flight: InFlight,
}

/// How pictures evolve at the same time.
pub(super) enum InFlight {
    /// The threads of each: waiting for a share of work, a thread of a common pool might begin another whole picture.
    Pools(Vec<ThreadPool>),
    /// At most so many, as lanes of the device.
    Lanes(usize),
}

/// What a thread that evolves has at hand.
enum Hands<'w> {
    /// The threads for one picture after the other.
    Pool(&'w ThreadPool),
    /// A device for so many pictures at once.
    Lanes(usize),
}

impl Worker {
    /// Pictures that evolve at the same time.
    fn in_flight(&self) -> usize {
        match &self.in_flight {
            InFlight::Pools(pools) => pools.len(),
            InFlight::Lanes(count) => *count,
        }
    }

    /// What each of its threads has at hand.
    fn crews(&self) -> Vec<Hands<'_>> {
        match &self.in_flight {
            InFlight::Pools(pools) => pools.iter().map(Hands::Pool).collect(),
            InFlight::Lanes(count) => vec![Hands::Lanes(*count)],
        }
    }
}

/// What all threads of a batch see.
pub(super) struct Pipeline<'a> {
    pub items: &'a [Item],
    pub workers: &'a [Worker],
    /// Threads that read, and that save.
    pub io_threads: (usize, usize),
    pub on_exists: OnExists,
    pub shard: Option<Shard>,
    pub schedule: &'a Schedule,
    pub gate: &'a Gate,
    pub interrupt: &'a Interrupt,
    /// Where all threads tell what they do.
    pub tracer: &'a Tracer,
}

/// What comes out: a row for every picture that was not interrupted, and what else should be said.
pub(super) enum Told {
    Row(Box<Row>),
    Warning(String),
    /// A failure that the pictures to come would share.
    Fatal(Error),
}

/// What there is to do about a picture.
pub(super) struct Work<'a> {
    pub options: EvolveOptions,
    pub prepared: Prepared,
    to_write: Vec<Destination>,
    /// The memory that it may take, until it is saved.
    permit: Permit<'a>,
}

/// A picture that waits to be evolved.
pub(super) struct Ready<'a> {
    pub item: &'a Item,
    pub work: Work<'a>,
    pub row: Row,
}

/// A picture that waits to be saved.
pub(super) struct Done<'a> {
    pub ready: Ready<'a>,
    pub ending: Ending,
    pub drawn: Drawn,
}

impl<'a> Pipeline<'a> {
    /// Starts all threads; rows come as pictures are finished, and end when nothing is left.
    pub(super) fn start<'scope>(&'a self, scope: &'scope Scope<'scope, 'a>) -> Receiver<Told> {
        let in_flight = self.workers.iter().map(Worker::in_flight).sum::<usize>().clamp(1, READ_AHEAD_MAX);
        let (told, rows) = channel();
        let (ready_in, ready_out) = sync_channel(in_flight);
        let (done_in, done_out) = sync_channel(self.io_threads.1);
        let (ready_out, done_out) = (Arc::new(Queue::new(ready_out)), Arc::new(Queue::new(done_out)));
        for _ in 0..self.io_threads.0 {
            let (ready, told) = (ready_in.clone(), told.clone());
            scope.spawn(move || self.read_all(&ready, &told));
        }
        for worker in self.workers {
            for crew in worker.crews() {
                let (ready, done, told) = (Arc::clone(&ready_out), done_in.clone(), told.clone());
                scope.spawn(move || self.evolve_all((&worker.selected, crew), &ready, &done, &told));
            }
        }
        for _ in 0..self.io_threads.1 {
            let (done, told) = (Arc::clone(&done_out), told.clone());
            scope.spawn(move || self.save_all(&done, &told));
        }
        rows
    }

    /// What a thread that reads does.
    fn read_all(&self, ready: &SyncSender<Ready<'a>>, told: &Sender<Told>) {
        while let Some(number) = self.schedule.next() {
            if self.interrupt.is_requested() {
                return self.schedule.end();
            }
            let item = &self.items[number];
            let mut row = self.row(item);
            match unless_it_panics(|| self.read(item, &mut row, told)) {
                // Whoever receives lives as long as there are senders.
                Ok(Some(work)) => drop(ready.send(Ready { item, work, row })),
                Ok(None) => tell(told, row),
                Err(error) => self.fail(row, error, told),
            }
        }
    }

    /// The row of a picture that was just taken up.
    pub(super) fn row(&self, item: &Item) -> Row {
        let mut row = Row::new(&item.input, item.seed(), item.scheme());
        row.id.clone_from(&item.id);
        row.shard = self.shard.map(|shard| shard.to_string());
        row
    }

    /// Reads a picture; none if nothing is left to do about it.
    fn read(&self, item: &Item, row: &mut Row, told: &Sender<Told>) -> Result<Option<Work<'a>>> {
        let paths = || item.outputs.iter().map(|output| output.path.display().to_string()).collect();
        if existing::is_skipped(&item.outputs, self.on_exists)? {
            (row.status, row.output) = (Status::Skipped, paths());
            return Ok(None);
        }
        check_is_file(&item.input)?;
        let options = item.options(self.tracer);
        let reading = self.gate.enter(photo::decoding_bytes(&item.input));
        let prepared = Prepared::load(&options, row)?;
        // Before the next permit is asked for: nobody waits while holding one.
        drop(reading);
        for warning in &prepared.job.warnings {
            let _ = told.send(Told::Warning(format!("{}: {warning}", item.input.display())));
        }
        // To look whether an output is whole takes its pixels.
        let permit = self.gate.enter(prepared.memory_bytes);
        if permit.is_beyond_limit() {
            prepared.check_memory()?;
        }
        let to_write = match existing::judge(&options, &prepared, self.on_exists)? {
            Verdict::Write(to_write) => to_write,
            Verdict::Unchanged(story) => {
                row.note_story(&story);
                (row.status, row.output) = (Status::Unchanged, paths());
                return Ok(None);
            }
        };
        Ok(Some(Work { options, prepared, to_write, permit }))
    }

    /// What a thread that evolves does.
    fn evolve_all(
        &self,
        (selected, hands): (&Selected, Hands<'_>),
        ready: &Queue<Ready<'a>>,
        done: &SyncSender<Done<'a>>,
        told: &Sender<Told>,
    ) {
        let on_cpu = Selected::Cpu { reason: None };
        let (selected, pool) = match hands {
            Hands::Pool(pool) => (selected, Some(pool)),
            Hands::Lanes(in_flight) => match Crew::muster((self, selected), in_flight, (done.clone(), told.clone())) {
                Ok(Some(mut crew)) => return crew.work(ready),
                Ok(None) => (selected, None),
                // Nobody asked for the device: the CPU comes to the same bytes.
                Err(error) if !selected.is_asked_for() => {
                    let _ = told.send(Told::Warning(format!("computing on the CPU, since {}", why_no_vulkan(&error))));
                    (&on_cpu, None)
                }
                Err(error) => return drop(told.send(Told::Fatal(error))),
            },
        };
        while let Some(picture) = ready.take() {
            if self.interrupt.is_requested() {
                self.schedule.end();
                continue;
            }
            self.evolve_one((selected, pool), picture, done, told);
        }
    }

    /// Evolves a picture to its end, on the threads of a pool.
    pub(super) fn evolve_one(
        &self,
        (selected, pool): (&Selected, Option<&ThreadPool>),
        mut picture: Ready<'a>,
        done: &SyncSender<Done<'a>>,
        told: &Sender<Told>,
    ) {
        let mut evolve = || {
            let mut watchers = Watchers { interrupt: self.interrupt, recorder: None };
            let Ready { work: Work { options, prepared, .. }, row, .. } = &mut picture;
            row.device = Some(selected.label().to_owned());
            prepared.evolve(options, selected, &mut watchers, row)
        };
        let evolved = unless_it_panics(|| match pool {
            Some(pool) => pool.install(evolve),
            None => evolve(),
        });
        match evolved {
            // What is not finished leaves nothing.
            Ok(Evolved { ending, .. }) if ending.status == Status::Partial => self.schedule.end(),
            Ok(Evolved { ending, drawn, .. }) => drop(done.send(Done { ready: picture, ending, drawn })),
            Err(error) => self.fail(picture.row, error, told),
        }
    }

    /// What a thread that saves does.
    fn save_all(&self, done: &Queue<Done<'a>>, told: &Sender<Told>) {
        while let Some(Done { ready, ending, drawn }) = done.take() {
            let Ready { item, work: Work { prepared, to_write, permit, .. }, mut row } = ready;
            match unless_it_panics(|| self.save(&prepared, &to_write, (&ending, drawn), &mut row)) {
                Ok(()) => {
                    row.output = item.outputs.iter().map(|output| output.path.display().to_string()).collect();
                    row.status = Status::Complete;
                    tell(told, row);
                }
                Err(error) => self.fail(row, error, told),
            }
            drop(permit);
        }
    }

    fn save(
        &self,
        prepared: &Prepared,
        to_write: &[Destination],
        (ending, drawn): (&Ending, Drawn),
        row: &mut Row,
    ) -> Result<()> {
        let began = Instant::now();
        let _span = self.tracer.span("save").tell("picture", row.id.as_str());
        let outputs: Vec<&Destination> = to_write.iter().collect();
        let files = outputs::encode(&outputs, drawn, &prepared.provenances.told(ending))?;
        for file in &files {
            existing::check_remade(file.destination, &file.bytes, self.on_exists)?;
        }
        for file in &files {
            let path = &file.destination.path;
            let folder = path.parent().unwrap_or(Path::new("."));
            std::fs::create_dir_all(folder).map_err(|error| {
                Error::output(folder, format!("the folder cannot be created ({error}); name another one"))
            })?;
            // What a crash of the system cuts short, the next run finds and makes anew.
            self.interrupt.while_writing(|| output::write_atomically_soon(path, &file.bytes))?;
        }
        row.save_ms = report::milliseconds(began.elapsed());
        Ok(())
    }

    /// Notes that a picture failed, and whether all others would.
    pub(super) fn fail(&self, mut row: Row, error: Error, told: &Sender<Told>) {
        row.note_failure(&error);
        row.output.clear();
        let is_fatal = matches!(error, Error::DeviceLost { .. }) || output::is_disk_full(&error);
        if is_fatal {
            let _ = told.send(Told::Fatal(error));
        }
        tell(told, row);
    }
}

/// Whoever listens does so until the last sender is gone.
fn tell(told: &Sender<Told>, row: Row) {
    let _ = told.send(Told::Row(Box::new(row)));
}

/// Refuses pipes and devices, which might never end: in a folder they are there by mistake.
fn check_is_file(input: &Path) -> Result<()> {
    let is_special = input.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir());
    if is_special { Err(Error::input(input, "is no file but a pipe or a device; name a picture")) } else { Ok(()) }
}

/// The result of some work on a picture, even if that panics: one picture must not end a batch.
pub(super) fn unless_it_panics<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let told = panic.downcast_ref::<&str>().map(ToString::to_string).or(panic.downcast_ref::<String>().cloned());
        Err(Error::Internal(format!("a picture made the program panic: {}", told.unwrap_or_default())))
    })
}
