//! Dialogs of the desktop for files. Each waits on a thread of its own, and where the desktop has none, the fields for
//! paths are there.

use std::env;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::interface::{Field, Request};
use crate::error::Result;
use crate::threads;

/// A dialog that ends sooner was never shown: nobody is so fast.
const NOT_SHOWN: Duration = Duration::from_millis(1_000);

/// Endings of pictures.
const PICTURES: [&str; 9] = ["png", "jpg", "jpeg", "jxl", "webp", "tif", "tiff", "bmp", "gif"];

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
    request: Request,
    folder: Option<&Path>,
    tell: impl FnOnce(Request, Answer) + Send + 'static,
) -> Result<()> {
    let folder = folder.map(Path::to_owned);
    threads::spawn("dialog", move || {
        let began = Instant::now();
        let dialog = rfd::FileDialog::new();
        let dialog = folder.map_or(dialog.clone(), |folder| dialog.set_directory(folder));
        let pick = |name: &str, others: &[&str]| {
            let endings = [&PICTURES, others].concat();
            dialog.clone().add_filter(name, &endings).add_filter("All files", &["*"]).pick_file()
        };
        let path = match &request {
            Request::Open => pick("Pictures and tiles", &["npz"]),
            Request::Field(Field::Palette) => pick("Palettes and pictures", &["gpl", "pal", "hex", "txt"]),
            Request::Field(Field::Mask) => pick("Pictures and drawings", &["svg"]),
            Request::Field(Field::LoadMap) => pick("Pictures", &[]),
            Request::Field(Field::SaveMap) => {
                dialog.add_filter("PNG", &["png"]).set_file_name("weights.png").save_file()
            }
            Request::Save(path) => dialog.set_file_name(super::name_of(path)).save_file(),
        };
        let answer = match path {
            Some(path) => Answer::Chosen(path),
            None if began.elapsed() < NOT_SHOWN => Answer::Missing,
            None => Answer::Cancelled,
        };
        tell(request, answer);
    })
    .map(|_| ())
}
