//! The result of an evolution: drawn, checked against what was reported, encoded, written.

use super::destination::{Content, Destination};
use super::interrupt::Interrupt;
use super::job::Job;
use super::options::{EvolveOptions, Verbosity};
use super::provenance::{Ending, Provenance, Provenances};
use super::report;
use crate::archive;
use crate::error::{Error, Result};
use crate::metrics::Difference;
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::model::{Canvas, Evaluator, Mosaic, Population};
use crate::output;
use crate::photo::{self, Format, Photo};

/// Quality of JPEG outputs, 1 to 100.
const JPEG_QUALITY: u8 = 92;
/// Samples along each side of a pixel of an enlarged picture.
const SUPERSAMPLING: u32 = 4;
/// Most samples along each side of a pixel of a reduced picture.
const SUPERSAMPLING_MAX: u32 = 16;

/// What an evolution led to.
#[derive(Debug)]
pub(super) struct Evolved {
    pub ending: Ending,
    /// The best population.
    pub population: Population,
    /// Marginal fitness of its flies.
    pub marginal: Vec<i64>,
    /// The best population as it was scored.
    pub mosaic: Mosaic,
    /// The same at the size that was asked for, if it is another.
    pub resized: Option<Mosaic>,
}

/// A file that is ready to be written.
pub(super) struct EncodedFile<'a> {
    destination: &'a Destination,
    bytes: Vec<u8>,
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
    let drawn = Difference::between(&mosaic.pixels, evaluator.scene(0).target.pixels()).sae();
    if scored != ending.sae || drawn != ending.sae {
        return Err(Error::Internal(format!(
            "the best population had an SAE of {}, is evaluated to {scored} and drawn with {drawn}",
            ending.sae
        )));
    }
    let resized = match resized_px(options, width_px, height_px) {
        Some(long) if options.outputs.iter().any(Destination::is_picture) => {
            let canvas = Canvas::scaled(width_px, height_px, long);
            if options.verbosity > Verbosity::Quiet {
                report::say(&format!("drawing {}x{} px", canvas.width_px, canvas.height_px));
            }
            Some(evaluator.draw(&population, &canvas, supersampling(long, width_px.max(height_px)))?)
        }
        _ => None,
    };
    Ok(Evolved { ending, population, marginal, mosaic, resized })
}

/// Longer side of the written picture in px, if it differs from the size at which the mosaic was evolved.
pub(super) fn resized_px(options: &EvolveOptions, width_px: u32, height_px: u32) -> Option<u32> {
    options.output_long_side_px.filter(|&long| long != width_px.max(height_px))
}

/// Samples along each side of a pixel of a picture of `long_side_px` that was evolved at `evolved_px`: one for each
/// evolved pixel, within the limits, and as many as the largest canvas allows.
pub(super) fn supersampling(long_side_px: u32, evolved_px: u32) -> u32 {
    let wanted = evolved_px.div_ceil(long_side_px).clamp(SUPERSAMPLING, SUPERSAMPLING_MAX);
    (1..=wanted).rev().find(|factor| long_side_px * factor <= TARGET_SIDE_MAX_PX).unwrap_or(1)
}

/// The outputs as bytes; nothing is written before all of them are there.
pub(super) fn encode<'a>(
    outputs: &[&'a Destination],
    evolved: Evolved,
    provenances: &Provenances,
) -> Result<Vec<EncodedFile<'a>>> {
    let Mosaic { width_px, height_px, pixels } = evolved.resized.unwrap_or(evolved.mosaic);
    let photo = Photo { width_px, height_px, pixels };
    let metadata = provenances.picture.picture_metadata(Some(&evolved.ending));
    let encode_one = |destination: &'a Destination| {
        let bytes = match destination.content {
            Content::Png => photo::encode(Format::Png, &photo, &metadata),
            Content::Jpeg => photo::encode(Format::Jpeg { quality: JPEG_QUALITY }, &photo, &metadata),
            Content::Population => {
                let told = provenances.population.population_metadata(&evolved.ending);
                archive::encode(&evolved.population, &evolved.marginal, &told)
            }
        }?;
        Ok(EncodedFile { destination, bytes })
    };
    outputs.iter().copied().map(encode_one).collect()
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
    let bytes = photo::encode(Format::Png, &photo, &provenance.picture_metadata(None))?;
    Ok(Some(EncodedFile { destination, bytes }))
}

/// Writes the files one after the other, each in one step, and adds to `written` those that are there now.
///
/// # Errors
/// The first failure; the files after it are written nevertheless, since hours of work may be in them.
pub(super) fn write(files: &[EncodedFile<'_>], interrupt: &mut Interrupt, written: &mut Vec<String>) -> Result<()> {
    let mut outcome = Ok(());
    for EncodedFile { destination, bytes } in files {
        let one = if destination.is_stdout() {
            report::write_picture_to_stdout(bytes)
        } else if destination.is_stream() {
            output::write_atomically(&destination.path, bytes)
        } else {
            interrupt.while_writing(|| output::write_atomically(&destination.path, bytes))
        };
        if one.is_ok() {
            written.push(destination.path.display().to_string());
        }
        outcome = outcome.and(one);
    }
    outcome
}

#[cfg(test)]
mod tests {
    use super::supersampling;

    #[test]
    fn supersampling_is_reduced_where_the_canvas_would_be_too_large() {
        assert_eq!(
            [1, 4_096, 16_383, 16_384, 21_845, 32_767, 32_768, 65_535].map(|long| supersampling(long, 1)),
            [4, 4, 4, 3, 3, 2, 1, 1]
        );
    }

    #[test]
    fn a_reduced_picture_takes_a_sample_for_each_evolved_pixel_within_limits() {
        assert_eq!([4_096, 1_024, 512, 256, 64].map(|long| supersampling(long, 4_096)), [4, 4, 8, 16, 16]);
    }
}
