//! A finished mosaic: its tiles, its score, its pixels at any size, and its bytes in every format.

use std::path::Path;

use super::device::Device;
use super::drawing::{Content, Drawn, JPEG_QUALITY, Pieces, Raster, View};
use super::job::Job;
use super::making::Finished;
use super::parameters::{in_range, wrong};
use super::provenance::{Provenance, Provenances, Told};
use super::settings::Settings;
use super::tile::Tile;
use crate::cpu::CpuPainter;
use crate::error::{Error, Result};
use crate::evolve::{Ending, StopReason};
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::model::{Backdrop, Population, Rgb};
use crate::output;
use crate::photo::{Photo, WEBP_SIDE_MAX_PX};

/// The pixels of a mosaic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Width in px.
    pub width_px: u32,
    /// Height in px.
    pub height_px: u32,
    /// Red, green and blue of every pixel as 8-bit sRGB, row by row from the top; not multiplied by alpha.
    pub pixels: Vec<Rgb>,
    /// Opacity of every pixel, 0 to 255; none if the picture is opaque.
    pub alpha: Option<Vec<u8>>,
}

impl Image {
    /// The pixels as bytes: three for each, row by row.
    #[must_use]
    pub fn rgb8(&self) -> &[u8] {
        self.pixels.as_flattened()
    }

    /// The pixels as bytes: four for each, with alpha.
    #[must_use]
    pub fn rgba8(&self) -> Vec<u8> {
        let alpha = |place: usize| self.alpha.as_ref().map_or(255, |alpha| alpha[place]);
        let pixels = self.pixels.iter().enumerate();
        pixels.flat_map(|(place, &[r, g, b])| [r, g, b, alpha(place)]).collect()
    }
}

/// A finished mosaic, drawn at the size at which it evolved or at another one ([`Mosaic::resized`]).
#[derive(Clone, Debug)]
pub struct Mosaic {
    ending: Ending,
    psnr_db: Option<f64>,
    drawn: Drawn,
    picture_provenance: Provenance,
    population_provenance: Provenance,
}

impl Mosaic {
    /// The result of a job; `drawn` has its picture.
    pub(super) fn new(settings: &Settings, job: &Job, finished: Finished) -> Self {
        let Provenances { picture, population, .. } = Provenances::new(settings, job, None);
        Self::with_provenance(finished, picture, population)
    }

    pub(super) fn with_provenance(finished: Finished, picture: Provenance, population: Provenance) -> Self {
        let Finished { ending, drawn, psnr_db, .. } = finished;
        Self { ending, psnr_db, drawn, picture_provenance: picture, population_provenance: population }
    }

    /// The tiles, in the order of the population. Which of two tiles is nearer, their depths tell.
    pub fn tiles(&self) -> impl Iterator<Item = Tile> + '_ {
        Tile::of(&self.drawn.population.flies, Some(&self.drawn.marginal))
    }

    /// The whole population, with its masks, background and grout: what can be drawn again, and begun from
    /// ([`crate::Recipe::init`]).
    #[must_use]
    pub fn population(&self) -> &Population {
        &self.drawn.population
    }

    /// The sum of absolute differences of 8-bit sRGB channels from the fitted picture, where tiles are wanted; lower is
    /// better.
    #[must_use]
    pub fn sae(&self) -> u64 {
        self.ending.sae
    }

    /// What was lowered: the SAE, with the penalties of the style and the weights if there are any.
    #[must_use]
    pub fn objective(&self) -> i64 {
        self.ending.objective()
    }

    /// Peak signal-to-noise ratio in dB against the fitted picture; none if it is infinite.
    #[must_use]
    pub fn psnr_db(&self) -> Option<f64> {
        self.psnr_db
    }

    /// Children that were evaluated; in the paper's scheme each is a birth.
    #[must_use]
    pub fn evals(&self) -> u64 {
        self.ending.evals()
    }

    /// New tiles that took a place; tiles that were only changed do not count.
    #[must_use]
    pub fn births(&self) -> u64 {
        self.ending.births()
    }

    /// Why the work ended; [`StopReason::Interrupted`] if the callback ended it.
    #[must_use]
    pub fn stop_reason(&self) -> StopReason {
        self.ending.stop
    }

    /// SHA-256 over everything that decides the picture: 64 lower-case hexadecimal digits. The same key means the same
    /// bytes, if the work came to its end.
    #[must_use]
    pub fn key(&self) -> &str {
        self.picture_provenance.key()
    }

    /// Its pixels.
    ///
    /// # Errors
    /// Never for a mosaic that was made by this crate.
    pub fn image(&self) -> Result<Image> {
        let drawn = self.drawn.picture.as_ref();
        let Raster { photo, alpha } =
            drawn.ok_or_else(|| Error::Internal("a mosaic was not drawn".to_owned()))?.clone();
        let Photo { width_px, height_px, pixels } = photo;
        Ok(Image { width_px, height_px, pixels, alpha })
    }

    /// The same mosaic drawn with a longer side of `long_side_px`, 1 to 65,535 px, from the tiles: sharp at any size.
    /// This takes about 10 bytes of memory for each pixel, 16 if it is transparent.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if the size is out of range; or if the device fails.
    pub fn resized(&self, long_side_px: u32, device: &Device) -> Result<Self> {
        in_range("output_size", u64::from(long_side_px), 1..=u64::from(TARGET_SIDE_MAX_PX))?;
        let Population { width_px, height_px, .. } = self.drawn.population;
        let resized_px = Some(long_side_px).filter(|&long| long != width_px.max(height_px));
        let (population, marginal) = (self.drawn.population.clone(), self.drawn.marginal.clone());
        let view = View::new(width_px, height_px, resized_px);
        let mut drawn = Drawn { population, marginal, view, picture: None, layers: None };
        drawn.draw(&mut *device.open_painter()?, Pieces { picture: true, layers: false })?;
        let picture_provenance = self.picture_provenance.resized(resized_px);
        Ok(Self { drawn, picture_provenance, ..self.clone() })
    }

    /// As a PNG file.
    ///
    /// # Errors
    /// If the picture cannot be encoded.
    pub fn png(&self) -> Result<Vec<u8>> {
        self.encode(Content::Png)
    }

    /// As a JPEG file of the quality 92, over black where it is transparent.
    ///
    /// # Errors
    /// If the picture cannot be encoded.
    pub fn jpeg(&self) -> Result<Vec<u8>> {
        self.jpeg_of_quality(JPEG_QUALITY)
    }

    /// As a JPEG file of a quality from 1 to 100, over black where it is transparent.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if the quality is out of range.
    pub fn jpeg_of_quality(&self, quality: u8) -> Result<Vec<u8>> {
        in_range("quality", u64::from(quality), 1..=100)?;
        self.encode(Content::Jpeg(quality))
    }

    /// As a WebP file without losses.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if it has more than 16,383 px a side, the most that the format has.
    pub fn webp(&self) -> Result<Vec<u8>> {
        let long_side_px = self.drawn.view.canvas.width_px.max(self.drawn.view.canvas.height_px);
        if long_side_px > WEBP_SIDE_MAX_PX {
            return Err(wrong("output_size", long_side_px, format!("a WebP has at most {WEBP_SIDE_MAX_PX} px a side")));
        }
        self.encode(Content::WebP)
    }

    /// As an SVG file: one element for each tile.
    ///
    /// # Errors
    /// If the picture of a mask cannot be encoded.
    pub fn svg(&self) -> Result<Vec<u8>> {
        self.encode(Content::Svg)
    }

    /// As an OpenRaster file: the tiles in eight layers by their depth.
    ///
    /// # Errors
    /// If the file would be too large for its format.
    pub fn ora(&self) -> Result<Vec<u8>> {
        let mut drawn = self.drawn.clone();
        drawn.draw(&mut CpuPainter, Pieces { picture: false, layers: true })?;
        drawn.encode(Content::OpenRaster, &self.told())
    }

    /// The population as a .npz file, which numpy opens, and which can be drawn again and begun from.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn npz(&self) -> Result<Vec<u8>> {
        self.encode(Content::Population)
    }

    /// The living flies as a CSV table.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn csv(&self) -> Result<Vec<u8>> {
        self.encode(Content::Csv)
    }

    /// The flies as one JSON object, a fly a line.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn json(&self) -> Result<Vec<u8>> {
        self.encode(Content::Json)
    }

    /// Whether nothing lies behind the tiles, so that pictures have alpha.
    #[must_use]
    pub fn is_transparent(&self) -> bool {
        self.drawn.population.background == Backdrop::Transparent
    }

    /// Writes a file in the format that its name ends in: `.png`, `.jpg`, `.webp`, `.svg`, `.ora`, `.npz`, `.csv` or
    /// `.json`. It is there as a whole or not at all, and a file of the same name is replaced.
    ///
    /// # Errors
    /// [`Error::Output`] if the name has no such ending, or the file cannot be written; else as the method of the
    /// format.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let unknown = || Error::Output {
            path: path.to_owned(),
            reason: "does not end in .png, .jpg, .webp, .svg, .ora, .npz, .csv or .json; choose one of these"
                .to_owned(),
        };
        let bytes = match Content::of_path(path).ok_or_else(unknown)? {
            Content::WebP => self.webp(),
            Content::OpenRaster => self.ora(),
            content => self.encode(content),
        };
        output::write_atomically(path, &bytes?)
    }

    fn encode(&self, content: Content) -> Result<Vec<u8>> {
        self.drawn.encode(content, &self.told())
    }

    fn told(&self) -> Told {
        Told {
            picture: self.picture_provenance.describe(Some(&self.ending)),
            population: self.population_provenance.describe(Some(&self.ending)),
        }
    }
}
