//! The flags that decide a picture: how it is read, looked at and evolved. All commands that evolve pictures of the user's
//! share them.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};

use super::cells::CellsArgs;
use super::look::LookArgs;
use super::presets::{self, PresetChoice};
use super::scheme::{ColorModeName, PaperSchemeArgs};
use super::values::{self, ColorCount};
use crate::model::Rgb;

/// The flags.
#[derive(Clone, Debug, Args)]
pub(super) struct PictureArgs {
    /// Longer side of the written picture, 1 to 65,535 px; the mosaic is drawn anew at that size [default: as evolved]
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Output")]
    pub output_size: Option<u64>,
    /// Number of tiles, 1 to 1,000,000 (suffixes k, M) [default: 2500 * sqrt(width * height) / 256, rounded]
    #[arg(short = 'n', long, value_name = "N", value_parser = values::count, help_heading = "Picture")]
    pub tiles: Option<u64>,
    /// Longer side that the picture is reduced to before it is evolved, 1 to 65,535 px; never enlarged [default: 512]
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Picture")]
    pub size: Option<u64>,
    /// Colours that the picture is reduced to before it is evolved: full, or 1 to 256 [default: full]
    #[arg(long, value_name = "K", value_parser = values::color_count, help_heading = "Picture", conflicts_with = "palette")]
    pub colors: Option<ColorCount>,
    /// Palette that picture and tiles are held to: .gpl, .pal, .hex (lines of RRGGBB), or the colours of a picture
    #[arg(long, value_name = "FILE", help_heading = "Picture")]
    pub palette: Option<PathBuf>,
    /// Colour behind the tiles and behind transparent pixels: black, white or RRGGBB [default: as in --init or the style, or
    /// black; what is transparent stays so, but not with --scheme paper]
    #[arg(long, value_name = "COLOR", value_parser = values::color, help_heading = "Picture")]
    pub background: Option<Rgb>,
    /// Map that tells where likeness matters, a picture with the proportions of IN: an error counts 16 times as much where
    /// the map is white as where it is black [default: alike everywhere]
    #[arg(long, value_name = "MAP", help_heading = "Picture")]
    pub weight: Option<PathBuf>,
    /// Population to begin with, a .npz file of the same picture size; it also gives the number of tiles
    #[arg(long, value_name = "POP.npz", help_heading = "Picture", conflicts_with = "tiles")]
    pub init: Option<PathBuf>,

    #[command(flatten)]
    pub look: LookArgs,

    /// How to evolve: `cells` comes closest by far, `paper` is the published Fly algorithm [default: cells, or as --preset
    /// needs]
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Evolution")]
    pub scheme: Option<SchemeName>,
    /// What other options begin from and change parts of: one of the paper's 12 schemes (Table 1), paper-1 to paper-12; a
    /// style; or a file of your own that ends in .toml
    #[arg(long, value_name = "NAME|FILE", value_parser = presets::parse, help_heading = "Evolution")]
    pub preset: Option<PresetChoice>,
    /// Where the colour of a new tile comes from [default: median, or evolved with --scheme paper]
    #[arg(long, value_enum, value_name = "MODE", help_heading = "Evolution")]
    pub color_mode: Option<ColorModeName>,
    /// Stop once the sum of absolute errors is at most this (suffixes k, M) [default: never]
    #[arg(long, value_name = "S", value_parser = values::count, help_heading = "Evolution")]
    pub target_sae: Option<u64>,
    /// Stop after this many evals in which the error fell by less than a thousandth, at least 1 (suffixes k, M); with
    /// --scheme paper, end a run after this many births without improvement [default: never]
    #[arg(long, value_name = "E", value_parser = values::count, help_heading = "Evolution")]
    pub patience: Option<u64>,
    /// Stop after this time even if evals are left: 90, 30s, 2m, 1h30m [default: never]
    #[arg(long, value_name = "TIME", value_parser = values::duration, help_heading = "Evolution")]
    pub time: Option<Duration>,
    /// Number that decides every random choice
    #[arg(long, value_name = "S", value_parser = values::seed, default_value_t = 0, help_heading = "Evolution")]
    pub seed: u64,
    #[command(flatten)]
    pub cells: CellsArgs,
    #[command(flatten)]
    pub paper: PaperSchemeArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum SchemeName {
    Cells,
    Paper,
}

impl SchemeName {
    /// The word for flags, results and metadata.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Cells => "cells",
            Self::Paper => "paper",
        }
    }
}
