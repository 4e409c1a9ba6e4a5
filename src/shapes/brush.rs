//! The template of a brush stroke: its bristles carry different amounts of paint and run dry towards the right.

use super::drawing::{ramp, smooth_step};
use super::ink::Ink;
use super::noise::{ONE, noise};
use crate::model::mask::MASK_SIDE;

/// The stroke runs along x, from a rounded start at the left to a dry, ragged end at the right.
pub(super) fn stroke() -> Vec<Ink> {
    let side = MASK_SIDE as i64;
    (0..side * side).map(|index| texel(index % side, index / side)).collect()
}

fn texel(column: i64, row: i64) -> Ink {
    let middle = MASK_SIDE as i64 / 2;
    let off = (2 * row + 1 - 2 * middle).abs();
    // The stroke becomes a little wider and narrower; in half texels, as `off` is.
    let half = 246 - noise(1, column * ONE / 40, 0) * 22 / 255;
    let shoulder = off * off / 1500;
    let start = 2 + shoulder + noise(2, row * ONE / 5, 0) * 16 / 255;
    let end = 252 - shoulder / 2 - noise(3, row * ONE / 6, 0) * 34 / 255 - noise(4, row * ONE / 2, 0) * 22 / 255;
    let shape =
        smooth_step(column, start - 2, start + 4) * smooth_step(end - column, -4, 12) * smooth_step(half - off, -3, 8)
            / (255 * 255);

    // Streaks are long and thin; the drier the brush, the more streaks open.
    let streak = (noise(5, column * ONE / 90, row * ONE / 3) * 3 + noise(6, column * ONE / 28, row * ONE / 7)) / 4;
    let paint = ramp(column, (60, 250), (240, 90));
    let opacity = ramp(streak + paint, (160, 325), (70, 255));

    let bristle = (noise(7, column * ONE / 160, row * ONE / 4) * 2 + noise(8, column * ONE / 60, row * ONE / 2)) / 3;
    let ridge = smooth_step(off, 200, 236) * 30 / 255;
    let intensity = ramp(bristle, (50, 205), (165, 255)) - ridge;
    Ink { alpha: (shape * opacity / 255) as u8, intensity: intensity.clamp(120, 255) as u8 }
}
