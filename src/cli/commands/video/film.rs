//! Draws the animations of a sequence from its populations.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::options::{Leash, Limit, NOISE, SCENE_CUT, VideoOptions, WarmStart};
use super::plan::Planned;
use super::store::Store;
use crate::archive;
use crate::cli::files::destination;
use crate::cli::film::{self, AnimationProvenance, Camera, End, Film, Shown};
use crate::cli::terminal::Verbosity;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::progress::Progress;
use crate::error::{Error, Result};
use crate::model::fly::UNITS_PER_PX;
use crate::photo::Timing;
use crate::studio::{Device, Provenance, hexadecimal};

/// The frames of an animation.
#[derive(Clone, Copy)]
pub(super) struct Sequence<'a> {
    pub planned: &'a [Planned],
    /// Frames per second of the input, if it has a rate.
    pub input_frames_per_s: Option<u64>,
}

/// Refuses to replace animations that this command would not have written.
///
/// # Errors
/// [`Error::Usage`].
pub(super) fn check_replaceable(options: &VideoOptions, sequence: Sequence<'_>) -> Result<()> {
    let key = provenance(options, sequence).key;
    options.films.iter().try_for_each(|output| film::check_replaceable(&output.path, &key, options.overwrite))
}

/// Everything that decides an animation: its frames, and how they are shown.
fn provenance(options: &VideoOptions, sequence: Sequence<'_>) -> AnimationProvenance {
    let Sequence { planned, input_frames_per_s } = sequence;
    let keys: Vec<&str> = planned.iter().map(|frame| frame.population.key()).collect();
    let digest = <sha2::Sha256 as sha2::Digest>::digest(keys.concat());
    let told = json!({
        "content": "video",
        "frames": planned.len(),
        "frames_sha256": hexadecimal(&digest),
        "frames_per_s": options.rate(input_frames_per_s),
        "output_size_px": options.pictures.output_long_side_px,
        "recipe": planned.first().map(|frame| frame.picture.decisive("recipe")),
        "animation": asked(options, options.rate(input_frames_per_s)),
    });
    let mut told: Map<String, Value> = if let Value::Object(told) = told { told } else { Map::new() };
    if has_alpha(planned) {
        told.insert("transparent".to_owned(), true.into());
    }
    let provenance = Provenance::of(told);
    let text = Value::Object(provenance.describe(None)).to_string();
    AnimationProvenance { key: provenance.key().to_owned(), text }
}

/// What was asked for of a sequence beyond its pictures, where it is not the default; under the names of the flags.
fn asked(options: &VideoOptions, frames_per_s: u16) -> Map<String, Value> {
    let told = json!({
        "fps": frames_per_s,
        "warm-start": (options.warm_start == WarmStart::Off).then_some("off"),
        "warm-evals": options.warm_evals,
        "scene-cut": match options.scene_cut {
            Limit::At(SCENE_CUT) => None,
            Limit::At(most) => Some(most.to_string()),
            Limit::Off => Some("off".to_owned()),
        },
        "keyframe-every": options.keyframe_every,
        "noise": Some(options.noise).filter(|&noise| u64::from(noise) != NOISE),
        "max-tile-move": options.max_tile_move.map(|Leash(units)| f64::from(units) / f64::from(UNITS_PER_PX)),
        "frames": options.span.map(|span| format!("{}..{}", span.first, span.end)),
    });
    let told = if let Value::Object(told) = told { told } else { Map::new() };
    told.into_iter().filter(|(_, value)| !value.is_null()).collect()
}

/// Whether some frame may be transparent.
fn has_alpha(planned: &[Planned]) -> bool {
    let is_open =
        |told: &Provenance| !told.decisive("transparent_sha256").is_null() || told.decisive("background") == "none";
    planned.iter().any(|frame| is_open(&frame.population))
}

/// Makes the animations that were asked for; returns their paths.
///
/// # Errors
/// If an animation cannot be drawn or written; [`Error::Interrupted`].
pub(super) fn make(
    options: &VideoOptions,
    sequence: Sequence<'_>,
    store: &Store,
    device: &Device,
    interrupt: &Interrupt,
) -> Result<Vec<String>> {
    let planned = sequence.planned;
    let Some(first) = planned.first().filter(|_| !options.films.is_empty()) else { return Ok(Vec::new()) };
    let paths: Vec<PathBuf> = planned.iter().map(|frame| store.population(frame.number)).collect();
    let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
    let shown =
        Shown { long_side_px: options.pictures.output_long_side_px, background: None, film_count: options.films.len() };
    let mut camera = Camera::open(shown, device, &archive::read(&store.population(first.number))?.population)?;
    let frames_per_s = options.rate(sequence.input_frames_per_s);
    // Rounded down, since ffmpeg would otherwise get the last frame twice.
    let last_cs = 100 / frames_per_s;
    let timing = Timing { frame_count: planned.len() as u32, frames_per_s, last_cs, plays: 0 };
    let provenance = provenance(options, sequence);
    destination::sweep_beside(options.films.iter().map(|output| output.path.as_path()));
    let frames = camera.frames(timing, has_alpha(planned));
    if frames.has_alpha && options.pictures.verbosity > Verbosity::Quiet {
        options.films.iter().filter(|output| !output.format.has_alpha()).for_each(film::say_shown_over_black);
    }
    let open = |output| Film::open(output, frames, &provenance);
    let films = options.films.iter().map(open).collect::<Result<Vec<_>>>()?;
    let (end, films) = film::shoot(
        films,
        &paths,
        &mut camera,
        interrupt,
        Progress::new(options.progress, options.pictures.verbosity),
    )?;
    if end == End::Interrupted {
        return Err(Error::Interrupted);
    }
    let commit =
        |film: Result<Film>| film.and_then(Film::finish).and_then(|file| interrupt.while_writing(|| file.commit()));
    films.into_iter().try_for_each(commit)?;
    Ok(options.films.iter().map(|output| output.path.display().to_string()).collect())
}
