//! Reducing a picture with Lanczos3.
//!
//! Weights are computed in double precision with the sine of `libm`, then rounded to integers; sums are integers. So
//! the pixels do not depend on the machine, and the SIMD paths of `fast_image_resize` give what its plain path gives (a
//! test compares them).

use std::f64::consts::PI;

use fast_image_resize::images::{Image, ImageRef};
use fast_image_resize::{Filter, FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer};

use super::Photo;

/// Pixels of the source, at scale 1, that the filter reaches to each side.
const SUPPORT: f64 = 3.0;

/// The photo with its longer side reduced to `long_side_px`; the same photo if it is not longer than that.
pub(super) fn fit(photo: &Photo, long_side_px: Option<u32>) -> Photo {
    let (width_px, height_px) = fitted_size(photo.width_px, photo.height_px, long_side_px);
    if (width_px, height_px) == (photo.width_px, photo.height_px) {
        return photo.clone();
    }
    // Columns first: both orders round and clip in between, so the order decides pixels, and it is Pillow's.
    resized(&resized(photo, width_px, photo.height_px), width_px, height_px)
}

fn resized(photo: &Photo, width_px: u32, height_px: u32) -> Photo {
    let filter = Filter::new("Lanczos3", lanczos3, SUPPORT).expect("the support is positive");
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Custom(filter)));
    let bytes = bytemuck::cast_slice(&photo.pixels);
    let source = ImageRef::new(photo.width_px, photo.height_px, bytes, PixelType::U8x3)
        .expect("a photo has as many pixels as its size says");
    let mut reduced = Image::new(width_px, height_px, PixelType::U8x3);
    Resizer::new().resize(&source, &mut reduced, &options).expect("both images have pixels of one type");
    let (pixels, _) = reduced.buffer().as_chunks::<3>();
    Photo { width_px, height_px, pixels: pixels.to_vec() }
}

/// The size in px that fits: the longer side is `long_side_px`, the other is rounded half up, and none is below 1 px.
fn fitted_size(width_px: u32, height_px: u32, long_side_px: Option<u32>) -> (u32, u32) {
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
        assert_eq!(fitted_size(1000, 500, Some(100)), (100, 50));
        assert_eq!(fitted_size(500, 1000, Some(100)), (50, 100));
        assert_eq!(fitted_size(1000, 625, Some(100)), (100, 63));
        assert_eq!(fitted_size(65_535, 1, Some(100)), (100, 1));
    }

    #[test]
    fn no_size_asked_for_and_larger_sizes_change_nothing() {
        assert_eq!(fitted_size(300, 200, None), (300, 200));
        assert_eq!(fitted_size(300, 200, Some(300)), (300, 200));
        assert_eq!(fitted_size(300, 200, Some(4000)), (300, 200));
    }
}
