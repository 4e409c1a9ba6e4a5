//! What is wished for, as the controls of the window hold it: plain values, of which a recipe is written.

use std::sync::Arc;

use crate::evolve::cells::EVALS_PER_FLY;
use crate::evolve::style::Style;
use crate::model::Rgb;
use crate::shapes::Shader;
use crate::studio::LONG_SIDE_PX;

/// How tiles lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum StyleWish {
    /// The closest likeness.
    Free,
    /// Whole tiles in rows, with grout: what people open the window for.
    #[default]
    Mosaic,
    /// Strokes.
    Paint,
    /// Soft translucent discs.
    Spray,
}

impl StyleWish {
    pub(super) const ALL: [Self; 4] = [Self::Mosaic, Self::Paint, Self::Free, Self::Spray];

    /// The name in recipes.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Mosaic => "mosaic",
            Self::Paint => "paint",
            Self::Spray => "spray",
        }
    }

    /// What it gives, in one line.
    pub(super) fn description(self) -> &'static str {
        match self {
            Self::Free => "the closest likeness, with tiles of any shape",
            Self::Mosaic => "whole tiles in rows along the contours, with grout between them",
            Self::Paint => "brush strokes along the contours, broad ones first",
            Self::Spray => "soft translucent discs",
        }
    }
}

/// A tile shape.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum MaskWish {
    /// One that comes with smalti, by its name.
    BuiltIn(&'static str),
    /// A picture of the user's.
    File { name: String, bytes: Arc<[u8]> },
}

/// The grout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum GroutWish {
    /// As the style has it.
    #[default]
    OfStyle,
    None,
    /// A quarter darker than the picture.
    Auto,
    Color(Rgb),
}

/// What lies behind the tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum GroundWish {
    /// As the style has it.
    #[default]
    OfStyle,
    /// Nothing: the mosaic is transparent there.
    None,
    Color(Rgb),
}

/// Which colours there are.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) enum ColorWish {
    /// All.
    #[default]
    Full,
    /// At most so many of the picture.
    Few(u64),
    /// Those of a palette, with the name that it goes by.
    Palette { name: String, colors: Arc<[Rgb]> },
}

/// Bounds of the style; none is as the style has it. Lengths are multiples of the mean side of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BoundWishes {
    /// Smallest and largest side.
    pub side: Option<[f64; 2]>,
    /// Largest ratio of the sides.
    pub aspect: Option<f64>,
    /// Cost of each further tile on a pixel.
    pub overlap: Option<u32>,
    /// Cost of a pixel that no tile covers.
    pub hole: Option<u32>,
    /// Cost of turning away from the contours.
    pub turn: Option<u32>,
}

/// The bounds that a style has by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UsualBounds {
    pub side: [f64; 2],
    pub aspect: f64,
    pub overlap: u32,
    pub hole: u32,
    pub turn: u32,
}

impl UsualBounds {
    /// Those of a style, to a hundredth.
    pub(super) fn of(style: StyleWish) -> Self {
        let Style { side_min_q8, side_max_q8, aspect_max_q8, overlap, hole, turn, .. } =
            Style::named(style.name()).unwrap_or_else(Style::free);
        let decimal = |q8: u32| (f64::from(q8) / 256.0 * 100.0).round() / 100.0;
        let side = [decimal(side_min_q8).max(0.01), decimal(side_max_q8)];
        Self { side, aspect: decimal(aspect_max_q8), overlap, hole, turn }
    }
}

/// Where likeness matters: a luma for each pixel of the fitted picture.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct WeightMap {
    /// Width and height in px.
    pub size: [u32; 2],
    /// 0 to 255, row by row.
    pub luma: Vec<u8>,
}

impl WeightMap {
    /// The same map for a picture of another size: each pixel as the nearest one was.
    pub(super) fn resized(&self, size: [u32; 2]) -> Self {
        let [old_width, old_height] = self.size.map(u64::from);
        let [width, height] = size.map(u64::from);
        let pixel = |place: u64| {
            let (x, y) = (place % width * old_width / width, place / width * old_height / height);
            self.luma[(y * old_width + x) as usize]
        };
        Self { size, luma: (0..width * height).map(pixel).collect() }
    }
}

impl std::fmt::Debug for WeightMap {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("WeightMap").field("size", &self.size).finish_non_exhaustive()
    }
}

/// Everything that is wished for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wishes {
    pub style: StyleWish,
    /// Number of tiles; none is as many as suit the picture.
    pub tiles: Option<u64>,
    /// Longer side in px at which the picture evolves.
    pub size: u64,
    pub evals_per_tile: u64,
    pub seed: u64,
    /// The shapes that tiles wear; none is as the style has it.
    pub masks: Vec<MaskWish>,
    pub shader: Option<Shader>,
    pub grout: GroutWish,
    /// Width of the grout in px of the evolved picture; none is as the style has it.
    pub grout_width: Option<f64>,
    pub ground: GroundWish,
    pub colors: ColorWish,
    pub bounds: BoundWishes,
    pub weight: Option<Arc<WeightMap>>,
}

impl Default for Wishes {
    fn default() -> Self {
        Self {
            style: StyleWish::default(),
            tiles: None,
            size: LONG_SIDE_PX,
            evals_per_tile: EVALS_PER_FLY,
            seed: 0,
            masks: Vec::new(),
            shader: None,
            grout: GroutWish::default(),
            grout_width: None,
            ground: GroundWish::default(),
            colors: ColorWish::default(),
            bounds: BoundWishes::default(),
            weight: None,
        }
    }
}

/// Wishes that were changed, and can be taken back.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    past: Vec<Wishes>,
    future: Vec<Wishes>,
}

/// As many changes can be taken back.
const PAST_MAX: usize = 200;

impl History {
    /// Notes what was wished for before a change.
    pub(super) fn note(&mut self, before: Wishes) {
        self.future.clear();
        if self.past.len() == PAST_MAX {
            self.past.remove(0);
        }
        self.past.push(before);
    }

    pub(super) fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    pub(super) fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }

    /// Forgets the maps of weights, where another picture is opened.
    pub(super) fn drop_weights(&mut self) {
        self.past.iter_mut().chain(&mut self.future).for_each(|wishes| wishes.weight = None);
    }

    /// Takes the last change back.
    pub(super) fn undo(&mut self, wishes: &mut Wishes) {
        if let Some(before) = self.past.pop() {
            self.future.push(std::mem::replace(wishes, before));
        }
    }

    /// Makes the change again that was taken back last.
    pub(super) fn redo(&mut self, wishes: &mut Wishes) {
        if let Some(after) = self.future.pop() {
            self.past.push(std::mem::replace(wishes, after));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_of_another_size_tells_the_same_places() {
        let map = WeightMap { size: [4, 2], luma: vec![0, 0, 9, 9, 5, 5, 7, 7] };
        assert_eq!(map.resized([2, 1]).luma, [0, 9]);
        assert_eq!(map.resized([2, 2]).luma, [0, 9, 5, 7]);
        assert_eq!(map.resized([2, 2]).resized([4, 2]), map);
    }

    #[test]
    fn changes_are_taken_back_and_made_again_in_order() {
        let (mut wishes, mut history) = (Wishes::default(), History::default());
        for tiles in [100, 200, 300] {
            history.note(wishes.clone());
            wishes.tiles = Some(tiles);
        }
        history.undo(&mut wishes);
        history.undo(&mut wishes);
        assert_eq!(wishes.tiles, Some(100));
        history.redo(&mut wishes);
        assert_eq!((wishes.tiles, history.can_redo()), (Some(200), true));
        history.note(wishes.clone());
        wishes.seed = 7;
        assert!(!history.can_redo());
        history.undo(&mut wishes);
        assert_eq!((wishes.tiles, wishes.seed), (Some(200), 0));
    }
}
