//! The animations of a sequence, drawn from its populations.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::options::VideoOptions;
use super::plan::Planned;
use super::store::Store;
use crate::app::device::Selected;
use crate::app::film::{self, AnimationProvenance, End, Film, Shown, Studio};
use crate::app::interrupt::Interrupt;
use crate::app::progress::Progress;
use crate::app::provenance::{Provenance, hexadecimal};
use crate::archive;
use crate::error::{Error, Result};
use crate::photo::Timing;

/// Refuses to replace animations that this command would not have written.
///
/// # Errors
/// [`Error::Usage`].
pub(super) fn check_replaceable(options: &VideoOptions, planned: &[Planned], rate: Option<u64>) -> Result<()> {
    let key = provenance(options, planned, rate).key;
    options.films.iter().try_for_each(|output| film::check_replaceable(&output.path, &key, options.overwrite))
}

/// What decides an animation: all its frames, and how they are shown.
fn provenance(options: &VideoOptions, planned: &[Planned], rate: Option<u64>) -> AnimationProvenance {
    let keys: Vec<&str> = planned.iter().map(|frame| frame.population.key()).collect();
    let digest = <sha2::Sha256 as sha2::Digest>::digest(keys.concat());
    let told = json!({
        "content": "video",
        "frames": planned.len(),
        "frames_sha256": hexadecimal(&digest),
        "frames_per_s": options.rate(rate),
        "output_size_px": options.pictures.output_long_side_px,
    });
    let told: Map<String, Value> = if let Value::Object(told) = told { told } else { Map::new() };
    let provenance = Provenance::of(told);
    let text = Value::Object(provenance.describe(None)).to_string();
    AnimationProvenance { key: provenance.key().to_owned(), text }
}

/// Makes the animations that were asked for; returns their paths.
///
/// # Errors
/// If one cannot be drawn or written; [`Error::Interrupted`].
pub(super) fn make(
    options: &VideoOptions,
    planned: &[Planned],
    (store, selected, rate): (&Store, &Selected, Option<u64>),
    interrupt: &Interrupt,
) -> Result<Vec<String>> {
    let Some(first) = planned.first().filter(|_| !options.films.is_empty()) else { return Ok(Vec::new()) };
    let paths: Vec<PathBuf> = planned.iter().map(|frame| store.population(frame.number)).collect();
    let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
    let shown =
        Shown { long_side_px: options.pictures.output_long_side_px, background: None, film_count: options.films.len() };
    let mut studio = Studio::open(shown, selected, &archive::read(&store.population(first.number))?.population)?;
    let frames_per_s = options.rate(rate);
    // Rounded down, or ffmpeg would get the last frame twice.
    let last_cs = 100 / frames_per_s;
    let timing = Timing { frame_count: planned.len() as u32, frames_per_s, last_cs, plays: 0 };
    let provenance = provenance(options, planned, rate);
    let open = |output| Film::open(output, &studio.canvas, timing, &provenance);
    let films = options.films.iter().map(open).collect::<Result<Vec<_>>>()?;
    let (end, films) = film::shoot(films, &paths, &mut studio, interrupt, Progress::new(options.progress))?;
    if end == End::Interrupted {
        return Err(Error::Interrupted);
    }
    let commit =
        |film: Result<Film>| film.and_then(Film::finish).and_then(|file| interrupt.while_writing(|| file.commit()));
    films.into_iter().try_for_each(commit)?;
    Ok(options.films.iter().map(|output| output.path.display().to_string()).collect())
}
