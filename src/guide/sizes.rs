//! Sizes of tiles: small where there is detail, large where there is none, and filling the picture exactly once.
//!
//! Cells that approximate a picture of steepness g err least if their side goes with g^(-1/3): their error grows with
//! g times the side, their number with the side's square.

use super::smooth::smoothed;
use super::tensor::Tensors;
use crate::model::Target;
use crate::model::guide::{GUIDE_PX, SIZE_ONE};

/// Smallest side over the mean side, in units of 1/[`SIZE_ONE`]: 0.6.
const SIZE_MIN: u32 = (SIZE_ONE * 6).div_ceil(10);
/// Largest side over the mean side: 1.7.
const SIZE_MAX: u32 = SIZE_ONE * 17 / 10;
/// Steps of the logarithm of a size per factor of two.
const STEPS_PER_OCTAVE: f64 = 1024.0;

/// How pixels are weighed, and how strongly sizes answer.
pub(super) struct Demand<'a> {
    /// Deviation of the smoothing, in squares.
    pub sigma: f64,
    /// The exponent of the detail, in 1/256 of a third.
    pub strength_q8: u32,
    /// Per pixel, how much its detail counts.
    pub weights: Option<&'a [u8]>,
}

/// Side over mean side of each square in units of 1/[`SIZE_ONE`]; `1 / size^2` has a mean of 1 over all pixels.
pub(super) fn sizes(target: &Target, tensors: &Tensors, demand: &Demand<'_>) -> Vec<u32> {
    // 1/256 of a step of the root is far below what noise does.
    let steepness: Vec<i64> =
        tensors.trace.iter().map(|&trace| libm::rint(256.0 * (trace as f64).sqrt()) as i64).collect();
    let steepness = smoothed(&steepness, tensors.columns, demand.sigma);
    let mean = |plane: &[i64]| plane.iter().sum::<i64>() as f64 / plane.len() as f64;
    let floor = mean(&steepness) / 16.0 + 1.0;
    let weights = demand.weights.map(|weights| {
        let weights = smoothed(&mean_weights(target, weights, tensors.columns), tensors.columns, demand.sigma);
        let mean = mean(&weights);
        weights.iter().map(|&weight| weight as f64 / mean).collect::<Vec<_>>()
    });
    let exponent = -f64::from(demand.strength_q8) / 256.0 / 3.0;
    let step = |place: usize| {
        let weight = weights.as_ref().map_or(1.0, |weights| weights[place]);
        let detail = (steepness[place] as f64 + floor) * weight;
        libm::rint(exponent * STEPS_PER_OCTAVE * libm::log2(detail)) as i32
    };
    let steps: Vec<i32> = (0..steepness.len()).map(step).collect();
    let first = steps.iter().copied().min().unwrap_or(0);
    let last = steps.iter().copied().max().unwrap_or(0);
    let mut pixels = vec![0_u64; (last - first) as usize + 1];
    for (place, step) in steps.iter().enumerate() {
        pixels[(step - first) as usize] += pixels_of(target, place, tensors.columns);
    }
    let table = balanced(&pixels);
    steps.iter().map(|step| table[(step - first) as usize]).collect()
}

/// Pixels of the picture in the square at `place`: fewer at the border.
fn pixels_of(target: &Target, place: usize, columns: usize) -> u64 {
    let side = |place: usize, length_px: u32| GUIDE_PX.min(length_px - place as u32 * GUIDE_PX);
    u64::from(side(place % columns, target.width_px())) * u64::from(side(place / columns, target.height_px()))
}

/// Mean weight of the pixels of each square, times 256.
fn mean_weights(target: &Target, weights: &[u8], columns: usize) -> Vec<i64> {
    let (width, side) = (target.width_px() as usize, GUIDE_PX as usize);
    let mut means = Vec::new();
    for rows in weights.chunks(width * side) {
        let mut sums = vec![0_i64; columns];
        for row in rows.chunks(width) {
            for (sum, weights) in sums.iter_mut().zip(row.chunks(side)) {
                *sum += weights.iter().map(|&weight| i64::from(weight.max(1))).sum::<i64>();
            }
        }
        let first = means.len();
        means.extend((first..).zip(sums).map(|(place, sum)| 256 * sum / pixels_of(target, place, columns) as i64));
    }
    means
}

/// The size of each step, from the number of pixels that have it: the same factor between neighbouring steps, within
/// bounds, and as small as the picture's area allows.
fn balanced(pixels: &[u64]) -> Vec<u32> {
    let sizes = |shift: i32| {
        let size = move |step: i32| {
            let size = f64::from(SIZE_ONE) * libm::exp2(f64::from(step + shift) / STEPS_PER_OCTAVE);
            libm::rint(size).clamp(f64::from(SIZE_MIN), f64::from(SIZE_MAX)) as u32
        };
        (0..pixels.len() as i32).map(size).collect::<Vec<_>>()
    };
    let fits = |shift: i32| {
        let area = |size: u32| (f64::from(SIZE_ONE) / f64::from(size)).powi(2);
        let sizes = sizes(shift);
        let tiles: f64 = sizes.iter().zip(pixels).map(|(&size, &pixels)| area(size) * pixels as f64).sum();
        tiles <= pixels.iter().sum::<u64>() as f64
    };
    // All steps are below the smallest size at the low end and above the largest at the high one.
    let (mut low, mut high) = (-(pixels.len() as i32) - 1024, 1024);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if fits(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    sizes(high)
}
