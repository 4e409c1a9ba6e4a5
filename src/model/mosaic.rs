//! The rendered picture, put together patch by patch from samples.

use super::target::Rgb;
use super::tile::{Canvas, unpack};

/// A rendered population: 8-bit sRGB pixels, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mosaic {
    /// Width in px.
    pub width_px: u32,
    /// Height in px.
    pub height_px: u32,
    /// `width_px * height_px` colours.
    pub pixels: Vec<Rgb>,
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
    /// A black mosaic of the size of `canvas`.
    #[must_use]
    pub fn new(canvas: &Canvas) -> Self {
        let pixels = vec![[0; 3]; canvas.width_px as usize * canvas.height_px as usize];
        Self { width_px: canvas.width_px, height_px: canvas.height_px, pixels }
    }

    /// Writes the pixels of a patch of samples: each pixel is the mean of `supersampling`² samples, rounded half up.
    ///
    /// `samples` are packed colours, row by row. The mean is of stored 8-bit values, as everywhere in the engine. The
    /// patch must start at a multiple of `supersampling` and hold whole pixels.
    pub fn absorb(&mut self, patch: &Patch, samples: &[u32], supersampling: u32) {
        let count = supersampling * supersampling;
        let (x, y) = (patch.x / supersampling, patch.y / supersampling);
        for row in 0..patch.height_px / supersampling {
            let first = (y + row) as usize * self.width_px as usize + x as usize;
            let pixels = &mut self.pixels[first..][..(patch.width_px / supersampling) as usize];
            for (column, pixel) in (0..).zip(pixels) {
                let mut sums = [0; 3];
                for sample_row in row * supersampling..(row + 1) * supersampling {
                    let start = (sample_row * patch.width_px + column * supersampling) as usize;
                    for &sample in &samples[start..][..supersampling as usize] {
                        let color = unpack(sample);
                        sums.iter_mut().zip(color).for_each(|(sum, channel)| *sum += u32::from(channel));
                    }
                }
                *pixel = sums.map(|sum| ((sum + count / 2) / count) as u8);
            }
        }
    }
}
