//! The flags that only the paper's scheme has, and where colours come from, which both schemes can be told.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::cli::values;
use crate::evolve::{ColorMode, OnDry};

/// The group of these flags in help.
pub(crate) const HEADING: &str = "Only with --scheme paper";

/// The flags that only the paper's scheme has.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = HEADING)]
pub(crate) struct PaperSchemeArgs {
    /// Births in each run (40k, 2M) [default: 40k]
    ///
    /// At each birth, a changed copy of one tile replaces another tile.
    #[arg(long, value_name = "B", value_parser = values::count)]
    pub births: Option<u64>,
    /// Births evaluated together, from 1 to the number of tiles; more is faster on a GPU, and 1 is the published
    /// algorithm [default: 1]
    #[arg(long, value_name = "K", value_parser = values::count)]
    pub batch_births: Option<u64>,
    /// Further runs, each from the best population so far, 0 to 1,000,000 [default: 0, or what --preset has]
    #[arg(long, value_name = "R", value_parser = values::count)]
    pub restarts: Option<u64>,
    /// Shapes that all tiles change to at the first restart [default: none, or what --preset has]
    #[arg(long = "restart-mask", value_name = "NAME|FILE", value_delimiter = ',', value_parser = values::path_in_list())]
    pub restart_masks: Vec<PathBuf>,
    /// Multiply all mutation steps by this at each restart, 0.00001 to 1 [default: 1]
    #[arg(long, value_name = "F", value_parser = values::number)]
    pub cool: Option<f64>,
    /// What to do when no useless tile is found: replace the worse of two, begin the next run, or stop [default:
    /// fallback]
    #[arg(long, value_enum, value_name = "ACTION")]
    pub on_dry: Option<OnDryName>,
    /// Probability that a child mutates, 0 to 1; otherwise it is a plain copy [default: 1]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub p_mutation: Option<f64>,
    /// Probability that a child is crossed from two good flies before it may mutate, 0 to 1 [default: 0]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub p_crossover: Option<f64>,
    /// Probability that a random fly is born instead of a child, 0 to 1 [default: 0]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub new_blood: Option<f64>,
    /// Begin with fewer tiles, and split each in two at each of the first M restarts, 0 to 20 [default: 0]
    ///
    /// The search begins with N / 2^M tiles and ends with N.
    #[arg(long, value_name = "M", value_parser = values::count, conflicts_with = "init")]
    pub mitosis: Option<u64>,
    /// Do not turn the tiles
    #[arg(long)]
    pub no_rotation: bool,
    /// Multiply the sides of the first tiles by this, 0.1 to 100 [default: 1]
    ///
    /// 1 is the size in Eq. 1 of the paper.
    #[arg(long, value_name = "S", value_parser = values::number)]
    pub tile_scale: Option<f64>,
}

/// What to do when no bad tile is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OnDryName {
    Fallback,
    Restart,
    Stop,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColorModeName {
    /// From its parent, mutated
    Evolved,
    /// The pixel of the picture at its centre
    Pick,
    /// The mean of the picture where the tile shows
    Mean,
    /// The median of the picture where the tile shows
    Median,
}

impl From<ColorModeName> for ColorMode {
    fn from(name: ColorModeName) -> Self {
        match name {
            ColorModeName::Evolved => Self::Evolved,
            ColorModeName::Pick => Self::Pick,
            ColorModeName::Mean => Self::Mean,
            ColorModeName::Median => Self::Median,
        }
    }
}

impl From<OnDryName> for OnDry {
    fn from(name: OnDryName) -> Self {
        match name {
            OnDryName::Fallback => Self::Fallback,
            OnDryName::Restart => Self::Restart,
            OnDryName::Stop => Self::Stop,
        }
    }
}
