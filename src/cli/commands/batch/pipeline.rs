//! Reads, evolves and saves side by side: while some pictures evolve, the next are read and the finished ones are
//! saved.
//!
//! Every stage has its own threads. Queues between them hold no more than the next stage can take at once, so memory
//! does not grow with the batch. A picture that fails, or a decoder that panics, affects its own row and nothing else.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::Scope;
use std::time::Instant;

use rayon::ThreadPool;

use super::crew::Crew;
use super::existing::{self, Verdict};
use super::orphans::{Orphans, QuitsInPanic};
use super::queue::Queue;
use super::stages::{Done, InFlight, Outlets, Pipeline, Ready, Report, Work, Worker, tell};
use crate::cli::files::destination::Destination;
use crate::cli::files::{memory, outputs};
use crate::cli::jobs::prepared::Prepared;
use crate::cli::jobs::row::{Row, Status};
use crate::cli::list::Item;
use crate::cli::terminal::advice::why_no_vulkan;
use crate::cli::terminal::aside::{self, Aside, unless_it_panics};
use crate::cli::terminal::{self, Verbosity};
use crate::error::{Error, Result, in_words};
use crate::evolve::Ending;
use crate::studio::{Device, Drawn};
use crate::{output, photo, threads};

/// How many pictures may wait to be evolved.
const READ_AHEAD_MAX: usize = 16;

/// What a thread that evolves works with.
#[derive(Clone, Copy)]
enum Hands<'w> {
    /// A pool of threads, for one picture after the other.
    Pool(&'w ThreadPool),
    /// A device that evolves this many pictures at once.
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

    /// What each of the device's threads works with.
    fn crews(&self) -> Vec<Hands<'_>> {
        match &self.in_flight {
            InFlight::Pools(pools) => pools.iter().map(Hands::Pool).collect(),
            InFlight::Lanes(count) => vec![Hands::Lanes(*count)],
        }
    }
}

impl<'a> Pipeline<'a> {
    /// Starts all threads. Rows arrive as pictures are finished; the channel closes when nothing is left.
    pub(super) fn start<'scope>(&'a self, scope: &'scope Scope<'scope, 'a>) -> Receiver<Report> {
        let in_flight = self.workers.iter().map(Worker::in_flight).sum::<usize>().clamp(1, READ_AHEAD_MAX);
        let (reports, received) = channel();
        let (ready_in, ready_out) = sync_channel(in_flight);
        let (done_in, done_out) = sync_channel(self.io_threads.save);
        let (ready_out, done_out) = (Arc::new(Queue::new(ready_out)), Arc::new(Queue::new(done_out)));
        let orphans = Arc::new(Orphans::new());
        let save = || {
            let (done, reports) = (Arc::clone(&done_out), reports.clone());
            threads::spawn_in(scope, move || self.save_all(&done, &reports)).map(drop)
        };
        let evolve = |(worker, crew): (&'a Worker, Hands<'a>)| {
            let ready = Arc::clone(&ready_out);
            let outlets = Outlets { done: done_in.clone(), reports: reports.clone(), orphans: Arc::clone(&orphans) };
            let evolve = move || self.evolve_all(&worker.device, crew, &ready, &outlets);
            let spawned = threads::spawn_in(scope, evolve).map(drop);
            if spawned.is_err() {
                orphans.quit();
            }
            spawned
        };
        let read = || {
            let (ready, reports) = (ready_in.clone(), reports.clone());
            threads::spawn_in(scope, move || self.read_all(&ready, &reports)).map(drop)
        };
        let crews: Vec<_> = self
            .workers
            .iter()
            .flat_map(|worker| worker.crews().into_iter().map(move |crew| (worker, crew)))
            .inspect(|_| orphans.enter())
            .collect();
        let mut crews = crews.into_iter();
        // One of each must start; where the system has no room for the others, these do their work, too.
        if let Err(error) = save().and_then(|()| crews.next().map_or(Ok(()), evolve)).and_then(|()| read()) {
            self.schedule.end();
            let _ = reports.send(Report::Fatal(error));
            return received;
        }
        let _ = crews.try_for_each(evolve);
        crews.for_each(|_| orphans.quit());
        let _ = (1..self.io_threads.save).try_for_each(|_| save());
        let _ = (1..self.io_threads.load).try_for_each(|_| read());
        received
    }

    /// The work of a thread that reads.
    fn read_all(&self, ready: &SyncSender<Ready<'a>>, reports: &Sender<Report>) {
        // A decoder may need for ever, and must not keep a signal from ending the batch.
        let aside = Aside::start("reading").ok();
        while let Some(number) = self.schedule.next() {
            if self.interrupt.is_requested() {
                return self.schedule.end();
            }
            let item = &self.items[number];
            let mut row = self.row(item);
            match unless_it_panics(|| self.read(item, &mut row, reports, aside.as_ref())) {
                // The send cannot fail: the receiver lives as long as there are senders.
                Ok(Some(work)) => drop(ready.send(Ready { item, work, row })),
                Ok(None) => tell(reports, row),
                Err(Error::Interrupted) => return self.schedule.end(),
                Err(error) => self.fail(row, error, reports),
            }
        }
    }

    /// Reads a picture; none if there is nothing to do about it.
    fn read(
        &self,
        item: &Item,
        row: &mut Row,
        reports: &Sender<Report>,
        aside: Option<&Aside<Prepared>>,
    ) -> Result<Option<Work<'a>>> {
        let paths = || item.outputs.iter().map(|output| output.path.display().to_string()).collect();
        if existing::is_skipped(&item.outputs, self.on_exists)? {
            (row.status, row.output) = (Status::Skipped, paths());
            return Ok(None);
        }
        check_is_file(&item.input)?;
        let options = item.options(self.tracer);
        let reading = self.gate.enter(photo::decoding_bytes(&item.input));
        let load = {
            let (options, id) = (options.clone(), row.id.clone());
            move || Prepared::load(&options, &id)
        };
        let prepared = match aside {
            Some(aside) => aside.unless_interrupted(self.interrupt, load)?,
            None => aside::unless_interrupted(self.interrupt, load)?,
        };
        row.note_prepared(&prepared, &options);
        let memory_bytes = prepared.check(&options)?;
        // This must precede the next request for a permit: no thread may wait while it holds one.
        drop(reading);
        for warning in &prepared.job.warnings {
            let _ = reports.send(Report::Warning(format!("{}: {warning}", item.input.display())));
        }
        // Needed already for the check of existing outputs, which decodes their pixels.
        let permit = self.gate.enter(memory_bytes);
        if permit.is_beyond_limit() {
            memory::check(memory_bytes)?;
        }
        let to_write = match existing::judge(&options, &prepared, self.on_exists)? {
            Verdict::Write(to_write) => to_write,
            Verdict::Unchanged(story) => {
                row.note_story(&story);
                if let Some(figures) = self.earlier.figures(&row.id, row.key.as_deref()) {
                    row.note_figures(figures);
                }
                (row.status, row.output) = (Status::Unchanged, paths());
                return Ok(None);
            }
        };
        let replaces = existing::replaces_other_result(&to_write, &prepared);
        Ok(Some(Work { options, prepared, to_write, replaces, permit }))
    }

    /// The work of a thread that evolves.
    fn evolve_all(&self, device: &Device, hands: Hands<'_>, ready: &Queue<Ready<'a>>, outlets: &Outlets<'a>) {
        let _quits = QuitsInPanic(&outlets.orphans);
        let reports = &outlets.reports;
        // Whoever has no crew computes on the CPU.
        let pool = match hands {
            Hands::Pool(pool) => Some(pool),
            Hands::Lanes(in_flight) => match Crew::muster(self, device, in_flight, outlets.clone()) {
                Ok(Some(mut crew)) => {
                    let left = crew.work(ready);
                    if left.is_empty() {
                        return;
                    }
                    drop(crew);
                    left.into_iter().for_each(|picture| self.evolve_on_cpu(None, picture, outlets));
                    None
                }
                Ok(None) => None,
                // The user did not name this device, so the CPU may replace it: the bytes are the same.
                Err(error) if !device.is_asked_for() => {
                    let _ =
                        reports.send(Report::Warning(format!("computing on the CPU, since {}", why_no_vulkan(&error))));
                    None
                }
                Err(error) => {
                    outlets.orphans.quit();
                    return drop(reports.send(Report::Fatal(error)));
                }
            },
        };
        let next = || ready.take_or(|| outlets.orphans.take()).or_else(|| outlets.orphans.wait());
        while let Some(picture) = next() {
            if self.interrupt.is_requested() {
                self.schedule.end();
                continue;
            }
            self.evolve_on_cpu(pool, picture, outlets);
        }
    }

    /// Evolves a picture to its end on the CPU, which is never lost.
    pub(super) fn evolve_on_cpu(&self, pool: Option<&ThreadPool>, picture: Ready<'a>, outlets: &Outlets<'a>) {
        if let Some((picture, error)) = self.evolve_one(&Device::cpu(), pool, picture, outlets) {
            self.fail(picture.row, error, &outlets.reports);
        }
    }

    /// The work of a thread that saves.
    fn save_all(&self, done: &Queue<Done<'a>>, reports: &Sender<Report>) {
        while let Some(Done { ready, ending, drawn }) = done.take() {
            let Ready { item, work, mut row } = ready;
            let began = Instant::now();
            match unless_it_panics(|| self.save(&work, &ending, &drawn)) {
                Ok(()) => {
                    row.save_ms = terminal::milliseconds(began.elapsed());
                    row.output = item.outputs.iter().map(|output| output.path.display().to_string()).collect();
                    row.status = Status::Complete;
                    if work.replaces {
                        let _ = reports.send(Report::Replaced);
                    }
                    tell(reports, row);
                }
                Err(error) => self.fail(row, error, reports),
            }
            drop(work.permit);
        }
    }

    fn save(&self, work: &Work<'_>, ending: &Ending, drawn: &Drawn) -> Result<()> {
        let _span = self.tracer.span("save").tell("picture", work.prepared.id.as_str());
        let outputs: Vec<&Destination> = work.to_write.iter().collect();
        let files = outputs::encode(&outputs, drawn, &work.prepared.provenances.told(ending), Verbosity::Quiet)?;
        for file in &files {
            existing::check_remade(file.destination, &file.bytes, self.on_exists)?;
        }
        for file in &files {
            let path = &file.destination.path;
            let folder = path.parent().unwrap_or(Path::new("."));
            std::fs::create_dir_all(folder).map_err(|error| {
                Error::output(
                    folder,
                    format!("the folder cannot be created, since {}; name another one", in_words(&error)),
                )
            })?;
            // No sync to disk: if a crash of the system cuts a file short, the next run finds it and makes it anew.
            self.interrupt.while_writing(|| output::write_atomically_soon(path, &file.bytes))?;
        }
        Ok(())
    }
}

/// Refuses pipes and devices: reading them might never end, and in a folder they are a mistake.
fn check_is_file(input: &Path) -> Result<()> {
    let is_special = input.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir());
    if is_special { Err(Error::input(input, "is a pipe or a device, not a file; name a picture")) } else { Ok(()) }
}
