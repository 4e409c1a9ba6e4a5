//! The flags that only the paper's scheme has, and where colours come from, which both schemes can be told.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::cli::values;
use crate::evolve::{ColorMode, OnDry};

/// The flags that only the paper's scheme has.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Evolution with --scheme paper")]
pub(crate) struct PaperSchemeArgs {
    /// Births of each run (suffixes k, M) [default: 40k]
    #[arg(long, value_name = "B", value_parser = values::count)]
    pub births: Option<u64>,
    /// Births evaluated together, 1 to N; more is faster on a GPU, 1 is the published algorithm [default: 1]
    #[arg(long, value_name = "K", value_parser = values::count)]
    pub batch_births: Option<u64>,
    /// Further runs, each from the best population so far, 0 to 1,000,000 [default: 0, or as in --preset]
    #[arg(long, value_name = "R", value_parser = values::count)]
    pub restarts: Option<u64>,
    /// Masks that all tiles change to at the first restart [default: none, or as in --preset]
    #[arg(long = "restart-mask", value_name = "NAME|FILE", value_delimiter = ',')]
    pub restart_masks: Vec<PathBuf>,
    /// Factor of all mutation steps at each restart, 0.00001 to 1 [default: 1]
    #[arg(long, value_name = "F", value_parser = values::number)]
    pub cool: Option<f64>,
    /// What to do when no bad tile is found: take the worse of two, begin the next run, or stop [default: fallback]
    #[arg(long, value_enum, value_name = "ACTION")]
    pub on_dry: Option<OnDryName>,
    /// Probability that a child mutates, 0 to 1; otherwise it is a plain copy [default: 1]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub p_mutation: Option<f64>,
    /// Probability that a child is crossed from two good flies, 0 to 1, before it may mutate [default: 0]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub p_crossover: Option<f64>,
    /// Probability that a fresh random fly is born instead of a child, 0 to 1 [default: 0]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub new_blood: Option<f64>,
    /// Begin with N / 2^M tiles, each of which splits in two at each of the first M restarts, 0 to 20 [default: 0]
    #[arg(long, value_name = "M", value_parser = values::count, conflicts_with = "init")]
    pub mitosis: Option<u64>,
    /// Turn no tile: all angles are 0
    #[arg(long)]
    pub no_rotation: bool,
    /// First sides over those of the paper's Eq. 1, 0.1 to 100 [default: 1]
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
    /// Its genes: inherited and mutated
    Evolved,
    /// The target's pixel nearest to its centre
    Pick,
    /// The mean of the target where the tile shows
    Mean,
    /// The median of the target where the tile shows
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
