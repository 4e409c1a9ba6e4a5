//! `smalti video`: turns a sequence of pictures into a sequence of mosaics whose tiles move instead of flickering.
//!
//! Each frame is evolved from the population of the one before. Populations are kept, so the same command continues
//! where an earlier one was interrupted. A shot can be made alone, since its frames depend on nothing before it.

mod extract;
mod film;
mod frame;
mod input;
mod options;
mod plan;
mod rhythm;
mod show;
mod store;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use self::film::Sequence;
use self::frame::Shooter;
pub(crate) use self::options::VideoArgs;
use self::options::VideoOptions;
use self::plan::Planned;
use self::show::{FrameRow, Totals, Watcher};
use self::store::Store;
use crate::cli::args::computing;
use crate::cli::files::places::{Inputs, place_of};
use crate::cli::jobs::row::{Row, Status};
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::progress::Progress;
use crate::cli::terminal::{self, Verbosity, advice};
use crate::cli::{film as animation, trace};
use crate::error::{Error, Result, in_words};

/// Makes the frames and reports on them; returns the exit code of the process.
pub(crate) fn make(args: &VideoArgs) -> ExitCode {
    if args.shots {
        return terminal::exit_code(VideoOptions::new(args).and_then(|options| print_shots(&options, args.json)));
    }
    let mut totals = Totals { id: "total", status: "failed", ..Totals::default() };
    let done = VideoOptions::new(args).and_then(|options| shoot_traced(options, args, &mut totals));
    if let Err(error) = &done {
        totals.error = Some(advice::sentence(error));
        totals.status = if matches!(error, Error::Interrupted) { "partial" } else { "failed" };
        terminal::error(&advice::sentence(error));
    }
    let printed = if args.json { terminal::print_json(&totals) } else { Ok(()) };
    if let Err(error) = &printed {
        terminal::error(&advice::sentence(error));
    }
    match done.and(printed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => ExitCode::from(advice::exit_code(&error)),
    }
}

fn print_shots(options: &VideoOptions, is_json: bool) -> Result<()> {
    let interrupt = Interrupt::listen()?;
    options.computing.start_threads()?;
    let folder = tempfile::tempdir().map_err(|error| {
        Error::Internal(format!("there is no place for temporary files, since {}", in_words(&error)))
    })?;
    let frames = input::find(options, &folder.path().join("input"), &interrupt)?;
    plan::print_shots(&plan::plan(options, &frames.paths, &interrupt)?, is_json)
}

/// As [`shoot_all`], and writes the trace if one was asked for.
fn shoot_traced(mut options: VideoOptions, args: &VideoArgs, totals: &mut Totals) -> Result<()> {
    if let Some(path) = &args.trace {
        let taken: Vec<&Path> = options.inputs.iter().chain(&args.outputs).map(PathBuf::as_path).collect();
        options.pictures.tracer = trace::begin_trace(path, &taken, options.overwrite)?;
    }
    if let failure @ Err(_) = shoot_all(&options, args, totals) {
        options.pictures.tracer.discard();
        return failure;
    }
    if options.pictures.tracer.is_on() { options.pictures.tracer.finish().map(|_| ()) } else { Ok(()) }
}

/// The work, in order: find and read the frames, check which exist, make the missing ones, make the animations.
fn shoot_all(options: &VideoOptions, args: &VideoArgs, totals: &mut Totals) -> Result<()> {
    let interrupt = Interrupt::listen()?;
    options.computing.start_threads()?;
    let given = Inputs::new(options.inputs.iter().map(PathBuf::as_path).chain(options.pictures.settings.files_read()));
    animation::check_writable(&options.films, &given)?;
    let store = Store::new(options);
    let frames = input::find(options, &options.populations.join("input"), &interrupt)?;
    check_places(options, &frames.paths)?;
    let inputs = Inputs::new(frames.paths.iter().map(PathBuf::as_path).chain(options.pictures.settings.files_read()));
    inputs.refuse(options.films.iter().map(|film| film.path.as_path()).chain(args.trace.as_deref()))?;
    let device = options.computing.select()?;
    trace::trace_device(&options.pictures.tracer, &device);
    if options.pictures.verbosity > Verbosity::Quiet {
        computing::say_device(&device);
    }
    let planned = plan::plan(options, &frames.paths, &interrupt)?;
    for frame in &planned {
        inputs.refuse(store.destinations(frame.number)?.iter().map(|output| output.path.as_path()))?;
    }
    store.check(&planned)?;
    let sequence = Sequence { planned: &planned, input_frames_per_s: frames.frames_per_s };
    film::check_replaceable(options, sequence)?;
    store.create()?;
    totals.frames_planned = planned.len();
    totals.shots = planned.chunk_by(|one, other| one.shot == other.shot).count();

    let mut shooter = Shooter::open(options, &planned, &store, &device, &interrupt)?;
    let mut watcher =
        Watcher::begin(&interrupt, Progress::new(options.progress, options.pictures.verbosity), planned.len());
    let made = planned.iter().try_for_each(|frame| {
        interrupt.check()?;
        watcher.evals = frame.evals;
        let Made { mut row, is_kept } = make_frame(&mut shooter, &store, frame, &mut watcher)?;
        row.note_end();
        let row = FrameRow { row: &row, frame: frame.number, begin: frame.begin, shot: frame.shot, is_kept };
        totals.note(&row);
        if args.json { terminal::print_json(&row) } else { Ok(()) }
    });
    watcher.finish();
    totals.wall_ms = terminal::milliseconds(watcher.elapsed());
    made?;
    drop(shooter);
    totals.output = film::make(options, sequence, &store, &device, &interrupt)?;
    totals.status = "complete";
    totals.wall_ms = terminal::milliseconds(watcher.elapsed());
    if options.pictures.verbosity > Verbosity::Quiet {
        totals.say(&planned, options.folder.as_ref().map(|folder| folder.display().to_string()));
    }
    Ok(())
}

/// A frame whose files are all there.
struct Made {
    row: Row,
    /// Whether it was complete already.
    is_kept: bool,
}

/// Makes one frame, or the files that it lacks.
fn make_frame(shooter: &mut Shooter<'_>, store: &Store, frame: &Planned, watcher: &mut Watcher<'_>) -> Result<Made> {
    let is_whole = store.whole_population(frame).is_some();
    let is_kept = is_whole && store.has_picture(frame)?;
    let mut row = if is_whole {
        shooter.redraw(frame, watcher)?
    } else {
        let row = shooter.shoot(frame, watcher)?;
        watcher.evolved += 1;
        row
    };
    watcher.done += 1;
    row.status = Status::Complete;
    if row.output.is_empty() {
        row.output = store.destinations(frame.number)?.iter().map(|one| one.path.display().to_string()).collect();
    }
    Ok(Made { row, is_kept })
}

/// Refuses to write frames into the folder that frames are read from.
fn check_places(options: &VideoOptions, inputs: &[PathBuf]) -> Result<()> {
    let places = options.folder.iter().chain([&options.populations]).map(|folder| place_of(folder));
    let places: Vec<_> = places.collect();
    let of_input = inputs.iter().filter_map(|input| input.parent()).map(|folder| {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        place_of(folder)
    });
    match of_input.into_iter().find(|folder| places.contains(folder)) {
        Some(folder) => {
            Err(Error::Usage(format!("{} holds the frames that are read; name another folder", folder.display())))
        }
        None => Ok(()),
    }
}
