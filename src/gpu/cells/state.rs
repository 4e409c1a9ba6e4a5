//! The state of a cells search as the host writes and reads it. `glsl/shared/cells_state.glsl` explains the words.

use super::buffers::{LaneSlices, Pool};
use super::layout::{FlyRecord, Placement, SearchRules, search_rules};
use super::plan::{BLOCK_PIXELS, PIXEL_WORDS, Plan, side_max};
use crate::error::{Error, Remedy, Result};
use crate::model::cells::glaze::opacity_of;
use crate::model::cells::grid::cell_side_px;
use crate::model::cells::pixel::{BACKGROUND_Z, UNWANTED_ERROR, difference};
use crate::model::cells::{Course, Stacks};
use crate::model::fly::UNITS_PER_PX;
use crate::model::tile::{pack, unpack};
use crate::model::translucency::{CLEAR, Compositing};
use crate::model::{Fly, NO_FLY};

/// In a pixel's third word its top fly's depth lies below its weight less 1, and whether it wants no tile.
const WEIGHT_SHIFT: u32 = 25;
const UNWANTED_SHIFT: u32 = 29;
/// A candidate has 28 bits for the index of a fly.
const FLY_COUNT_MAX: usize = 1 << 28;

/// What keeps sums of errors within 32 bits: tiles that cover fewer pixels, or the CPU, whose sums have 64.
const SMALLER_TILES: [Remedy; 3] = [Remedy::MoreTiles, Remedy::SmallerPicture, Remedy::Cpu];

/// Refuses what would not fit the 32 bits of fitness and changes, or of indices.
pub(super) fn check(course: &Course) -> Result<()> {
    let Course { rules, target, .. } = course;
    let side_px = u64::from(side_max(rules).div_ceil(UNITS_PER_PX)) + 2;
    let pixels = (side_px * side_px).min(u64::from(target.width_px()) * u64::from(target.height_px()));
    let penalties = &rules.penalties;
    let weight = target.weights().map_or(1, |weights| u64::from(weights.iter().copied().max().unwrap_or(1)));
    let most = 765 * weight + u64::from(penalties.hole) + 2 * u64::from(penalties.overlap);
    // The bound is half of 2^31, so that the sum of two fitnesses fits. The penalty of a turn counts the whole area of
    // a tile, also beyond the picture.
    if pixels * most + side_px * side_px * u64::from(penalties.turn) >= 1 << 30 {
        let what = format!(
            "a tile may cover {pixels} pixels with an error of up to {most} each, which does not fit the 32 bits of a Vulkan device"
        );
        return Err(Error::TooLarge { what, remedies: &SMALLER_TILES });
    }
    check_gains(course)?;
    if course.fly_count >= FLY_COUNT_MAX {
        let what = format!("{} tiles are more than a Vulkan device searches", course.fly_count);
        return Err(Error::TooLarge { what, remedies: &[Remedy::FewerTiles, Remedy::Cpu] });
    }
    Ok(())
}

/// Refuses a translucent search in which the gains of one fly in a round might not fit 32 bits. A fly may be changed in
/// each step of a round, and its marginal fitness gathers all of these gains until the round is over.
fn check_gains(course: &Course) -> Result<()> {
    let target = &course.target;
    let side = u64::from(cell_side_px(course.rules.side));
    let pixels = u64::from(target.width_px()) * u64::from(target.height_px());
    let (weight, all) = target.weights().map_or((1, pixels), |weights| {
        let most = weights.iter().copied().max().unwrap_or(1);
        (u64::from(most), weights.iter().map(|&weight| u64::from(weight)).sum())
    });
    let most = all.min(side * side * weight) * UNWANTED_ERROR as u64;
    if course.is_translucent() && most >= 1 << 30 {
        let what = format!(
            "a cell of {side}x{side} pixels with translucent tiles may have an error of up to {most}, which does not fit the 32 bits of a Vulkan device"
        );
        return Err(Error::TooLarge { what, remedies: &SMALLER_TILES });
    }
    Ok(())
}

/// The rules of a lane as the device reads them.
pub(super) fn rules_record(course: &Course, plan: &Plan, slices: &LaneSlices) -> SearchRules {
    let first_stack = slices.first(Pool::Stacks).wrapping_mul(BLOCK_PIXELS as u32);
    let first_pixel = slices.first(Pool::Blocks).wrapping_mul(BLOCK_PIXELS as u32);
    let placement = Placement {
        width: plan.width_px,
        height: plan.height_px,
        columns: plan.block_columns,
        side_shift: plan.cell_side_px.trailing_zeros(),
        fly_count: course.fly_count as u32,
        scratch_words: (slices.of(Pool::Scratch).count / u64::from(plan.cell_count)) as u32,
        guide_columns: course.guide.columns,
        guide_rows: course.guide.rows,
        lane: slices.first(Pool::Lanes),
        first_fly: slices.first(Pool::Flies),
        first_deal: slices.first(Pool::Flies).wrapping_mul(3),
        first_cell: slices.first(Pool::Cells),
        first_pixel,
        first_stack: first_stack.wrapping_sub(first_pixel.wrapping_mul(plan.stack_depth as u32)),
        first_scratch: slices.first(Pool::Scratch),
        first_guide: slices.first(Pool::Guide),
        first_mask: slices.first(Pool::Masks),
        first_origin: slices.first(Pool::Origins),
    };
    search_rules(&course.rules, &placement)
}

impl FlyRecord {
    /// The genes of a fly, packed.
    pub(super) fn new(fly: &Fly) -> Self {
        Self {
            x: fly.x,
            y: fly.y,
            z: fly.z,
            rg: u32::from(fly.r) | u32::from(fly.g) << 16,
            ba: u32::from(fly.b) | u32::from(fly.angle) << 16,
            w: fly.w,
            h: fly.h,
            form: u32::from(fly.mask) | u32::from(fly.alive) << 16,
        }
    }

    /// The fly with these genes.
    pub(super) fn fly(&self) -> Fly {
        Fly {
            x: self.x,
            y: self.y,
            z: self.z,
            r: self.rg as u16,
            g: (self.rg >> 16) as u16,
            b: self.ba as u16,
            angle: (self.ba >> 16) as u16,
            w: self.w,
            h: self.h,
            mask: self.form as u16,
            alive: self.form >> 16 != 0,
        }
    }
}

/// The words of all pixels on which no fly lies, and what the objective is then.
pub(super) fn bare_words(course: &Course, plan: &Plan) -> (Vec<u32>, i64) {
    let mut pixels = vec![0; plan.pixel_count() * PIXEL_WORDS];
    let mut objective = 0;
    for (place, number) in plan.places().zip(0..) {
        let words = pixel_words(course, number, &[], &[]);
        pixels[place * PIXEL_WORDS..(place + 1) * PIXEL_WORDS].copy_from_slice(&words);
        objective += i64::from(words[3]);
        if !course.is_translucent() {
            objective -= i64::from(course.rules.penalties.overlap);
        }
    }
    (pixels, objective)
}

/// The words of all pixels, and of all stacks, of a population in its stacks.
pub(super) fn state_words(course: &Course, plan: &Plan, flies: &[Fly], stacks: &Stacks) -> (Vec<u32>, Vec<u32>) {
    let mut pixels = vec![0; plan.pixel_count() * PIXEL_WORDS];
    let mut words = vec![0; plan.stack_words()];
    for ((place, stack), number) in plan.places().zip(&stacks.pixels).zip(0..) {
        let pixel = pixel_words(course, number, flies, stack);
        pixels[place * PIXEL_WORDS..(place + 1) * PIXEL_WORDS].copy_from_slice(&pixel);
        for (entry, &(fly, error)) in stack.iter().enumerate() {
            let word = plan.stack_word(place, entry);
            words[word..word + 2].copy_from_slice(&[fly, error as u32]);
        }
    }
    (pixels, words)
}

/// The words of a pixel of the target under a stack of flies.
fn pixel_words(course: &Course, number: usize, flies: &[Fly], stack: &[(u32, i32)]) -> [u32; PIXEL_WORDS] {
    let Course { rules, target, .. } = course;
    let color = pack(target.pixels()[number]);
    let weight = target.weights().map_or(1, |weights| u32::from(weights[number]));
    let is_unwanted = target.transparent().is_some_and(|transparent| transparent[number]);
    let bare = difference(color, rules.background) * weight as i32 + rules.penalties.hole as i32;
    let ground = if is_unwanted { 0 } else { bare } + rules.penalties.overlap as i32;
    let layer = |nth: usize| {
        stack.get(nth).map_or((NO_FLY, BACKGROUND_Z, ground), |&(fly, error)| (fly, flies[fly as usize].z, error))
    };
    let ((top, top_z, mut top_error), mut behind) = (layer(0), layer(1));
    if course.is_translucent() {
        top_error = glazed_error(stack, color, is_unwanted, rules.background) * weight as i32;
        behind = (NO_FLY, BACKGROUND_Z, 0);
    }
    let (under, under_z, under_error) = behind;
    [
        color | (stack.len() as u32) << 24,
        top,
        top_z | (weight - 1) << WEIGHT_SHIFT | u32::from(is_unwanted) << UNWANTED_SHIFT,
        top_error as u32,
        under,
        under_z,
        under_error as u32,
        ground as u32,
    ]
}

/// Error of a pixel of this target, or of one that wants no tile, under translucent tiles of these looks.
fn glazed_error(stack: &[(u32, i32)], target: u32, is_unwanted: bool, background: u32) -> i32 {
    let mut pixel = Compositing::START;
    for look in stack.iter().map(|&(_, look)| look as u32) {
        pixel.add(opacity_of(look), unpack(look));
    }
    match is_unwanted {
        true if pixel.transmittance < CLEAR => UNWANTED_ERROR,
        true => 0,
        false => difference(target, pack(pixel.over(unpack(background)))),
    }
}

/// The stacks in these words.
pub(super) fn stacks(plan: &Plan, pixels: &[u32], words: &[u32]) -> Stacks {
    let stack_at = |place: usize| {
        let depth = (pixels[place * PIXEL_WORDS] >> 24) as usize;
        (0..depth)
            .map(|entry| plan.stack_word(place, entry))
            .map(|word| (words[word], words[word + 1] as i32))
            .collect()
    };
    Stacks { pixels: plan.places().map(stack_at).collect() }
}
