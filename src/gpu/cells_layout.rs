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
#[expect(missing_docs, reason = "named as the fields of `Rules` and its parts, which tell units and ranges")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SearchRules {
    pub seed_low: u32,
    pub seed_high: u32,
    pub width: u32,
    pub height: u32,
    /// Blocks of 8x8 px in a row.
    pub columns: u32,
    /// Logarithm of the side of a cell.
    pub side_shift: u32,
    pub fly_count: u32,
    /// Words of scratch for each cell.
    pub scratch_words: u32,
    pub side: u32,
    pub candidates: u32,
    pub steps_per_fly: u32,
    pub deal_tournament: u32,
    /// Largest change that is accepted.
    pub highest: i32,
    pub birth_q16: u32,
    pub recolor_q16: u32,
    pub edge: u32,
    pub turn: u32,
    pub shift: u32,
    pub depth: u32,
    pub mix_total: u32,
    pub place_tournament: u32,
    pub victim_tournament: u32,
    pub side_low: i32,
    pub side_high: i32,
    pub aspect_high: i32,
    /// Whether the longer side of a newborn tile is its width.
    pub is_stroke: u32,
    pub angle_spread: u32,
    pub coherence_range: u32,
    pub side_min_q8: u32,
    pub side_max_q8: u32,
    pub aspect_max_q8: u32,
    pub overlap: u32,
    pub turn_penalty: u32,
    pub mask_first: u32,
    pub mask_count: u32,
    pub depth_gap: u32,
    /// How far a tile may go from where it was, in 1/64 px.
    pub leash: u32,
    /// Width of the ring of grout in 1/64 px.
    pub grout: u32,
    /// Its colour, packed.
    pub grout_color: u32,
    pub guide_columns: u32,
    pub guide_rows: u32,
    pub class_count: u32,
    /// End, scale and first round of each class.
    pub end_0: u32,
    pub end_1: u32,
    pub end_2: u32,
    pub scale_0: u32,
    pub scale_1: u32,
    pub scale_2: u32,
    pub scale_3: u32,
    pub first_round_0: u32,
    pub first_round_1: u32,
    pub first_round_2: u32,
    pub first_round_3: u32,
    /// The colour behind all tiles, packed.
    pub background: u32,
    /// Where the lane lies in the buffers that all lanes share.
    pub lane: u32,
    pub first_fly: u32,
    pub first_deal: u32,
    pub first_cell: u32,
    pub first_pixel: u32,
    pub first_stack: u32,
    pub first_scratch: u32,
    pub first_guide: u32,
    pub first_mask: u32,
    pub first_origin: u32,
}

/// `Header`: how far a search has come.
#[expect(missing_docs, reason = "the names tell all; what they are for stands at the struct of the shaders")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SearchHeader {
    /// Rounds made, and rounds to make.
    pub round: u32,
    pub wanted: u32,
    /// Cells that have steps left in this round.
    pub pending: u32,
    /// 1: the scan of this iteration began a round.
    pub is_fresh: u32,
    /// Not 0: a step of this cell, less 1, alone exceeds the budget.
    pub overrun: u32,
    /// Children evaluated, low word.
    pub evals_low: u32,
    pub evals_high: u32,
    /// Births accepted, low word.
    pub births_low: u32,
    pub births_high: u32,
    /// Children accepted, low word.
    pub accepted_low: u32,
    pub accepted_high: u32,
    /// Change of the objective since the population was loaded.
    pub change_low: u32,
    pub change_high: u32,
    /// Dispatches of cells that had something to do.
    pub iterations: u32,
}

/// `CellRecord`: a cell of the round at hand.
#[expect(missing_docs, reason = "the names tell all; what they are for stands at the struct of the shaders")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct CellRecord {
    /// Its slice of the members.
    pub first: u32,
    pub count: u32,
    /// Steps made, then members looked at for removal; STEP_DONE when there is nothing left.
    pub step: u32,
    /// Members that the next round deals to the cell.
    pub dealt: u32,
    /// Members written to the slice.
    pub filled: u32,
}

/// `Push` of all stages of the search.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CellsPush {
    /// Place of the first lane in the order of rules.
    pub first_lane: u32,
    /// Most turns of loops in one invocation.
    pub budget: u32,
}
