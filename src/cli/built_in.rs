//! A picture that needs no file, for measurements and checks.

use crate::error::Result;
use crate::model::cells::random::hash;
use crate::model::{Rgb, Target};

/// The picture with sides of `side_px`, of which `[width, height]` px from the upper left corner on are kept.
///
/// # Errors
/// Never, if the size is at least 1x1 px.
pub(crate) fn picture(side_px: u32, [width_px, height_px]: [u32; 2]) -> Result<Target> {
    let places = (0..height_px).flat_map(|y| (0..width_px).map(move |x| (x, y)));
    Target::new(width_px, height_px, places.map(|(x, y)| painted(x, y, side_px)).collect())
}

/// A pixel of the built-in picture: a fading sky, a disc, a ring, slanted bars, and noise on half of it.
fn painted(x: u32, y: u32, side_px: u32) -> Rgb {
    // Coordinates are scaled to a width of 1,024 px, so that both sizes show the same.
    let [u, v] = [x, y].map(|place| ((2 * place + 1) * 512 / side_px) as i32);
    let square_to = |x: i32, y: i32| (u - x) * (u - x) + (v - y) * (v - y);
    let is_barred = u + 2 * v > 1_900 && (u - v / 2).rem_euclid(96) < 40;
    let base = if square_to(340, 330) < 210 * 210 {
        [230, 90 + v / 8, 40]
    } else if (150 * 150..200 * 200).contains(&square_to(740, 420)) {
        [240, 230, 200 - u / 10]
    } else if is_barred {
        [20, 60 + u / 20, 50]
    } else {
        [u / 6, 120 + v / 10, 220 - v / 6]
    };
    let amplitude = if u > 512 { 24 } else { 4 };
    let noise = ((hash(y * side_px + x) >> 16) as i32 % amplitude) - amplitude / 2;
    base.map(|channel| (channel + noise).clamp(0, 255) as u8)
}
