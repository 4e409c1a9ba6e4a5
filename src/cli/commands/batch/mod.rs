//! `smalti batch`: many pictures, one after the other or side by side, and what became of each.

mod crew;
mod earlier;
mod existing;
mod gate;
mod orphans;
mod pipeline;
mod places;
mod queue;
mod schedule;
mod stages;
mod summary;
mod threads;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use indicatif::HumanCount;

use self::earlier::Earlier;
use self::gate::Gate;
use self::places::Taken;
use self::schedule::Schedule;
use self::stages::{Pipeline, Report};
use self::summary::Summary;
use crate::cli::args::computing::{self, Computing};
use crate::cli::args::typed::Typed;
use crate::cli::checks::{self, Checked};
use crate::cli::files::destination::Overwrite;
use crate::cli::files::memory;
use crate::cli::jobs::row::{Row, Status};
use crate::cli::list::shard;
use crate::cli::list::{self, BatchArgs, Item, OnExists};
use crate::cli::terminal::interrupt::{EXIT_INTERRUPTED, Interrupt};
use crate::cli::terminal::progress::Progress;
use crate::cli::terminal::{self, Verbosity, advice, words};
use crate::cli::trace;
use crate::error::{Error, Result};
use crate::output::Journal;
use crate::studio::Device;
use crate::vk::Validation;

/// Exit code of a batch in which some pictures failed.
const EXIT_SOME_FAILED: u8 = 3;
/// Time between two looks at signals and progress.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// Evolves the pictures and reports on them; returns the exit code of the process.
pub(crate) fn make(args: &BatchArgs, typed: &Typed) -> ExitCode {
    match run(args, typed) {
        Ok(exit_code) => ExitCode::from(exit_code),
        Err(error) => {
            terminal::error(&advice::sentence(&error));
            ExitCode::from(advice::exit_code(&error))
        }
    }
}

/// The work, in order: find and check, evolve, report.
fn run(args: &BatchArgs, typed: &Typed) -> Result<u8> {
    let verbosity = args.messages.verbosity();
    let validation = if args.validate { Validation::On } else { Validation::Off };
    let computing = args.computing.check(validation)?;
    let shard = args.shard.map(|choice| choice.resolve(|name| std::env::var(name).ok())).transpose()?;
    if args.devices.devices.is_some() && typed.has("device") {
        return Err(Error::Usage("--devices also takes a single device; drop --device".to_owned()));
    }
    // A manifest may come through a pipe that never ends, so signals are heard from here on.
    let items = list::find(args, typed)?;
    let interrupt = Interrupt::listen()?;
    let all = items.len();
    let results = args.results.clone().unwrap_or_else(|| {
        let name = shard.map_or("results.jsonl".to_owned(), |shard| {
            format!("results.{}-of-{}.jsonl", shard.index(), shard.count())
        });
        args.output.join(name)
    });
    // The pictures of other shards count, too.
    let taken = Taken::new(&items, args);
    let items = match shard {
        Some(shard) => {
            let groups: Vec<Option<&str>> = items.iter().map(|item| item.group.as_deref()).collect();
            let numbers = shard::assign(&groups, shard);
            numbers.into_iter().map(|number| items[number].clone()).collect()
        }
        None => items,
    };
    if args.dry_run {
        return print_list(&items, args).map(|()| 0);
    }
    taken.check_results(&results)?;
    let mut journal = places::prepare(args, &items, &results)?;
    let earlier = Earlier::read(&results);
    if verbosity > Verbosity::Quiet && shard.is_some() {
        terminal::say(&format!("smalti: {} of {all} pictures are in this shard", items.len()));
    }
    if verbosity > Verbosity::Quiet {
        say_existing(args.on_exists, &items);
    }
    computing.start_threads()?;
    let begin = |path: &PathBuf| {
        taken.check("--trace", path)?;
        trace::begin_trace(path, &[&results], Overwrite::Refuse)
    };
    let tracer = args.trace.as_ref().map(begin).transpose()?.unwrap_or_default();
    let workers = threads::workers(args, &computing, items.len())?;
    if verbosity > Verbosity::Quiet {
        workers.iter().for_each(|worker| computing::say_device(&worker.device));
    }
    if args.check {
        workers.iter().try_for_each(|worker| check(&worker.device, &computing, &interrupt, args))?;
    }
    workers.iter().for_each(|worker| trace::trace_device(&tracer, &worker.device));
    let pipeline = Pipeline {
        items: &items,
        workers: &workers,
        io_threads: threads::io_threads(args.io_threads, computing.thread_count(), items.len()),
        on_exists: args.on_exists,
        earlier: &earlier,
        shard,
        schedule: &Schedule::new(&items),
        gate: &Gate::new(memory::share_of_free()),
        on_device_lost: computing.on_device_lost,
        interrupt: &interrupt,
        tracer: &tracer,
    };
    let (summary, fatal) = watch(&pipeline, &mut journal, args);
    let traced = interrupt.while_writing(|| tracer.finish());
    if verbosity > Verbosity::Quiet {
        summary.print(&results);
    }
    match fatal {
        Some(error) => Err(error),
        None if traced.is_err() => traced.map(|_| 0),
        None if summary.left() > 0 => Ok(EXIT_INTERRUPTED),
        None if summary.failed() > 0 => Ok(EXIT_SOME_FAILED),
        None => Ok(0),
    }
}

/// Ends the batch before it begins if a device does not give what the CPU gives.
fn check(device: &Device, computing: &Computing, interrupt: &Interrupt, args: &BatchArgs) -> Result<()> {
    if device.is_cpu() {
        return Ok(());
    }
    let progress = Progress::new(args.messages.progress.unless(args.messages.quiet), args.messages.verbosity());
    let uuid = device.vulkan().map(|vulkan| vulkan.info().uuid.clone()).unwrap_or_default();
    let itself = computing.of(format!("uuid:{uuid}").parse()?).select_itself()?;
    let made = checks::run_all(&itself, progress, || interrupt.check())?;
    let wrong: Vec<&Checked> = made.iter().filter(|check| check.outcome.is_wrong()).collect();
    let Some(first) = wrong.first() else { return Ok(()) };
    let detail = first.detail.as_deref().unwrap_or("it is different");
    let reason = format!(
        "{} of {} checks did not come out equal ({}: {detail}); do without this device, as with --device cpu, and \
         report what smalti check prints",
        wrong.len(),
        made.len(),
        first.name
    );
    Err(Error::Vulkan { call: format!("--check of {}", device.label()), reason })
}

/// Says how many outputs are there already, and what becomes of them.
fn say_existing(on_exists: OnExists, items: &[Item]) {
    let outputs = || items.iter().flat_map(|item| &item.outputs);
    let (count, all) = (existing::count(outputs()), outputs().count());
    let rule = match on_exists {
        OnExists::SkipSame => "those of the same options stay, and smalti's others are replaced",
        OnExists::Overwrite => "all of them are replaced",
        OnExists::Skip => "all of them stay",
        OnExists::Error => return,
    };
    if count > 0 {
        let outputs = words::counted(all as u64, "output");
        terminal::say(&format!("smalti: {} of {outputs} are there already: {rule}", HumanCount(count as u64)));
    }
}

/// Runs the pipeline, writes a row for each picture, and shows the progress.
fn watch(pipeline: &Pipeline<'_>, journal: &mut Journal, args: &BatchArgs) -> (Summary, Option<Error>) {
    let mut overseer = Overseer {
        pipeline,
        journal,
        prints_rows: args.json,
        progress: Progress::new(args.messages.progress.unless(args.messages.quiet), args.messages.verbosity()),
        verbosity: args.messages.verbosity(),
        summary: Summary::begin(pipeline.items.len()),
        fatal: None,
    };
    std::thread::scope(|scope| overseer.run(&pipeline.start(scope)));
    overseer.progress.finish();
    (overseer.summary, overseer.fatal)
}

/// Receives the reports of all threads, writes the rows, and shows the progress.
struct Overseer<'a> {
    pipeline: &'a Pipeline<'a>,
    journal: &'a mut Journal,
    prints_rows: bool,
    progress: Progress,
    verbosity: Verbosity,
    summary: Summary,
    fatal: Option<Error>,
}

impl Overseer<'_> {
    fn run(&mut self, reports: &Receiver<Report>) {
        loop {
            match reports.recv_timeout(LOOK_INTERVAL) {
                Ok(Report::Row(row)) => self.note(&row),
                Ok(Report::Warning(warning)) if self.verbosity > Verbosity::Quiet => {
                    self.progress.say(&format!("smalti: {warning}"));
                }
                Ok(Report::Replaced) => self.summary.replaced += 1,
                Ok(Report::Warning(_)) | Err(RecvTimeoutError::Timeout) => {}
                Ok(Report::Fatal(error)) => self.end_with(error),
                Err(RecvTimeoutError::Disconnected) => return,
            }
            if self.pipeline.interrupt.is_requested() {
                self.pipeline.schedule.end();
            }
            let standing = self.summary.standing();
            if self.progress.is_due(standing.elapsed) {
                self.progress.show(&standing);
            }
        }
    }

    /// Ends the batch as a signal would; the first reason counts.
    fn end_with(&mut self, error: Error) {
        self.fatal.get_or_insert(error);
        self.pipeline.interrupt.request();
        self.pipeline.schedule.end();
    }

    /// Notes the outcome of a picture, and tells the schedule, so that pictures that waited for it can begin or fail.
    fn note(&mut self, row: &Row) {
        if let Some(error) = &row.error {
            self.progress.say(&format!("smalti: {error}"));
        }
        self.summary.note(row);
        let written = serde_json::to_string(row)
            .map_err(|error| Error::Internal(format!("no JSON: {error}")))
            .and_then(|line| self.journal.append(&line))
            .and_then(|()| if self.prints_rows { row.print() } else { Ok(()) });
        if let Err(error) = written {
            self.end_with(error);
        }
        if row.status != Status::Failed {
            return self.pipeline.schedule.note_done(&row.id);
        }
        for number in self.pipeline.schedule.note_failed(&row.id) {
            let item = &self.pipeline.items[number];
            let after = item.after.clone().unwrap_or_default();
            let mut row = self.pipeline.row(item);
            row.note_end();
            row.note_failure(&Error::input(&item.input, format!("comes after {after}, which failed; fix that first")));
            self.note(&row);
        }
    }
}

/// Prints what a dry run found.
fn print_list(items: &[Item], args: &BatchArgs) -> Result<()> {
    for item in items {
        let outputs: Vec<String> = item.outputs.iter().map(|output| output.path.display().to_string()).collect();
        terminal::say(&format!("{} -> {}", item.input.display(), outputs.join(", ")));
        if args.json {
            let mut row = Row::new(&item.input, item.seed(), item.scheme());
            (row.id, row.status, row.output) = (item.id.clone(), Status::Planned, outputs);
            row.print()?;
        }
    }
    terminal::say(&words::counted(items.len() as u64, "picture"));
    Ok(())
}
