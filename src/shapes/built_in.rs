//! The templates that come with smalti: their names, descriptions and drawings.

use std::fmt;
use std::str::FromStr;

use super::ink::Ink;
use super::{brush, outlines};
use crate::error::{Error, Result};

/// A template that comes with smalti (paper, Fig. 7, and more).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BuiltIn {
    /// The full square.
    #[default]
    Square,
    /// A square with a dark edge (Figs 8e and 8f).
    Border,
    /// Parallel stripes with gaps (Fig. 7).
    Lines,
    /// Six petals around a disc (Fig. 7).
    Flower,
    /// A round, slightly domed stone.
    Disc,
    /// A cut triangle.
    Triangle,
    /// A hexagon with the faces of a cube.
    Hexagon,
    /// A brush stroke with bristles.
    Brush,
}

impl BuiltIn {
    /// All of them, in the order in which they are listed.
    pub const ALL: [Self; 8] =
        [Self::Square, Self::Border, Self::Lines, Self::Flower, Self::Disc, Self::Triangle, Self::Hexagon, Self::Brush];

    /// The name that users type.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Square => "square",
            Self::Border => "border",
            Self::Lines => "lines",
            Self::Flower => "flower",
            Self::Disc => "disc",
            Self::Triangle => "triangle",
            Self::Hexagon => "hexagon",
            Self::Brush => "brush",
        }
    }

    /// What it looks like, in one line without a full stop.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::Square => "the plain rectangle, full and even",
            Self::Border => "a rectangle with a dark edge all around, like a tile set in grout",
            Self::Lines => "four parallel cords with gaps between them, along the tile's width",
            Self::Flower => "six folded petals around a darker disc",
            Self::Disc => "a circle, slightly domed",
            Self::Triangle => "a triangle cut into three facets",
            Self::Hexagon => "a hexagon shaded as the three faces of a cube",
            Self::Brush => "a bristled stroke of paint that runs dry, with ragged ends and see-through streaks",
        }
    }

    /// The ink of its texels, row by row.
    pub(super) fn drawing(self) -> Vec<Ink> {
        match self {
            Self::Square => outlines::square(),
            Self::Border => outlines::border(),
            Self::Lines => outlines::lines(),
            Self::Flower => outlines::flower(),
            Self::Disc => outlines::disc(),
            Self::Triangle => outlines::triangle(),
            Self::Hexagon => outlines::hexagon(),
            Self::Brush => brush::stroke(),
        }
    }
}

impl fmt::Display for BuiltIn {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for BuiltIn {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|shape| shape.name().eq_ignore_ascii_case(name)).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            Error::UnknownName { what: "built-in mask", name: name.to_owned(), known }
        })
    }
}
