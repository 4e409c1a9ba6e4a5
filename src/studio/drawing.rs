//! A population drawn and encoded: at what size, what of it has to be drawn for which content, and the bytes.

use std::ffi::OsStr;
use std::path::Path;

use super::provenance::{self, Told};
use crate::archive;
use crate::error::{Error, Result};
use crate::metrics::Difference;
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::model::{Canvas, Mosaic, Painter, Population, Rgb, Target};
use crate::openraster::{self, BAND_COUNT, Layers};
use crate::photo::{self, Format, Photo};
use crate::vector;

/// Quality of JPEG pictures, 1 to 100.
pub(super) const JPEG_QUALITY: u8 = 92;
/// Samples along each side of a pixel of an enlarged picture.
const SUPERSAMPLING: u32 = 4;
/// Most samples along each side of a pixel.
pub(crate) const SUPERSAMPLING_MAX: u32 = 16;

/// What a result is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    /// A picture as PNG.
    Png,
    /// A picture as JPEG, of a quality from 1 to 100.
    Jpeg(u8),
    /// A picture as WebP.
    WebP,
    /// A picture as vectors.
    Svg,
    /// A picture in layers.
    OpenRaster,
    /// The population.
    Population,
    /// A table of the flies, with metadata.
    Json,
    /// A table of the flies, with what may be replaced in its last columns.
    Csv,
}

impl Content {
    /// A picture as JPEG of the usual quality.
    pub(crate) const JPEG: Self = Self::Jpeg(JPEG_QUALITY);

    /// What is written to a path, as its ending tells.
    pub(crate) fn of_path(path: &Path) -> Option<Self> {
        let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase();
        Some(match ending.as_str() {
            "png" => Self::Png,
            "jpg" | "jpeg" => Self::JPEG,
            "webp" => Self::WebP,
            "svg" => Self::Svg,
            "ora" => Self::OpenRaster,
            "npz" => Self::Population,
            "json" => Self::Json,
            "csv" => Self::Csv,
            _ => return None,
        })
    }

    /// Whether it is a picture, which has a size, rather than a population, which has none.
    pub(crate) fn is_picture(self) -> bool {
        !matches!(self, Self::Population | Self::Json | Self::Csv)
    }

    /// Whether it has pixels.
    pub(crate) fn is_raster(self) -> bool {
        self.is_picture() && self != Self::Svg
    }
}

/// At what size a population is drawn, and how finely.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct View {
    pub canvas: Canvas,
    /// Samples along each side of a pixel.
    pub supersampling: u32,
}

impl View {
    /// A picture of `width_px` x `height_px` as it evolved, or with a longer side of `resized_px`.
    pub(crate) fn new(width_px: u32, height_px: u32, resized_px: Option<u32>) -> Self {
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
    pub(crate) fn is_as_evolved(&self) -> bool {
        self.canvas.scale == (1, 1) && self.supersampling == 1
    }
}

/// Samples along each side of a pixel of a picture of `long_side_px` that was evolved at `evolved_px`: one for each
/// evolved pixel, within the limits, and as many as the largest canvas allows.
pub(crate) fn usual_supersampling(long_side_px: u32, evolved_px: u32) -> u32 {
    let wanted = evolved_px.div_ceil(long_side_px).clamp(SUPERSAMPLING, SUPERSAMPLING_MAX);
    (1..=wanted).rev().find(|factor| long_side_px * factor <= TARGET_SIDE_MAX_PX).unwrap_or(1)
}

/// What has to be drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Pieces {
    pub picture: bool,
    pub layers: bool,
}

impl Pieces {
    /// What these contents need.
    pub(crate) fn of(contents: impl Iterator<Item = Content>) -> Self {
        contents.fold(Self::default(), |pieces, content| Self {
            picture: pieces.picture || content.is_raster(),
            layers: pieces.layers || content == Content::OpenRaster,
        })
    }
}

/// A drawn picture.
#[derive(Clone, Debug)]
pub(crate) struct Raster {
    pub photo: Photo,
    /// Opacity of every pixel, 0 to 255; none if the picture is opaque.
    pub alpha: Option<Vec<u8>>,
}

impl From<Mosaic> for Raster {
    fn from(Mosaic { width_px, height_px, pixels, alpha }: Mosaic) -> Self {
        Self { photo: Photo { width_px, height_px, pixels }, alpha }
    }
}

/// A population with all that its outputs need of a painter.
#[derive(Clone, Debug)]
pub(crate) struct Drawn {
    pub population: Population,
    /// Marginal fitness of its flies.
    pub marginal: Vec<i64>,
    pub view: View,
    /// The picture, if one of the outputs has pixels.
    pub picture: Option<Raster>,
    /// The picture in layers, if one of the outputs has them.
    pub layers: Option<Layers>,
}

impl Drawn {
    /// What of `pieces` is not there yet.
    pub(crate) fn missing(&self, pieces: Pieces) -> Pieces {
        Pieces { picture: pieces.picture && self.picture.is_none(), layers: pieces.layers && self.layers.is_none() }
    }

    /// Draws what of `pieces` is not there yet, and now and then tells `watch` which share of it is done, 0 to 1.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn draw_watched(
        &mut self,
        painter: &mut dyn Painter,
        pieces: Pieces,
        watch: &mut dyn FnMut(f64),
    ) -> Result<()> {
        let View { canvas, supersampling } = self.view;
        let missing = self.missing(pieces);
        // A band of layers is drawn over black and over white.
        let picture_share = if missing.layers { 1.0 / (1.0 + 2.0 * BAND_COUNT as f64) } else { 1.0 };
        if missing.picture {
            let watch = &mut |share| watch(share * picture_share);
            self.picture = Some(painter.draw_watched(&self.population, &canvas, supersampling, watch)?.into());
        }
        if missing.layers {
            let watch = &mut |share| watch(picture_share + share * (1.0 - picture_share));
            self.layers = Some(Layers::draw(painter, &self.population, &canvas, supersampling, BAND_COUNT, watch)?);
        }
        Ok(())
    }

    /// As [`Drawn::draw_watched`], with nobody to tell.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn draw(&mut self, painter: &mut dyn Painter, pieces: Pieces) -> Result<()> {
        self.draw_watched(painter, pieces, &mut |_| {})
    }

    /// The bytes of a content.
    ///
    /// # Errors
    /// If the content cannot hold the result.
    pub(crate) fn encode(&self, content: Content, told: &Told) -> Result<Vec<u8>> {
        let Self { population, marginal, view, layers, .. } = self;
        match content {
            Content::Png => self.encode_picture(Format::Png, told),
            Content::Jpeg(quality) => self.encode_picture(Format::Jpeg { quality }, told),
            Content::WebP => self.encode_picture(Format::WebP, told),
            Content::Svg => vector::encode(population, &view.canvas, &told.picture),
            Content::OpenRaster => {
                openraster::encode(layers.as_ref().ok_or_else(undrawn)?, &self.encode_picture(Format::Png, told)?)
            }
            Content::Population => {
                archive::encode(population, marginal, &provenance::without_header(told.population.clone()))
            }
            Content::Json => archive::encode_json(population, marginal, &told.population),
            Content::Csv => archive::encode_csv(population, marginal, &told.population),
        }
    }

    fn encode_picture(&self, format: Format, told: &Told) -> Result<Vec<u8>> {
        let Raster { photo, alpha } = self.picture.as_ref().ok_or_else(undrawn)?;
        photo::encode_with_alpha(format, photo, alpha.as_deref(), &provenance::picture_metadata(&told.picture))
    }
}

fn undrawn() -> Error {
    Error::Internal("an output was not drawn".to_owned())
}

/// How far a mosaic is from its target where tiles are wanted, over black if nothing lies behind its tiles.
pub(crate) fn difference(mosaic: &Mosaic, target: &Target) -> Difference {
    let pixels = &mosaic.over_black();
    let Some(transparent) = target.transparent() else { return Difference::between(pixels, target.pixels()) };
    let wanted = |pixels: &[Rgb]| -> Vec<Rgb> {
        let wanted = pixels.iter().zip(transparent).filter(|&(_, &is_transparent)| !is_transparent);
        wanted.map(|(&color, _)| color).collect()
    };
    Difference::between(&wanted(pixels), &wanted(target.pixels()))
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
