//! Everything that decides a step of the cells search besides the picture: operators, their weights and amplitudes,
//! bounds and penalties. The one place for these numbers; the ablation bench (`cargo bench --bench ablation`) shows what each of
//! them is worth.

use crate::model::fly::{UNITS_PER_PX, Z_MAX};
use crate::model::guide::GuideSample;
use crate::model::target::Rgb;
use crate::model::tile::pack;

/// Fixed-point one of weights and probabilities.
pub const ONE_Q16: u32 = 1 << 16;
/// Largest side that the search makes; with it an error summed over a tile fits 32 bits.
pub const SEARCH_SIDE_MAX: u32 = 1_024 * UNITS_PER_PX;
/// First step size of a fly, u16.16: 0.3.
pub const STEP_FIRST: u32 = 19_661;
/// Largest step size: 1.
pub const STEP_MAX: u32 = 65_536;
/// Smallest step size: 0.01.
pub const STEP_MIN: u32 = 655;
/// An accepted change lets the step grow by this over 256: 1.4.
pub const STEP_GROWTH_Q8: u32 = 358;
/// A refused one lets it shrink: 0.92.
pub const STEP_SHRINK_Q8: u32 = 235;

/// Where a child's colour comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum ColorSource {
    /// The median of the target where the child would show: least SAE.
    Median = 0,
    /// The mean of the target where the child would show: least squares.
    Mean = 1,
    /// The target's pixel nearest to the child's centre.
    Pick = 2,
    /// Inherited and mutated; of newborn tiles random.
    Evolved = 3,
}

/// Which changes are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Acceptance {
    /// Those that do not raise the objective.
    Neutral = 0,
    /// Only those that lower it.
    Strict = 1,
}

/// What a newborn tile is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum BirthKind {
    /// A new tile at a place of large error.
    Fresh = 0,
    /// A mutated copy of a fly of the cell that helps.
    Mutant = 1,
}

/// How deep a newborn tile lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum BirthDepth {
    /// Just in front of what shows at its place.
    Front = 0,
    /// Anywhere.
    Random = 1,
}

/// How often each operator is applied. Weights are relative to their sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Mix {
    /// Chance of a birth in a step whose fly helps, over 65,536.
    pub birth_q16: u32,
    /// Chance that a changed fly is recoloured too, over 65,536.
    pub recolor_q16: u32,
    /// Weight of moving one edge.
    pub edge: u32,
    /// Weight of turning.
    pub turn: u32,
    /// Weight of moving, resizing and turning a little.
    pub shift: u32,
    /// Weight of a change of depth.
    pub depth: u32,
    /// Weight of recolouring alone.
    pub recolor: u32,
}

/// Births.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Births {
    /// What newborn tiles are like.
    pub kind: BirthKind,
    /// How deep they lie.
    pub depth: BirthDepth,
    /// Random pixels of which the one with the largest error is the place; 1 is a uniform place.
    pub place_tournament: u32,
    /// Random flies of the cell of which the least helpful dies.
    pub victim_tournament: u32,
    /// Smallest side over the mean side, as a logarithm in steps of 1/256.
    pub side_low: i32,
    /// Largest side over the mean side, as a logarithm in steps of 1/256.
    pub side_high: i32,
    /// Largest ratio of the two sides, as a logarithm in steps of 1/256.
    pub aspect_high: i32,
    /// Whether the longer side is the width, which lies along the guide's direction (1), or either (0).
    pub is_stroke: u32,
    /// Standard deviation of the angle around the guide's direction, in 1/65536 of a turn.
    pub angle_spread: u32,
    /// Where the guide's coherence (0 to 255) is below a random number of 0 to this, the angle is random; 0 always follows
    /// the guide.
    pub coherence_range: u32,
}

/// What every fly obeys, relative to its own side ([`Rules::own_side`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Bounds {
    /// Smallest side over the own side, over 256.
    pub side_min_q8: u32,
    /// Largest side over the own side, over 256, at most [`SIDE_MAX_Q8`].
    pub side_max_q8: u32,
    /// Largest ratio of the longer to the shorter side, over 256; [`ASPECT_FREE_Q8`] or more is any.
    pub aspect_max_q8: u32,
    /// Whether own sides follow the guide's local size (1) or not (0).
    pub local_size: u32,
}

/// A part of the population with tiles of its own size: painters begin with a broad brush.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Class {
    /// Flies with a smaller index belong to this class or to one before it.
    pub end: u32,
    /// Their own side over the mean side, over 4,096.
    pub scale_q12: u32,
    /// The first round in which absent flies of the class are dealt to cells.
    pub first_round: u32,
}

/// What is added to the error, so that tiles lie as a style wants them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Penalties {
    /// For each further tile on a covered pixel.
    pub overlap: u32,
    /// For each pixel that no tile covers.
    pub hole: u32,
    /// For a tile that is turned 45 degrees (mod 90) from the guide's direction, per pixel of its area, at most [`TURN_MAX`];
    /// the penalty grows with the square of the deviation.
    pub turn: u32,
}

/// Everything that decides a step besides the picture and its guide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rules {
    /// Names all random numbers.
    pub seed: u64,
    /// The mean side d of tiles (paper Eq. 1) in 1/64 px.
    pub side: u32,
    /// Children tried in each step, 1 to [`CANDIDATES_MAX`]; the best one counts.
    pub candidates: u32,
    /// Steps in each cell and round for each of its flies.
    pub steps_per_fly: u32,
    /// Random pixels of which the one with the largest error gives an absent fly its cell.
    pub deal_tournament: u32,
    /// Where colours come from.
    pub color: ColorSource,
    /// Which changes are accepted.
    pub acceptance: Acceptance,
    /// How often each operator is applied.
    pub mix: Mix,
    /// Births.
    pub births: Births,
    /// What every fly obeys.
    pub bounds: Bounds,
    /// What is added to the error.
    pub penalties: Penalties,
    /// Parts of the population, in the order of their flies; the last one ends where the population does.
    pub classes: [Class; CLASSES_MAX],
    /// How many classes there are, at least 1.
    pub class_count: u32,
    /// First of the mask layers of which newborn tiles wear one.
    pub mask_first: u32,
    /// How many such layers there are; all are equally likely. At least 1.
    pub mask_count: u32,
    /// Depth of a newborn tile in front of what shows: up to this.
    pub depth_gap: u32,
    /// How far a tile may go from where it was when the population was loaded, in 1/64 px, at most [`super::leash::LEASH_MAX`];
    /// 0 is anywhere. Tiles born since are free.
    pub leash: u32,
    /// Colour behind all tiles, packed.
    pub background: u32,
    /// Width of the grout ring of every tile in 1/64 px; 0 is none.
    pub grout: u32,
    /// Colour of the grout, packed.
    pub grout_color: u32,
}

/// Largest of [`Bounds::side_max_q8`]: 16 own sides.
pub const SIDE_MAX_Q8: u32 = 16 << 8;
/// An aspect that bounds nothing.
pub const ASPECT_FREE_Q8: u32 = 1 << 14;
/// Largest of [`Penalties::turn`].
pub const TURN_MAX: u32 = 1_000;
/// Most classes of a population.
pub const CLASSES_MAX: usize = 4;
/// Largest scale of a class: 8.
pub const SCALE_MAX_Q12: u32 = 8 << 12;
/// Most candidates of a step.
pub const CANDIDATES_MAX: u32 = 64;

impl Rules {
    /// The rules of the style `free` for tiles of the mean side `side` (1/64 px).
    #[must_use]
    pub fn free(seed: u64, side: u32, fly_count: usize, background: Rgb) -> Self {
        let everyone = Class { end: fly_count as u32, scale_q12: 1 << 12, first_round: 0 };
        Self {
            seed,
            side: side.min(SEARCH_SIDE_MAX),
            candidates: 1,
            steps_per_fly: 3,
            deal_tournament: 2,
            color: ColorSource::Median,
            acceptance: Acceptance::Neutral,
            mix: Mix {
                birth_q16: ONE_Q16 / 5,
                recolor_q16: ONE_Q16 / 2,
                edge: 80,
                turn: 10,
                shift: 10,
                depth: 2,
                recolor: 2,
            },
            births: Births {
                kind: BirthKind::Fresh,
                depth: BirthDepth::Front,
                place_tournament: 16,
                victim_tournament: 48,
                // 0.08 d to 6 d.
                side_low: -654,
                side_high: 459,
                aspect_high: 1024,
                is_stroke: 0,
                angle_spread: 400,
                coherence_range: 128,
            },
            bounds: Bounds { side_min_q8: 1, side_max_q8: 8 << 8, aspect_max_q8: ASPECT_FREE_Q8, local_size: 0 },
            penalties: Penalties::default(),
            classes: [everyone; CLASSES_MAX],
            class_count: 1,
            mask_first: 0,
            mask_count: 1,
            depth_gap: ((Z_MAX + 1) / (fly_count as u32).max(1)).clamp(1, 256),
            leash: 0,
            background: pack(background),
            grout: 0,
            grout_color: 0,
        }
    }
}

impl Rules {
    /// The class of a fly.
    #[inline]
    #[must_use]
    pub fn class_of(&self, fly: u32) -> &Class {
        let last = self.class_count as usize - 1;
        let place = self.classes[..last].iter().position(|class| fly < class.end).unwrap_or(last);
        &self.classes[place]
    }

    /// The side that a fly's bounds, births and moves are measured in, in 1/64 px: that of its class, at a place of this
    /// local size.
    #[inline]
    #[must_use]
    pub fn own_side(&self, fly: u32, local: GuideSample) -> u32 {
        // At most 2^16 * 2^15 and 2^16 * 2^14: 32 bits.
        let side = ((self.side * self.class_of(fly).scale_q12) >> 12).min(SEARCH_SIDE_MAX);
        if self.bounds.local_size == 0 {
            side
        } else {
            ((side * local.size_q12.min(1 << 14)) >> 12).min(SEARCH_SIDE_MAX)
        }
    }
}

/// The step size after a changed child of the fly was accepted.
#[inline]
#[must_use]
pub fn grown(step: u32) -> u32 {
    ((step * STEP_GROWTH_Q8) >> 8).min(STEP_MAX)
}

/// The step size after all changed children of the fly were refused.
#[inline]
#[must_use]
pub fn shrunk(step: u32) -> u32 {
    ((step * STEP_SHRINK_Q8) >> 8).max(STEP_MIN)
}
