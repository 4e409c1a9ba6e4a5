//! `smalti score`: measures how similar pictures are to a reference. Prints a table or JSON.

mod flicker;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;

use crate::cli::terminal::{self, advice};
use crate::cli::values;
use crate::error::{Error, Result};
use crate::metrics::{Picture, Reference, Score};
use crate::model::{Canvas, Rgb};
use crate::photo::{self, Background, CutShort, Photo, ReadOptions};
use crate::studio::color;
use crate::threads;

/// The smallest size at which a mosaic is likely to have evolved: to fewer pixels, pictures of all shapes are squares.
const EVOLVED_MIN_PX: u32 = 7;
/// Exit code when some of the pictures could not be scored.
const EXIT_SOME_FAILED: u8 = 3;

const AFTER_HELP: &str = "\
Columns (more in --json: MAE_R, MAE_G, MAE_B, EDGE_P, EDGE_R, width, height):
  SAE   sum of absolute errors over all pixels and channels, 0 to 255 each; lower is closer
  MAE   their mean; RMSE the root of the mean square; PSNR = 20 log10(255 / RMSE) dB, higher is closer
  SSIM  structural similarity, 7x7 px window, mean of the channels; 1 is identical
  GMSM  mean similarity of luma gradients, 1 is identical; GMSD its standard deviation
  EDGE  how well edges are kept: F1 of the Canny edges of luma, found again within 2 px; EDGE_P is precision, EDGE_R is recall

With --flicker, REF and OUT are folders of frames in natural order, and the columns are of all neighbouring frames:
  FLICKER  how much OUT changes where REF stands still, lower is better: mean of |OUT[t] - OUT[t-1]| over the channels of pixels of which no channel of REF changes by more than --still
  STILL    the share of such pixels
  CHANGE   mean of |(OUT[t] - OUT[t-1]) - (REF[t] - REF[t-1])| over the channels of all pixels
  SAE, MAE of OUT to REF, over all frames

Exit codes: 0 all were scored; 2 none could be; 3 some could not be.

Examples:
  smalti evolve photo.jpg -o mosaic.png --save-target target.png
  smalti score target.png mosaic.png
  smalti score photo.jpg mosaic.png --fit
  smalti score target.png a.png b.png c.jpg --json > scores.json
  smalti score --flicker frames mosaic-frames
  smalti score logo.png mosaic.png --background white";

#[derive(Debug, Args)]
#[command(after_long_help = AFTER_HELP)]
pub(crate) struct ScoreArgs {
    /// Picture to compare with, at least 7x7 px; - reads stdin. With --flicker, a folder of frames
    #[arg(value_name = "REF", value_parser = values::input())]
    pub reference: PathBuf,
    /// Pictures to score, of the same size; - reads stdin. With --flicker, folders of frames
    #[arg(value_name = "OUT", required = true, value_parser = values::input())]
    pub pictures: Vec<PathBuf>,
    /// Measure how much frames change where those of the reference do not
    #[arg(long)]
    pub flicker: bool,
    /// A pixel counts as still if no channel of REF changes by more than this, 0 to 255
    #[arg(long, value_name = "T", default_value_t = 12, requires = "flicker")]
    pub still: u8,
    /// Reduce REF to the size of each picture first, as evolve reduces its input
    #[arg(long, conflicts_with = "flicker")]
    pub fit: bool,
    /// If the file of a picture is cut short, use the part that is there
    #[arg(long)]
    pub lenient: bool,
    /// Print a JSON array to stdout instead of a table, with one object for each scored picture
    #[arg(long)]
    pub json: bool,
    /// Colour behind transparent pixels, such as white or #f80
    #[arg(long, value_name = "COLOR", value_parser = color, default_value = "black")]
    pub background: Rgb,
}

/// The figures of one picture.
#[derive(Debug, Serialize)]
#[serde(rename_all = "UPPERCASE")]
struct ScoreRow {
    #[serde(rename = "file")]
    file: String,
    #[serde(rename = "width")]
    width_px: u32,
    #[serde(rename = "height")]
    height_px: u32,
    sae: u64,
    mae: f64,
    mae_r: f64,
    mae_g: f64,
    mae_b: f64,
    rmse: f64,
    /// In dB; none for a perfect likeness, whose ratio is infinite.
    psnr: Option<f64>,
    ssim: f64,
    gmsm: f64,
    gmsd: f64,
    edge: f64,
    edge_p: f64,
    edge_r: f64,
}

impl ScoreRow {
    fn new(path: &Path, photo: &Photo, score: &Score) -> Self {
        let Score { difference, ssim, gradients, edges } = score;
        let [mae_r, mae_g, mae_b] = difference.mae_by_channel();
        Self {
            file: path.display().to_string(),
            width_px: photo.width_px,
            height_px: photo.height_px,
            sae: difference.sae(),
            mae: difference.mae(),
            mae_r,
            mae_g,
            mae_b,
            rmse: difference.rmse(),
            psnr: difference.psnr_db(),
            ssim: *ssim,
            gmsm: gradients.mean,
            gmsd: gradients.deviation,
            edge: edges.f1(),
            edge_p: edges.precision,
            edge_r: edges.recall,
        }
    }

    /// The figures of the table, without the file's name.
    fn cells(&self) -> [String; 8] {
        let figures = [self.mae, self.rmse, self.psnr.unwrap_or(f64::INFINITY)];
        let [mae, rmse, psnr] = figures.map(|value| format!("{value:.4}"));
        let [ssim, gmsm, gmsd, edge] = [self.ssim, self.gmsm, self.gmsd, self.edge].map(|value| format!("{value:.4}"));
        [self.sae.to_string(), mae, rmse, psnr, ssim, gmsm, gmsd, edge]
    }
}

/// Scores the pictures; returns the exit code of the process.
pub(crate) fn score(args: &ScoreArgs) -> ExitCode {
    if args.flicker {
        return flicker::score(args);
    }
    match threads::start(None).and_then(|()| score_all(args)) {
        Ok(exit_code) => exit_code,
        Err(error) => {
            terminal::error(&advice::sentence(&error));
            ExitCode::from(advice::exit_code(&error))
        }
    }
}

fn score_all(args: &ScoreArgs) -> Result<ExitCode> {
    if args.fit {
        return score_each(args, |path| score_fitted(args, path), table);
    }
    let photo = read(&args.reference, args)?;
    let reference = reference(args, &photo)?;
    score_each(args, |path| score_one(&reference, path, args), table)
}

/// Scores everything that `args` names against the reference, and prints the rows as JSON or as a table. A failure is
/// reported, and the others are still scored.
pub(crate) fn score_each<R: Serialize>(
    args: &ScoreArgs,
    score_one: impl Fn(&Path) -> Result<R>,
    table: impl FnOnce(&[R]) -> String,
) -> Result<ExitCode> {
    let (mut rows, mut worst) = (Vec::new(), 0);
    for path in &args.pictures {
        match score_one(path) {
            Ok(row) => rows.push(row),
            Err(error) => {
                terminal::error(&advice::sentence(&error));
                worst = advice::exit_code(&error);
            }
        }
    }
    if args.json {
        terminal::print_json(&rows)?;
    } else if !rows.is_empty() {
        terminal::write_stdout(table(&rows).as_bytes())?;
    }
    let some_failed = worst != 0 && !rows.is_empty();
    Ok(ExitCode::from(if some_failed { EXIT_SOME_FAILED } else { worst }))
}

fn reference<'p>(args: &ScoreArgs, photo: &'p Photo) -> Result<Reference<'p>> {
    Reference::new(picture(photo)).map_err(|reason| Error::input(&args.reference, reason))
}

fn score_one(reference: &Reference<'_>, path: &Path, args: &ScoreArgs) -> Result<ScoreRow> {
    let photo = read(path, args)?;
    let score = reference.score(picture(&photo)).map_err(|reason| {
        let advice = if reason.contains("the reference") { "; --fit reduces the reference to its size" } else { "" };
        Error::input(path, reason + advice)
    })?;
    Ok(ScoreRow::new(path, &photo, &score))
}

/// Scores a picture against the reference at the picture's size.
fn score_fitted(args: &ScoreArgs, path: &Path) -> Result<ScoreRow> {
    let photo = read(path, args)?;
    let whole = read(&args.reference, args)?;
    let mut fitted = photo::fitted(&whole, photo.width_px.max(photo.height_px));
    let (fitted_px, photo_px) = ((fitted.width_px, fitted.height_px), (photo.width_px, photo.height_px));
    if fitted_px.0 < photo_px.0 && fitted_px.1 < photo_px.1 {
        let reason = format!(
            "has {}x{} px, more than the reference with {}x{} px, which --fit does not enlarge; draw the mosaic smaller",
            photo_px.0, photo_px.1, fitted_px.0, fitted_px.1
        );
        return Err(Error::input(path, reason));
    }
    if fitted_px != photo_px && is_drawn_larger((whole.width_px, whole.height_px), photo_px) {
        fitted = photo::fitted_to(&whole, photo_px);
    }
    let score = reference(args, &fitted)?.score(picture(&photo)).map_err(|reason| Error::input(path, reason))?;
    Ok(ScoreRow::new(path, &photo, &score))
}

/// Whether a picture of `drawn_px` may be a mosaic of one of `photo_px`, which was reduced on the way and drawn larger,
/// so that its sides were rounded twice.
fn is_drawn_larger(photo_px: (u32, u32), drawn_px: (u32, u32)) -> bool {
    let long_side_px = drawn_px.0.max(drawn_px.1);
    (EVOLVED_MIN_PX..long_side_px).any(|evolved_px| {
        let (width_px, height_px) = photo::fitted_size(photo_px, Some(evolved_px));
        let canvas = Canvas::scaled(width_px, height_px, long_side_px);
        (canvas.width_px, canvas.height_px) == drawn_px
    })
}

/// Reads a picture, and prints a warning about what was ignored in it.
pub(super) fn read(path: &Path, args: &ScoreArgs) -> Result<Photo> {
    let background = Background::Color(args.background);
    let cut_short = if args.lenient { CutShort::Take } else { CutShort::Refuse };
    let loaded = photo::read(path, &ReadOptions { background, long_side_px: None, cut_short })?;
    for warning in &loaded.warnings {
        terminal::error(&format!("{}: {warning}", path.display()));
    }
    Ok(loaded.photo)
}

fn picture(photo: &Photo) -> Picture<'_> {
    Picture { width_px: photo.width_px, height_px: photo.height_px, pixels: &photo.pixels }
}

/// The rows under their headings, with the figures aligned to the right.
fn table(rows: &[ScoreRow]) -> String {
    let headings = ["SAE", "MAE", "RMSE", "PSNR", "SSIM", "GMSM", "GMSD", "EDGE"].map(str::to_owned);
    let mut lines = vec![(headings, "file")];
    lines.extend(rows.iter().map(|row| (row.cells(), row.file.as_str())));
    let widths: [usize; 8] =
        std::array::from_fn(|column| lines.iter().map(|(cells, _)| cells[column].len()).max().unwrap_or_default());
    let line = |(cells, file): &([String; 8], &str)| {
        let figures: String = cells.iter().zip(widths).map(|(cell, width)| format!("{cell:>width$}  ")).collect();
        format!("{figures}{}\n", terminal::shown(file))
    };
    lines.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{Difference, EdgeMatch, GradientSimilarity};

    fn row(file: &str, other: [u8; 3]) -> ScoreRow {
        let score = Score {
            difference: Difference::between(&[[100; 3]; 64], &[other; 64]),
            ssim: 0.98765,
            gradients: GradientSimilarity { mean: 1.0, deviation: 0.0 },
            edges: EdgeMatch { precision: 1.0, recall: 0.5 },
        };
        ScoreRow::new(Path::new(file), &Photo { width_px: 8, height_px: 8, pixels: vec![other; 64] }, &score)
    }

    #[test]
    fn the_table_is_aligned_and_tells_a_perfect_likeness() {
        let expected = [
            " SAE      MAE     RMSE     PSNR    SSIM    GMSM    GMSD    EDGE  file\n",
            "   0   0.0000   0.0000      inf  0.9877  1.0000  0.0000  0.6667  a.png\n",
            "1920  10.0000  10.0000  28.1308  0.9877  1.0000  0.0000  0.6667  my b.png\n",
        ];
        assert_eq!(table(&[row("a.png", [100; 3]), row("my b.png", [110, 90, 110])]), expected.concat());
    }

    #[test]
    fn the_fields_of_json_have_the_names_and_the_order_of_the_columns() {
        let expected =
            r#"{"file":"a.png","width":8,"height":8,"SAE":192,"MAE":1.0,"MAE_R":0.0,"MAE_G":1.0,"MAE_B":2.0,"RMSE":"#;
        let json = |other| serde_json::to_string(&row("a.png", other)).expect("a row is JSON");
        let perfect = json([100; 3]);
        assert!(perfect.contains(r#""PSNR":null"#), "{perfect}");
        let json = json([100, 101, 102]);
        assert!(json.starts_with(expected), "{json}");
        let rest = r#""SSIM":0.98765,"GMSM":1.0,"GMSD":0.0,"EDGE":0.6666666666666666,"EDGE_P":1.0,"EDGE_R":0.5}"#;
        assert!(json.ends_with(rest), "{json}");
    }
}
