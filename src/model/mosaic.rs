//! The rendered picture, put together patch by patch from samples.

use std::borrow::Cow;

use super::population::Backdrop;
use super::target::Rgb;
use super::tile::{Canvas, unpack};

/// A rendered population: 8-bit sRGB pixels, row by row from the top, with alpha if its backdrop is transparent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mosaic {
    /// Width in px.
    pub width_px: u32,
    /// Height in px.
    pub height_px: u32,
    /// `width_px * height_px` colours; with alpha they are not premultiplied, and black where the picture is empty.
    pub pixels: Vec<Rgb>,
    /// `width_px * height_px` opacities, from 0 where the picture is empty to 255; `None` if the backdrop is a colour.
    pub alpha: Option<Vec<u8>>,
}

/// A rectangle of samples of a canvas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patch {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
}

impl Mosaic {
    /// A black mosaic of the size of `canvas`, with alpha 0 if `backdrop` is transparent.
    #[must_use]
    pub fn new(canvas: &Canvas, backdrop: Backdrop) -> Self {
        let pixel_count = canvas.width_px as usize * canvas.height_px as usize;
        let alpha = (backdrop == Backdrop::Transparent).then(|| vec![0; pixel_count]);
        Self { width_px: canvas.width_px, height_px: canvas.height_px, pixels: vec![[0; 3]; pixel_count], alpha }
    }

    /// The colours over black. This is what a search scores where nothing lies behind the tiles: what a tile does not
    /// cover counts as black, and what it covers in part, as partly black.
    #[must_use]
    pub fn over_black(&self) -> Cow<'_, [Rgb]> {
        let Some(alpha) = &self.alpha else { return Cow::Borrowed(&self.pixels) };
        let darkened = |(color, &alpha): (&Rgb, &u8)| {
            color.map(|channel| ((u32::from(channel) * u32::from(alpha) + 127) / 255) as u8)
        };
        Cow::Owned(self.pixels.iter().zip(alpha).map(darkened).collect())
    }

    /// Writes the pixels of a patch of samples: each pixel is the mean of `supersampling`² samples, rounded half up.
    ///
    /// `samples` are packed colours, row by row. With alpha, their highest byte is their opacity: the pixel's alpha is
    /// the mean of these opacities, and its colour the mean weighted by them. The mean is of stored 8-bit values, as
    /// everywhere in the engine. The patch must start at a multiple of `supersampling` and hold whole pixels.
    pub fn absorb(&mut self, patch: &Patch, samples: &[u32], supersampling: u32) {
        let (x, y) = (patch.x / supersampling, patch.y / supersampling);
        let width = (patch.width_px / supersampling) as usize;
        for row in 0..patch.height_px / supersampling {
            let first = (y + row) as usize * self.width_px as usize + x as usize;
            let rows = &samples[(row * supersampling * patch.width_px) as usize..];
            let samples_of = |column: u32| {
                let starts =
                    (0..supersampling).map(move |row| (row * patch.width_px + column * supersampling) as usize);
                starts.map(move |start| &rows[start..][..supersampling as usize])
            };
            let pixels = (0..).zip(&mut self.pixels[first..][..width]);
            match &mut self.alpha {
                None => pixels.for_each(|(column, pixel)| *pixel = mean(samples_of(column), supersampling)),
                Some(alpha) => pixels.zip(&mut alpha[first..][..width]).for_each(|((column, pixel), alpha)| {
                    (*pixel, *alpha) = mean_with_alpha(samples_of(column), supersampling);
                }),
            }
        }
    }
}

/// The mean colour of `supersampling`² samples.
fn mean<'a>(rows: impl Iterator<Item = &'a [u32]>, supersampling: u32) -> Rgb {
    let count = supersampling * supersampling;
    let mut sums = [0; 3];
    for row in rows {
        for &sample in row {
            sums.iter_mut().zip(unpack(sample)).for_each(|(sum, channel)| *sum += u32::from(channel));
        }
    }
    sums.map(|sum| ((sum + count / 2) / count) as u8)
}

/// The mean opacity of `supersampling`² samples, and the mean of their colours weighted by opacity; black if the
/// opacity is 0.
fn mean_with_alpha<'a>(rows: impl Iterator<Item = &'a [u32]>, supersampling: u32) -> (Rgb, u8) {
    let count = supersampling * supersampling;
    let (mut sums, mut weight) = ([0; 3], 0);
    for row in rows {
        for &sample in row {
            let alpha = sample >> 24;
            sums.iter_mut().zip(unpack(sample)).for_each(|(sum, channel)| *sum += alpha * u32::from(channel));
            weight += alpha;
        }
    }
    match (weight + count / 2) / count {
        0 => ([0; 3], 0),
        alpha => (sums.map(|sum| ((sum + weight / 2) / weight) as u8), alpha as u8),
    }
}
