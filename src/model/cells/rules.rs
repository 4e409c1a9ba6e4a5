//! Everything that decides a step of the cells search besides the picture: operators, their weights and amplitudes,
//! bounds and penalties.
//!
//! The one place for these numbers. A row of a table here is a rule: the struct that shaders read follows from it
//! (`glsl/shared/cells_rules.glsl`, written by `compile-shaders`), as does what is copied there. The ablation bench
//! (`cargo bench --bench ablation`) shows what each of them is worth.

use super::numbers::{choice, numbers};
use crate::model::fly::{UNITS_PER_PX, Z_MAX};
use crate::model::guide::GuideSample;
use crate::model::target::Rgb;
use crate::model::tile::pack;

/// 1 as a fixed-point weight or probability.
pub const ONE_Q16: u32 = 1 << 16;
/// Largest side that the search makes; with it an error summed over a tile fits 32 bits.
pub const SEARCH_SIDE_MAX: u32 = 1_024 * UNITS_PER_PX;
/// First step size of a fly, u16.16: 0.3.
pub const STEP_FIRST: u32 = 19_661;
/// Largest step size: 1.
pub const STEP_MAX: u32 = 65_536;
/// Smallest step size: 0.01.
pub const STEP_MIN: u32 = 655;
/// An accepted change multiplies the step by this over 256: 1.4.
pub const STEP_GROWTH_Q8: u32 = 358;
/// A refused change multiplies it by this over 256: 0.92.
pub const STEP_SHRINK_Q8: u32 = 235;

choice! {
    /// Where a child's colour comes from.
    pub enum ColorSource {
        /// The median of the target where the child would show: least SAE.
        Median = 0,
        /// The mean of the target where the child would show: least squares.
        Mean = 1,
        /// The target's pixel nearest to the child's centre.
        Pick = 2,
        /// Inherited and mutated; random for newborn tiles.
        Evolved = 3,
    }
}

choice! {
    /// Which changes are accepted.
    pub enum Acceptance {
        /// Those that do not raise the objective.
        Neutral = 0,
        /// Only those that lower it.
        Strict = 1,
    }
}

choice! {
    /// What a newborn tile is like.
    pub enum BirthKind {
        /// A new tile at a place of large error.
        Fresh = 0,
        /// A mutated copy of a fly of the cell that helps.
        Mutant = 1,
    }
}

choice! {
    /// How deep a newborn tile lies.
    pub enum BirthDepth {
        /// Just in front of what shows at its place.
        Front = 0,
        /// Anywhere.
        Random = 1,
    }
}

numbers! {
    /// How often each operator is applied. Weights are relative to their sum.
    pub struct Mix {
        /// Chance of a birth, over 65,536, in a step of a fly that helps.
        birth_q16: u32 = ONE_Q16 / 5,
        /// Chance, over 65,536, that a changed fly is recoloured too.
        recolor_q16: u32 = ONE_Q16 / 2,
        /// Weight of moving one edge.
        edge: u32 = 80,
        /// Weight of turning.
        turn: u32 = 10,
        /// Weight of moving, resizing and turning a little.
        shift: u32 = 10,
        /// Weight of a change of depth.
        depth: u32 = 2,
        /// Weight of recolouring alone.
        recolor: u32 = 2,
    }
}

numbers! {
    /// Births.
    pub struct Births {
        /// What newborn tiles are like.
        kind: BirthKind = BirthKind::Fresh,
        /// How deep they lie.
        depth: BirthDepth = BirthDepth::Front,
        /// Number of random pixels that compete for the place of a birth: the largest error wins. With 1 the place is
        /// uniform.
        place_tournament: u32 = 16,
        /// Number of random flies of the cell that compete to die: the least helpful does.
        victim_tournament: u32 = 48,
        /// Smallest side over the mean side, as a logarithm in steps of 1/256.
        // 0.08.
        side_low: i32 = -654,
        /// Largest side over the mean side, as a logarithm in steps of 1/256.
        // 6.
        side_high: i32 = 459,
        /// Largest ratio of the two sides, as a logarithm in steps of 1/256.
        aspect_high: i32 = 1024,
        /// 1 if the longer side is always the width, which lies along the guide's direction; 0 if it may be either.
        is_stroke: u32 = 0,
        /// Standard deviation of the angle around the guide's direction, in 1/65536 of a turn.
        angle_spread: u32 = 400,
        /// The angle is random if the guide's coherence (0 to 255) is below a random number between 0 and this. With 0
        /// the angle always follows the guide.
        coherence_range: u32 = 128,
    }
}

numbers! {
    /// What every fly obeys, relative to its own side ([`Rules::own_side`]).
    pub struct Bounds {
        /// Smallest side over the own side, over 256.
        side_min_q8: u32 = 1,
        /// Largest side over the own side, over 256, at most [`SIDE_MAX_Q8`].
        side_max_q8: u32 = 8 << 8,
        /// Largest ratio of the longer to the shorter side, over 256; from [`ASPECT_FREE_Q8`] on there is no limit.
        aspect_max_q8: u32 = ASPECT_FREE_Q8,
        /// 1 if own sides follow the guide's local size, 0 if not.
        local_size: u32 = 0,
    }
}

numbers! {
    /// A part of the population with tiles of its own size: painters begin with a broad brush.
    pub struct Class {
        /// Flies with a smaller index belong to this class or to one before it.
        end: u32,
        /// Their own side over the mean side, over 4,096.
        scale_q12: u32,
        /// The first round in which absent flies of the class are dealt to cells.
        first_round: u32,
    }
}

numbers! {
    /// What is added to the error so that tiles lie as the style wants.
    pub struct Penalties {
        /// For each further tile on a covered pixel.
        overlap: u32 = 0,
        /// For each pixel that no tile covers.
        hole: u32 = 0,
        /// Per pixel of its area, for a tile that is turned 45 degrees (mod 90) from the guide's direction; at most
        /// [`TURN_MAX`]. The penalty grows with the square of the deviation.
        turn: u32 = 0,
    }
}

numbers! {
    /// Everything that decides a step, apart from the picture and its guide.
    pub struct Rules {
        /// Part of the name of every random number.
        seed: u64,
        /// The mean side d of tiles (paper Eq. 1) in 1/64 px.
        side: u32,
        /// Children tried in each step, 1 to [`CANDIDATES_MAX`]; the best one counts.
        candidates: u32,
        /// Steps in each cell and round for each of its flies.
        steps_per_fly: u32,
        /// Number of random pixels that compete for an absent fly: it is dealt to the cell of the largest error.
        deal_tournament: u32,
        /// Where colours come from.
        color: ColorSource,
        /// Which changes are accepted.
        acceptance: Acceptance,
        /// How often each operator is applied.
        mix: Mix,
        /// Births.
        births: Births,
        /// What every fly obeys.
        bounds: Bounds,
        /// What is added to the error.
        penalties: Penalties,
        /// Parts of the population, in the order of their flies; the last one ends where the population does.
        classes: [Class; CLASSES_MAX],
        /// How many classes there are, at least 1.
        class_count: u32,
        /// First of the mask layers that newborn tiles choose from.
        mask_first: u32,
        /// How many such layers there are; all are equally likely. At least 1.
        mask_count: u32,
        /// A newborn tile lies in front of what shows by at most this depth.
        depth_gap: u32,
        /// How far a tile may move from where it was when the population was loaded, in 1/64 px, at most
        /// [`super::leash::LEASH_MAX`]; 0 sets no limit. Tiles born since then are free.
        leash: u32,
        /// Colour behind all tiles, packed.
        background: u32,
        /// Width of the grout ring of every tile in 1/64 px; 0 is none.
        grout: u32,
        /// Colour of the grout, packed.
        grout_color: u32,
    }
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
            mix: Mix::FREE,
            births: Births::FREE,
            bounds: Bounds::FREE,
            penalties: Penalties::FREE,
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

    /// The fly's own side in 1/64 px, in which its bounds, births and moves are measured. It follows from its class and
    /// from the local size of its place.
    #[inline]
    #[must_use]
    pub fn own_side(&self, fly: u32, local: GuideSample) -> u32 {
        // The products are at most 2^16 * 2^15 and 2^16 * 2^14, so 32 bits hold them.
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
