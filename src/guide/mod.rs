//! Computes the guide of a search: directions along the contours of a picture, and sizes of tiles that follow its
//! detail.
//!
//! Every sum is an integer or a float in a fixed order, so that a picture has the same guide on every machine and with
//! any number of threads. Time depends on the number of pixels alone. Devices read the [`Guide`] as a buffer; nothing
//! here knows about devices.

mod flow;
mod sizes;
mod smooth;
mod tensor;

use rayon::prelude::*;

use crate::model::Target;
use crate::model::fly::UNITS_PER_PX;
use crate::model::guide::{GUIDE_PX, Guide, GuideSample, SIZE_ONE};

use sizes::Demand;
use tensor::Tensors;

/// What a [`flowing`] guide shall be like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flow<'a> {
    /// Mean side of a tile in 1/64 px. Contours finer than half of it do not count, and sizes change slowly over two of
    /// it.
    pub tile_side: u32,
    /// Over how many 1/64 px the directions are smoothed. One to three sides of a tile make a mosaic look laid by hand.
    pub smoothing: u32,
    /// How much sizes follow the detail, in 1/256: 0 keeps them equal, 256 gives all tiles about the same error.
    pub size_strength_q8: u32,
    /// How much each pixel's detail counts, row by row; 0 counts as 1. `None` if all pixels count the same.
    pub weights: Option<&'a [u8]>,
}

/// A guide with the directions of the edges themselves, at a scale of two pixels; all sizes are 1.
#[must_use]
pub fn sharp(target: &Target) -> Guide {
    // Smoothing adds to the extent of the square itself, which has a deviation of 1.12 px.
    const DEVIATION: f64 = 1.5 / GUIDE_PX as f64;
    let tensors = Tensors::of(target).smoothed(DEVIATION);
    let sample = |place| {
        let (x, y) = tensors.along(place);
        let coherence = libm::rint(255.0 * tensors.coherence(place)) as u16;
        GuideSample { direction: half_angle(x, y), coherence, size_q12: SIZE_ONE }
    };
    guide(&tensors, sample)
}

/// A guide with directions that flow along the contours and on into flat areas, and sizes that follow the detail.
///
/// If the picture has any contour, every place has a direction. Coherence fades with the distance from contours and
/// where contours contradict each other. The outermost [`GUIDE_PX`] px are replaced by the pixels next to them.
///
/// # Panics
/// If there are weights, but not one per pixel.
#[must_use]
pub fn flowing(target: &Target, flow: &Flow<'_>) -> Guide {
    assert!(flow.weights.is_none_or(|weights| weights.len() == target.pixels().len()), "each pixel has one weight");
    let in_squares = |length: u32| f64::from(length) / f64::from(UNITS_PER_PX * GUIDE_PX);
    let side = in_squares(flow.tile_side);
    let tensors = Tensors::of(target).without_frame();
    let demand = Demand { sigma: 1.25 * side, strength_q8: flow.size_strength_q8, weights: flow.weights };
    let sizes = sizes::sizes(target, &tensors, &demand);
    let field = flow::flow(&tensors.smoothed(0.5 * side), in_squares(flow.smoothing));
    let sample = |place: usize| {
        let [x, y] = field.vectors[place].map(f64::from);
        let coherence = libm::rint(255.0 * (x * x + y * y).sqrt().sqrt().min(1.0)) as u16;
        GuideSample { direction: half_angle(x, y), coherence, size_q12: sizes[place] }
    };
    guide(&tensors, sample)
}

fn guide(tensors: &Tensors, sample: impl Fn(usize) -> GuideSample + Send + Sync) -> Guide {
    let samples = (0..tensors.trace.len()).into_par_iter().with_min_len(1 << 10).map(sample).collect();
    Guide { columns: tensors.columns as u32, rows: tensors.rows as u32, samples }
}

/// Half the angle of a vector in 1/65536 of a turn, below half a turn; 0 for the vector 0.
fn half_angle(x: f64, y: f64) -> u16 {
    let halves = libm::rint(libm::atan2(y, x) * (f64::from(1_u32 << 15) / std::f64::consts::TAU)) as i32;
    halves.rem_euclid(1 << 15) as u16
}
