//! Gene-level steps of the paper's scheme, in integers: the random fly, mutation, crossover and the split in two.
//!
//! Amplitudes are standard deviations. The paper does not give them. The defaults are the best found for 40,000 births
//! on the development pictures; `cargo bench --bench paper_run` repeats the run that chose them.

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
    scaled_tile_side(width_px, height_px, fly_count, ONE_Q16 as u32)
}

/// `scale_q16` / 65536 times the side of Eq. 1, as a gene (paper Fig. 8c: tiles much bigger than Eq. 1).
#[must_use]
pub fn scaled_tile_side(width_px: u32, height_px: u32, fly_count: usize, scale_q16: u32) -> u32 {
    let side = i128::from(tile_side_q16(width_px, height_px, fly_count)) * i128::from(scale_q16);
    let rounded = (side + (1 << 31)) >> 32;
    (rounded.min(i128::from(SIDE_MAX)) as u32).max(SIDE_MIN)
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

    /// The same, but the angle makes no step if tiles do not turn.
    #[must_use]
    pub fn turning(self, rotation: Rotation) -> Self {
        Self { angle: if rotation == Rotation::None { 0 } else { self.angle }, ..self }
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

/// Whether tiles turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Rotation {
    /// Angles are random and mutate.
    #[default]
    Free,
    /// Every angle is 0 (paper Fig. 8d).
    None,
}

/// What random flies are like (paper section 4).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RandomFlies {
    /// Width of the picture in px.
    pub width_px: u32,
    /// Height of the picture in px.
    pub height_px: u32,
    /// Both sides of every fly, as a gene.
    pub side: u32,
    /// Whether the angle is random or 0.
    pub rotation: Rotation,
    /// Mask layers of which each fly wears one, all equally likely; at least one.
    pub layers: Vec<u16>,
}

impl RandomFlies {
    /// A fly with uniform random position, depth, colour and angle.
    #[must_use]
    pub fn fly(&self, stream: &mut Stream) -> Fly {
        let mut channel = || (stream.bits() >> 16) as u16;
        let (r, g, b, angle) = (channel(), channel(), channel(), channel());
        Fly {
            x: stream.below(position_max(self.width_px) as u32 + 1) as i32,
            y: stream.below(position_max(self.height_px) as u32 + 1) as i32,
            z: stream.bits() >> 8,
            r,
            g,
            b,
            angle: if self.rotation == Rotation::None { 0 } else { angle },
            w: self.side,
            h: self.side,
            mask: random_layer(&self.layers, stream),
            alive: true,
        }
    }
}

/// One of `layers`, all equally likely. Draws a random number only if there is a choice.
#[must_use]
pub fn random_layer(layers: &[u16], stream: &mut Stream) -> u16 {
    match layers {
        [] => 0,
        [only] => *only,
        _ => layers[stream.below(layers.len() as u32) as usize],
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

/// The arithmetic crossover of two flies: every gene lies `weight_q16` / 65536 of the way from `first` to `second`, the
/// angle on the shorter way round. The mask is that of `first`.
#[must_use]
pub fn crossed(first: &Fly, second: &Fly, weight_q16: u32) -> Fly {
    let way = |distance: i64| (distance * i64::from(weight_q16) + (1 << 15)) >> 16;
    let between = |one: i64, other: i64| one + way(other - one);
    let channel = |one: u16, other: u16| between(i64::from(one), i64::from(other)) as u16;
    // As a signed 16-bit number the difference is the shorter way round; between opposite angles it is negative.
    let turn = i64::from(second.angle.wrapping_sub(first.angle) as i16);
    Fly {
        x: between(i64::from(first.x), i64::from(second.x)) as i32,
        y: between(i64::from(first.y), i64::from(second.y)) as i32,
        z: between(i64::from(first.z), i64::from(second.z)) as u32,
        r: channel(first.r, second.r),
        g: channel(first.g, second.g),
        b: channel(first.b, second.b),
        angle: first.angle.wrapping_add(way(turn) as u16),
        w: between(i64::from(first.w), i64::from(second.w)) as u32,
        h: between(i64::from(first.h), i64::from(second.h)) as u32,
        mask: first.mask,
        alive: true,
    }
}

/// `fly` with both sides divided by the square root of 2, so that two of it have the area of one (mitosis).
#[must_use]
pub fn halved(fly: &Fly) -> Fly {
    let side = |side: u32| ((u64::from(side).pow(2) * 2).isqrt().div_ceil(2) as u32).max(SIDE_MIN);
    Fly { w: side(fly.w), h: side(fly.h), ..*fly }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rng::Purpose;

    fn stream(slot: u64) -> Stream {
        Stream::new(11, Purpose::Birth, 0, slot)
    }

    fn random_flies(rotation: Rotation, layers: Vec<u16>) -> RandomFlies {
        RandomFlies { width_px: 200, height_px: 100, side: 640, rotation, layers }
    }

    /// The genes that crossover interpolates without wrapping.
    fn straight_genes(fly: &Fly) -> [i64; 8] {
        let [r, g, b] = [fly.r, fly.g, fly.b].map(i64::from);
        [fly.x.into(), fly.y.into(), fly.z.into(), r, g, b, fly.w.into(), fly.h.into()]
    }

    #[test]
    fn a_crossed_fly_lies_between_its_parents_and_is_one_of_them_at_the_ends() {
        let flies = random_flies(Rotation::Free, vec![0, 3]);
        for slot in 0..2_000 {
            let mut stream = stream(slot);
            let (first, second) = (flies.fly(&mut stream), Fly { w: 77, ..flies.fly(&mut stream) });
            let child = crossed(&first, &second, stream.below(65_537));
            for ((one, other), gene) in
                straight_genes(&first).into_iter().zip(straight_genes(&second)).zip(straight_genes(&child))
            {
                assert!((one.min(other)..=one.max(other)).contains(&gene), "{one} {other} {gene}");
            }
            assert_eq!(child.mask, first.mask);
            assert_eq!(crossed(&first, &second, 0), first);
            assert_eq!(Fly { mask: second.mask, ..crossed(&first, &second, 65_536) }, second);
        }
    }

    #[test]
    fn crossed_angles_take_the_shorter_way_round() {
        let at = |angle| Fly { angle, ..Fly::ABSENT };
        let half_way = |one, other| crossed(&at(one), &at(other), 1 << 15).angle;
        assert_eq!(half_way(0xF000, 0x1000), 0, "from -22.5 to 22.5 degrees through 0");
        assert_eq!(half_way(0x1000, 0xF000), 0);
        assert_eq!(half_way(0x1000, 0x3000), 0x2000);
        assert_eq!(half_way(0x6000, 0xA000), 0x8000, "from 135 to 225 degrees through 180");
    }

    #[test]
    fn two_halved_flies_have_the_area_of_one() {
        for w in [SIDE_MIN * 2, 100, 641, 12_345, SIDE_MAX] {
            let whole = Fly { w, h: w / 2 * 3, ..Fly::ABSENT };
            let half = halved(&whole);
            let area = |fly: &Fly| f64::from(fly.w) * f64::from(fly.h);
            let ratio = 2.0 * area(&half) / area(&whole);
            assert!((ratio - 1.0).abs() < 3.0 / f64::from(w), "side {w}: {ratio}");
        }
        assert_eq!(halved(&Fly { w: SIDE_MIN, h: SIDE_MIN, ..Fly::ABSENT }).w, SIDE_MIN, "the bound holds");
    }

    #[test]
    fn without_rotation_no_angle_is_drawn_and_none_changes() {
        let amplitudes = Amplitudes::paper(200, 100, 50);
        for slot in 0..200 {
            let fly = random_flies(Rotation::None, vec![0]).fly(&mut stream(slot));
            let turned = random_flies(Rotation::Free, vec![0]).fly(&mut stream(slot));
            assert_eq!(Fly { angle: 0, ..turned }, fly, "all other genes are the same");
            assert_eq!(mutated(&fly, &amplitudes.turning(Rotation::None), 200, 100, &mut stream(slot)).angle, 0);
        }
    }

    #[test]
    fn random_flies_wear_all_layers_about_equally_and_draw_only_if_there_is_a_choice() {
        let flies = random_flies(Rotation::Free, vec![2, 5, 7]);
        let worn: Vec<u16> = (0..3_000).map(|slot| flies.fly(&mut stream(slot)).mask).collect();
        for layer in [2, 5, 7] {
            let count = worn.iter().filter(|&&mask| mask == layer).count();
            assert!((900..1_100).contains(&count), "{count} of 3,000 wear layer {layer}");
        }
        let (mut used, mut unused) = (stream(0), stream(0));
        assert_eq!(random_layer(&[4], &mut used), 4);
        assert_eq!(used.bits(), unused.bits());
    }

    #[test]
    fn the_first_side_is_scaled_and_stays_within_its_bounds() {
        let side = |scale_q16| scaled_tile_side(256, 256, 2_500, scale_q16);
        assert_eq!(side(1 << 16), tile_side(256, 256, 2_500));
        assert_eq!(side(10 << 16), 3_277, "ten times 5.12 px");
        assert_eq!(scaled_tile_side(65_535, 65_535, 1, 100 << 16), SIDE_MAX);
        assert_eq!(scaled_tile_side(2, 2, 1_000_000, 6_554), SIDE_MIN);
    }
}
