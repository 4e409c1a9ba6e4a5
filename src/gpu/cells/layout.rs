//! The bytes of the cells search that cross to shaders, all in `glsl/shared/cells_state.glsl` and
//! `glsl/shared/cells_rules.glsl`. `tests/suite/layout.rs` compares every offset here with the compiled modules.

use bytemuck::{Pod, Zeroable};

use crate::model::cells::Rules;
use crate::model::cells::numbers::{Field, Numbers, numbers};
use crate::model::cells::rules::{
    ASPECT_FREE_Q8, ColorSource, SEARCH_SIDE_MAX, STEP_FIRST, STEP_GROWTH_Q8, STEP_MAX, STEP_MIN, STEP_SHRINK_Q8,
};

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

numbers! {
    /// Where a search lies in the buffers that all lanes share, and what it must know of its picture.
    pub struct Placement {
        /// Width of the picture in px.
        width: u32,
        /// Height of the picture in px.
        height: u32,
        /// Blocks of 8x8 px in a row.
        columns: u32,
        /// Logarithm of the side of a cell in px.
        side_shift: u32,
        /// Number of flies.
        fly_count: u32,
        /// Words of scratch for each cell.
        scratch_words: u32,
        /// Samples of the guide in a row.
        guide_columns: u32,
        /// Rows of samples of the guide.
        guide_rows: u32,
        /// Place among the headers.
        lane: u32,
        /// Place of its first fly.
        first_fly: u32,
        /// Place of its first word of deals.
        first_deal: u32,
        /// Place of its first cell.
        first_cell: u32,
        /// Place of its first pixel.
        first_pixel: u32,
        /// Where its stacks would begin if its first pixel were pixel 0. Such sums wrap around.
        first_stack: u32,
        /// Place of its first word of scratch.
        first_scratch: u32,
        /// Place of its first sample of the guide.
        first_guide: u32,
        /// Its first mask layer.
        first_mask: u32,
        /// Place of the first fly as it was loaded.
        first_origin: u32,
    }
}

/// `SearchRules`: all numbers of [`Rules`], then those of [`Placement`].
pub type SearchRules = [u32; Rules::WORDS + Placement::WORDS];

/// The words that shaders read as `SearchRules`.
pub(super) fn search_rules(rules: &Rules, placement: &Placement) -> SearchRules {
    let mut words = [0; Rules::WORDS + Placement::WORDS];
    placement.put(rules.put(&mut words));
    words
}

/// Constants of the rules that shaders use, too.
const CONSTANTS: [(&str, u32); 11] = [
    ("COLOR_MEDIAN", ColorSource::Median as u32),
    ("COLOR_MEAN", ColorSource::Mean as u32),
    ("COLOR_PICK", ColorSource::Pick as u32),
    ("COLOR_EVOLVED", ColorSource::Evolved as u32),
    ("SEARCH_SIDE_MAX", SEARCH_SIDE_MAX),
    ("ASPECT_FREE_Q8", ASPECT_FREE_Q8),
    ("STEP_FIRST", STEP_FIRST),
    ("STEP_MAX", STEP_MAX),
    ("STEP_MIN", STEP_MIN),
    ("STEP_GROWTH_Q8", STEP_GROWTH_Q8),
    ("STEP_SHRINK_Q8", STEP_SHRINK_Q8),
];

/// The members of `SearchRules` in GLSL.
fn search_rules_fields() -> impl Iterator<Item = &'static Field> {
    Rules::FIELDS.iter().chain(Placement::FIELDS)
}

/// What `glsl/shared/cells_rules.glsl` begins with.
const GLSL_HEAD: &str = "\
// The numbers that decide the steps of a search. compile-shaders writes this file from src/model/cells/rules.rs and
// src/gpu/cells/layout.rs. Add a number there, where its unit and range stand, too.
";

/// The text of `glsl/shared/cells_rules.glsl`, which `compile-shaders` writes.
#[must_use]
pub fn search_rules_glsl() -> String {
    let mut text = GLSL_HEAD.to_owned();
    text.extend(CONSTANTS.iter().map(|(name, value)| format!("\nconst uint {name} = {value}u;")));
    text.push('\n');
    let structs = search_rules_fields().filter(|field| !field.fields.is_empty());
    for field in structs {
        text.push_str(&struct_glsl(field.glsl, field.fields.iter()));
    }
    text + &struct_glsl("SearchRules", search_rules_fields())
}

fn struct_glsl(name: &str, fields: impl Iterator<Item = &'static Field>) -> String {
    let members: String = fields
        .map(|Field { name, glsl, count, .. }| match count {
            Some(count) => format!("    {glsl} {name}[{count}];\n"),
            None => format!("    {glsl} {name};\n"),
        })
        .collect();
    format!("\nstruct {name} {{\n{members}}};\n")
}

/// Every number in `SearchRules`: how GLSL reaches it (`classes[1].end`), its offset in bytes and its type in GLSL.
#[must_use]
pub fn search_rules_numbers() -> Vec<(String, u32, &'static str)> {
    let mut found = Vec::new();
    list_numbers("", search_rules_fields(), &mut found);
    (0..).step_by(4).zip(found).map(|(offset, (path, glsl))| (path, offset, glsl)).collect()
}

fn list_numbers(path: &str, fields: impl Iterator<Item = &'static Field>, found: &mut Vec<(String, &'static str)>) {
    for Field { name, glsl, count, fields, .. } in fields {
        let paths = match count {
            Some(count) => (0..*count).map(|place| format!("{path}{name}[{place}]")).collect(),
            None => vec![format!("{path}{name}")],
        };
        for path in paths {
            match fields {
                [] => found.push((path, glsl)),
                fields => list_numbers(&format!("{path}."), fields.iter(), found),
            }
        }
    }
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
    /// The round that the scan began last.
    pub under_way: u32,
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

impl CellRecord {
    /// A cell without work, as all are between two rounds.
    pub const DONE: Self = Self { first: 0, count: 0, step: u32::MAX, dealt: 0, filled: 0 };
}

/// `Push` of all stages of the search.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct CellsPush {
    /// Place of the first lane in the order of rules.
    pub first_lane: u32,
    /// Most turns of loops in one invocation.
    pub budget: u32,
    /// The cell that workgroup 0 of a lane works on.
    pub first_cell: u32,
}
