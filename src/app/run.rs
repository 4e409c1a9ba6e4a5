//! `smalti evolve`: from options to written files.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use super::cli::EvolveArgs;
use super::curve::Curve;
use super::curve_file::{CurveFile, Tabled};
use super::destination::Destination;
use super::device::{Opened, Selected};
use super::interrupt::Interrupt;
use super::job::Job;
use super::options::{EvolveOptions, Mode, SchemeOptions, Verbosity, scheme_name};
use super::progress::Progress;
use super::provenance::{Ending, Provenances};
use super::recorder::Recorder;
use super::report::{self, Row, Status};
use super::result::Evolved;
use super::watch::{Watch, Watchers};
use super::{cells, curve_file, destination, memory, outputs, provenance, result, scheme};
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::evolve::{Evolution, PaperScheme, Spread};
use crate::model::Canvas;
use crate::vk::ValidationLog;

/// Evolves one picture and reports about it; the exit code of the process.
pub(super) fn evolve(args: &EvolveArgs) -> ExitCode {
    let mut row = Row::new(&args.input, args.picture.seed, scheme_name(&args.picture));
    let done = EvolveOptions::new(args).and_then(|options| evolve_picture(&options, &mut row));
    if let Err(error) = &done {
        row.note_failure(error);
        report::error(&error.to_string());
    }
    let printed = if args.json { row.print() } else { Ok(()) };
    if let Err(error) = &printed {
        report::error(&error.to_string());
    }
    match done.and(printed) {
        Ok(()) => ExitCode::from(row.exit_code()),
        Err(error) => ExitCode::from(error.exit_code()),
    }
}

/// The work, in order: check, read, evolve and draw, encode and write.
fn evolve_picture(options: &EvolveOptions, row: &mut Row) -> Result<()> {
    let interrupt = Interrupt::listen()?;
    options.computing.start_threads()?;
    let inputs = options.picture_inputs();
    destination::check_writable(options.destinations(), &inputs)?;
    curve_file::check_writable(&options.curves, options.destinations(), &inputs)?;
    let written = options.destinations().map(|destination| &destination.path);
    let mut written = written.chain(options.curves.iter().map(|file| &file.path)).map(PathBuf::as_path);
    options.save_run.iter().try_for_each(|save_run| save_run.check_place(&mut written, &inputs))?;
    let selected = options.computing.select()?;
    row.device = Some(selected.label().to_owned());

    let began = Instant::now();
    let job = Job::load(options)?;
    row.load_ms = report::milliseconds(began.elapsed());
    row.tiles = Some(job.fly_count);
    if options.verbosity > Verbosity::Quiet {
        say_notes(&job, options, &selected);
    }
    let resized_px = result::resized_px(options, job.target.width_px(), job.target.height_px());
    let provenances = Provenances::new(options, &job, resized_px);
    row.key = Some(provenances.of_row(options).key().to_owned());
    let memory_bytes = check_job(options, &job)?;
    check_replaceable(options, &provenances)?;
    if options.mode == Mode::DryRun {
        row.status = Status::Planned;
        let paths = options.destinations().map(|destination| &destination.path);
        let paths = paths.chain(options.curves.iter().map(|file| &file.path));
        let paths = paths.chain(options.save_run.iter().map(|save_run| &save_run.folder));
        row.output = paths.map(|path| path.display().to_string()).collect();
        report::print_plan(row, options, &job, memory_bytes);
        return Ok(());
    }

    let recorder = begin_record(options, &job, &provenances)?;
    let mut watchers = Watchers { interrupt: &interrupt, recorder };
    let Evolved { ending, drawn, curve } = match &job.scheme {
        SchemeOptions::Paper(scheme) => evolve_job(options, &job, (scheme, &selected), &mut watchers, row),
        SchemeOptions::Cells(cells) => cells::search_job(options, &job, (cells, &selected), &mut watchers, row),
    }?;
    let recorder = watchers.recorder;
    let began = Instant::now();
    let status = ending.status;
    let outputs = outputs_to_write(options, &provenances, &ending);
    let mut files = outputs::encode(&outputs, drawn, &provenances.told(&ending))?;
    files.extend(result::encode_target(options, &job, &provenances.target)?);
    let written = outputs::write(&files, &interrupt, &mut row.output);
    let curve_written = curve.map_or(Ok(()), |curve| {
        let told = (provenances.population.key(), &ending);
        let files = curves_to_write(options, told);
        curve_file::write(&files, (&*curve, row.id.as_str()), told, &interrupt, &mut row.output)
    });
    written.and(curve_written)?;
    // A broken record of the course is no reason to lose its result.
    row.output.extend(recorder.map(Recorder::outcome).transpose()?);
    row.save_ms = report::milliseconds(began.elapsed());
    row.status = status;
    if options.verbosity > Verbosity::Quiet {
        report::print_summary(row, options, &job);
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

/// Checks what depends on the picture's size; returns about how many bytes the work needs.
fn check_job(options: &EvolveOptions, job: &Job) -> Result<u64> {
    let (width_px, height_px) = (job.target.width_px(), job.target.height_px());
    let pixel_count = u64::from(width_px) * u64::from(height_px);
    let search_bytes = match &job.scheme {
        SchemeOptions::Cells(_) => memory::search_bytes(pixel_count, job.masks().blend()),
        SchemeOptions::Paper(scheme) => scheme::check_fly_count(scheme, job.fly_count).map(|()| 0)?,
    };
    let output = options.output_long_side_px.map(|long| Canvas::scaled(width_px, height_px, long));
    let output_pixel_count =
        output.map_or(pixel_count, |canvas| u64::from(canvas.width_px) * u64::from(canvas.height_px));
    let written = output.map_or((width_px, height_px), |canvas| (canvas.width_px, canvas.height_px));
    destination::check_fits_formats(&options.outputs, written)?;
    let list_bytes = job.init.as_ref().map_or(0, memory::list_bytes);
    let needed_bytes = memory::estimate_bytes(
        pixel_count,
        job.fly_count,
        output_pixel_count * destination::memory_weight(&options.outputs),
    )
    .saturating_add(list_bytes)
    .saturating_add(search_bytes);
    memory::check(needed_bytes)?;
    Ok(needed_bytes)
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

/// Evolves the job by the paper's scheme, records its curve if one is asked for, and draws its best population; the device
/// is closed before it returns.
fn evolve_job(
    options: &EvolveOptions,
    job: &Job,
    (scheme, selected): (&PaperScheme, &Selected),
    watchers: &mut Watchers<'_>,
    row: &mut Row,
) -> Result<Evolved> {
    let mut curve = (!options.curves.is_empty()).then(|| Curve::new(0));
    let Opened { evaluator, validation_log } = selected.open(vec![job.scene()])?;
    let (width_px, height_px) = (job.target.width_px(), job.target.height_px());
    let evolution = Evolution::new(scheme.clone(), 0, width_px, height_px, job.first_flies(scheme));
    let mut engine = Engine::new(evaluator, vec![evolution]);
    let mut watch = Watch::begin(watchers, options.time_limit, Progress::new(options.progress));
    let ran = engine.run(&mut (&mut watch, &mut curve));
    if let Some(curve) = &mut curve {
        curve.finish(engine.evolutions());
    }
    row.evolve_ms = report::milliseconds(watch.finish(&engine.evolutions()[0]));
    ran?;
    let evolution = &engine.evolutions()[0];
    row.note_evolution(evolution);
    row.spread = Spread::of(evolution.best_flies(), width_px, height_px).clark_evans;
    let ending = Ending::of(evolution);
    let population = job.population(evolution.best_flies().to_vec());
    let evaluation = engine.evaluator().evaluation(0);
    let (scored, marginal) = (evaluation.sae, evaluation.marginal.to_vec());
    if scored != ending.sae {
        let sentence = format!("the best population had an SAE of {} and is evaluated to {scored}", ending.sae);
        return Err(Error::Internal(sentence));
    }
    let (drawn, psnr) = result::draw(engine.evaluator(), options, (population, marginal), ending.sae)?;
    row.psnr = psnr;
    drop(engine);
    validation_log.map_or(Ok(()), |log| check_messages(&log))?;
    Ok(Evolved { ending, drawn, curve: curve.map(|curve| Box::new(curve) as Box<dyn Tabled>) })
}

/// Turns what the validation layer said into an error.
pub(super) fn check_messages(log: &ValidationLog) -> Result<()> {
    let messages = log.messages();
    let Some(first) = messages.first() else { return Ok(()) };
    let first = first.split_whitespace().collect::<Vec<_>>().join(" ");
    Err(Error::Validation(format!("{first} ({} messages in all)", messages.len())))
}
