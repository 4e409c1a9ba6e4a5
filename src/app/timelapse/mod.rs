//! `smalti timelapse`: from the snapshots of an evolution to animations.
//!
//! Frames are drawn one after the other and handed to all outputs at once; each output encodes in a thread of its own.

mod ffmpeg;
mod film;
mod frames;
mod options;
mod provenance;

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use indicatif::HumanCount;
use serde_json::json;

use self::film::Film;
use self::options::TimelapseOptions;
use super::device::Opened;
use super::interrupt::{EXIT_INTERRUPTED, Interrupt};
use super::progress::{Progress, Stage, short_time};
use super::snapshots::{self, Snapshot};
use super::{memory, outputs, report};
use crate::archive;
use crate::error::{Error, Result};
use crate::model::{Canvas, Evaluator, MaskSet, Mosaic, Population, Rgb, Scene, Target};

pub(super) use self::options::TimelapseArgs;

/// Frames that may wait to be encoded by each output.
const QUEUE_LENGTH: usize = 1;

/// How the work ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Complete,
    Interrupted,
}

/// What every frame is drawn by.
struct Studio {
    evaluator: Box<dyn Evaluator>,
    /// The population's size.
    size_px: (u32, u32),
    canvas: Canvas,
    supersampling: u32,
    background: Option<Rgb>,
}

/// Makes animations and says so; the exit code of the process.
pub(super) fn make(args: &TimelapseArgs) -> ExitCode {
    match TimelapseOptions::new(args).and_then(|options| animate(&options)) {
        Ok(End::Complete) => ExitCode::SUCCESS,
        Ok(End::Interrupted) => {
            report::error("interrupted, and no animation was written; run the same command again");
            ExitCode::from(EXIT_INTERRUPTED)
        }
        Err(error) => {
            report::error(&error.to_string());
            ExitCode::from(error.exit_code())
        }
    }
}

/// The work, in order: check, open every output, draw and encode, give the files their names.
fn animate(options: &TimelapseOptions) -> Result<End> {
    let interrupt = Interrupt::listen()?;
    options.computing.start_threads()?;
    let snapshots = snapshots::list(&options.folder)?;
    let chosen = frames::choose(&snapshots, options.spacing, options.frame_count);
    let snapshots: Vec<&Snapshot> = chosen.into_iter().map(|index| &snapshots[index]).collect();
    options.check_outputs()?;
    let first = archive::read(&snapshots[0].path)?.population;
    let mut studio = Studio::open(options, &first)?;
    let timing = options.timing(snapshots.len());
    let provenance = provenance::of_animation(options, &snapshots, studio.canvas)?;
    for output in &options.outputs {
        provenance::check_replaceable(&output.path, &provenance.key, options.overwrite)?;
    }
    let open = |output| Film::open(output, &studio.canvas, timing, &provenance);
    let films = options.outputs.iter().map(open).collect::<Result<Vec<_>>>()?;

    let progress = Progress::new(options.progress);
    let (end, films) = shoot(films, &snapshots, &mut studio, &interrupt, progress)?;
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
        say_written(&paths, snapshots.len(), &studio.canvas, options);
    }
    written.into_iter().collect::<Result<()>>().map(|()| End::Complete)
}

fn say_written(paths: &[String], frame_count: usize, canvas: &Canvas, options: &TimelapseOptions) {
    let timing = options.timing(frame_count);
    let seconds = (frame_count - 1) as f64 / f64::from(timing.frames_per_s) + f64::from(timing.last_cs) / 100.0;
    let frames = if frame_count == 1 { "frame" } else { "frames" };
    let (width_px, height_px) = (canvas.width_px, canvas.height_px);
    report::say(&format!(
        "wrote {}: {frame_count} {frames} of {width_px}x{height_px} px, {seconds:.1} s",
        paths.join(", ")
    ));
}

/// Draws the snapshots and gives each to all films, which are returned with what became of them.
///
/// # Errors
/// If a snapshot cannot be read or drawn. A film that fails is left behind, and the others go on.
fn shoot(
    films: Vec<Film>,
    snapshots: &[&Snapshot],
    studio: &mut Studio,
    interrupt: &Interrupt,
    mut progress: Progress,
) -> Result<(End, Vec<Result<Film>>)> {
    std::thread::scope(|scope| {
        let mut feeds = Vec::new();
        let workers: Vec<_> = films
            .into_iter()
            .map(|mut film| {
                let (feed, frames) = sync_channel::<Arc<Mosaic>>(QUEUE_LENGTH);
                feeds.push(feed);
                scope.spawn(move || frames.into_iter().try_for_each(|frame| film.add(&frame)).map(|()| film))
            })
            .collect();
        let drawn = draw(feeds, snapshots, studio, interrupt, &mut progress);
        progress.finish();
        let ended = || Err(Error::Internal("a thread that encodes ended".to_owned()));
        let films = workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| ended())).collect();
        drawn.map(|end| (end, films))
    })
}

/// Draws the snapshots into the feeds; that they are dropped at the end lets their workers end.
fn draw(
    mut feeds: Vec<SyncSender<Arc<Mosaic>>>,
    snapshots: &[&Snapshot],
    studio: &mut Studio,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Result<End> {
    let began = Instant::now();
    for (done, snapshot) in snapshots.iter().enumerate() {
        if interrupt.is_requested() {
            return Ok(End::Interrupted);
        }
        let frame = Arc::new(studio.draw(snapshot)?);
        feeds.retain(|feed| feed.send(Arc::clone(&frame)).is_ok());
        if feeds.is_empty() {
            break;
        }
        let standing = Standing { elapsed: began.elapsed(), frames: done + 1, frame_count: snapshots.len() };
        if progress.is_due(standing.elapsed) {
            progress.show(&standing);
        }
    }
    // A Ctrl-C during the last frame, too, was meant to end this.
    Ok(if interrupt.is_requested() { End::Interrupted } else { End::Complete })
}

impl Studio {
    /// Opens the device for populations like `first`.
    fn open(options: &TimelapseOptions, first: &Population) -> Result<Self> {
        let (width_px, height_px) = (first.width_px, first.height_px);
        let evolved_px = width_px.max(height_px);
        let canvas = options.long_side_px.map_or(Canvas::evaluation(width_px, height_px), |long| {
            if long == evolved_px {
                Canvas::evaluation(width_px, height_px)
            } else {
                Canvas::scaled(width_px, height_px, long)
            }
        });
        let is_resized = canvas != Canvas::evaluation(width_px, height_px);
        let long_side_px = canvas.width_px.max(canvas.height_px);
        let pixel_count = u64::from(canvas.width_px) * u64::from(canvas.height_px);
        // Each output holds the frame before, the changes to it, and what waits.
        let held = pixel_count.saturating_mul(1 + 2 * options.outputs.len() as u64);
        memory::check(memory::estimate_bytes(0, first.flies.len(), held))?;
        let selected = options.computing.select()?;
        // Nothing is evaluated, and an evaluator has at least one lane.
        let target = Arc::new(Target::new(1, 1, vec![[0; 3]])?);
        let scene = Scene { target, masks: Arc::new(MaskSet::default()), background: [0; 3], fly_count: 1 };
        let Opened { evaluator, .. } = selected.open(vec![scene])?;
        Ok(Self {
            evaluator,
            size_px: (width_px, height_px),
            canvas,
            supersampling: if is_resized { outputs::usual_supersampling(long_side_px, evolved_px) } else { 1 },
            background: options.background,
        })
    }

    /// The frame of a snapshot.
    fn draw(&mut self, snapshot: &Snapshot) -> Result<Mosaic> {
        let mut population = archive::read(&snapshot.path)?.population;
        if (population.width_px, population.height_px) != self.size_px {
            return Err(Error::input(&snapshot.path, "is of another size than the first snapshot; remove it"));
        }
        // Films have no alpha.
        population.background = self.background.unwrap_or(population.background.color()).into();
        self.evaluator.draw(&population, &self.canvas, self.supersampling)
    }
}

/// Where the drawing stands.
struct Standing {
    elapsed: Duration,
    frames: usize,
    frame_count: usize,
}

impl Standing {
    fn eta_s(&self) -> f64 {
        self.elapsed.as_secs_f64() / self.frames as f64 * (self.frame_count - self.frames) as f64
    }
}

impl Stage for Standing {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.frames as f64 / self.frame_count as f64
    }

    fn line(&self) -> String {
        let count = |frames: usize| HumanCount(frames as u64);
        format!("{}/{} frames, {} left", count(self.frames), count(self.frame_count), short_time(self.eta_s()))
    }

    fn json_line(&self) -> String {
        let rounded = |value: f64| (value * 10.0).round() / 10.0;
        json!({
            "frames": self.frames,
            "frame_count": self.frame_count,
            "elapsed_s": rounded(self.elapsed.as_secs_f64()),
            "eta_s": rounded(self.eta_s()),
        })
        .to_string()
    }
}
