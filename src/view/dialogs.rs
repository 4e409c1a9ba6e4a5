//! Dialogs of the desktop for files. Each waits on a thread of its own, and where the desktop has none, the fields for
//! paths are there.

use std::env;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::error::Result;
use crate::threads;

/// A dialog that ends sooner was never shown: nobody is so fast.
const NOT_SHOWN: Duration = Duration::from_millis(1_000);

/// What a dialog is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    Open,
    Save(PathBuf),
}

/// What came of a dialog.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    Chosen(PathBuf),
    Cancelled,
    /// The desktop has no dialog.
    Missing,
}

/// Whether the desktop may have dialogs.
pub(super) fn may_be_there() -> bool {
    // Elsewhere on Unix they come over the session bus.
    cfg!(windows) || (cfg!(unix) && !cfg!(target_os = "macos") && env::var_os("DBUS_SESSION_BUS_ADDRESS").is_some())
}

/// Shows a dialog, and hands its answer to `tell` on another thread.
pub(super) fn show(
    purpose: Purpose,
    folder: Option<&Path>,
    tell: impl FnOnce(Purpose, Answer) + Send + 'static,
) -> Result<()> {
    let folder = folder.map(Path::to_owned);
    threads::spawn("dialog", move || {
        let began = Instant::now();
        let dialog = rfd::FileDialog::new();
        let dialog = folder.map_or(dialog.clone(), |folder| dialog.set_directory(folder));
        let path = match &purpose {
            Purpose::Open => dialog
                .add_filter(
                    "Pictures and tiles",
                    &["png", "jpg", "jpeg", "jxl", "webp", "tif", "tiff", "bmp", "gif", "npz"],
                )
                .add_filter("All files", &["*"])
                .pick_file(),
            Purpose::Save(path) => dialog.set_file_name(super::name_of(path)).save_file(),
        };
        let answer = match path {
            Some(path) => Answer::Chosen(path),
            None if began.elapsed() < NOT_SHOWN => Answer::Missing,
            None => Answer::Cancelled,
        };
        tell(purpose, answer);
    })
    .map(|_| ())
}
