//! The result of an evolution: checked against what was reported, and drawn for its outputs.

use super::job::Job;
use super::options::EvolveOptions;
use super::outputs::{Drawn, EncodedFile, View};
use super::provenance::{self, Ending, Provenance};
use crate::error::{Error, Result};
use crate::metrics::Difference;
use crate::model::{Canvas, Evaluator, Population};
use crate::photo::{self, Photo};

/// What an evolution led to.
#[derive(Debug)]
pub(super) struct Evolved {
    pub ending: Ending,
    /// Peak signal-to-noise ratio of the best population in dB; none if it is infinite.
    pub psnr_db: Option<f64>,
    /// The best population.
    pub drawn: Drawn,
}

/// Draws the best population, which the evaluator holds in lane 0, at evaluation size and at the size asked for.
///
/// # Errors
/// If the device fails, or if the mosaic is not what was scored.
pub(super) fn draw(
    evaluator: &mut dyn Evaluator,
    options: &EvolveOptions,
    population: Population,
    ending: Ending,
) -> Result<Evolved> {
    let evaluation = evaluator.evaluation(0);
    let (scored, marginal) = (evaluation.sae, evaluation.marginal.to_vec());
    let (width_px, height_px) = (population.width_px, population.height_px);
    let mosaic = evaluator.draw(&population, &Canvas::evaluation(width_px, height_px), 1)?;
    let difference = Difference::between(&mosaic.pixels, evaluator.scene(0).target.pixels());
    let drawn = difference.sae();
    if scored != ending.sae || drawn != ending.sae {
        return Err(Error::Internal(format!(
            "the best population had an SAE of {}, is evaluated to {scored} and drawn with {drawn}",
            ending.sae
        )));
    }
    let psnr_db = difference.psnr_db();
    let view = View::new(width_px, height_px, options.output_long_side_px);
    let picture = view.is_as_evolved().then_some(mosaic);
    let mut drawn = Drawn { population, marginal, view, picture, layers: None };
    drawn.draw(evaluator, &options.outputs, options.verbosity)?;
    Ok(Evolved { ending, psnr_db, drawn })
}

/// Longer side of the written picture in px, if it differs from the size at which the mosaic was evolved.
pub(super) fn resized_px(options: &EvolveOptions, width_px: u32, height_px: u32) -> Option<u32> {
    options.output_long_side_px.filter(|&long| long != width_px.max(height_px))
}

/// The file of `--save-target`, if it was asked for.
pub(super) fn encode_target<'a>(
    options: &'a EvolveOptions,
    job: &Job,
    provenance: &Provenance,
) -> Result<Option<EncodedFile<'a>>> {
    let Some(destination) = &options.save_target else { return Ok(None) };
    let (width_px, height_px) = (job.target.width_px(), job.target.height_px());
    let photo = Photo { width_px, height_px, pixels: job.target.pixels().to_vec() };
    let bytes = photo::encode_png(&photo, &provenance::picture_metadata(&provenance.describe(None)))?;
    Ok(Some(EncodedFile { destination, bytes }))
}
