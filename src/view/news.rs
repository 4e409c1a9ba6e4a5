//! What the window and the worker tell each other: orders go one way, news the other. Neither waits for the other.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::wishes::Wishes;
use crate::evolve::StopReason;
use crate::model::Population;

/// What the worker is asked to do.
pub(super) enum Order {
    /// Open a picture, a population or a folder of snapshots.
    Open(PathBuf),
    /// Take a picture that never was a file: width, height, and four bytes for each pixel.
    Take {
        size: [u32; 2],
        rgba: Vec<u8>,
    },
    /// Evolve by these wishes: go on from the present tiles if possible, else begin anew.
    Ask(Box<Ask>),
    Go,
    Pause,
    /// One round, then rest.
    Step,
    /// Begin anew with the same wishes.
    Restart,
    Save(SaveOrder),
    Quit,
}

/// Wishes, and the picture that they are for.
pub(super) struct Ask {
    pub wishes: Wishes,
    /// [`PictureNews::serial`]; 0 if there was none.
    pub serial: u64,
}

/// A file to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SaveOrder {
    /// Its ending tells the format.
    pub path: PathBuf,
    /// Longer side of a picture in px; none is as it evolved.
    pub long_side_px: Option<u32>,
}

/// The picture that is open.
pub(super) struct PictureNews {
    /// Another number for each picture that is opened.
    pub serial: u64,
    /// Its name, for people.
    pub name: String,
    /// Its file, if it has one.
    pub path: Option<PathBuf>,
    /// Width and height in px at which it evolves.
    pub size: [u32; 2],
    /// Four bytes for each pixel, as it evolves; empty if only tiles are known.
    pub rgba: Vec<u8>,
}

/// What the search is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Doing {
    /// No picture is open.
    #[default]
    Nothing,
    /// A file is being read, or a search begun.
    Opening,
    Running,
    Paused,
    /// It came to its end.
    Done(StopReason),
    /// Saved tiles are shown, which no search works on.
    Showing,
}

/// A moment of the run.
#[derive(Clone)]
pub(super) struct Moment {
    pub evals: u64,
    /// Mean error of a channel, 0 to 255.
    pub error: f64,
    pub tiles: Arc<Population>,
}

/// How far the search is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Standing {
    pub evals: u64,
    pub evals_planned: u64,
    pub tile_count: usize,
    /// Mean error of a channel, 0 to 255.
    pub error: f64,
    pub evals_per_s: f64,
}

/// A message for the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Note {
    pub kind: NoteKind,
    pub text: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoteKind {
    Done,
    Hint,
    Failure,
}

impl Note {
    pub(super) fn done(text: impl Into<String>) -> Self {
        Self { kind: NoteKind::Done, text: text.into() }
    }

    pub(super) fn hint(text: impl Into<String>) -> Self {
        Self { kind: NoteKind::Hint, text: text.into() }
    }

    pub(super) fn failure(text: impl Into<String>) -> Self {
        Self { kind: NoteKind::Failure, text: text.into() }
    }
}

/// Everything that the window shows of the work. Large parts are shared, so that a copy is cheap.
#[derive(Clone, Default)]
pub(super) struct News {
    pub picture: Option<Arc<PictureNews>>,
    pub tiles: Option<Arc<Population>>,
    /// Marginal fitness of each fly of `tiles`, if somebody asked for it.
    pub marginal: Option<Arc<Vec<i64>>>,
    /// Error of each pixel of `tiles`, 0 to 765, if somebody asked for it.
    pub error_map: Option<Arc<Vec<u16>>>,
    pub doing: Doing,
    pub standing: Standing,
    pub course: Arc<Vec<Moment>>,
    /// The command that makes this mosaic again.
    pub command: String,
    /// What computes, for people.
    pub device: String,
    /// Whether it was steered since it was last saved.
    pub is_unsaved: bool,
    /// Whether a file is being written.
    pub is_saving: bool,
    /// Messages that were not fetched yet.
    pub notes: Vec<Note>,
}

/// Where news lies, and what the window would like to know.
pub(super) struct Desk {
    news: Mutex<News>,
    /// Whether marginal fitness is looked at.
    pub wants_marginal: AtomicBool,
    /// Whether the error of each pixel is looked at.
    pub wants_error_map: AtomicBool,
    /// Wakes the window.
    wake: Box<dyn Fn() + Send + Sync>,
}

impl Desk {
    pub(super) fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self {
            news: Mutex::default(),
            wants_marginal: AtomicBool::new(false),
            wants_error_map: AtomicBool::new(false),
            wake: Box::new(wake),
        }
    }

    fn lock(&self) -> MutexGuard<'_, News> {
        // News is whole at any time.
        self.news.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the news and wakes the window.
    pub(super) fn tell(&self, change: impl FnOnce(&mut News)) {
        change(&mut self.lock());
        (self.wake)();
    }

    /// The news; its notes are fetched with it.
    pub(super) fn fetch(&self) -> News {
        let mut news = self.lock();
        let notes = std::mem::take(&mut news.notes);
        News { notes, ..news.clone() }
    }

    /// The news, whose notes stay to be fetched.
    pub(super) fn peek(&self) -> News {
        self.lock().clone()
    }

    /// Tells what the window looks at.
    pub(super) fn want(&self, marginal: bool, error_map: bool) {
        self.wants_marginal.store(marginal, Ordering::Relaxed);
        self.wants_error_map.store(error_map, Ordering::Relaxed);
    }
}
