//! What `evolve` and `render` write: a population, drawn as its outputs need it, then encoded, then written.

use std::path::Path;

use serde_json::{Map, Value};

use super::destination::{Content, Destination};
use super::interrupt::Interrupt;
use super::options::Verbosity;
use super::{provenance, report};
use crate::archive;
use crate::error::{Error, Result};
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::model::{Canvas, Evaluator, Mosaic, Population};
use crate::openraster::{self, BAND_COUNT, Layers};
use crate::output;
use crate::photo::{self, Format, Photo};
use crate::vector;

/// Quality of JPEG outputs, 1 to 100.
const JPEG_QUALITY: u8 = 92;
/// Samples along each side of a pixel of an enlarged picture.
const SUPERSAMPLING: u32 = 4;
/// Most samples along each side of a pixel.
pub(super) const SUPERSAMPLING_MAX: u32 = 16;

/// At what size a population is drawn, and how finely.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct View {
    pub canvas: Canvas,
    /// Samples along each side of a pixel.
    pub supersampling: u32,
}

impl View {
    /// A picture of `width_px` x `height_px` as it evolved, or with a longer side of `resized_px`.
    pub(super) fn new(width_px: u32, height_px: u32, resized_px: Option<u32>) -> Self {
        let evolved_px = width_px.max(height_px);
        match resized_px.filter(|&long| long != evolved_px) {
            None => Self { canvas: Canvas::evaluation(width_px, height_px), supersampling: 1 },
            Some(long) => Self {
                canvas: Canvas::scaled(width_px, height_px, long),
                supersampling: usual_supersampling(long, evolved_px),
            },
        }
    }

    /// Whether the picture has one pixel for each that evolved, of one sample.
    pub(super) fn is_as_evolved(&self) -> bool {
        self.canvas.scale == (1, 1) && self.supersampling == 1
    }
}

/// Samples along each side of a pixel of a picture of `long_side_px` that was evolved at `evolved_px`: one for each
/// evolved pixel, within the limits, and as many as the largest canvas allows.
pub(super) fn usual_supersampling(long_side_px: u32, evolved_px: u32) -> u32 {
    let wanted = evolved_px.div_ceil(long_side_px).clamp(SUPERSAMPLING, SUPERSAMPLING_MAX);
    (1..=wanted).rev().find(|factor| long_side_px * factor <= TARGET_SIDE_MAX_PX).unwrap_or(1)
}

/// A population with all that its outputs need of an evaluator.
#[derive(Debug)]
pub(super) struct Drawn {
    pub population: Population,
    /// Marginal fitness of its flies.
    pub marginal: Vec<i64>,
    pub view: View,
    /// The picture, if one of the outputs has pixels.
    pub picture: Option<Mosaic>,
    /// The picture in layers, if one of the outputs has them.
    pub layers: Option<Layers>,
}

impl Drawn {
    /// Draws what `outputs` need and is not there yet.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn draw(
        &mut self,
        evaluator: &mut dyn Evaluator,
        outputs: &[Destination],
        verbosity: Verbosity,
    ) -> Result<()> {
        let View { canvas, supersampling } = self.view;
        let (needs_picture, needs_layers) = (
            self.picture.is_none() && outputs.iter().any(Destination::is_raster),
            outputs.iter().any(|output| output.content == Content::OpenRaster),
        );
        if (needs_picture || needs_layers) && verbosity > Verbosity::Quiet {
            let layers = if needs_layers { " and its layers" } else { "" };
            report::say(&format!("drawing {}x{} px{layers}", canvas.width_px, canvas.height_px));
        }
        if needs_picture {
            self.picture = Some(evaluator.draw(&self.population, &canvas, supersampling)?);
        }
        if needs_layers {
            self.layers = Some(Layers::draw(evaluator, &self.population, &canvas, supersampling, BAND_COUNT)?);
        }
        Ok(())
    }
}

/// The metadata of the outputs.
#[derive(Clone, Debug)]
pub(super) struct Told {
    pub picture: Map<String, Value>,
    pub population: Map<String, Value>,
}

/// A file that is ready to be written.
pub(super) struct EncodedFile<'a> {
    pub destination: &'a Destination,
    pub bytes: Vec<u8>,
}

/// The outputs as bytes; nothing is written before all of them are there.
///
/// # Errors
/// If one of them cannot hold the result.
pub(super) fn encode<'a>(outputs: &[&'a Destination], drawn: Drawn, told: &Told) -> Result<Vec<EncodedFile<'a>>> {
    let Drawn { population, marginal, view, picture, layers } = drawn;
    let photo =
        picture.map(|Mosaic { width_px, height_px, pixels, alpha }| (Photo { width_px, height_px, pixels }, alpha));
    let metadata = provenance::picture_metadata(&told.picture);
    let undrawn = || Error::Internal("an output was not drawn".to_owned());
    let encode_picture = |format| {
        let (photo, alpha) = photo.as_ref().ok_or_else(undrawn)?;
        photo::encode_with_alpha(format, photo, alpha.as_deref(), &metadata)
    };
    let encode_one = |&destination: &&'a Destination| {
        let bytes = match destination.content {
            Content::Png => encode_picture(Format::Png),
            Content::Jpeg => encode_picture(Format::Jpeg { quality: JPEG_QUALITY }),
            Content::WebP => encode_picture(Format::WebP),
            Content::Svg => vector::encode(&population, &view.canvas, &told.picture),
            Content::OpenRaster => {
                openraster::encode(layers.as_ref().ok_or_else(undrawn)?, &encode_picture(Format::Png)?)
            }
            Content::Population => {
                archive::encode(&population, &marginal, &provenance::without_header(told.population.clone()))
            }
            Content::Json => archive::encode_json(&population, &marginal, &told.population),
            Content::Csv => archive::encode_csv(&population, &marginal, &told.population),
        }?;
        Ok(EncodedFile { destination, bytes })
    };
    outputs.iter().map(encode_one).collect()
}

/// Writes the files one after the other, each in one step, and adds to `written` those that are there now.
///
/// # Errors
/// The first failure; the files after it are written nevertheless, since hours of work may be in them.
pub(super) fn write(files: &[EncodedFile<'_>], interrupt: &Interrupt, written: &mut Vec<String>) -> Result<()> {
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

/// Whether a file that does not tell that smalti made it is what is left of an output that was cut short: `bytes`, which are to be
/// written now, begin with it, and zeros may follow that a file system put there.
pub(super) fn is_left_of(path: &Path, bytes: &[u8]) -> bool {
    std::fs::read(path).is_ok_and(|old| {
        let length = old.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
        bytes.starts_with(&old[..length])
    })
}

#[cfg(test)]
mod tests {
    use super::usual_supersampling;

    #[test]
    fn supersampling_is_reduced_where_the_canvas_would_be_too_large() {
        assert_eq!(
            [1, 4_096, 16_383, 16_384, 21_845, 32_767, 32_768, 65_535].map(|long| usual_supersampling(long, 1)),
            [4, 4, 4, 3, 3, 2, 1, 1]
        );
    }

    #[test]
    fn a_reduced_picture_takes_a_sample_for_each_evolved_pixel_within_limits() {
        assert_eq!([4_096, 1_024, 512, 256, 64].map(|long| usual_supersampling(long, 4_096)), [4, 4, 8, 16, 16]);
    }
}
