//! `smalti score --flicker`: measures how much sequences change where the reference stands still. Prints a table or
//! JSON.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde::Serialize;

use super::{ScoreArgs, read, score_each};
use crate::cli::files::inputs;
use crate::cli::files::left_out::LeftOut;
use crate::cli::terminal::{self, advice};
use crate::error::{Error, Result};
use crate::metrics::{Difference, Flicker};
use crate::photo::Photo;

/// The figures of one sequence.
#[derive(Debug, Serialize)]
#[serde(rename_all = "UPPERCASE")]
struct FlickerRow {
    #[serde(rename = "file")]
    file: String,
    #[serde(rename = "frames")]
    frames: usize,
    #[serde(rename = "width")]
    width_px: u32,
    #[serde(rename = "height")]
    height_px: u32,
    flicker: Option<f64>,
    still: Option<f64>,
    change: Option<f64>,
    sae: u64,
    mae: f64,
}

/// Scores the sequences; returns the exit code of the process.
pub(super) fn score(args: &ScoreArgs) -> ExitCode {
    match score_all(args) {
        Ok(exit_code) => exit_code,
        Err(error) => {
            terminal::error(&advice::sentence(&error));
            ExitCode::from(advice::exit_code(&error))
        }
    }
}

fn score_all(args: &ScoreArgs) -> Result<ExitCode> {
    let reference = inputs::in_folder(&args.reference, &mut LeftOut::default())?;
    score_each(args, |folder| score_one(args, &reference, folder), table)
}

fn score_one(args: &ScoreArgs, reference: &[PathBuf], folder: &Path) -> Result<FlickerRow> {
    let paths = inputs::in_folder(folder, &mut LeftOut::default())?;
    if paths.len() != reference.len() {
        let reason = format!("has {} frames and the reference {}; compare the same ones", paths.len(), reference.len());
        return Err(Error::input(folder, reason));
    }
    let mut flicker = Flicker::default();
    let mut before: Option<[Photo; 2]> = None;
    let (mut sae, mut pixel_count, mut size_px) = (0, 0, (0, 0));
    for (its, own) in reference.iter().zip(&paths) {
        let pair = [read(its, args)?, read(own, args)?];
        let size = |photo: &Photo| (photo.width_px, photo.height_px);
        let first = before.as_ref().map_or(size(&pair[0]), |before| size(&before[0]));
        if let Some((path, photo)) = [its, own].into_iter().zip(&pair).find(|(_, photo)| size(photo) != first) {
            let (width_px, height_px) = size(photo);
            let reason = format!("has {width_px}x{height_px} px and the sequence {}x{}; resize it", first.0, first.1);
            return Err(Error::input(path, reason));
        }
        sae += Difference::between(&pair[0].pixels, &pair[1].pixels).sae();
        pixel_count += pair[0].pixels.len();
        size_px = first;
        if let Some(before) = &before {
            let frames = |of: usize| [before[of].pixels.as_slice(), pair[of].pixels.as_slice()];
            flicker.add(frames(0), frames(1), args.still);
        }
        before = Some(pair);
    }
    Ok(FlickerRow {
        file: folder.display().to_string(),
        frames: paths.len(),
        width_px: size_px.0,
        height_px: size_px.1,
        flicker: flicker.still(),
        still: flicker.still_share(),
        change: flicker.compensated(),
        sae,
        mae: sae as f64 / (3 * pixel_count) as f64,
    })
}

/// The rows under their headings, with the figures aligned to the right.
fn table(rows: &[FlickerRow]) -> String {
    let figure = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
    let mut text = format!("{:>8}  {:>6}  {:>8}  {:>12}  {:>8}  file\n", "FLICKER", "STILL", "CHANGE", "SAE", "MAE");
    for FlickerRow { file, flicker, still, change, sae, mae, .. } in rows {
        let [flicker, still, change] = [*flicker, *still, *change].map(figure);
        let file = terminal::shown(file);
        text += &format!("{flicker:>8}  {still:>6}  {change:>8}  {sae:>12}  {mae:>8.4}  {file}\n");
    }
    text
}
