//! Plans a run: its frames, where shots begin, and the key of each frame.
//!
//! If a frame continues from another one, its key covers that one's key, too: its whole chain decides a frame.

use std::path::{Path, PathBuf};

use indicatif::HumanCount;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use super::options::{Leash, Limit, VideoOptions, WarmStart};
use crate::cli::jobs::options::PictureOptions;
use crate::cli::jobs::prepared::Prepared;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::{self, aside};
use crate::error::{Error, Result};
use crate::evolve::held::Glance;
use crate::studio::Provenance;

/// Version of evolving frames from each other. Raise it whenever the same frames and options lead to another result.
const VIDEO_VERSION: u32 = 1;
/// A frame that continues gets this part of the evals of a frame that begins anew, by default.
const WARM_PART: u64 = 4;

/// How a frame begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Begin {
    /// Anew: it is the first one, or no frame continues from another.
    Anew,
    /// Anew: it comes after a cut.
    Cut,
    /// Anew: it is a keyframe.
    Keyframe,
    /// With the tiles of the frame before.
    Warm,
}

/// A frame to be made.
#[derive(Clone, Debug)]
pub(super) struct Planned {
    /// Its place in the whole sequence, from 0.
    pub number: usize,
    pub input: PathBuf,
    pub begin: Begin,
    /// Mean difference from the frame before, 0 to 255; 0 for the first.
    pub difference: u32,
    /// The frame that its shot begins with.
    pub shot: usize,
    /// Children to evaluate.
    pub evals: u64,
    pub tiles: usize,
    pub picture: Provenance,
    pub population: Provenance,
}

/// A frame as it was read.
struct FrameRead {
    size_px: (u32, u32),
    glance: Glance,
    evals: u64,
    tiles: usize,
    picture: Provenance,
    population: Provenance,
}

/// The options of one frame.
pub(super) fn frame_options(options: &VideoOptions, input: &Path) -> PictureOptions {
    PictureOptions { input: input.to_owned(), ..options.pictures.clone() }
}

/// Reads all requested frames, and decides how each begins.
///
/// # Errors
/// [`Error::Input`] for a frame that cannot be used, [`Error::Usage`] if none of the requested frames exists;
/// [`Error::Interrupted`].
pub(super) fn plan(options: &VideoOptions, paths: &[PathBuf], interrupt: &Interrupt) -> Result<Vec<Planned>> {
    let span = options.span.map_or(0..paths.len(), |span| span.first..span.end);
    if span.end > paths.len() {
        let sentence = format!("--frames {}..{}: there are {} frames", span.start, span.end, paths.len());
        return Err(Error::Usage(sentence));
    }
    let read = {
        let (options, paths) = (options.clone(), paths[span.clone()].to_vec());
        move || paths.par_iter().map(|path| see(&options, path)).collect::<Result<Vec<FrameRead>>>()
    };
    let seen = aside::unless_interrupted(interrupt, read)?;
    let mut planned: Vec<Planned> = Vec::new();
    for (index, one) in seen.iter().enumerate() {
        let number = span.start + index;
        if one.size_px != seen[0].size_px {
            let reason = format!(
                "becomes {}x{} px, and the first frame {}x{}; make all frames the same size",
                one.size_px.0, one.size_px.1, seen[0].size_px.0, seen[0].size_px.1
            );
            return Err(Error::input(&paths[number], reason));
        }
        let difference = index.checked_sub(1).map_or(0, |before| seen[before].glance.difference(&one.glance));
        let before = planned.last();
        let begin = begin(options, before.map(|before| number - before.shot), difference);
        let frame = Planned {
            number,
            input: paths[number].clone(),
            begin,
            difference,
            shot: before.filter(|_| begin == Begin::Warm).map_or(number, |before| before.shot),
            evals: one.evals,
            tiles: one.tiles,
            picture: one.picture.clone(),
            population: one.population.clone(),
        };
        let first = |shot: usize| &seen[shot - span.start];
        planned.push(match before.filter(|_| begin == Begin::Warm) {
            None => frame,
            Some(before) => go_on(options, frame, before, first(before.shot)),
        });
    }
    Ok(planned)
}

fn see(options: &VideoOptions, path: &Path) -> Result<FrameRead> {
    let options = frame_options(options, path);
    let Prepared { job, provenances, .. } = Prepared::load(&options, &path.display().to_string())?;
    Ok(FrameRead {
        size_px: (job.target.width_px(), job.target.height_px()),
        glance: Glance::of(&job.target),
        evals: job.evals_planned(),
        tiles: job.fly_count,
        picture: provenances.picture,
        population: provenances.population,
    })
}

/// How a frame begins. `since` counts the frames since the shot before it began, if there is one.
fn begin(options: &VideoOptions, since: Option<usize>, difference: u32) -> Begin {
    let Some(since) = since.filter(|_| options.warm_start == WarmStart::On) else { return Begin::Anew };
    match options.scene_cut {
        Limit::At(most) if difference > most => Begin::Cut,
        _ if options.keyframe_every.is_some_and(|every| since >= every) => Begin::Keyframe,
        _ => Begin::Warm,
    }
}

/// The frame as one that continues from the frame before. Its shot began with `first`, whose ground and grout it keeps.
fn go_on(options: &VideoOptions, frame: Planned, before: &Planned, first: &FrameRead) -> Planned {
    let evals = options.warm_evals.unwrap_or(frame.evals / WARM_PART);
    let more = json!({
        "video_algorithm": VIDEO_VERSION,
        "evals_planned": evals,
        "background": first.population.decisive("background"),
        "grout_ring": first.population.decisive("grout_ring"),
        "frames_since_start": frame.number - before.shot,
        "noise": options.noise,
        "previous_key": before.population.key(),
    });
    let mut more = if let Value::Object(more) = more { more } else { serde_json::Map::new() };
    if let Some(Leash(units)) = options.max_tile_move {
        more.insert("max_tile_move_64ths".to_owned(), units.into());
    }
    Planned { evals, picture: frame.picture.with(more.clone()), population: frame.population.with(more), ..frame }
}

/// A shot, for people and programs.
#[derive(Debug, Serialize)]
struct Shot {
    /// The frames in the form that `--frames` takes.
    frames: String,
    first: usize,
    count: usize,
    begin: Begin,
    difference: u32,
    input: String,
}

/// Prints the shots to stdout: a table, or one line of JSON for each.
///
/// # Errors
/// If stdout cannot be written.
pub(super) fn print_shots(planned: &[Planned], is_json: bool) -> Result<()> {
    let shots: Vec<Shot> = planned
        .chunk_by(|one, other| one.shot == other.shot)
        .map(|frames| Shot {
            frames: format!("{}..{}", frames[0].number, frames[0].number + frames.len()),
            first: frames[0].number,
            count: frames.len(),
            begin: frames[0].begin,
            difference: frames[0].difference,
            input: frames[0].input.display().to_string(),
        })
        .collect();
    if is_json {
        return shots.iter().try_for_each(terminal::print_json);
    }
    let mut text = format!("{:>17}  {:>7}  {:8}  {:>10}  first frame\n", "frames", "count", "begins", "difference");
    for Shot { frames, count, begin, difference, input, .. } in &shots {
        let begins = match begin {
            Begin::Anew | Begin::Warm => "anew",
            Begin::Cut => "cut",
            Begin::Keyframe => "keyframe",
        };
        text += &format!(
            "{frames:>17}  {:>7}  {begins:8}  {difference:>10}  {}\n",
            HumanCount(*count as u64),
            terminal::shown(input)
        );
    }
    terminal::write_stdout(text.as_bytes())
}
