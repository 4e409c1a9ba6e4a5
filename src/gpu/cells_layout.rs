//! The bytes of the cells search that cross to shaders, all in `glsl/shared/cells_state.glsl`. `tests/suite/layout.rs` compares
//! every offset here with the compiled modules.

use bytemuck::{Pod, Zeroable};

/// `Fly`: a fly, its genes packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct FlyRecord {
    /// Horizontal centre in 1/64 px.
    pub x: i32,
    /// Vertical centre in 1/64 px.
    pub y: i32,
    /// Depth.
    pub z: u32,
    /// Red and green, 16 bits each, red lowest.
    pub rg: u32,
    /// Blue and angle.
    pub ba: u32,
    /// Width in 1/64 px.
    pub w: u32,
    /// Height in 1/64 px.
    pub h: u32,
    /// Mask; bit 16 is set if the fly is not absent.
    pub form: u32,
}

/// `SearchRules`: what decides the steps of a search; see [`crate::model::cells::Rules`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SearchRules {
    /// Seed low.
    pub seed_low: u32,
    /// Seed high.
    pub seed_high: u32,
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
    /// Blocks of 8x8 px in a row.
    pub columns: u32,
    /// Logarithm of the side of a cell.
    pub side_shift: u32,
    /// Fly count.
    pub fly_count: u32,
    /// Words of scratch for each cell.
    pub scratch_words: u32,
    /// Side.
    pub side: u32,
    /// Candidates.
    pub candidates: u32,
    /// Steps per fly.
    pub steps_per_fly: u32,
    /// Deal tournament.
    pub deal_tournament: u32,
    /// Largest change that is accepted.
    pub highest: i32,
    /// Birth q16.
    pub birth_q16: u32,
    /// Recolor q16.
    pub recolor_q16: u32,
    /// Edge.
    pub edge: u32,
    /// Turn.
    pub turn: u32,
    /// Shift.
    pub shift: u32,
    /// Depth.
    pub depth: u32,
    /// Mix total.
    pub mix_total: u32,
    /// Place tournament.
    pub place_tournament: u32,
    /// Victim tournament.
    pub victim_tournament: u32,
    /// Side low.
    pub side_low: i32,
    /// Side high.
    pub side_high: i32,
    /// Aspect high.
    pub aspect_high: i32,
    /// Whether the longer side of a newborn tile is its width.
    pub is_stroke: u32,
    /// Angle spread.
    pub angle_spread: u32,
    /// Coherence range.
    pub coherence_range: u32,
    /// Side min q8.
    pub side_min_q8: u32,
    /// Side max q8.
    pub side_max_q8: u32,
    /// Aspect max q8.
    pub aspect_max_q8: u32,
    /// Overlap.
    pub overlap: u32,
    /// Turn penalty.
    pub turn_penalty: u32,
    /// Mask first.
    pub mask_first: u32,
    /// Mask count.
    pub mask_count: u32,
    /// Depth gap.
    pub depth_gap: u32,
    /// Width of the ring of grout in 1/64 px.
    pub grout: u32,
    /// Its colour, packed.
    pub grout_color: u32,
    /// Guide columns.
    pub guide_columns: u32,
    /// Guide rows.
    pub guide_rows: u32,
    /// Class count.
    pub class_count: u32,
    /// End, scale and first round of each class.
    pub end_0: u32,
    /// End 1.
    pub end_1: u32,
    /// End 2.
    pub end_2: u32,
    /// Scale 0.
    pub scale_0: u32,
    /// Scale 1.
    pub scale_1: u32,
    /// Scale 2.
    pub scale_2: u32,
    /// Scale 3.
    pub scale_3: u32,
    /// First round 0.
    pub first_round_0: u32,
    /// First round 1.
    pub first_round_1: u32,
    /// First round 2.
    pub first_round_2: u32,
    /// First round 3.
    pub first_round_3: u32,
}

/// `Header`: how far a search has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SearchHeader {
    /// Rounds made, and rounds to make.
    pub round: u32,
    /// Wanted.
    pub wanted: u32,
    /// Cells that have steps left in this round.
    pub pending: u32,
    /// 1: the scan of this iteration began a round.
    pub is_fresh: u32,
    /// Not 0: a step of this cell, less 1, alone exceeds the budget.
    pub overrun: u32,
    /// Children evaluated, low word.
    pub evals_low: u32,
    /// Evals high.
    pub evals_high: u32,
    /// Births accepted, low word.
    pub births_low: u32,
    /// Births high.
    pub births_high: u32,
    /// Children accepted, low word.
    pub accepted_low: u32,
    /// Accepted high.
    pub accepted_high: u32,
    /// Change of the objective since the population was loaded.
    pub change_low: u32,
    /// Change high.
    pub change_high: u32,
    /// Dispatches of cells that had something to do.
    pub iterations: u32,
}

/// `CellRecord`: a cell of the round at hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct CellRecord {
    /// Its slice of the members.
    pub first: u32,
    /// Count.
    pub count: u32,
    /// Steps made, then members looked at for removal; STEP_DONE when there is nothing left.
    pub step: u32,
    /// Members that the next round deals to the cell.
    pub dealt: u32,
    /// Members written to the slice.
    pub filled: u32,
}

/// `Push` of `glsl/cells.comp`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CellsPush {
    /// Most turns of loops in one invocation.
    pub budget: u32,
}
