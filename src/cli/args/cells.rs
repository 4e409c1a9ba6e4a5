//! The flags that only the `cells` scheme has.

use clap::Args;

use super::preset;
use crate::cli::values;
use crate::studio::{GroutColor, grout_color};

/// The flags that only the `cells` scheme has.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Evolution with --scheme cells")]
pub(crate) struct CellsArgs {
    /// How tiles lie: free (closest likeness), mosaic (whole tiles in rows along the contours), paint (brush strokes)
    /// or spray (soft translucent discs) [default: free]
    #[arg(long, value_name = "NAME", value_parser = preset::parse_style, conflicts_with = "preset")]
    pub style: Option<String>,
    /// Stop after so many children were evaluated (suffixes k, M) [default: 400 for each tile]
    #[arg(long, value_name = "E", value_parser = values::count)]
    pub evals: Option<u64>,
    /// Children tried in each step, 1 to 64, of which the best one counts; more is faster on a GPU [default: 1]
    #[arg(long, value_name = "K", value_parser = values::count)]
    pub candidates: Option<u64>,
    /// Colour of the grout, the ring of each tile: none, auto (keeps the picture's brightness), black, white or RRGGBB
    /// [default: auto if the style has grout, else none]
    #[arg(long, value_name = "COLOR", value_parser = grout_color)]
    pub grout: Option<GroutColor>,
    /// Width of the grout in px of the evolved picture, 0.02 to 64 [default: as in the style, or a 16th of a tile's
    /// side]
    #[arg(long, value_name = "PX", value_parser = values::number)]
    pub grout_width: Option<f64>,
}
