//! A template: the raw drawing of a tile shape, before a shader turns it into a mask.

use std::fmt;
use std::path::PathBuf;

use super::built_in::BuiltIn;
use super::ink::Ink;
use crate::model::mask::MASK_SIDE;

/// Where a template comes from, for messages and metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// It comes with smalti.
    BuiltIn(BuiltIn),
    /// It was read from this file.
    File(PathBuf),
    /// It never was a file.
    Memory,
}

impl fmt::Display for Source {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BuiltIn(shape) => formatter.write_str(shape.name()),
            Self::File(path) => path.display().fmt(formatter),
            Self::Memory => formatter.write_str("a mask in memory"),
        }
    }
}

/// A drawing of [`MASK_SIDE`] x [`MASK_SIDE`] texels (paper, Fig. 7); row 0 is the tile's top, column 0 its left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Template {
    source: Source,
    ink: Vec<Ink>,
}

impl Template {
    /// The template of `ink`: [`MASK_SIDE`]² texels, row by row.
    pub(super) fn new(source: Source, ink: Vec<Ink>) -> Self {
        assert_eq!(ink.len(), MASK_SIDE * MASK_SIDE, "a template has one ink per texel");
        Self { source, ink }
    }

    /// Where the template comes from.
    #[must_use]
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The texels, row by row.
    #[must_use]
    pub fn ink(&self) -> &[Ink] {
        &self.ink
    }
}

impl BuiltIn {
    /// The template; it always has the same texels.
    #[must_use]
    pub fn template(self) -> Template {
        Template::new(Source::BuiltIn(self), self.drawing())
    }
}
