//! `smalti batch`: many pictures, one after the other or side by side, and what became of each.

mod crew;
mod existing;
mod gate;
mod items;
mod manifest;
mod name;
mod pipeline;
mod places;
mod queue;
mod schedule;
mod summary;
mod threads;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use clap::Args;

use self::existing::OnExists;
use self::gate::Gate;
use self::items::{Item, Naming};
pub(super) use self::manifest::ManifestRow;
use self::name::NameTemplate;
use self::pipeline::{Pipeline, Told};
use self::places::Taken;
use self::schedule::Schedule;
use self::summary::Summary;
use self::threads::IoThreads;
use super::cli::{Cli, MessageArgs};
use super::computing::{ComputingArgs, DevicesArg};
use super::inputs::{self, Depth, Givers};
use super::inside::{self, Tracer};
use super::interrupt::{EXIT_INTERRUPTED, Interrupt};
use super::options::{EvolveOptions, Overwrite, Verbosity};
use super::picture::PictureArgs;
use super::progress::Progress;
use super::report::{self, Row, Status};
use super::shard::{self, ShardChoice};
use super::{advice, memory, values};
use crate::error::{Error, Result};
use crate::output::Journal;
use crate::vk::Validation;

/// Exit code of a batch of which some pictures failed.
const EXIT_SOME_FAILED: u8 = 3;
/// How often signals and progress are looked at.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

const EXAMPLES: &str = "\
Examples:
  smalti batch photos -o mosaics
  smalti batch photos --recursive -o mosaics --format png,npz --style mosaic --size 256
  smalti batch 'trip/*.jpg' -o mosaics --name '{stem}-{seed}.{ext}' --seed 7
  smalti batch --manifest work.jsonl -o mosaics --shard 2/8
  find . -name '*.jpg' | jq -R '{input: .}' -c | smalti batch --manifest - -o mosaics

Run the same command again to go on where it was interrupted, killed, or failed. A line of a manifest is an object with `input`,
and as it likes `id`, `output`, `seed`, `preset`, `params` (flags without their minuses), `group` and `after`.";

#[derive(Clone, Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct BatchArgs {
    /// Pictures, folders of pictures, and patterns such as 'trip/*.jpg'
    #[arg(value_name = "IN")]
    pub inputs: Vec<PathBuf>,
    /// More pictures, one object of JSON a line; `-` reads stdin
    #[arg(long, value_name = "FILE")]
    pub manifest: Option<PathBuf>,
    /// Also take what lies in folders below those that are named
    #[arg(long)]
    pub recursive: bool,
    /// Do only a part of the batch: k/n is the k-th of n, auto asks the scheduler (Slurm, Kubernetes, Grid Engine, or
    /// SHARD_INDEX and SHARD_COUNT) [default: all]
    #[arg(long, value_name = "k/n|auto", value_parser = shard::parse)]
    pub shard: Option<ShardChoice>,

    /// Folder of the outputs; made if it is not there
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    pub output: PathBuf,
    /// What is written of each picture: png, jpg, webp, svg, ora, npz, json, csv; several with commas
    #[arg(long = "format", value_name = "EXT", value_delimiter = ',', default_value = "png", help_heading = "Output")]
    pub formats: Vec<String>,
    /// Names of the outputs, with {stem} {suffix} {dir} {id} {group} {index} {seed} {ext}
    #[arg(long, value_name = "NAME", value_parser = name::parse, default_value = "{dir}/{stem}.{ext}", help_heading = "Output")]
    pub name: NameTemplate,
    /// What to do about outputs that are there already
    #[arg(long, value_enum, value_name = "WHAT", default_value = "skip-same", help_heading = "Output")]
    pub on_exists: OnExists,
    /// Where a line of JSON is added for every picture [default: results.jsonl in the output folder, or results.K-of-N.jsonl of a
    /// shard]
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub results: Option<PathBuf>,
    /// Only list what would be done; write nothing
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,
    /// Also print the lines of JSON to stdout
    #[arg(long, help_heading = "Output")]
    pub json: bool,

    #[command(flatten)]
    pub picture: PictureArgs,

    /// Pictures that evolve at the same time on a device [default: one for each CPU thread; 256 on a GPU, 16 on software
    /// Vulkan, or as many as its memory holds]
    #[arg(long, value_name = "N", value_parser = values::count, help_heading = "Computing")]
    pub in_flight: Option<u64>,
    /// Threads that read pictures ahead, and that save them [default: half the CPU threads each]
    #[arg(long, value_name = "LOAD:SAVE", value_parser = threads::parse, help_heading = "Computing")]
    pub io_threads: Option<IoThreads>,
    #[command(flatten)]
    pub devices: DevicesArg,
    #[command(flatten)]
    pub computing: ComputingArgs,
    /// Watch every Vulkan call with the validation layer; any message is an error
    #[arg(long, help_heading = "Computing")]
    pub validate: bool,

    /// Also write what threads and devices did when, as JSON for ui.perfetto.dev or chrome://tracing; changes no result
    #[arg(long, value_name = "FILE", help_heading = "Seeing inside")]
    pub trace: Option<PathBuf>,

    #[command(flatten)]
    pub messages: MessageArgs,
}

/// Evolves the pictures and reports about them; the exit code of the process.
pub(super) fn make(args: &BatchArgs, cli: &Cli) -> ExitCode {
    match run(args, cli) {
        Ok(exit_code) => ExitCode::from(exit_code),
        Err(error) => {
            report::error(&advice::sentence(&error));
            ExitCode::from(advice::exit_code(&error))
        }
    }
}

/// The work, in order: find and check, evolve, report.
fn run(args: &BatchArgs, cli: &Cli) -> Result<u8> {
    let interrupt = Interrupt::listen()?;
    let verbosity = args.messages.verbosity();
    let validation = if args.validate { Validation::On } else { Validation::Off };
    let computing = args.computing.check(validation)?;
    let shard = args.shard.map(|choice| choice.resolve(|name| std::env::var(name).ok())).transpose()?;
    if args.devices.devices.is_some() && cli.has_typed("--device") {
        return Err(Error::Usage("--devices names all devices, also a single one; drop --device".to_owned()));
    }
    let items = find(args, cli)?;
    let all = items.len();
    let results = args.results.clone().unwrap_or_else(|| {
        let name = shard.map_or("results.jsonl".to_owned(), |shard| {
            format!("results.{}-of-{}.jsonl", shard.index(), shard.count())
        });
        args.output.join(name)
    });
    // Also of pictures that are in another shard.
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
        return list(&items, args).map(|()| 0);
    }
    taken.check_results(&results)?;
    let mut journal = places::prepare(args, &items, &results)?;
    if verbosity > Verbosity::Quiet && shard.is_some() {
        report::say(&format!("smalti: {} of {all} pictures are in this shard", items.len()));
    }
    computing.start_threads()?;
    let begin = |path: &PathBuf| {
        taken.check("--trace", path)?;
        inside::begin_trace(path, &[&results], Overwrite::Refuse)
    };
    let tracer = args.trace.as_ref().map(begin).transpose()?.unwrap_or_default();
    let workers = threads::workers(args, &computing, items.len())?;
    if verbosity > Verbosity::Quiet {
        workers.iter().for_each(|worker| report::say_device(&worker.selected));
    }
    workers.iter().for_each(|worker| inside::trace_device(&tracer, &worker.selected));
    let pipeline = Pipeline {
        items: &items,
        workers: &workers,
        io_threads: threads::io_threads(args.io_threads, computing.thread_count(), items.len()),
        on_exists: args.on_exists,
        shard,
        schedule: &Schedule::new(&items),
        gate: &Gate::new(memory::share_of_free()),
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

/// Finds the pictures, and gives each its options and outputs.
fn find(args: &BatchArgs, cli: &Cli) -> Result<Vec<Item>> {
    let depth = if args.recursive { Depth::Recursive } else { Depth::Flat };
    let found = inputs::find(&args.inputs, depth, &args.output)?;
    let none = Path::new("-");
    let (manifest, rows) = match &args.manifest {
        Some(path) => (path.as_path(), manifest::read(path)?),
        None => (none, Vec::new()),
    };
    if found.is_empty() && rows.is_empty() {
        let sentence = if args.inputs.is_empty() && args.manifest.is_none() {
            "name pictures, folders or patterns, or a --manifest; see smalti batch --help"
        } else {
            "there is no picture where you said; name other folders, or add --recursive"
        };
        return Err(Error::Usage(sentence.to_owned()));
    }
    let computing = args.computing.check(Validation::Off)?;
    let options_with = |flags: &[String]| -> Result<EvolveOptions> {
        // What concerns single pictures is said in the rows.
        let of_pictures =
            |picture: &PictureArgs| EvolveOptions::of_pictures(picture, computing.clone(), Verbosity::Quiet);
        if flags.is_empty() { of_pictures(&args.picture) } else { of_pictures(&cli.picture_with(flags)?) }
    };
    let formats = check_formats(&args.formats)?;
    let naming = Naming { folder: &args.output, template: &args.name, formats: &formats };
    let items = items::gather(found, (manifest, rows), &options_with, &naming)?;
    let givers = Givers::new(&args.inputs, depth, &args.output);
    for output in items.iter().flat_map(|item| &item.outputs) {
        if let Some(folder) = givers.of(&output.path) {
            return Err(Error::Usage(format!(
                "{} would be taken for a picture of {} by the next run; name an output folder elsewhere or below it",
                output.path.display(),
                folder.display()
            )));
        }
    }
    Ok(items)
}

/// The formats as endings without a dot, each once.
fn check_formats(formats: &[String]) -> Result<Vec<String>> {
    let formats: Vec<String> = formats.iter().map(|format| format.trim_start_matches('.').to_lowercase()).collect();
    let mut seen = HashSet::new();
    if let Some(twice) = formats.iter().find(|format| !seen.insert(format.as_str())) {
        return Err(Error::Usage(format!("--format: {twice} is named twice")));
    }
    Ok(formats)
}

/// A picture of a batch, for plans.
pub(super) struct Planned(Item);

impl Planned {
    /// All that a manifest must say of it.
    pub(super) fn row(&self) -> &ManifestRow {
        &self.0.row
    }

    /// How it would be evolved.
    pub(super) fn options(&self) -> EvolveOptions {
        self.0.options(&Tracer::default())
    }
}

/// The pictures that a batch would evolve.
///
/// # Errors
/// As those of the batch, before it begins.
pub(super) fn planned(args: &BatchArgs, cli: &Cli) -> Result<Vec<Planned>> {
    Ok(find(args, cli)?.into_iter().map(Planned).collect())
}

/// The ids of the pictures of a manifest, in its order.
///
/// # Errors
/// As [`manifest::read`].
pub(super) fn ids(path: &Path) -> Result<Vec<String>> {
    let rows: Vec<ManifestRow> = manifest::read(path)?.into_iter().map(|(_, row)| row).collect();
    items::ids_of_rows(&rows)
}

/// Runs the pipeline, writes a row for each picture, and shows how far it is.
fn watch(pipeline: &Pipeline<'_>, journal: &mut Journal, args: &BatchArgs) -> (Summary, Option<Error>) {
    let mut watch = Watch {
        pipeline,
        journal,
        prints_rows: args.json,
        progress: Progress::new(args.messages.progress.unless(args.messages.quiet)),
        verbosity: args.messages.verbosity(),
        summary: Summary::begin(pipeline.items.len()),
        fatal: None,
    };
    std::thread::scope(|scope| watch.run(&pipeline.start(scope)));
    watch.progress.finish();
    (watch.summary, watch.fatal)
}

struct Watch<'a> {
    pipeline: &'a Pipeline<'a>,
    journal: &'a mut Journal,
    prints_rows: bool,
    progress: Progress,
    verbosity: Verbosity,
    summary: Summary,
    fatal: Option<Error>,
}

impl Watch<'_> {
    fn run(&mut self, told: &Receiver<Told>) {
        loop {
            match told.recv_timeout(LOOK_INTERVAL) {
                Ok(Told::Row(row)) => self.note(&row),
                Ok(Told::Warning(warning)) if self.verbosity > Verbosity::Quiet => {
                    self.progress.say(&format!("smalti: {warning}"));
                }
                Ok(Told::Warning(_)) | Err(RecvTimeoutError::Timeout) => {}
                Ok(Told::Fatal(error)) => self.end_with(error),
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

    /// Takes in what became of a picture, and of those that come after it.
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
            row.note_failure(&Error::input(&item.input, format!("comes after {after}, which failed; mend that first")));
            self.note(&row);
        }
    }
}

/// What a dry run says.
fn list(items: &[Item], args: &BatchArgs) -> Result<()> {
    for item in items {
        let outputs: Vec<String> = item.outputs.iter().map(|output| output.path.display().to_string()).collect();
        report::say(&format!("{} -> {}", item.input.display(), outputs.join(", ")));
        if args.json {
            let mut row = Row::new(&item.input, item.seed(), item.scheme());
            (row.id, row.status, row.output) = (item.id.clone(), Status::Planned, outputs);
            row.print()?;
        }
    }
    report::say(&format!("{} pictures", items.len()));
    Ok(())
}
