//! Drawing templates with integers: every texel is the mean of 8x8 samples, so edges are smooth and the drawing is the
//! same on every machine.

use super::ink::Ink;
use crate::model::mask::MASK_SIDE;

/// Units of a drawing's coordinates per texel.
pub(super) const UNITS_PER_TEXEL: i64 = 16;
/// Half the side of the square in which a template is drawn, in units: coordinates run from `-HALF` to `HALF`.
pub(super) const HALF: i64 = MASK_SIDE as i64 / 2 * UNITS_PER_TEXEL;
/// Samples along each side of a texel.
const SAMPLES: i64 = 8;

/// The drawing whose intensity at (x, y) is `intensity_at`, or a hole where that is `None`. x goes to the right and y
/// down from the middle.
///
/// Samples lie at odd coordinates, so no sample lies on an axis, and a symmetric rule gives a symmetric drawing.
pub(super) fn drawn(intensity_at: impl Fn(i64, i64) -> Option<i64>) -> Vec<Ink> {
    let side = MASK_SIDE as i64;
    let texel = |index: i64| {
        let (left, top) = (index % side * UNITS_PER_TEXEL - HALF, index / side * UNITS_PER_TEXEL - HALF);
        let step = UNITS_PER_TEXEL / SAMPLES;
        let places = (0..SAMPLES * SAMPLES)
            .map(|sample| (left + sample % SAMPLES * step + step / 2, top + sample / SAMPLES * step + step / 2));
        let (count, sum) = places
            .filter_map(|(x, y)| intensity_at(x, y))
            .fold((0, 0), |(count, sum), intensity| (count + 1, sum + intensity.clamp(0, 255)));
        Ink {
            alpha: rounded(255 * count, SAMPLES * SAMPLES) as u8,
            intensity: if count == 0 { 255 } else { rounded(sum, count) as u8 },
        }
    };
    (0..side * side).map(texel).collect()
}

/// The value at `value` of the straight line from (`from`, `low`) to (`to`, `high`), constant beyond its ends; `from <
/// to`.
pub(super) fn ramp(value: i64, (from, to): (i64, i64), (low, high): (i64, i64)) -> i64 {
    low + rounded((value.clamp(from, to) - from) * (high - low), to - from)
}

/// As [`ramp`] from 0 to 255, but it begins and ends with slope 0: `3 t^2 - 2 t^3`.
pub(super) fn smooth_step(value: i64, from: i64, to: i64) -> i64 {
    let t = ramp(value, (from, to), (0, 4096));
    rounded(255 * t * t * (3 * 4096 - 2 * t), 1 << 36)
}

/// `value / divisor` for a positive divisor, rounded to the nearest integer, halves up.
pub(super) fn rounded(value: i64, divisor: i64) -> i64 {
    (2 * value + divisor).div_euclid(2 * divisor)
}
