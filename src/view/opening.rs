//! What a path holds: a picture, saved tiles, or the snapshots of a run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::news::Moment;
use crate::archive;
use crate::error::{Error, Result};
use crate::studio::Picture;

/// Lists the snapshots of a folder: evals, SAE and file of each, in the order of their evals.
pub(crate) type Snapshots = fn(&Path) -> Result<Vec<(u64, u64, PathBuf)>>;

/// What was found.
pub(super) enum Found {
    Picture(Picture),
    /// Tiles, with what is known of their course, and the file of the last of them.
    Tiles {
        moments: Vec<Moment>,
        file: PathBuf,
    },
}

/// Opens a path.
///
/// # Errors
/// [`Error::Input`] if it holds none of these.
pub(super) fn find(path: &Path, snapshots: Snapshots) -> Result<Found> {
    if path.is_dir() {
        let listed = snapshots(path)?;
        let file = listed.last().map_or_else(|| path.to_owned(), |(_, _, file)| file.clone());
        let moments = listed.into_iter().map(|(evals, sae, path)| moment(&path, Some((evals, sae))));
        return moments.collect::<Result<_>>().map(|moments| Found::Tiles { moments, file });
    }
    let ending = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    if ending.is_some_and(|ending| ending == "npz") {
        let file = path.to_owned();
        return moment(path, None).map(|moment| Found::Tiles { moments: vec![moment], file });
    }
    Picture::open(path).map(Found::Picture)
}

fn moment(path: &Path, known: Option<(u64, u64)>) -> Result<Moment> {
    let archive = archive::read(path)?;
    let told = |word| archive.meta.get(word).and_then(serde_json::Value::as_u64);
    let evals = known.map(|(evals, _)| evals).or(told("evals")).or(told("births")).unwrap_or(0);
    let sae = known.map(|(_, sae)| sae).or(told("sae")).unwrap_or(0);
    let tiles = archive.population;
    if tiles.flies.is_empty() {
        return Err(Error::input(path, "holds no tiles; choose another file"));
    }
    let channels = u64::from(tiles.width_px) * u64::from(tiles.height_px) * 3;
    Ok(Moment { evals, error: sae as f64 / channels as f64, tiles: Arc::new(tiles) })
}
