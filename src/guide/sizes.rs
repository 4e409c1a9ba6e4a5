//! Sizes of tiles: small where there is detail, large where there is none, and such that the tiles' areas add up to the
//! picture's.
//!
//! Tiles on a picture of local steepness g make the least error if their side is proportional to g^(-1/3): their error
//! per pixel grows with g times the side, and their number falls with the square of the side.

use super::smooth::smoothed;
use super::tensor::Tensors;
use crate::model::Target;
use crate::model::guide::{GUIDE_PX, SIZE_ONE};

/// Smallest side relative to the mean side, in units of 1/[`SIZE_ONE`]: 0.6.
const SIZE_MIN: u32 = (SIZE_ONE * 6).div_ceil(10);
/// Largest side relative to the mean side: 1.7.
const SIZE_MAX: u32 = SIZE_ONE * 17 / 10;
/// How far a size may lie from the middle size before the last smoothing. The bounds would cut off larger deviations
/// anyway, and leave a hard step.
const REACH_OCTAVES: f64 = 0.8;
/// Steps of the logarithm of a size per factor of two.
const STEPS_PER_OCTAVE: f64 = 1024.0;

/// How pixels are weighed, and how strongly sizes answer.
pub(super) struct Demand<'a> {
    /// Deviation, in squares, with which both the detail and the sizes are smoothed.
    pub sigma: f64,
    /// The exponent of the detail, in 1/256 of a third.
    pub strength_q8: u32,
    /// Per pixel, how much its detail counts.
    pub weights: Option<&'a [u8]>,
}

/// For each square, the side of a tile relative to the mean side, in units of 1/[`SIZE_ONE`]; `1 / size^2` has a mean
/// of 1 over all pixels.
pub(super) fn sizes(target: &Target, tensors: &Tensors, demand: &Demand<'_>) -> Vec<u32> {
    let steps = steps(&details(target, tensors, demand), demand);
    let steps = smoothed(&steps, tensors.columns, demand.sigma);
    let first = steps.iter().copied().min().unwrap_or(0);
    let last = steps.iter().copied().max().unwrap_or(0);
    let mut pixels = vec![0_u64; (last - first) as usize + 1];
    for (place, &step) in steps.iter().enumerate() {
        pixels[(step - first) as usize] += pixels_of(target, place, tensors.columns);
    }
    let table = balanced(&pixels);
    steps.iter().map(|&step| table[(step - first) as usize]).collect()
}

/// The weighted amount of detail around each square; above 0, in an arbitrary unit.
fn details(target: &Target, tensors: &Tensors, demand: &Demand<'_>) -> Vec<f64> {
    // Rounding to 1/256 of the root changes far less than noise does.
    let steepness = |&trace: &i64| libm::rint(256.0 * (trace as f64).sqrt()) as i64;
    let steepness: Vec<i64> = tensors.trace.iter().map(steepness).collect();
    let steepness = smoothed(&steepness, tensors.columns, demand.sigma);
    // The floor is relative to the picture, so its contrast does not matter.
    let floor = mean(&steepness) / 16.0 + 1.0;
    let mut details: Vec<f64> = steepness.iter().map(|&steepness| steepness as f64 + floor).collect();
    if let Some(weights) = demand.weights {
        let weights = smoothed(&mean_weights(target, weights, tensors.columns), tensors.columns, demand.sigma);
        let mean = mean(&weights);
        details.iter_mut().zip(&weights).for_each(|(detail, &weight)| *detail *= weight as f64 / mean);
    }
    details
}

/// The logarithm of the size that each detail asks for, relative to the middle size, in [`STEPS_PER_OCTAVE`].
fn steps(details: &[f64], demand: &Demand<'_>) -> Vec<i64> {
    let factor = -f64::from(demand.strength_q8) / 256.0 / 3.0 * STEPS_PER_OCTAVE;
    let reach = (STEPS_PER_OCTAVE * REACH_OCTAVES) as i64;
    let mut steps: Vec<i64> = details.iter().map(|&detail| libm::rint(factor * libm::log2(detail)) as i64).collect();
    let middle = libm::rint(mean(&steps)) as i64;
    steps.iter_mut().for_each(|step| *step = (*step - middle).clamp(-reach, reach));
    steps
}

fn mean(plane: &[i64]) -> f64 {
    plane.iter().sum::<i64>() as f64 / plane.len() as f64
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

/// The size of each step, given the number of pixels that have it. Neighbouring steps differ by the same factor, within
/// bounds, and all are as small as the picture's area allows.
fn balanced(pixels: &[u64]) -> Vec<u32> {
    let sizes = |shift: i32| {
        let size = move |step: i32| {
            let size = f64::from(SIZE_ONE) * libm::exp2(f64::from(step + shift) / STEPS_PER_OCTAVE);
            libm::rint(size).clamp(f64::from(SIZE_MIN), f64::from(SIZE_MAX)) as u32
        };
        (0..pixels.len() as i32).map(size).collect::<Vec<_>>()
    };
    let fits = |shift: i32| {
        let area = |size: u32| f64::from(SIZE_ONE * SIZE_ONE) / f64::from(size * size);
        let sizes = sizes(shift);
        let tiles: f64 = sizes.iter().zip(pixels).map(|(&size, &pixels)| area(size) * pixels as f64).sum();
        tiles <= pixels.iter().sum::<u64>() as f64
    };
    // At the low end all steps are below the smallest size, at the high end all are above the largest.
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
