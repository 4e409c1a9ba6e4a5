//! The state of a cells search in the words that `glsl/shared/cells_state.glsl` explains: what the host writes and reads.

use super::cells_layout::{FlyRecord, SearchRules};
use super::cells_pools::{LaneSlices, Pool};
use crate::error::{Error, Remedy, Result};
use crate::model::cells::glaze::opacity_of;
use crate::model::cells::grid::{BLOCK_SIDE_PX, cell_side_px};
use crate::model::cells::pixel::{BACKGROUND_Z, STACK_DEPTH, TRANSLUCENT_DEPTH, UNWANTED_ERROR, difference};
use crate::model::cells::rules::{Acceptance, CLASSES_MAX, SEARCH_SIDE_MAX};
use crate::model::cells::{Course, Rules, Stacks};
use crate::model::fly::UNITS_PER_PX;
use crate::model::tile::{pack, unpack};
use crate::model::translucency::{CLEAR, Compositing};
use crate::model::{Fly, NO_FLY};

/// Pixels of a block.
pub(super) const BLOCK_PIXELS: usize = (BLOCK_SIDE_PX * BLOCK_SIDE_PX) as usize;
/// Words of a pixel: two words of four.
pub(super) const PIXEL_WORDS: usize = 8;
/// In a pixel's third word its top fly's depth lies below its weight less 1, and whether it wants no tile.
const WEIGHT_SHIFT: u32 = 25;
const UNWANTED_SHIFT: u32 = 29;
/// Flies are told by 28 bits in a candidate.
const FLY_COUNT_MAX: usize = 1 << 28;

/// How a picture lies in blocks, and in cells at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    pub width_px: u32,
    pub height_px: u32,
    pub block_columns: u32,
    pub block_rows: u32,
    pub cell_side_px: u32,
    /// Most cells of a round.
    pub cell_count: u32,
    /// Most flies on a pixel.
    pub stack_depth: usize,
}

impl Plan {
    pub fn new(course: &Course) -> Self {
        let (width_px, height_px) = (course.target.width_px(), course.target.height_px());
        let side = cell_side_px(course.rules.side);
        let is_one = side >= width_px && side >= height_px;
        let most = |px: u32| if is_one { 1 } else { (px - 1 + side - BLOCK_SIDE_PX) / side + 1 };
        Self {
            width_px,
            height_px,
            block_columns: width_px.div_ceil(BLOCK_SIDE_PX),
            block_rows: height_px.div_ceil(BLOCK_SIDE_PX),
            cell_side_px: side,
            cell_count: most(width_px) * most(height_px),
            stack_depth: if course.is_translucent() { TRANSLUCENT_DEPTH } else { STACK_DEPTH },
        }
    }

    /// Blocks of 8x8 px.
    pub fn block_count(&self) -> u64 {
        u64::from(self.block_columns) * u64::from(self.block_rows)
    }

    /// Pixels of all blocks.
    pub fn pixel_count(&self) -> usize {
        self.block_count() as usize * BLOCK_PIXELS
    }

    /// Words of the stacks of all pixels: a fly and its error, or its look, for each place.
    pub fn stack_words(&self) -> usize {
        self.pixel_count() * self.stack_depth * 2
    }

    /// The first word of an entry: in each block first the nearest flies of all pixels, then the next ones.
    fn stack_word(&self, place: usize, entry: usize) -> usize {
        (place / BLOCK_PIXELS * self.stack_depth + entry) * 2 * BLOCK_PIXELS + place % BLOCK_PIXELS * 2
    }

    /// Columns and rows of the largest box of a child in px.
    pub fn largest_box(&self, rules: &Rules) -> (u32, u32) {
        // The diagonal of a square is below 3/2 of its side.
        let longest = side_max(rules).div_ceil(UNITS_PER_PX) * 3 / 2 + 2;
        let side = longest.min(self.cell_side_px);
        (side.min(self.width_px), side.min(self.height_px))
    }

    /// Longest side of a tile in px, with what its pixels may reach beyond.
    pub fn largest_side_px(&self, rules: &Rules) -> u32 {
        side_max(rules).div_ceil(UNITS_PER_PX) + 1
    }

    /// Where a pixel lies in the state.
    pub fn place(&self, x: u32, y: u32) -> usize {
        let block = y / BLOCK_SIDE_PX * self.block_columns + x / BLOCK_SIDE_PX;
        block as usize * BLOCK_PIXELS + (y % BLOCK_SIDE_PX * BLOCK_SIDE_PX + x % BLOCK_SIDE_PX) as usize
    }

    /// All pixels of the picture, row by row, and where they lie.
    fn places(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.height_px).flat_map(move |y| (0..self.width_px).map(move |x| self.place(x, y)))
    }
}

/// Largest side that a fly may have, in 1/64 px.
fn side_max(rules: &Rules) -> u32 {
    let classes = &rules.classes[..rules.class_count as usize];
    let scale = classes.iter().map(|class| class.scale_q12).max().unwrap_or(1 << 12);
    let local = if rules.bounds.local_size == 0 { 1 } else { 4 };
    let own = (u64::from(rules.side) * u64::from(scale) * local) >> 12;
    let side = (own.min(u64::from(SEARCH_SIDE_MAX)) * u64::from(rules.bounds.side_max_q8)) >> 8;
    side.min(u64::from(SEARCH_SIDE_MAX)) as u32
}

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
    // Two fitnesses add up to less than 2^31.
    // The penalty of a turn counts a tile's whole area, also beyond the picture.
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

/// Refuses a translucent search in which the gains of one fly in a round might not fit 32 bits: it may take its place anew in each step,
/// and until the round is over its marginal fitness is what it had, with all that it gained.
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
    let Course { rules, guide, .. } = course;
    let mix = &rules.mix;
    let births = &rules.births;
    let class = |place: usize| rules.classes[place.min(CLASSES_MAX - 1)];
    SearchRules {
        seed_low: rules.seed as u32,
        seed_high: (rules.seed >> 32) as u32,
        width: plan.width_px,
        height: plan.height_px,
        columns: plan.block_columns,
        side_shift: plan.cell_side_px.trailing_zeros(),
        fly_count: course.fly_count as u32,
        scratch_words: (slices.of(Pool::Scratch).count / u64::from(plan.cell_count)) as u32,
        side: rules.side,
        candidates: rules.candidates,
        steps_per_fly: rules.steps_per_fly,
        deal_tournament: rules.deal_tournament,
        highest: match rules.acceptance {
            Acceptance::Neutral => 0,
            Acceptance::Strict => -1,
        },
        birth_q16: mix.birth_q16,
        recolor_q16: mix.recolor_q16,
        edge: mix.edge,
        turn: mix.turn,
        shift: mix.shift,
        depth: mix.depth,
        mix_total: mix.edge + mix.turn + mix.shift + mix.depth + mix.recolor,
        place_tournament: births.place_tournament,
        victim_tournament: births.victim_tournament,
        side_low: births.side_low,
        side_high: births.side_high,
        aspect_high: births.aspect_high,
        is_stroke: births.is_stroke,
        angle_spread: births.angle_spread,
        coherence_range: births.coherence_range,
        side_min_q8: rules.bounds.side_min_q8,
        side_max_q8: rules.bounds.side_max_q8,
        aspect_max_q8: rules.bounds.aspect_max_q8,
        overlap: rules.penalties.overlap,
        turn_penalty: rules.penalties.turn,
        mask_first: rules.mask_first,
        mask_count: rules.mask_count,
        depth_gap: rules.depth_gap,
        leash: rules.leash,
        grout: rules.grout,
        grout_color: rules.grout_color,
        guide_columns: guide.columns,
        guide_rows: guide.rows,
        class_count: rules.class_count,
        end_0: class(0).end,
        end_1: class(1).end,
        end_2: class(2).end,
        scale_0: class(0).scale_q12,
        scale_1: class(1).scale_q12,
        scale_2: class(2).scale_q12,
        scale_3: class(3).scale_q12,
        first_round_0: class(0).first_round,
        first_round_1: class(1).first_round,
        first_round_2: class(2).first_round,
        first_round_3: class(3).first_round,
        background: rules.background,
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
    }
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
        top_error = glazed_error(stack, (color, is_unwanted), rules.background) * weight as i32;
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

/// Error of a pixel of this target under translucent tiles of these looks.
fn glazed_error(stack: &[(u32, i32)], (target, is_unwanted): (u32, bool), background: u32) -> i32 {
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
