//! What a recipe is made of, but for its numbers.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use super::look::Mask;
use super::presets::PaperPreset;
use crate::evolve::style::Style;
use crate::evolve::{ColorMode, OnDry};
use crate::model::{Backdrop, Blend, Population, Rgb};
use crate::shapes::Shader;

/// How to evolve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scheme {
    /// The search in cells, which comes closest by far.
    #[default]
    Cells,
    /// The published Fly algorithm.
    Paper,
}

impl Scheme {
    /// The word for it in files and results.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Cells => "cells",
            Self::Paper => "paper",
        }
    }
}

impl fmt::Display for Scheme {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.word())
    }
}

/// The colour of the grout, the ring of every tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroutColor {
    /// No grout.
    None,
    /// A quarter darker than the mean of the picture.
    Auto,
    /// This one.
    This(Rgb),
}

/// Which colours the target keeps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Colors {
    Full,
    /// At most so many of its own.
    Few(usize),
    /// Those of a palette, and the tiles too.
    Palette(PaletteSource),
}

/// Where a palette is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PaletteSource {
    File(PathBuf),
    Colors(Vec<Rgb>),
}

/// Where a population to begin with is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum InitSource {
    File(PathBuf),
    Population(Arc<Population>),
}

/// Where a map of weights is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum WeightSource {
    File(PathBuf),
    /// The bytes of a picture file.
    Encoded(Vec<u8>),
    /// The luma of every pixel of the fitted picture.
    Luma(Vec<u8>),
}

/// What was set; `None` is the default.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Choices {
    pub scheme: Option<Scheme>,
    pub paper_preset: Option<PaperPreset>,
    pub style: Option<Style>,
    pub colors: Option<Colors>,
    pub color_mode: Option<ColorMode>,
    pub background: Option<Backdrop>,
    pub weight: Option<WeightSource>,
    pub init: Option<InitSource>,
    pub masks: Vec<Mask>,
    pub restart_masks: Vec<Mask>,
    pub shader: Option<Shader>,
    pub blend: Option<Blend>,
    pub grout: Option<GroutColor>,
    pub on_dry: Option<OnDry>,
    pub no_rotation: bool,
    /// Whether pictures that are cut short are taken as far as they go.
    pub lenient: bool,
}
