//! The window: a picture turns into tiles before one's eyes, and can be steered. It owns no search: a thread of its own
//! goes through a [`crate::Session`] step by step, and the window only looks.
//!
//! ```text
//! app (winit events, frames) ── interface (egui) ──> Order ──> worker (Session) ──> News ──┐
//!   └── vk::Screen, gpu::LiveMosaic <──────────────── tiles ───────────────────────────────┘
//! ```
//!
//! Neither waits for the other: orders are a queue, news a place that is overwritten. What is drawn depends on time;
//! what is made does not, since a step of the recipe is noted by the evals at which it came.

mod app;
mod camera;
mod course;
mod dialogs;
mod interface;
mod looking;
mod news;
mod opened;
mod opening;
mod pick;
mod remembered;
mod rescue;
mod saving;
mod wishes;
mod worker;
mod written;

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::error::{Error, Result};
use crate::studio::Device;
use crate::vk::Validation;

pub(crate) use self::opening::Snapshots;
pub(crate) use self::saving::Redraw;

/// How the window is opened.
pub(crate) struct Options {
    /// What to open at once: a picture, a population or a folder of snapshots.
    pub path: Option<PathBuf>,
    /// Opens what searches; on the thread of the search, so that the window need not wait.
    pub device: Box<dyn FnOnce() -> Result<Device> + Send>,
    /// Whether the validation layer watches what the window draws.
    pub validation: Validation,
    /// Lists the snapshots of a folder.
    pub snapshots: Snapshots,
    /// Draws saved tiles into a file.
    pub redraw: Redraw,
    /// Tells a failure and ends the process, where the system leaves no other way.
    pub end_process: fn(&Error) -> !,
}

/// How the window went.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Figures {
    /// Frames in which the mosaic was drawn anew.
    pub frames: u64,
    /// From the start until the first tiles were on the screen.
    pub first_tiles: Option<Duration>,
    /// Evals of the last run.
    pub evals: u64,
    /// How fast they were made since the search was last set going, until it rested or ended.
    pub evals_per_s: f64,
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// [`crate::Error::NoSuitableDevice`] if there is no display, or no device that can show on it;
/// [`crate::Error::Rescued`] if the device or the display goes while it is used, and tells where the tiles were saved.
pub(crate) fn open(options: Options) -> Result<Figures> {
    app::run(options)
}

/// A path without its folder, for people.
fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
