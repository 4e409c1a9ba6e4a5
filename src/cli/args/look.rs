//! The flags about how tiles look, which several commands share.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::cli::values;
use crate::model::Blend;
use crate::shapes::Shader;
use crate::studio::{LookChoices, Mask};

/// The flags.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Tiles")]
pub(crate) struct LookArgs {
    /// Shape of the tiles: square, border, lines, flower, disc, triangle, hexagon, brush, or a PNG or SVG file; several
    /// with commas or repeated, for a mix, in which --scheme cells counts each once [default: square, or as the style
    /// or the population has it]
    #[arg(long = "mask", value_name = "NAME|FILE", value_delimiter = ',')]
    pub masks: Vec<PathBuf>,
    /// What the drawing of a mask becomes: template (its own shading), flat, outline, emboss, soft, hollow, negative,
    /// fade or wash; for the masks that are named [default: template, or as the style has it]
    #[arg(long, value_name = "NAME")]
    pub shader: Option<Shader>,
    /// Whether a mask's coverage cuts the tile out or is its opacity [default: translucent with --opacity or the
    /// shaders soft, fade and wash, or as the style has it, else opaque]
    #[arg(long, value_enum, value_name = "KIND")]
    pub blend: Option<BlendName>,
    /// Opacity of whole tiles, 0.01 to 1 [default: 1, or as the style has it]
    #[arg(long, value_name = "A", value_parser = values::number)]
    pub opacity: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BlendName {
    Opaque,
    Translucent,
}

impl From<BlendName> for Blend {
    fn from(name: BlendName) -> Self {
        match name {
            BlendName::Opaque => Self::Opaque,
            BlendName::Translucent => Self::Translucent,
        }
    }
}

/// The masks of these names, or in these files.
pub(crate) fn masks(names: &[PathBuf]) -> Vec<Mask> {
    names.iter().map(Mask::named_or_file).collect()
}

impl LookArgs {
    /// What the flags ask for, without the defaults of a style.
    pub(crate) fn choices(&self) -> LookChoices {
        let (shader, blend, opacity) = (self.shader, self.blend.map(Blend::from), self.opacity);
        LookChoices { masks: masks(&self.masks), shader, blend, opacity }
    }
}
