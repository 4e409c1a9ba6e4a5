//! What is saved when the device or the display is gone: the last tiles that were shown.

use std::path::{Path, PathBuf};

use super::news::News;
use super::remembered;
use crate::archive;
use crate::error::{Error, Result};
use crate::guard::Panicked;
use crate::output;

/// Why the window gave up. Some calls of winit panic where the X server is gone.
pub(super) fn reason(panicked: &Panicked) -> Error {
    if panicked.place.contains("/winit-") {
        return Error::DisplayLost;
    }
    Error::Internal(format!("{panicked} ({})", panicked.place))
}

/// The failure that ends the window, which tells where the tiles were saved if there were any.
pub(super) fn after(error: Error, news: &News) -> Error {
    match rescue(news) {
        Ok(Some(path)) => Error::Rescued { error: Box::new(error), path },
        Ok(None) | Err(_) => error,
    }
}

/// Writes the last tiles beside the picture, or where that cannot be, into the folder of the user's configuration; the
/// file, if there were tiles.
pub(super) fn rescue(news: &News) -> Result<Option<PathBuf>> {
    let Some(tiles) = &news.tiles else { return Ok(None) };
    let bytes = archive::encode_snapshot(tiles, &serde_json::Map::new())?;
    let picture = news.picture.as_ref().and_then(|picture| picture.path.as_deref());
    let stem = picture.and_then(Path::file_stem).map_or_else(|| "mosaic".into(), |stem| stem.to_string_lossy());
    let name = format!("{stem}-rescued.npz");
    let beside = picture.and_then(Path::parent).unwrap_or(Path::new(""));
    let folders = std::iter::once(beside.to_owned()).chain(remembered::folder());
    let mut outcome = Ok(None);
    for path in folders.map(|folder| folder.join(&name)) {
        outcome = output::write_atomically(&path, &bytes).map(|()| Some(path));
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}
