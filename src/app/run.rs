//! `smalti evolve`: from options to written files.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use super::cli::EvolveArgs;
use super::curve_file::CurveFile;
use super::destination::Destination;
use super::device::Selected;
use super::inside::{self, Capture, CaptureRange, InsideArgs};
use super::interrupt::Interrupt;
use super::job::Job;
use super::options::{EvolveOptions, Mode, SchemeOptions, Verbosity, scheme_name};
use super::prepared::Prepared;
use super::provenance::{Ending, Provenances};
use super::recorder::Recorder;
use super::report::{self, Row, Status};
use super::result::Evolved;
use super::watch::Watchers;
use super::{advice, curve_file, destination, outputs, provenance, result};
use crate::error::Result;

/// Evolves one picture and reports about it; the exit code of the process.
pub(super) fn evolve(args: &EvolveArgs) -> ExitCode {
    let mut row = Row::new(&args.input, args.picture.seed, scheme_name(&args.picture));
    let done = EvolveOptions::new(args).and_then(|options| evolve_watched(options, &args.inside, &mut row));
    if let Err(error) = &done {
        row.note_failure(error);
        report::error(&advice::sentence(error));
    }
    let printed = if args.json { row.print() } else { Ok(()) };
    if let Err(error) = &printed {
        report::error(&advice::sentence(error));
    }
    match done.and(printed) {
        Ok(()) => ExitCode::from(row.exit_code()),
        Err(error) => ExitCode::from(advice::exit_code(&error)),
    }
}

/// As [`evolve_picture`], and writes the trace if one was asked for.
fn evolve_watched(mut options: EvolveOptions, inside: &InsideArgs, row: &mut Row) -> Result<()> {
    let interrupt = Interrupt::listen()?;
    if let (Some(path), Mode::Work) = (&inside.trace, options.mode) {
        let written = options.destinations().map(|destination| &destination.path);
        let taken = written.chain(options.curves.iter().map(|file| &file.path)).chain(&options.init);
        let taken: Vec<&Path> = taken.map(PathBuf::as_path).chain(options.picture_inputs()).collect();
        options.tracer = inside::begin_trace(path, &taken, options.overwrite)?;
    }
    evolve_picture(&options, inside.capture, &interrupt, row)?;
    let Some(path) = inside.trace.as_ref().filter(|_| options.tracer.is_on()) else { return Ok(()) };
    let events = interrupt.while_writing(|| options.tracer.finish())?;
    row.output.push(path.display().to_string());
    if options.verbosity > Verbosity::Quiet {
        report::say(&format!("smalti: {} has {events} events; ui.perfetto.dev shows them", path.display()));
    }
    Ok(())
}

/// The work, in order: check, read, evolve and draw, encode and write.
fn evolve_picture(
    options: &EvolveOptions,
    capture: Option<CaptureRange>,
    interrupt: &Interrupt,
    row: &mut Row,
) -> Result<()> {
    options.computing.start_threads()?;
    let inputs = options.picture_inputs();
    destination::check_writable(options.destinations(), &inputs)?;
    curve_file::check_writable(&options.curves, options.destinations(), &inputs)?;
    let written = options.destinations().map(|destination| &destination.path);
    let mut written = written.chain(options.curves.iter().map(|file| &file.path)).map(PathBuf::as_path);
    options.save_run.iter().try_for_each(|save_run| save_run.check_place(&mut written, &inputs))?;
    let selected = {
        let _span = options.tracer.span("open device");
        options.computing.select()?
    };
    inside::trace_device(&options.tracer, &selected);
    let capture = capture.map(|range| inside::begin_capture(range, &selected)).transpose()?;
    row.device = Some(selected.label().to_owned());

    let prepared = Prepared::load(options, row)?;
    prepared.check_memory()?;
    let Prepared { job, provenances, memory_bytes } = &prepared;
    if options.verbosity > Verbosity::Quiet {
        say_notes(job, options, &selected);
    }
    check_replaceable(options, provenances)?;
    if options.mode == Mode::DryRun {
        row.status = Status::Planned;
        let paths = options.destinations().map(|destination| &destination.path);
        let paths = paths.chain(options.curves.iter().map(|file| &file.path));
        let paths = paths.chain(options.save_run.iter().map(|save_run| &save_run.folder));
        row.output = paths.map(|path| path.display().to_string()).collect();
        report::print_plan(row, options, job, *memory_bytes);
        return Ok(());
    }

    let recorder = begin_record(options, job, provenances)?;
    let mut watchers = Watchers { interrupt, recorder };
    let Evolved { ending, drawn, curve } = prepared.evolve(options, &selected, &mut watchers, row)?;
    let recorder = watchers.recorder;
    let began = Instant::now();
    let status = ending.status;
    let outputs = outputs_to_write(options, provenances, &ending);
    let encoding = options.tracer.span("encode");
    let mut files = outputs::encode(&outputs, drawn, &provenances.told(&ending))?;
    files.extend(result::encode_target(options, job, &provenances.target)?);
    drop(encoding);
    let writing = options.tracer.span("write");
    let written = outputs::write(&files, interrupt, &mut row.output);
    let curve_written = curve.map_or(Ok(()), |curve| {
        let told = (provenances.population.key(), &ending);
        let files = curves_to_write(options, told);
        curve_file::write(&files, (&*curve, row.id.as_str()), told, interrupt, &mut row.output)
    });
    drop(writing);
    written.and(curve_written)?;
    // A broken record of the course is no reason to lose its result.
    row.output.extend(recorder.map(Recorder::outcome).transpose()?);
    capture.map_or(Ok(()), |capture| note_capture(&capture, options, row))?;
    row.save_ms = report::milliseconds(began.elapsed());
    row.status = status;
    if options.verbosity > Verbosity::Quiet {
        report::print_summary(row, options, job);
    }
    Ok(())
}

/// Tells where the capture is.
fn note_capture(capture: &Capture, options: &EvolveOptions, row: &mut Row) -> Result<()> {
    let (path, what) = capture.outcome()?;
    row.output.push(path.display().to_string());
    if options.verbosity > Verbosity::Quiet {
        report::say(&format!("smalti: {} holds {what}; qrenderdoc opens it", path.display()));
    }
    Ok(())
}

/// Begins to keep snapshots, if they were asked for.
fn begin_record(options: &EvolveOptions, job: &Job, provenances: &Provenances) -> Result<Option<Recorder>> {
    let Some(save_run) = &options.save_run else { return Ok(None) };
    let evals_planned = match &job.scheme {
        SchemeOptions::Paper(scheme) => scheme.births.saturating_mul(u64::from(scheme.restarts) + 1),
        SchemeOptions::Cells(cells) => cells.budget(job.fly_count).evals,
    };
    let told = provenance::without_header(provenances.population.describe(None));
    Recorder::begin(save_run, evals_planned, job.population(Vec::new()), told).map(Some)
}

/// Refuses to replace files that are not what this command would write.
fn check_replaceable(options: &EvolveOptions, provenances: &Provenances) -> Result<()> {
    let outputs = options.outputs.iter().map(|output| (output, provenances.of_output(output).key()));
    let targets = options.save_target.iter().map(|output| (output, provenances.target.key()));
    outputs
        .chain(targets)
        .try_for_each(|(output, key)| destination::check_replaceable(output, key, options.overwrite))?;
    let key = provenances.population.key();
    options.curves.iter().try_for_each(|file| file.check_replaceable(key, options.overwrite))?;
    options.save_run.iter().try_for_each(|save_run| save_run.check(key, options.overwrite))
}

/// The outputs without those that hold a better result of the same command.
fn outputs_to_write<'a>(
    options: &'a EvolveOptions,
    provenances: &Provenances,
    ending: &Ending,
) -> Vec<&'a Destination> {
    let (kept, outputs): (Vec<_>, Vec<_>) = options.outputs.iter().partition(|output| {
        destination::should_keep(output, provenances.of_output(output).key(), ending, options.overwrite)
    });
    kept.iter().for_each(|output| say_kept(options, &output.path));
    outputs
}

/// The files of the curve without those that hold a better one of the same command.
fn curves_to_write<'a>(options: &'a EvolveOptions, (key, ending): (&str, &Ending)) -> Vec<&'a CurveFile> {
    let (kept, curves): (Vec<_>, Vec<_>) =
        options.curves.iter().partition(|file| file.should_keep(key, ending, options.overwrite));
    kept.iter().for_each(|file| say_kept(options, &file.path));
    curves
}

fn say_kept(options: &EvolveOptions, path: &Path) {
    if options.verbosity > Verbosity::Quiet {
        let path = path.display();
        report::say(&format!("smalti: {path} is kept: the same command got farther when it wrote it"));
    }
}

/// Says what somebody should know before the work begins.
fn say_notes(job: &Job, options: &EvolveOptions, selected: &Selected) {
    for warning in &job.warnings {
        report::say(&format!("smalti: {}: {warning}", options.input.display()));
    }
    report::say_device(selected);
}
