//! Gene-level steps: the random first fly and the mutation of the paper's scheme, in integers.
//!
//! Amplitudes are standard deviations. They are not in the paper; the defaults are the best found for 40,000 births on
//! the development pictures (`cargo bench --bench paper_run` repeats the run they were chosen by).

use super::fly::{Fly, SIDE_MAX, SIDE_MIN, UNITS_PER_PX, Z_MAX, position_max};
use super::rng::Stream;
use super::tables::{normal_q8, size_factor_q16};

/// A step's standard deviation in units of its gene, with 16 fractional bits.
type StepQ16 = i64;

const ONE_Q16: i64 = 1 << 16;

/// Side of a tile such that `fly_count` squares have the area of the picture (paper Eq. 1), with 16 fractional bits of
/// 1/64 px.
fn tile_side_q16(width_px: u32, height_px: u32, fly_count: usize) -> i64 {
    let area = u128::from(width_px) * u128::from(height_px) * u128::from(UNITS_PER_PX * UNITS_PER_PX);
    ((area << 32) / fly_count as u128).isqrt() as i64
}

/// The side of Eq. 1, d = sqrt(width * height / N), as a gene.
#[must_use]
pub fn tile_side(width_px: u32, height_px: u32, fly_count: usize) -> u32 {
    let rounded = (tile_side_q16(width_px, height_px, fly_count) + ONE_Q16 / 2) / ONE_Q16;
    (rounded.clamp(0, i64::from(SIDE_MAX)) as u32).max(SIDE_MIN)
}

/// How far mutation moves each gene: standard deviations of bell-shaped steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Amplitudes {
    position: StepQ16,
    z: StepQ16,
    color: StepQ16,
    angle: StepQ16,
    /// In steps of 1/256 of the natural logarithm of a side.
    log_side: StepQ16,
}

impl Amplitudes {
    /// The paper's scheme: 1.55 d, 0.12 of the depth range, 0.023 of the colour range, 60 degrees, 0.16 in log size.
    #[must_use]
    pub fn paper(width_px: u32, height_px: u32, fly_count: usize) -> Self {
        Self {
            position: tile_side_q16(width_px, height_px, fly_count) * 155 / 100,
            z: (i64::from(Z_MAX) + 1) * ONE_Q16 * 12 / 100,
            color: 65_535 * ONE_Q16 * 23 / 1000,
            angle: 65_536 * ONE_Q16 / 6,
            log_side: 256 * ONE_Q16 * 16 / 100,
        }
    }

    /// All amplitudes times `factor_q16` / 65536.
    #[must_use]
    pub fn scaled(self, factor_q16: u32) -> Self {
        let scale = |step: StepQ16| ((i128::from(step) * i128::from(factor_q16)) >> 16) as i64;
        Self {
            position: scale(self.position),
            z: scale(self.z),
            color: scale(self.color),
            angle: scale(self.angle),
            log_side: scale(self.log_side),
        }
    }
}

/// A fly with uniform random position, depth, colour and angle, and both sides `side` (paper section 4).
#[must_use]
pub fn random_fly(width_px: u32, height_px: u32, side: u32, stream: &mut Stream) -> Fly {
    let mut channel = || (stream.bits() >> 16) as u16;
    let (r, g, b, angle) = (channel(), channel(), channel(), channel());
    Fly {
        x: stream.below(position_max(width_px) as u32 + 1) as i32,
        y: stream.below(position_max(height_px) as u32 + 1) as i32,
        z: stream.bits() >> 8,
        r,
        g,
        b,
        angle,
        w: side,
        h: side,
        mask: 0,
        alive: true,
    }
}

/// A copy of `parent` with a bell-shaped step in all nine genes. Position, depth, colour and sides stop at their
/// bounds; the angle wraps.
#[must_use]
pub fn mutated(parent: &Fly, amplitudes: &Amplitudes, width_px: u32, height_px: u32, stream: &mut Stream) -> Fly {
    let mut moved = |gene: i64, amplitude, max: i64| (gene + step(amplitude, stream)).clamp(0, max);
    let x = moved(i64::from(parent.x), amplitudes.position, i64::from(position_max(width_px))) as i32;
    let y = moved(i64::from(parent.y), amplitudes.position, i64::from(position_max(height_px))) as i32;
    let z = moved(i64::from(parent.z), amplitudes.z, i64::from(Z_MAX)) as u32;
    let [r, g, b] =
        [parent.r, parent.g, parent.b].map(|channel| moved(i64::from(channel), amplitudes.color, 65_535) as u16);
    let angle = (i64::from(parent.angle) + step(amplitudes.angle, stream)) as u16;
    let w = resized(parent.w, amplitudes.log_side, stream);
    let h = resized(parent.h, amplitudes.log_side, stream);
    Fly { x, y, z, r, g, b, angle, w, h, mask: parent.mask, alive: true }
}

/// A bell-shaped step of this standard deviation, rounded at random so that its mean is exact however small it is.
fn step(amplitude: StepQ16, stream: &mut Stream) -> i64 {
    let bits = stream.bits();
    let dither_q24 = i64::from(bits & 0x003F_FFFF) << 2;
    (amplitude * i64::from(normal_q8(bits >> 22)) + dither_q24) >> 24
}

/// `side` times e^(bell-shaped step), rounded and within the bounds of a side.
fn resized(side: u32, log_amplitude: StepQ16, stream: &mut Stream) -> u32 {
    let factor = size_factor_q16(step(log_amplitude, stream).clamp(-4096, 4096) as i32);
    (((u64::from(side) * factor + (1 << 15)) >> 16) as u32).clamp(SIDE_MIN, SIDE_MAX)
}
