//! Reducing a picture with Lanczos3.
//!
//! The kernel uses the sine of `libm`. The sums are single-precision floats in a fixed order, without SIMD and without
//! fused operations, so the pixels do not depend on the machine.

use std::f64::consts::PI;

use image::{GrayImage, RgbImage, RgbaImage};
use resize::px::RGB;
use resize::{Filter, Pixel, PixelFormat, Resizer, Type};

use super::Photo;

/// Pixels of the source, at scale 1, that the filter reaches to each side.
const SUPPORT: f64 = 3.0;
/// Least alpha of a pixel that is not transparent.
const OPAQUE_FROM: u8 = 128;

/// The picture with its longer side reduced to `long_side_px`; the same picture if it is not longer than that.
pub(super) fn fit(image: &RgbImage, long_side_px: Option<u32>) -> Photo {
    // A view instead of a copy, which would take most of a GiB for the largest picture.
    let (source, _) = image.as_raw().as_chunks::<3>();
    fit_pixels(source, image.dimensions(), long_side_px)
}

/// `photo` with its longer side reduced to `long_side_px`, at least 1, by Lanczos3; a copy if it is not longer than
/// that.
#[must_use]
pub fn fitted(photo: &Photo, long_side_px: u32) -> Photo {
    fit_pixels(&photo.pixels, (photo.width_px, photo.height_px), Some(long_side_px))
}

/// `photo` brought to exactly this size by Lanczos3.
#[must_use]
pub fn fitted_to(photo: &Photo, size_px: (u32, u32)) -> Photo {
    let pixels = resized(&photo.pixels, (photo.width_px, photo.height_px), size_px, Channels);
    Photo { width_px: size_px.0, height_px: size_px.1, pixels }
}

fn fit_pixels(source: &[[u8; 3]], size_px: (u32, u32), long_side_px: Option<u32>) -> Photo {
    let (width_px, height_px) = fitted_size(size_px, long_side_px);
    if (width_px, height_px) == size_px {
        return Photo { width_px, height_px, pixels: source.to_vec() };
    }
    Photo { width_px, height_px, pixels: resized(source, size_px, (width_px, height_px), Channels) }
}

/// The picture with its longer side reduced to `long_side_px`, and which of its pixels are transparent, if any are.
/// Transparent pixels become black, and all others opaque in their own colour.
///
/// Each pixel is weighted by its opacity, so transparent pixels give their neighbours no colour, not even black.
pub(super) fn fit_cut(image: &RgbaImage, long_side_px: Option<u32>) -> (Photo, Option<Vec<bool>>) {
    let (source, _) = image.as_raw().as_chunks::<4>();
    let (width_px, height_px) = fitted_size(image.dimensions(), long_side_px);
    let fitted = if (width_px, height_px) == image.dimensions() {
        source.to_vec()
    } else {
        resized(source, image.dimensions(), (width_px, height_px), Weighed)
    };
    let is_transparent = |&[_, _, _, alpha]: &[u8; 4]| alpha < OPAQUE_FROM;
    let color = |pixel: &[u8; 4]| if is_transparent(pixel) { [0; 3] } else { [pixel[0], pixel[1], pixel[2]] };
    let photo = Photo { width_px, height_px, pixels: fitted.iter().map(color).collect() };
    let transparent = fitted.iter().any(is_transparent).then(|| fitted.iter().map(is_transparent).collect());
    (photo, transparent)
}

/// The luma of a picture, row by row, at another size (larger or smaller), by Lanczos3.
pub(super) fn fit_luma(image: &GrayImage, (width_px, height_px): (u32, u32)) -> Vec<u8> {
    if (width_px, height_px) == image.dimensions() {
        return image.as_raw().clone();
    }
    resized(image.as_raw(), image.dimensions(), (width_px, height_px), Luma)
}

/// The pixels of a picture of the size `from` at the size `to`, both in px.
fn resized<F: PixelFormat>(source: &[F::InputPixel], from: (u32, u32), to: (u32, u32), format: F) -> Vec<F::OutputPixel>
where
    F::OutputPixel: Default,
{
    let filter = Filter::new(Box::new(|x| lanczos3(f64::from(x)) as f32), SUPPORT as f32);
    let [width, height, fitted_width, fitted_height] = [from.0, from.1, to.0, to.1].map(|side_px| side_px as usize);
    let mut pixels = vec![F::OutputPixel::default(); fitted_width * fitted_height];
    Resizer::new(width, height, fitted_width, fitted_height, format, Type::Custom(filter))
        .and_then(|mut resizer| resizer.resize(source, &mut pixels))
        .expect("both pictures have as many pixels as their sizes say");
    pixels
}

/// Pixels as arrays, with the arithmetic of [`Pixel::RGB8`].
struct Channels;

impl PixelFormat for Channels {
    type InputPixel = [u8; 3];
    type OutputPixel = [u8; 3];
    type Accumulator = RGB<f32>;

    fn new() -> RGB<f32> {
        RGB { r: 0.0, g: 0.0, b: 0.0 }
    }

    fn add(&self, sum: &mut RGB<f32>, [r, g, b]: [u8; 3], weight: f32) {
        Pixel::RGB8.add(sum, RGB { r, g, b }, weight);
    }

    fn add_acc(sum: &mut RGB<f32>, part: RGB<f32>, weight: f32) {
        sum.r += part.r * weight;
        sum.g += part.g * weight;
        sum.b += part.b * weight;
    }

    fn into_pixel(&self, sum: RGB<f32>) -> [u8; 3] {
        let RGB { r, g, b } = Pixel::RGB8.into_pixel(sum);
        [r, g, b]
    }
}

/// Colours weighted by their alpha, and the alpha itself.
struct Weighed;

impl PixelFormat for Weighed {
    type InputPixel = [u8; 4];
    type OutputPixel = [u8; 4];
    type Accumulator = [f32; 4];

    fn new() -> [f32; 4] {
        [0.0; 4]
    }

    fn add(&self, sum: &mut [f32; 4], [r, g, b, alpha]: [u8; 4], weight: f32) {
        let weight = f32::from(alpha) * weight;
        Self::add_acc(sum, [f32::from(r), f32::from(g), f32::from(b), 1.0], weight);
    }

    fn add_acc(sum: &mut [f32; 4], part: [f32; 4], weight: f32) {
        sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part * weight);
    }

    fn into_pixel(&self, [r, g, b, alpha]: [f32; 4]) -> [u8; 4] {
        // A pixel with alpha 0 has no colour: 0/0 becomes 0.
        [r / alpha, g / alpha, b / alpha, alpha].map(rounded)
    }
}

/// Grey pixels.
struct Luma;

impl PixelFormat for Luma {
    type InputPixel = u8;
    type OutputPixel = u8;
    type Accumulator = f32;

    fn new() -> f32 {
        0.0
    }

    fn add(&self, sum: &mut f32, luma: u8, weight: f32) {
        *sum += f32::from(luma) * weight;
    }

    fn add_acc(sum: &mut f32, part: f32, weight: f32) {
        *sum += part * weight;
    }

    fn into_pixel(&self, sum: f32) -> u8 {
        rounded(sum)
    }
}

/// The nearest 8-bit value, as [`Pixel::RGB8`] rounds.
fn rounded(value: f32) -> u8 {
    (value + 0.5) as u8
}

/// The fitted size in px: the longer side is `long_side_px`, the other one is rounded half up, and neither is below 1
/// px.
#[must_use]
pub fn fitted_size((width_px, height_px): (u32, u32), long_side_px: Option<u32>) -> (u32, u32) {
    let longer_px = u64::from(width_px.max(height_px));
    let fitted_px = u64::from(long_side_px.unwrap_or(u32::MAX).max(1)).min(longer_px);
    let scaled = |side_px: u32| ((u64::from(side_px) * fitted_px * 2 + longer_px) / (longer_px * 2)).max(1) as u32;
    (scaled(width_px), scaled(height_px))
}

fn lanczos3(x: f64) -> f64 {
    if (-SUPPORT..SUPPORT).contains(&x) { sinc(x) * sinc(x / SUPPORT) } else { 0.0 }
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { libm::sin(x * PI) / (x * PI) }
}

#[cfg(test)]
mod tests {
    use super::fitted_size;

    #[test]
    fn the_longer_side_is_fitted_and_the_other_rounded_half_up() {
        assert_eq!(fitted_size((1000, 500), Some(100)), (100, 50));
        assert_eq!(fitted_size((500, 1000), Some(100)), (50, 100));
        assert_eq!(fitted_size((1000, 625), Some(100)), (100, 63));
        assert_eq!(fitted_size((65_535, 1), Some(100)), (100, 1));
    }

    #[test]
    fn no_size_asked_for_and_larger_sizes_change_nothing() {
        assert_eq!(fitted_size((300, 200), None), (300, 200));
        assert_eq!(fitted_size((300, 200), Some(300)), (300, 200));
        assert_eq!(fitted_size((300, 200), Some(4000)), (300, 200));
    }
}
