//! The operators of the cells search: how a child comes from its parent, or from nothing.
//!
//! Twin: `glsl/shared/cells_operators.glsl`. Each draws its numbers by slot, so that it can be tested alone. Children are
//! within the bounds of the rules; whether they are within their cell and an improvement is for the step to say.

use super::random::{Chain, below};
use super::rules::{ASPECT_FREE_Q8, BirthDepth, Bounds, Rules, SEARCH_SIDE_MAX, STEP_FIRST};
use crate::model::fly::{Fly, SIDE_MIN, Z_MAX, position_max};
use crate::model::guide::GuideSample;
use crate::model::tables::{cos_sin, normal_q8, size_factor_q16};

/// Slots of a candidate's numbers.
pub mod slot {
    /// Which kind of candidate: birth or change; then which operator.
    pub const KIND: u32 = 0;
    /// Whether the child is recoloured.
    pub const RECOLOR: u32 = 1;
    /// The numbers of the operator, nine.
    pub const OPERATOR: u32 = 2;
    /// Pixels that compete for the place of a birth.
    pub const PLACE: u32 = 16;
    /// Flies that compete to die.
    pub const VICTIM: u32 = 48;
}

/// Most competitors for a place.
pub const PLACE_TOURNAMENT_MAX: u32 = slot::VICTIM - slot::PLACE;

/// The mean side in the steps of moves; clamped so that step times bell-shaped number fits 32 bits: 138 px.
const MOVE_SIDE_MAX: u32 = 138 * 64;

/// What an operator needs besides the fly.
#[derive(Clone, Copy, Debug)]
pub struct Setting<'a> {
    /// The rules.
    pub rules: &'a Rules,
    /// The own side of the fly, or of the one to be born.
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
    let low = ((own_side * bounds.side_min_q8) >> 8).max(SIDE_MIN);
    let high = ((own_side * bounds.side_max_q8) >> 8).clamp(low, SEARCH_SIDE_MAX);
    let (w, h) = (fly.w.clamp(low, high), fly.h.clamp(low, high));
    let longest = |other: u32| {
        if bounds.aspect_max_q8 >= ASPECT_FREE_Q8 { high } else { ((other * bounds.aspect_max_q8) >> 8).max(low) }
    };
    Fly { w: w.min(longest(h)), h: h.min(longest(w)), ..*fly }
}

/// One edge is moved along its normal; the opposite edge stays.
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

/// The angle changes: by 90 degrees times the step size, bell-shaped.
#[must_use]
pub fn turned(fly: &Fly, step: u32, draws: Chain) -> Fly {
    let by = (step as i32 * bell_q8(draws, slot::OPERATOR) + 512) >> 10;
    Fly { angle: fly.angle.wrapping_add(by as u16), ..*fly }
}

/// Place, sides and angle change a little: half a mean side, a third in the logarithm of each side and 22 degrees, times the
/// step size.
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

/// The depth changes: up or down by a bell-shaped part of the whole range.
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

/// A new tile centred on a pixel: sides log-uniform around the mean side, turned as the guide says, in front of what
/// shows there.
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

/// A copy of a parent with a step in every gene: a birth as in the paper.
#[must_use]
pub fn mutant(parent: &Fly, setting: &Setting<'_>, draws: Chain) -> Fly {
    let step = STEP_FIRST;
    let child = shifted(parent, setting, 2 * step, draws);
    let child = raised(&child, step, draws.then(1));
    repainted(&child, step, draws)
}

/// What a tile costs for being turned away from the guide's direction: `turn` per pixel of its area at 45 degrees, by the
/// square of the deviation modulo 90 degrees.
#[inline]
#[must_use]
pub fn turn_penalty(fly: &Fly, rules: &Rules, local: GuideSample) -> i64 {
    if rules.penalties.turn == 0 {
        return 0;
    }
    let deviation = (i32::from(fly.angle.wrapping_sub(local.direction).wrapping_add(8_192) & 16_383) - 8_192) as u32;
    // 0 to 256 at 45 degrees; the area in 1/16 px.
    let squared = deviation.wrapping_mul(deviation) >> 18;
    let area = (fly.w >> 4) * (fly.h >> 4);
    i64::from(((area * squared) >> 12) * rules.penalties.turn)
}
