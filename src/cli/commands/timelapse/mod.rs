//! `smalti timelapse`: makes animations from the snapshots of an evolution.

mod frames;
mod options;
mod provenance;

use std::path::Path;
use std::process::ExitCode;

pub(crate) use self::options::TimelapseArgs;
use self::options::TimelapseOptions;
use crate::archive;
use crate::cli::files::destination;
use crate::cli::files::places::Inputs;
use crate::cli::files::snapshots::{self, Snapshot};
use crate::cli::film::{self, Camera, End, Film, Shown};
use crate::cli::terminal::interrupt::{EXIT_INTERRUPTED, Interrupt};
use crate::cli::terminal::progress::Progress;
use crate::cli::terminal::{self, Verbosity, advice, words};
use crate::error::Result;
use crate::model::{Backdrop, Canvas};

/// Makes animations and reports them; returns the exit code of the process.
pub(crate) fn make(args: &TimelapseArgs) -> ExitCode {
    match TimelapseOptions::new(args).and_then(|options| animate(&options)) {
        Ok(End::Complete) => ExitCode::SUCCESS,
        Ok(End::Interrupted) => {
            terminal::error("interrupted, and no animation was written; run the same command again");
            ExitCode::from(EXIT_INTERRUPTED)
        }
        Err(error) => {
            terminal::error(&advice::sentence(&error));
            ExitCode::from(advice::exit_code(&error))
        }
    }
}

/// The work, in order: check, open every output, draw and encode, give the files their names.
fn animate(options: &TimelapseOptions) -> Result<End> {
    options.computing.start_threads()?;
    let snapshots = snapshots::list(&options.folder)?;
    let chosen = frames::choose(&snapshots, options.spacing, options.frame_count);
    let inputs = Inputs::new(snapshots.iter().map(|snapshot| snapshot.path.as_path()));
    let snapshots: Vec<&Snapshot> = chosen.into_iter().map(|index| &snapshots[index]).collect();
    film::check_writable(&options.outputs, &inputs)?;
    let first = archive::read(&snapshots[0].path)?.population;
    let interrupt = Interrupt::listen()?;
    let shown =
        Shown { long_side_px: options.long_side_px, background: options.background, film_count: options.outputs.len() };
    let mut camera = Camera::open(shown, &options.computing.select()?, &first)?;
    let has_alpha = options.background.unwrap_or(first.background) == Backdrop::Transparent;
    let frames = camera.frames(options.timing(snapshots.len()), has_alpha);
    let provenance = provenance::of_animation(options, &snapshots, &frames)?;
    for output in &options.outputs {
        film::check_replaceable(&output.path, &provenance.key, options.overwrite)?;
    }
    destination::sweep_beside(options.outputs.iter().map(|output| output.path.as_path()));
    if has_alpha && !options.is_quiet {
        options.outputs.iter().filter(|output| !output.format.has_alpha()).for_each(film::say_shown_over_black);
    }
    let open = |output| Film::open(output, frames, &provenance);
    let films = options.outputs.iter().map(open).collect::<Result<Vec<_>>>()?;

    let paths: Vec<&Path> = snapshots.iter().map(|snapshot| snapshot.path.as_path()).collect();
    let progress = Progress::new(options.progress, Verbosity::Normal);
    let (end, films) = film::shoot(films, &paths, &mut camera, &interrupt, progress)?;
    if end == End::Interrupted {
        return Ok(end);
    }
    let written: Vec<Result<()>> = films
        .into_iter()
        .map(|film| film.and_then(Film::finish).and_then(|file| interrupt.while_writing(|| file.commit())))
        .collect();
    if !options.is_quiet && written.iter().any(Result::is_ok) {
        let paths = options.outputs.iter().zip(&written).filter(|(_, written)| written.is_ok());
        let paths: Vec<String> = paths.map(|(output, _)| output.path.display().to_string()).collect();
        say_written(&paths, snapshots.len(), &camera.canvas, options);
    }
    written.into_iter().collect::<Result<()>>().map(|()| End::Complete)
}

fn say_written(paths: &[String], frame_count: usize, canvas: &Canvas, options: &TimelapseOptions) {
    let timing = options.timing(frame_count);
    let seconds = (frame_count - 1) as f64 / f64::from(timing.frames_per_s) + f64::from(timing.last_cs) / 100.0;
    let frames = words::counted(frame_count as u64, "frame");
    let (width_px, height_px) = (canvas.width_px, canvas.height_px);
    terminal::say(&format!("wrote {}: {frames} of {width_px}x{height_px} px, {seconds:.1} s", paths.join(", ")));
}
