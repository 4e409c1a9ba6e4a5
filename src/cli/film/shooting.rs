//! Draws populations from files, one after the other, and hands each frame to all films at once. Each film encodes in
//! its own thread.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use indicatif::HumanCount;
use serde_json::{Map, Value};

use super::Film;
use crate::archive;
use crate::cli::files::memory;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::progress::{Progress, Stage};
use crate::error::{Error, Result};
use crate::model::{Backdrop, Canvas, Mosaic, Painter, Population};
use crate::photo::{Frames, Timing};
use crate::studio::{Device, estimate_bytes, usual_supersampling};
use crate::threads;

/// How many frames may wait for each output's encoder.
const QUEUE_LENGTH: usize = 1;

/// How the work ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    Complete,
    Interrupted,
}

/// How populations are to be shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shown {
    /// Longer side of the frames in px; `None` draws them as evolved.
    pub long_side_px: Option<u32>,
    /// `None` takes the background of the populations, which may be transparent.
    pub background: Option<Backdrop>,
    pub film_count: usize,
}

/// Draws every frame.
pub(crate) struct Camera {
    painter: Box<dyn Painter>,
    /// The population's size.
    size_px: (u32, u32),
    pub canvas: Canvas,
    supersampling: u32,
    background: Option<Backdrop>,
}

/// Draws the populations and gives each frame to all films. Returns each film with its outcome.
///
/// # Errors
/// If a population cannot be read or drawn. If only a film fails, the others go on.
pub(crate) fn shoot(
    films: Vec<Film>,
    paths: &[&Path],
    camera: &mut Camera,
    interrupt: &Interrupt,
    mut progress: Progress,
) -> Result<(End, Vec<Result<Film>>)> {
    std::thread::scope(|scope| {
        let mut feeds = Vec::new();
        let start = |mut film: Film| {
            let (feed, frames) = sync_channel::<Arc<Mosaic>>(QUEUE_LENGTH);
            let encode = move || frames.into_iter().try_for_each(|frame| film.add(&frame)).map(|()| film);
            let worker = threads::spawn_in(scope, encode)?;
            feeds.push(feed);
            Ok(worker)
        };
        // If one cannot be started, the feeds of the others are dropped, which ends them.
        let workers = films.into_iter().map(start).collect::<Result<Vec<_>>>()?;
        let drawn = draw(feeds, paths, camera, interrupt, &mut progress);
        progress.finish();
        let ended = || Err(Error::Internal("a thread that encodes ended".to_owned()));
        let films = workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| ended())).collect();
        drawn.map(|end| (end, films))
    })
}

/// Draws the populations into the feeds. The workers end when the feeds are dropped.
fn draw(
    mut feeds: Vec<SyncSender<Arc<Mosaic>>>,
    paths: &[&Path],
    camera: &mut Camera,
    interrupt: &Interrupt,
    progress: &mut Progress,
) -> Result<End> {
    let began = Instant::now();
    for (done, path) in paths.iter().enumerate() {
        if interrupt.is_requested() {
            return Ok(End::Interrupted);
        }
        let frame = Arc::new(camera.draw(path)?);
        feeds.retain(|feed| feed.send(Arc::clone(&frame)).is_ok());
        if feeds.is_empty() {
            break;
        }
        let standing = FramesDone { elapsed: began.elapsed(), frames: done + 1, frame_count: paths.len() };
        if progress.is_due(standing.elapsed) {
            progress.show(&standing);
        }
    }
    // A Ctrl-C during the last frame counts, too.
    Ok(if interrupt.is_requested() { End::Interrupted } else { End::Complete })
}

impl Camera {
    /// Opens the device for populations like `first`.
    ///
    /// # Errors
    /// If the frames do not fit into memory, or the device has no room.
    pub(crate) fn open(shown: Shown, device: &Device, first: &Population) -> Result<Self> {
        let (width_px, height_px) = (first.width_px, first.height_px);
        let evolved_px = width_px.max(height_px);
        let canvas = shown.long_side_px.map_or(Canvas::evaluation(width_px, height_px), |long| {
            if long == evolved_px {
                Canvas::evaluation(width_px, height_px)
            } else {
                Canvas::scaled(width_px, height_px, long)
            }
        });
        let is_resized = canvas != Canvas::evaluation(width_px, height_px);
        let long_side_px = canvas.width_px.max(canvas.height_px);
        let pixel_count = u64::from(canvas.width_px) * u64::from(canvas.height_px);
        // Each output holds the frame before, the changes to it, and the waiting frames.
        let held = pixel_count.saturating_mul(1 + 2 * shown.film_count as u64);
        memory::check(estimate_bytes(0, first.flies.len(), held))?;
        Ok(Self {
            painter: device.open_painter()?,
            size_px: (width_px, height_px),
            canvas,
            supersampling: if is_resized { usual_supersampling(long_side_px, evolved_px) } else { 1 },
            background: shown.background,
        })
    }

    /// The frames of this camera in an animation.
    pub(crate) fn frames(&self, timing: Timing, has_alpha: bool) -> Frames {
        Frames { size_px: (self.canvas.width_px, self.canvas.height_px), timing, has_alpha }
    }

    /// The frame of the population at `path`.
    fn draw(&mut self, path: &Path) -> Result<Mosaic> {
        let mut population = archive::read(path)?.population;
        if (population.width_px, population.height_px) != self.size_px {
            return Err(Error::input(path, "differs in size from the first population; remove it"));
        }
        population.background = self.background.unwrap_or(population.background);
        self.painter.draw(&population, &self.canvas, self.supersampling)
    }
}

/// How far the drawing has come.
struct FramesDone {
    elapsed: Duration,
    frames: usize,
    frame_count: usize,
}

impl Stage for FramesDone {
    fn elapsed(&self) -> Duration {
        self.elapsed
    }

    fn share(&self) -> f64 {
        self.frames as f64 / self.frame_count as f64
    }

    fn eta_s(&self) -> Option<f64> {
        Some(self.elapsed.as_secs_f64() / self.frames as f64 * (self.frame_count - self.frames) as f64)
    }

    fn count(&self) -> String {
        let count = |frames: usize| HumanCount(frames as u64);
        format!("{}/{} frames", count(self.frames), count(self.frame_count))
    }

    fn json(&self) -> Map<String, Value> {
        let count = |frames: usize| Value::from(frames);
        Map::from_iter([("frames".to_owned(), count(self.frames)), ("frame_count".to_owned(), count(self.frame_count))])
    }
}
