//! What was typed: commands and flags with their help. What they mean is decided in `options`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::error::ErrorKind;
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};

use super::bench::BenchArgs;
use super::cells::CellsArgs;
use super::computing::ComputingArgs;
use super::gallery::GalleryArgs;
use super::look::LookArgs;
use super::paper::PaperArgs;
use super::presets::{self, PresetChoice};
use super::render::RenderArgs;
use super::scheme::{ColorModeName, PaperSchemeArgs};
use super::score::ScoreArgs;
use super::timelapse::TimelapseArgs;
use super::values::ColorCount;
use super::{report, values};
use crate::model::Rgb;

/// Evolves pictures into mosaics of thousands of tiles.
#[derive(Debug, Parser)]
#[command(
    name = "smalti",
    version,
    about = "Evolves pictures into mosaics of thousands of tiles.",
    after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage or unreadable input, 3 some items failed,\n\
                  4 no suitable device, 75 interrupted or device lost (run the same command again), 130 second Ctrl-C."
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(super) command: Command,
}

impl Cli {
    /// The command line of this process; if it is wrong, or only asks for help, the exit code after having said so.
    ///
    /// # Errors
    /// The exit code to end with: 0 after help or version, 2 after a wrong command line.
    pub fn from_command_line() -> Result<Self, ExitCode> {
        Self::try_parse().map_err(|error| {
            if error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
                report::error(&one_sentence(&error.to_string(), &command_typed()));
            } else {
                // Only a closed pipe can fail here: nobody wants the rest of the help.
                let _ = error.print();
            }
            ExitCode::from(if error.use_stderr() { 2 } else { 0 })
        })
    }
}

/// The first paragraphs of a message of clap in one line, without the usage that follows them.
fn one_sentence(message: &str, command: &str) -> String {
    let told = message.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:"));
    let told: Vec<String> = told
        .filter(|line| !line.is_empty() && !line.starts_with("For more information"))
        // Nothing here takes a value that begins with a minus.
        .filter(|line| !line.starts_with("tip: to pass '-"))
        .map(|line| line.strip_prefix("tip: ").map_or_else(|| line.to_owned(), |tip| format!("({tip})")))
        .collect();
    let told = told.join(" ");
    format!("{}; see {command} --help", told.strip_prefix("error: ").unwrap_or(&told))
}

/// The command that was typed, with its subcommand if that is one.
fn command_typed() -> String {
    let first = std::env::args().nth(1).unwrap_or_default();
    let is_known = Cli::command().get_subcommands().any(|command| command.get_name() == first);
    if is_known { format!("smalti {first}") } else { "smalti".to_owned() }
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Evolve one picture into a mosaic
    ///
    /// Thousands of coloured tiles are bred, child by child, until together they look like the picture. The same picture, options and seed give the same bytes on every device.
    Evolve(Box<EvolveArgs>),
    /// Draw a population again, at any size, or write it in another format
    ///
    /// At the size at which it evolved the picture is the one that `evolve` wrote.
    Render(Box<RenderArgs>),
    /// Make the figures and tables of the paper from your own pictures
    ///
    /// Each is a page with its pictures, plots and tables, to be opened from disk.
    Paper(PaperArgs),
    /// Show every mask and every shader on the same pictures
    Gallery(GalleryArgs),
    /// Turn the snapshots of an evolution into an animation
    ///
    /// Draws what `smalti evolve --save-run DIR` kept, in order and at any size.
    Timelapse(Box<TimelapseArgs>),
    /// List the Vulkan devices of this machine, and which one would be taken
    Devices(DevicesArgs),
    /// Measure how much pictures are like a reference
    ///
    /// All figures are of 8-bit sRGB, after EXIF orientation and ICC profile have been applied, and can be recomputed with
    /// numpy, scipy and scikit-image. Of an animation the first frame is measured.
    Score(ScoreArgs),
    /// Measure how fast this machine evolves pictures
    Bench(BenchArgs),
}

const EVOLVE_EXAMPLES: &str = "\
Examples:
  smalti evolve photo.jpg -o mosaic.png
  smalti evolve photo.jpg -o mosaic.png -o flies.npz -n 10k --evals 20M
  smalti evolve photo.jpg -o mosaic.png --style mosaic --grout auto -n 4000
  smalti evolve photo.jpg -o paper.png --scheme paper --births 200k --restarts 3 --cool 0.5
  smalti evolve photo.jpg -o poster.png --output-size 4096 --time 2m
  smalti evolve photo.jpg -o better.png --init flies.npz --seed 1
  smalti evolve photo.jpg -o - --quiet > mosaic.png";

#[derive(Clone, Debug, Args)]
#[command(after_help = EVOLVE_EXAMPLES)]
pub(super) struct EvolveArgs {
    /// Picture to evolve: PNG, JPEG, WebP, TIFF, BMP, or the first frame of a GIF
    #[arg(value_name = "IN")]
    pub input: PathBuf,

    /// Where to write the mosaic (.png .jpg .webp .svg .ora) or the population (.npz .csv .json); may repeat; `-` writes a
    /// PNG to stdout
    #[arg(short, long = "output", value_name = "OUT", required = true, help_heading = "Output")]
    pub outputs: Vec<PathBuf>,
    /// Longer side of the written picture, 1 to 65,535 px; the mosaic is drawn anew at that size [default: as evolved]
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Output")]
    pub output_size: Option<u64>,
    /// Also write the picture that was evolved towards, fitted to size, as a PNG
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub save_target: Option<PathBuf>,
    /// Also write how the error fell as a table (.csv) or a plot (.svg); may repeat
    #[arg(long = "curve", value_name = "FILE", help_heading = "Output")]
    pub curves: Vec<PathBuf>,
    /// Also keep the course of the evolution: snapshots of its best population, for `smalti timelapse`
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    pub save_run: Option<PathBuf>,
    /// Most evals or births between two snapshots, at least 1 (suffixes k, M); the first ones come closer [default: a 100th
    /// of all]
    #[arg(long, value_name = "B", value_parser = values::count, requires = "save_run", help_heading = "Output")]
    pub save_every: Option<u64>,
    /// Replace outputs that are not smalti's or were made with other options, and .csv files that hold another table
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Only say what would be done; write nothing
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,
    /// Print one line of JSON about the result to stdout
    #[arg(long, help_heading = "Output")]
    pub json: bool,

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

    #[command(flatten)]
    pub computing: ComputingArgs,
    /// Watch every Vulkan call with the validation layer; any message is an error
    #[arg(long, help_heading = "Computing")]
    pub validate: bool,

    /// How to show progress on stderr; a bar needs a terminal, elsewhere it becomes plain lines
    #[arg(long, value_enum, value_name = "KIND", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressKind,
    /// Say more
    #[arg(short, long, help_heading = "Messages", conflicts_with = "quiet")]
    pub verbose: bool,
    /// Say nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

#[derive(Debug, Args)]
pub(super) struct DevicesArgs {
    /// Print JSON to stdout instead of a table
    #[arg(long)]
    pub json: bool,
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ProgressKind {
    /// A bar on a terminal, else plain lines
    Auto,
    Bar,
    /// A line every few seconds
    Plain,
    /// A line of JSON every second
    Json,
    None,
}

impl ProgressKind {
    /// The kind to show: none for those who want to hear nothing, unless they asked for one.
    pub(super) fn unless(self, is_quiet: bool) -> Self {
        if is_quiet && self == Self::Auto { Self::None } else { self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_of_the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_message_of_clap_becomes_one_sentence() {
        let message = "error: unexpected argument '--sed' found\n\n  tip: a similar argument exists: '--seed'\n\n\
                       Usage: smalti evolve <IN>\n\nFor more information, try '--help'.\n";
        let sentence =
            "unexpected argument '--sed' found (a similar argument exists: '--seed'); see smalti evolve --help";
        assert_eq!(one_sentence(message, "smalti evolve"), sentence);
    }
}
