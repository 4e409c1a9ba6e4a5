//! The flags that only the `cells` scheme has.

use clap::Args;

use super::preset;
use crate::cli::values;
use crate::studio::{GroutColor, grout_color};

/// The flags that only the `cells` scheme has.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Search")]
pub(crate) struct CellsArgs {
    /// free, mosaic, paint or spray [default: free]
    ///
    /// free comes closest to the picture. mosaic lays whole tiles in rows along the contours, with grout between them.
    /// paint makes brush strokes, spray makes soft clouds of colour.
    #[arg(long, value_name = "NAME", value_parser = preset::parse_style, conflicts_with = "preset")]
    pub style: Option<String>,
    /// How many new or changed tiles to try before the search ends (500k, 2M) [default: 400 for each tile]
    ///
    /// Each is kept only if the mosaic comes closer to the picture.
    #[arg(long, value_name = "E", value_parser = values::count)]
    pub evals: Option<u64>,
    /// Children tried in each step, of which the best is taken, 1 to 64; more is faster on a GPU [default: 1]
    #[arg(long, value_name = "K", value_parser = values::count)]
    pub candidates: Option<u64>,
    /// Colour between the tiles: auto, none, or a colour such as white or #444
    ///
    /// auto is a quarter darker than the mean colour of the picture. Without this flag, styles with grout use auto,
    /// and the others have none.
    #[arg(long, value_name = "COLOR", value_parser = grout_color)]
    pub grout: Option<GroutColor>,
    /// Width of the grout in px of the evolved picture, 0.02 to 64 [default: by the style, or a 16th of a tile's side]
    #[arg(long, value_name = "PX", value_parser = values::number)]
    pub grout_width: Option<f64>,
}
