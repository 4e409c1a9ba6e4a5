//! The result of an evolution: checked against what was reported, and drawn for its outputs.

use super::curve_file::Tabled;
use super::job::Job;
use super::options::EvolveOptions;
use super::outputs::{Drawn, EncodedFile, View};
use super::provenance::{self, Ending, Provenance};
use crate::error::{Error, Result};
use crate::metrics::Difference;
use crate::model::{Canvas, Evaluator, Population, Rgb, Target};
use crate::photo::{self, Photo};

/// What an evolution led to.
pub(super) struct Evolved {
    pub ending: Ending,
    /// The best population.
    pub drawn: Drawn,
    /// How it came there, if that was asked for.
    pub curve: Option<Box<dyn Tabled>>,
}

/// Draws a population of `job`, with the marginal fitness of its flies, at evaluation size and at the size asked for; also
/// returns its peak signal-to-noise ratio in dB, if that is not infinite.
///
/// # Errors
/// If the device fails, or if the mosaic is not what was scored.
pub(super) fn draw(
    evaluator: &mut dyn Evaluator,
    (options, job): (&EvolveOptions, &Job),
    (population, marginal): (Population, Vec<i64>),
    scored: u64,
) -> Result<(Drawn, Option<f64>)> {
    let (width_px, height_px) = (population.width_px, population.height_px);
    let mosaic = evaluator.draw(&population, &Canvas::evaluation(width_px, height_px), 1)?;
    let difference = difference(&mosaic.pixels, &job.target);
    let drawn = difference.sae();
    if drawn != scored {
        return Err(Error::Internal(format!("the best population had an SAE of {scored} and is drawn with {drawn}")));
    }
    let psnr_db = difference.psnr_db();
    let view = View::new(width_px, height_px, options.output_long_side_px);
    let picture = view.is_as_evolved().then_some(mosaic);
    let mut drawn = Drawn { population, marginal, view, picture, layers: None };
    drawn.draw(evaluator, &options.outputs, options.verbosity)?;
    Ok((drawn, psnr_db))
}

/// How far a mosaic is from its target where tiles are wanted.
pub(super) fn difference(pixels: &[Rgb], target: &Target) -> Difference {
    let Some(transparent) = target.transparent() else { return Difference::between(pixels, target.pixels()) };
    let wanted = |pixels: &[Rgb]| -> Vec<Rgb> {
        let wanted = pixels.iter().zip(transparent).filter(|&(_, &is_transparent)| !is_transparent);
        wanted.map(|(&color, _)| color).collect()
    };
    Difference::between(&wanted(pixels), &wanted(target.pixels()))
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
    let metadata = provenance::picture_metadata(&provenance.describe(None));
    let pixels = job.target.pixels();
    let bytes = if let Some(transparent) = job.target.transparent() {
        let with_alpha =
            |(&[r, g, b], &is_transparent): (&Rgb, &bool)| if is_transparent { [0; 4] } else { [r, g, b, 255] };
        let pixels: Vec<[u8; 4]> = pixels.iter().zip(transparent).map(with_alpha).collect();
        photo::encode_png_with_alpha(width_px, height_px, &pixels, &metadata)?
    } else {
        photo::encode_png(&Photo { width_px, height_px, pixels: pixels.to_vec() }, &metadata)?
    };
    Ok(Some(EncodedFile { destination, bytes }))
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::app::job::tests::plan;
    use crate::app::provenance::Provenances;

    #[test]
    fn the_saved_target_is_clear_where_it_is_transparent_and_tells_its_key() {
        let photo = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/rgb.png");
        let (options, mut job) = plan(&photo, &["--save-target", "target.png"]);
        let opaque = job.target.as_ref().clone();
        let mut transparent = vec![false; opaque.pixels().len()];
        transparent[64] = true;
        for plane in [None, Some(&transparent)] {
            let target = plane.map_or(Ok(opaque.clone()), |plane| opaque.clone().with_transparent(plane.clone()));
            job.target = Arc::new(target.expect("the plane fits"));
            let provenance = Provenances::new(&options, &job, None).target;
            let file =
                encode_target(&options, &job, &provenance).expect("it can be encoded").expect("it was asked for");
            let told = photo::png_metadata(&file.bytes);
            assert!(told.iter().any(|(_, text)| text.contains(provenance.key())), "{told:?}");
            let written = image::load_from_memory(&file.bytes).expect("it is a picture");
            assert_eq!(written.color().has_alpha(), plane.is_some());
            for (index, (pixel, color)) in written.to_rgba8().pixels().zip(opaque.pixels()).enumerate() {
                let is_clear = plane.is_some_and(|plane| plane[index]);
                let expected = if is_clear { [0; 4] } else { [color[0], color[1], color[2], 255] };
                assert_eq!(pixel.0, expected, "pixel {index}");
            }
        }
    }
}
