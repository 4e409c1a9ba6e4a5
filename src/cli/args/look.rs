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
    /// Shape of the tiles: square, border, lines, flower, disc, triangle, hexagon, brush, or your own PNG or SVG
    ///
    /// Several shapes with commas make a mix. Unless this flag is given, the style or --init decides; else it
    /// is square.
    #[arg(long = "mask", value_name = "NAME|FILE", value_delimiter = ',', value_parser = values::path_in_list())]
    pub masks: Vec<PathBuf>,
    /// How a shape is filled: template (as drawn), flat, outline, emboss, soft, hollow, negative, fade or wash
    ///
    /// It needs shapes that are named. Unless this flag is given, the style decides; else it is template.
    #[arg(long, value_name = "NAME")]
    pub shader: Option<Shader>,
    /// Whether tiles hide what is behind them or let it show through [default: by the style; translucent with
    /// --opacity or the shaders soft, fade and wash]
    #[arg(long, value_enum, value_name = "KIND")]
    pub blend: Option<BlendName>,
    /// Opacity of the tiles, 0.01 (almost invisible) to 1 [default: by the style, else 1]
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
