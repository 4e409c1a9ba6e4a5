//! A template: the raw drawing of a tile shape, before a shader makes a mask of it.

use std::fmt;
use std::path::{Path, PathBuf};

use super::built_in::BuiltIn;
use super::read::read;
use crate::error::{Error, Result};
use crate::model::mask::MASK_SIDE;

/// One texel of a drawing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Ink {
    /// How much of the texel is drawn on: 0 is a hole, 255 is full.
    pub alpha: u8,
    /// How bright the drawing is there, of 255; means nothing where alpha is 0.
    pub intensity: u8,
}

/// Where a template comes from, for messages and metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// It comes with smalti.
    BuiltIn(BuiltIn),
    /// It was read from this file.
    File(PathBuf),
}

impl fmt::Display for Source {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BuiltIn(shape) => formatter.write_str(shape.name()),
            Self::File(path) => path.display().fmt(formatter),
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
    /// The template of `ink`, which has [`MASK_SIDE`]² texels, row by row.
    pub(super) fn new(source: Source, ink: Vec<Ink>) -> Self {
        assert_eq!(ink.len(), MASK_SIDE * MASK_SIDE, "a template has one ink per texel");
        Self { source, ink }
    }

    /// The template that `name_or_path` means: a built-in one if it is the name of one, else the file at that path. A file
    /// of a built-in's name is reached as `./NAME`.
    ///
    /// # Errors
    /// [`Error::Input`] as [`read`]; for a file that is not there the message lists the built-in names.
    pub fn find(name_or_path: &Path) -> Result<Self> {
        let shape = BuiltIn::ALL.into_iter().find(|shape| Path::new(shape.name()) == name_or_path);
        if let Some(shape) = shape {
            return Ok(shape.template());
        }
        if !name_or_path.exists() {
            let names = BuiltIn::ALL.map(BuiltIn::name).join(", ");
            return Err(Error::input(
                name_or_path,
                format!("there is no such mask; name one of {names}, or a picture or SVG file"),
            ));
        }
        read(name_or_path)
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
