//! Styles of the cells search: named sets of bounds, penalties, masks and start.
//!
//! Lengths are multiples of d, the mean side of a tile (paper Eq. 1), so that a style looks alike at every size and
//! number of tiles. All numbers are integers: they decide the picture.

use crate::model::cells::Rules;
use crate::model::cells::operators::PLACE_TOURNAMENT_MAX;
use crate::model::cells::rules::{ASPECT_FREE_Q8, Births, Bounds, CLASSES_MAX, Class, Mix, ONE_Q16, Penalties};
use crate::model::tables::size_factor_q16;
use crate::model::tile::pack;
use crate::model::{Blend, Rgb};

/// The value 1 for lengths divided by d, in fixed point.
const ONE_Q8: u32 = 256;

/// Where the guide of a style comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GuideKind {
    /// The edges themselves; without them tiles are turned at random.
    Edges,
    /// Directions that flow along the contours and on into flat areas, and sizes that follow the detail.
    Flow {
        /// The distance over which directions are smoothed, in 1/256 of the mean side.
        smoothing_q8: u32,
        /// How much sizes follow the detail, 0 to 256.
        size_strength_q8: u32,
    },
}

/// The ground behind all tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Ground {
    /// Black, as in the paper.
    Black,
    /// The mean colour of the picture: a toned canvas.
    Mean,
    /// The grout, the same between tiles as within them.
    Grout,
}

/// A class of tiles with their own size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ClassStyle {
    /// Its share of the population, in 1/65536. The last class takes the rest.
    pub share_q16: u32,
    /// Its side over d, in 1/256.
    pub scale_q8: u32,
    /// The first round in which its tiles are laid.
    pub first_round: u32,
}

/// The numbers that decide how a mosaic looks.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Style {
    /// Smallest side, divided by the side of the tile's class, in 1/256.
    pub side_min_q8: u32,
    /// Largest side, divided by the side of the tile's class, in 1/256.
    pub side_max_q8: u32,
    /// Largest ratio of the sides, in 1/256. A ratio of 64 or more means any.
    pub aspect_max_q8: u32,
    /// Smallest side of a newborn tile, divided by the side of its class, in 1/256.
    pub birth_min_q8: u32,
    /// Largest side of a newborn tile, divided by the side of its class, in 1/256.
    pub birth_max_q8: u32,
    /// Whether the longer side of a newborn tile lies along the guide's direction, as a brush is drawn.
    pub is_stroke: bool,
    /// The ground behind the tiles, unless a colour is asked for.
    pub ground: Ground,
    /// Cost of each further tile on a pixel.
    pub overlap: u32,
    /// Cost of each pixel that no tile covers.
    pub hole: u32,
    /// Cost of a tile turned 45 degrees off the guide, per pixel of its area.
    pub turn: u32,
    /// Standard deviation of the angle of newborn tiles around the guide, in 1/65536 of a turn.
    pub angle_spread: u32,
    /// Newborn tiles always follow the guide where its coherence is at least this, 0 to 255.
    pub coherence: u32,
    /// Where directions and sizes come from.
    pub guide: GuideKind,
    /// Width of the ring of grout divided by d, in 1/256; 0 is none.
    pub grout_q8: u32,
    /// The classes of tiles, 1 to 4.
    pub classes: Vec<ClassStyle>,
    /// Names of the masks that tiles wear by default. An empty list means the square.
    pub masks: Vec<String>,
    /// Name of the shader that turns drawings into masks.
    pub shader: String,
    /// How the masks' coverage is read.
    pub blend: Blend,
    /// Opacity of whole translucent tiles, 1 to 255.
    pub opacity: u8,
    /// Chance that a changed fly is also recoloured, in 1/65536.
    pub recolor_q16: u32,
}

impl Style {
    /// All names, the default first.
    pub const NAMES: [&'static str; 4] = ["free", "mosaic", "paint", "spray"];

    /// The style with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "free" => Self::free(),
            "mosaic" => Self::mosaic(),
            "paint" => Self::paint(),
            "spray" => Self::spray(),
            _ => return None,
        })
    }

    /// The closest likeness: no penalty, and tiles of any shape.
    #[must_use]
    pub fn free() -> Self {
        Self {
            side_min_q8: 1,
            side_max_q8: 8 * ONE_Q8,
            aspect_max_q8: ASPECT_FREE_Q8,
            birth_min_q8: 20,
            birth_max_q8: 6 * ONE_Q8,
            is_stroke: false,
            ground: Ground::Black,
            overlap: 0,
            hole: 0,
            turn: 0,
            angle_spread: 400,
            coherence: 128,
            guide: GuideKind::Edges,
            grout_q8: 0,
            classes: vec![ClassStyle { share_q16: ONE_Q16, scale_q8: ONE_Q8, first_round: 0 }],
            masks: Vec::new(),
            shader: "template".to_owned(),
            blend: Blend::Opaque,
            opacity: 255,
            recolor_q16: ONE_Q16 / 2,
        }
    }

    /// Whole tiles side by side in rows along the contours, with grout between them: opus vermiculatum.
    #[must_use]
    pub fn mosaic() -> Self {
        Self {
            side_min_q8: ONE_Q8 * 6 / 10,
            side_max_q8: ONE_Q8 * 16 / 10,
            aspect_max_q8: ONE_Q8 * 16 / 10,
            birth_min_q8: ONE_Q8 * 7 / 10,
            birth_max_q8: ONE_Q8 * 14 / 10,
            ground: Ground::Grout,
            overlap: 20,
            hole: 120,
            turn: 60,
            angle_spread: 65_536 / 120,
            coherence: 0,
            guide: GuideKind::Flow { smoothing_q8: 2 * ONE_Q8, size_strength_q8: 160 },
            grout_q8: 16,
            ..Self::free()
        }
    }

    /// Brush strokes along the contours, broad ones first.
    #[must_use]
    pub fn paint() -> Self {
        Self {
            side_min_q8: ONE_Q8 * 4 / 10,
            side_max_q8: ONE_Q8 * 4,
            aspect_max_q8: ONE_Q8 * 6,
            birth_min_q8: ONE_Q8 * 5 / 10,
            birth_max_q8: ONE_Q8 * 3,
            is_stroke: true,
            ground: Ground::Mean,
            hole: 60,
            angle_spread: 65_536 / 40,
            coherence: 0,
            guide: GuideKind::Flow { smoothing_q8: ONE_Q8, size_strength_q8: 128 },
            classes: vec![
                ClassStyle { share_q16: ONE_Q16 / 10, scale_q8: 5 * ONE_Q8 / 2, first_round: 0 },
                ClassStyle { share_q16: ONE_Q16 * 3 / 10, scale_q8: ONE_Q8 * 3 / 2, first_round: 4 },
                ClassStyle { share_q16: ONE_Q16 * 6 / 10, scale_q8: ONE_Q8 * 8 / 10, first_round: 8 },
            ],
            masks: vec!["brush".to_owned()],
            ..Self::free()
        }
    }

    /// Soft round clouds of paint that show through each other, as from an airbrush.
    #[must_use]
    pub fn spray() -> Self {
        Self {
            side_min_q8: ONE_Q8,
            side_max_q8: ONE_Q8 * 8,
            aspect_max_q8: ONE_Q8 * 3,
            birth_min_q8: ONE_Q8,
            birth_max_q8: ONE_Q8 * 6,
            recolor_q16: ONE_Q16 * 6 / 10,
            ground: Ground::Mean,
            masks: vec!["disc".to_owned()],
            shader: "soft".to_owned(),
            blend: Blend::Translucent,
            opacity: 200,
            ..Self::free()
        }
    }

    /// The style for translucent tiles. It has no grout and no penalties for overlaps or holes, since translucent tiles
    /// lie on each other and show what is behind them.
    #[must_use]
    pub fn for_translucent_tiles(self) -> Self {
        Self { overlap: 0, hole: 0, grout_q8: 0, ..self }
    }

    /// The rules of the style for `fly_count` tiles of the mean side `side` (1/64 px) over `background`, with grout of
    /// `grout_color`.
    #[must_use]
    pub fn rules(&self, seed: u64, side: u32, fly_count: usize, background: Rgb, grout_color: Rgb) -> Rules {
        let base = Rules::free(seed, side, fly_count, background);
        debug_assert!(base.births.place_tournament <= PLACE_TOURNAMENT_MAX, "draws of two purposes would coincide");
        let mut classes = base.classes;
        let mut share_q16 = 0;
        for (class, style) in classes.iter_mut().zip(&self.classes) {
            share_q16 = (share_q16 + style.share_q16).min(ONE_Q16);
            let end = (fly_count as u64 * u64::from(share_q16)) >> 16;
            *class = Class { end: end as u32, scale_q12: style.scale_q8 << 4, first_round: style.first_round };
        }
        Rules {
            births: Births {
                side_low: logarithm(self.birth_min_q8),
                side_high: logarithm(self.birth_max_q8),
                aspect_high: if self.aspect_max_q8 >= ASPECT_FREE_Q8 { 1_024 } else { logarithm(self.aspect_max_q8) },
                is_stroke: u32::from(self.is_stroke),
                angle_spread: self.angle_spread,
                coherence_range: self.coherence,
                ..base.births
            },
            bounds: Bounds {
                side_min_q8: self.side_min_q8,
                side_max_q8: self.side_max_q8,
                aspect_max_q8: self.aspect_max_q8,
                local_size: u32::from(matches!(self.guide, GuideKind::Flow { .. })),
            },
            penalties: Penalties { overlap: self.overlap, hole: self.hole, turn: self.turn },
            mix: Mix { recolor_q16: self.recolor_q16, ..base.mix },
            classes,
            class_count: self.classes.len().clamp(1, CLASSES_MAX) as u32,
            grout: (base.side * self.grout_q8) >> 8,
            grout_color: pack(grout_color),
            ..base
        }
    }
}

/// The natural logarithm of `value_q8` / 256 in steps of 1/256, from the table of size factors: the largest step whose
/// factor is at most the value.
fn logarithm(value_q8: u32) -> i32 {
    let value_q16 = u64::from(value_q8) << 8;
    (-1_024..=1_024).rev().find(|&step| size_factor_q16(step) <= value_q16).unwrap_or(-1_024)
}
