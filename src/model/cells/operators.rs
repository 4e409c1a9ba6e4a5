//! The operators of the cells search: how a child comes from its parent, or from nothing.
//!
//! Twin: `glsl/shared/cells_operators.glsl`. Each operator draws its numbers by slot, so it can be tested alone.
//! Children are within the bounds of the rules. The step that asked for a child checks whether it lies in its cell and
//! is an improvement.

use super::random::{Chain, below};
use super::rules::{ASPECT_FREE_Q8, BirthDepth, Bounds, Rules, SEARCH_SIDE_MAX, STEP_FIRST};
use crate::model::fly::{Fly, SIDE_MIN, Z_MAX, position_max};
use crate::model::guide::GuideSample;
use crate::model::tables::{cos_sin, normal_q8, size_factor_q16};

/// Slots of the random numbers of a candidate.
pub mod slot {
    /// Decides between birth and change, and which operator makes the change.
    pub const KIND: u32 = 0;
    /// Whether the child is recoloured.
    pub const RECOLOR: u32 = 1;
    /// The nine numbers of the operator.
    pub const OPERATOR: u32 = 2;
    /// Pixels that compete for the place of a birth.
    pub const PLACE: u32 = 16;
    /// Flies that compete to die.
    pub const VICTIM: u32 = 48;
}

/// Most competitors for a place.
pub const PLACE_TOURNAMENT_MAX: u32 = slot::VICTIM - slot::PLACE;

/// Largest mean side that scales moves, 138 px: a step times a bell-shaped number then fits 32 bits.
const MOVE_SIDE_MAX: u32 = 138 * 64;

/// What an operator needs apart from the fly.
#[derive(Clone, Copy, Debug)]
pub struct Setting<'a> {
    /// The rules.
    pub rules: &'a Rules,
    /// The own side ([`Rules::own_side`]) of the fly, or of the one to be born.
    pub own_side: u32,
    /// Size of the picture in px.
    pub size_px: (u32, u32),
}

/// A bell-shaped number with 8 fractional bits, by slot.
#[inline]
fn bell_q8(draws: Chain, slot: u32) -> i32 {
    normal_q8(draws.bits(slot) >> 22)
}

/// `amplitude` (u16.16) times a bell-shaped number, rounded at random so that its mean is exact.
#[inline]
fn bell_step(amplitude_q8: i32, draws: Chain, slot: u32) -> i32 {
    let bits = draws.bits(slot);
    (amplitude_q8 * normal_q8(bits >> 22) + (bits & 0xFFFF) as i32) >> 16
}

/// The step of a move in 1/64 px with 8 fractional bits: d times the fly's step size.
#[inline]
fn move_q8(setting: &Setting<'_>, step: u32) -> i32 {
    ((setting.own_side.min(MOVE_SIDE_MAX) * step) >> 8) as i32
}

impl Setting<'_> {
    fn moved_to(&self, fly: &Fly, x: i32, y: i32) -> Fly {
        let (width_px, height_px) = self.size_px;
        Fly { x: x.clamp(0, position_max(width_px)), y: y.clamp(0, position_max(height_px)), ..*fly }
    }
}

/// `fly` with its sides within the bounds of a fly of this own side.
#[inline]
#[must_use]
pub fn bounded(fly: &Fly, bounds: &Bounds, own_side: u32) -> Fly {
    let low = ((own_side * bounds.side_min_q8) >> 8).clamp(SIDE_MIN, SEARCH_SIDE_MAX);
    let high = ((own_side * bounds.side_max_q8) >> 8).clamp(low, SEARCH_SIDE_MAX);
    let (w, h) = (fly.w.clamp(low, high), fly.h.clamp(low, high));
    let longest = |other: u32| {
        if bounds.aspect_max_q8 >= ASPECT_FREE_Q8 { high } else { ((other * bounds.aspect_max_q8) >> 8).max(low) }
    };
    Fly { w: w.min(longest(h)), h: h.min(longest(w)), ..*fly }
}

/// Moves one edge along its normal; the opposite edge stays.
#[must_use]
pub fn edge_moved(fly: &Fly, setting: &Setting<'_>, step: u32, draws: Chain) -> Fly {
    let which = draws.bits(slot::OPERATOR) >> 30;
    let by = bell_step(move_q8(setting, step), draws, slot::OPERATOR + 1);
    let (cos, sin) = cos_sin(fly.angle);
    let is_width = which & 1 == 0;
    let side = if is_width { fly.w } else { fly.h } as i32;
    let child = if is_width {
        Fly { w: (side + by).max(0) as u32, ..*fly }
    } else {
        Fly { h: (side + by).max(0) as u32, ..*fly }
    };
    let child = bounded(&child, &setting.rules.bounds, setting.own_side);
    let by = if is_width { child.w } else { child.h } as i32 - side;
    let by = if which & 2 == 0 { by } else { -by };
    let (along_x, along_y) = if is_width { (cos, sin) } else { (-sin, cos) };
    setting.moved_to(&child, fly.x + ((by * along_x + 4096) >> 13), fly.y + ((by * along_y + 4096) >> 13))
}

/// Changes the angle by a bell-shaped amount, with a standard deviation of 90 degrees times the step size.
#[must_use]
pub fn turned(fly: &Fly, step: u32, draws: Chain) -> Fly {
    let by = (step as i32 * bell_q8(draws, slot::OPERATOR) + 512) >> 10;
    Fly { angle: fly.angle.wrapping_add(by as u16), ..*fly }
}

/// Changes place, sides and angle a little. The standard deviations are half a mean side, a third in the logarithm of
/// each side, and 22 degrees, all times the step size.
#[must_use]
pub fn shifted(fly: &Fly, setting: &Setting<'_>, step: u32, draws: Chain) -> Fly {
    let amplitude_q8 = move_q8(setting, step) / 2;
    let x = fly.x + bell_step(amplitude_q8, draws, slot::OPERATOR);
    let y = fly.y + bell_step(amplitude_q8, draws, slot::OPERATOR + 1);
    let angle = (step as i32 * bell_q8(draws, slot::OPERATOR + 2) + 2048) >> 12;
    let child = Fly { angle: fly.angle.wrapping_add(angle as u16), ..*fly };
    let resized = |side: u32, slot: u32| {
        // 85 steps of 1/256 are a third; step and bell have 16 and 8 fractional bits.
        let by = ((step >> 4) as i32 * bell_q8(draws, slot) / 256 * 85 + 2048) >> 12;
        scaled(side, by)
    };
    let child = Fly { w: resized(fly.w, slot::OPERATOR + 3), h: resized(fly.h, slot::OPERATOR + 4), ..child };
    setting.moved_to(&child, x, y)
}

/// `side` times e^(steps / 256), rounded.
#[inline]
#[must_use]
pub fn scaled(side: u32, steps: i32) -> u32 {
    ((u64::from(side) * size_factor_q16(steps) + (1 << 15)) >> 16) as u32
}

/// Changes the depth, up or down, by a bell-shaped part of the whole range.
#[must_use]
pub fn raised(fly: &Fly, step: u32, draws: Chain) -> Fly {
    // A standard deviation of 1/8 of the range, times the step size.
    let by = (step as i32 >> 3) * bell_q8(draws, slot::OPERATOR);
    Fly { z: (fly.z as i32 + by).clamp(0, Z_MAX as i32) as u32, ..*fly }
}

/// Each channel takes a bell-shaped step of 1/16 of the range times the step size.
#[must_use]
pub fn repainted(fly: &Fly, step: u32, draws: Chain) -> Fly {
    let moved = |channel: u16, slot: u32| {
        let by = ((step as i32 >> 4) * bell_q8(draws, slot)) >> 8;
        (i32::from(channel) + by).clamp(0, 65_535) as u16
    };
    Fly {
        r: moved(fly.r, slot::OPERATOR + 5),
        g: moved(fly.g, slot::OPERATOR + 6),
        b: moved(fly.b, slot::OPERATOR + 7),
        ..*fly
    }
}

/// A new tile centred on a pixel, in front of what shows there. Its sides are log-uniform around the own side, and its
/// angle follows the guide.
#[must_use]
pub fn newborn(setting: &Setting<'_>, (x, y): (u32, u32), shown_z: u32, local: GuideSample, draws: Chain) -> Fly {
    let births = &setting.rules.births;
    let range = (births.side_high - births.side_low + 1) as u32;
    let log_w = births.side_low + draws.below(slot::OPERATOR, range) as i32;
    let log_h = births.side_low + draws.below(slot::OPERATOR + 1, range) as i32;
    let log_h = log_h.clamp(log_w - births.aspect_high, log_w + births.aspect_high);
    let (log_w, log_h) = if births.is_stroke == 0 { (log_w, log_h) } else { (log_w.max(log_h), log_w.min(log_h)) };
    let bits = draws.bits(slot::OPERATOR + 2);
    let follows = u32::from(local.coherence) >= below(bits << 16, births.coherence_range + 1);
    let around = (births.angle_spread as i32 * bell_q8(draws, slot::OPERATOR + 3) + 128) >> 8;
    let angle = if follows { local.direction.wrapping_add(around as u16) } else { (bits >> 16) as u16 };
    let bits = draws.bits(slot::OPERATOR + 4);
    let z = match births.depth {
        BirthDepth::Front => shown_z.saturating_sub(1 + below(bits, setting.rules.depth_gap)),
        BirthDepth::Random => bits >> 8,
    };
    let channel = |slot| (draws.bits(slot) >> 16) as u16;
    Fly {
        x: (x * 64) as i32,
        y: (y * 64) as i32,
        z: z.min(Z_MAX),
        r: channel(slot::OPERATOR + 5),
        g: channel(slot::OPERATOR + 6),
        b: channel(slot::OPERATOR + 7),
        angle,
        w: scaled(setting.own_side, log_w),
        h: scaled(setting.own_side, log_h),
        mask: (setting.rules.mask_first + draws.below(slot::OPERATOR + 8, setting.rules.mask_count)) as u16,
        alive: true,
    }
}

/// A copy of a parent in which every gene makes a step: a birth as in the paper.
#[must_use]
pub fn mutant(parent: &Fly, setting: &Setting<'_>, draws: Chain) -> Fly {
    let step = STEP_FIRST;
    let child = shifted(parent, setting, 2 * step, draws);
    let child = raised(&child, step, draws.then(1));
    repainted(&child, step, draws)
}

/// What a tile costs for being turned away from the guide's direction. It grows with the square of the deviation modulo
/// 90 degrees, up to `turn` per pixel of its area at 45 degrees.
#[inline]
#[must_use]
pub fn turn_penalty(fly: &Fly, rules: &Rules, local: GuideSample) -> i64 {
    if rules.penalties.turn == 0 {
        return 0;
    }
    let deviation = (i32::from(fly.angle.wrapping_sub(local.direction).wrapping_add(8_192) & 16_383) - 8_192) as u32;
    // `squared` goes from 0 to 256 at 45 degrees. `area` is in units of 1/16 px squared, and one less for the largest
    // tiles so that the product fits 32 bits. With a penalty of at most `TURN_MAX` the result is below 2^30.
    let squared = deviation.wrapping_mul(deviation) >> 18;
    let area = ((fly.w >> 4) * (fly.h >> 4)).min((1 << 24) - 1);
    i64::from(((area * squared) >> 12) * rules.penalties.turn)
}

#[cfg(test)]
mod tests {
    use super::super::random::Draw;
    use super::super::rules::{BirthKind, STEP_MAX, STEP_MIN, TURN_MAX};
    use super::*;

    const SIZE_PX: (u32, u32) = (300, 200);

    fn draws(number: u32) -> Chain {
        Chain::new(9, 0, Draw::Step).then(number)
    }

    fn fly(angle: u16) -> Fly {
        Fly { x: 150 * 64, y: 100 * 64, z: 1 << 22, w: 640, h: 480, angle, alive: true, ..Fly::ABSENT }
    }

    fn rules() -> Rules {
        Rules::free(0, 512, 300, [0; 3])
    }

    fn setting(rules: &Rules) -> Setting<'_> {
        Setting { rules, own_side: rules.side, size_px: SIZE_PX }
    }

    /// Middles of the four edges in 1/64 px: right, left, bottom, top.
    fn edges(fly: &Fly) -> [(f64, f64); 4] {
        let (cos, sin) = cos_sin(fly.angle);
        let (cos, sin) = (f64::from(cos) / 4096.0, f64::from(sin) / 4096.0);
        let (w, h) = (f64::from(fly.w) / 2.0, f64::from(fly.h) / 2.0);
        [(w * cos, w * sin), (-w * cos, -w * sin), (-h * sin, h * cos), (h * sin, -h * cos)]
            .map(|(dx, dy)| (f64::from(fly.x) + dx, f64::from(fly.y) + dy))
    }

    #[test]
    fn moving_an_edge_leaves_the_opposite_edge_where_it_is() {
        let rules = rules();
        let mut moved = [0; 4];
        for number in 0..2_000 {
            let parent = fly((number * 97) as u16);
            let child = edge_moved(&parent, &setting(&rules), STEP_MAX, draws(number));
            let distances: Vec<f64> =
                edges(&parent).iter().zip(edges(&child)).map(|(a, b)| (a.0 - b.0).hypot(a.1 - b.1)).collect();
            let fixed = (0..4).filter(|&edge| distances[edge] < 1.0).count();
            assert!(fixed >= 1, "no edge of {child:?} is where it was: {distances:?}");
            let most = (0..4).max_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(0);
            moved[most] += 1;
        }
        assert!(moved.iter().all(|&count| count > 300), "each edge is moved as often as the others: {moved:?}");
    }

    #[test]
    fn smaller_steps_make_smaller_changes() {
        let rules = rules();
        let spread = |step: u32| {
            let of = |number| {
                let (parent, setting) = (fly(0), setting(&rules));
                let edge = edge_moved(&parent, &setting, step, draws(number));
                let shift = shifted(&parent, &setting, step, draws(number));
                let turn = turned(&parent, step, draws(number)).angle as i16;
                let depth = raised(&parent, step, draws(number)).z.abs_diff(parent.z);
                let sides = u64::from(edge.w.abs_diff(640) + edge.h.abs_diff(480) + shift.w.abs_diff(640));
                [sides, u64::from(shift.x.abs_diff(parent.x)), u64::from(turn.unsigned_abs()), u64::from(depth)]
            };
            (0..500).map(of).fold([0; 4], |sums: [u64; 4], changes| std::array::from_fn(|i| sums[i] + changes[i]))
        };
        let (large, small) = (spread(STEP_MAX), spread(STEP_MIN));
        for (kind, (large, small)) in large.into_iter().zip(small).enumerate() {
            assert!(large > 20 * small && large > 0, "kind {kind}: {large} against {small}");
        }
    }

    #[test]
    fn newborn_tiles_lie_in_front_of_what_shows_and_follow_a_sure_guide() {
        let rules = rules();
        let local = GuideSample { direction: 5_000, coherence: 255, size_q12: 4_096 };
        let mut sides = (u32::MAX, 0);
        for number in 0..2_000 {
            let child = newborn(&setting(&rules), (17, 33), 1 << 20, local, draws(number));
            assert!(child.z < 1 << 20 && child.z + rules.depth_gap >= 1 << 20);
            assert_eq!((child.x, child.y), (17 * 64, 33 * 64));
            let off = child.angle.wrapping_sub(local.direction) as i16;
            assert!(off.unsigned_abs() < 4 * rules.births.angle_spread as u16, "turned {off} away");
            sides = (sides.0.min(child.w), sides.1.max(child.h));
        }
        assert!(sides.0 < 512 / 8 && sides.1 > 512 * 5, "sides from {} to {}", sides.0, sides.1);
        let unsure = GuideSample { coherence: 0, ..local };
        let turns = (0..400).map(|number| newborn(&setting(&rules), (1, 1), 5, unsure, draws(number)).angle >> 13);
        assert_eq!(turns.collect::<std::collections::BTreeSet<_>>().len(), 8, "without a guide all angles occur");
    }

    #[test]
    fn strokes_have_their_longer_side_along_the_guide() {
        let mut rules = rules();
        rules.births.is_stroke = 1;
        let local = GuideSample { direction: 0, coherence: 0, size_q12: 4_096 };
        for number in 0..500 {
            let child = newborn(&setting(&rules), (9, 9), 99, local, draws(number));
            assert!(child.w >= child.h);
        }
    }

    #[test]
    fn bounded_flies_keep_to_sides_and_aspect_and_bounded_again_stay_as_they_are() {
        let bounds = Bounds { side_min_q8: 150, side_max_q8: 410, aspect_max_q8: 410, local_size: 0 };
        for number in 0..3_000 {
            let side = |slot| 16 + draws(number).below(slot, 3_000);
            let child = bounded(&Fly { w: side(0), h: side(1), ..fly(0) }, &bounds, 500);
            let (long, short) = (child.w.max(child.h), child.w.min(child.h));
            assert!(short >= 500 * 150 / 256 && long <= 500 * 410 / 256, "{long} by {short}");
            assert!(long * 256 <= short * 410, "{long} by {short}");
            assert_eq!(bounded(&child, &bounds, 500), child);
        }
    }

    #[test]
    fn the_penalty_of_a_turn_is_least_along_the_guide_and_across_it() {
        let mut rules = rules();
        rules.penalties.turn = 60;
        let local = GuideSample { direction: 3_000, coherence: 0, size_q12: 4_096 };
        let penalty = |angle: u16| turn_penalty(&fly(angle), &rules, local);
        for quarter in [0, 16_384, 32_768, 49_152] {
            assert_eq!(penalty(3_000_u16.wrapping_add(quarter)), 0);
        }
        // 10 x 7.5 px at 45 degrees: 60 for each pixel.
        assert_eq!(penalty(3_000 + 8_192), 75 * 60);
        assert!(penalty(3_000 + 4_096) < penalty(3_000 + 6_000));
        rules.penalties.turn = 0;
        assert_eq!(turn_penalty(&fly(9_999), &rules, local), 0);
        rules.penalties.turn = TURN_MAX;
        let largest = Fly { w: SEARCH_SIDE_MAX, h: SEARCH_SIDE_MAX, ..fly(3_000 + 8_192) };
        let cost = turn_penalty(&largest, &rules, local);
        assert!(cost < 1 << 30 && cost > 1_000_000_000, "{cost}");
    }

    #[test]
    fn a_mutant_differs_from_its_parent_in_every_gene_but_its_mask() {
        let mut rules = rules();
        rules.births.kind = BirthKind::Mutant;
        let parent = Fly { r: 30_000, g: 30_000, b: 30_000, mask: 3, ..fly(1_000) };
        let child = (0..50).map(|number| mutant(&parent, &setting(&rules), draws(number)));
        let differs = |of: fn(&Fly) -> i64| child.clone().filter(|child| of(child) != of(&parent)).count() > 25;
        let genes: [fn(&Fly) -> i64; 6] =
            [|f| f.x.into(), |f| f.y.into(), |f| f.z.into(), |f| f.r.into(), |f| f.w.into(), |f| f.angle.into()];
        assert!(genes.into_iter().all(differs));
        assert!(child.clone().all(|child| child.mask == 3));
    }

    #[test]
    fn bounds_beyond_the_largest_side_of_all_are_that_side() {
        let bounds = Bounds { side_min_q8: 2 << 8, side_max_q8: 16 << 8, aspect_max_q8: 256, local_size: 0 };
        let child = bounded(&fly(0), &bounds, SEARCH_SIDE_MAX);
        assert_eq!((child.w, child.h), (SEARCH_SIDE_MAX, SEARCH_SIDE_MAX));
    }
}
