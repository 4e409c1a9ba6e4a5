//! The whole command line: all commands, with their help. What flags mean is decided where they are defined.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::cli::args::typed::{Typed, one_sentence};
use crate::cli::commands::bench::BenchArgs;
use crate::cli::commands::check::CheckArgs;
use crate::cli::commands::devices::DevicesArgs;
use crate::cli::commands::evolve::EvolveArgs;
use crate::cli::commands::gallery::GalleryArgs;
use crate::cli::commands::manual::{CompletionsArgs, ManArgs};
use crate::cli::commands::merge::MergeArgs;
use crate::cli::commands::paper::PaperArgs;
use crate::cli::commands::plan::PlanArgs;
use crate::cli::commands::plugins::PluginsArgs;
use crate::cli::commands::render::RenderArgs;
use crate::cli::commands::score::ScoreArgs;
use crate::cli::commands::show::ShowArgs;
use crate::cli::commands::timelapse::TimelapseArgs;
use crate::cli::commands::video::VideoArgs;
#[cfg(feature = "view")]
use crate::cli::commands::view::ViewArgs;
use crate::cli::list::{self, BatchArgs};
use crate::cli::terminal::{self, advice, interrupt};
use crate::cli::{commands, config, help, hints};
use crate::error::Result;

const AFTER_HELP: &str = "\
Begin with: smalti evolve photo.jpg -o mosaic.png --style mosaic

smalti evolve -h shows the most used flags of a command, and smalti evolve --help explains all of them.";

const AFTER_LONG_HELP: &str = "\
Begin with: smalti evolve photo.jpg -o mosaic.png --style mosaic

Exit codes: 0 done; 1 failed; 2 wrong usage or unreadable input; 3 some items failed; 4 no suitable device or display; 75 interrupted, or \
the device was lost (run the same command again); 130 second Ctrl-C.";

/// Evolves pictures into mosaics of thousands of tiles.
#[derive(Debug, Parser)]
#[command(
    name = "smalti",
    version,
    about = "Evolves pictures into mosaics of thousands of tiles.",
    after_help = AFTER_HELP,
    after_long_help = AFTER_LONG_HELP
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    command: Command,
    /// File with flags, in TOML; flags on the command line override it
    #[arg(long, global = true, value_name = "FILE", env = "SMALTI_CONFIG", hide_env_values = true)]
    config: Option<PathBuf>,
    /// What was typed, and what the file of `--config` added to it.
    #[arg(skip)]
    typed: Typed,
}

impl Cli {
    /// The command line of this process; if it is wrong, or only asks for help, the exit code after having said so.
    ///
    /// # Errors
    /// The exit code to end with: 0 after help or version, 2 after a wrong command line.
    pub fn from_command_line() -> Result<Self, ExitCode> {
        let (built, typed) = known(std::env::args_os().collect());
        let tokens = config::expand(typed, &built).map_err(|error| {
            terminal::error(&advice::sentence(&error));
            ExitCode::from(advice::exit_code(&error))
        })?;
        Self::parsed(&tokens).map_err(|error| {
            if error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
                let hint = hints::of(&error, &tokens, &built);
                terminal::error(&hint.unwrap_or_else(|| one_sentence(&error.to_string(), &command_typed(&tokens))));
            } else {
                // Only a closed pipe can fail here: nobody wants the rest of the help.
                let _ = error.print();
            }
            ExitCode::from(if error.use_stderr() { 2 } else { 0 })
        })
    }

    /// The command line of these tokens, of which the first names the program; nothing is printed.
    fn parsed(tokens: &[OsString]) -> Result<Self, clap::Error> {
        let matches = definition().try_get_matches_from(tokens)?;
        let cli = Self::from_arg_matches(&matches)?;
        Ok(Self { typed: Typed { tokens: tokens.to_vec(), matches, definition: definition() }, ..cli })
    }

    /// Checks the command line of these tokens as far as is possible before the first picture is read, and does
    /// nothing: for the fuzz targets of files of flags and manifests. How many pictures it names, if it is a batch.
    ///
    /// # Errors
    /// The sentence that the user would see.
    #[doc(hidden)]
    pub fn checked(typed: Vec<OsString>) -> Result<usize, String> {
        let (built, typed) = known(typed);
        let tokens = config::expand(typed, &built).map_err(|error| advice::sentence(&error))?;
        let cli = Self::parsed(&tokens).map_err(|error| one_sentence(&error.to_string(), "smalti"))?;
        match &cli.command {
            Command::Batch(args) => list::find(args, &cli.typed).map(|items| items.len()),
            _ => Ok(0),
        }
        .map_err(|error| advice::sentence(&error))
    }
}

/// The command line with everything that it may say, and what was typed with the command that it lacks.
fn known(typed: Vec<OsString>) -> (clap::Command, Vec<OsString>) {
    let mut built = definition();
    built.build();
    advice::know_flags(&built);
    let typed = hints::with_command(typed, &built);
    (built, typed)
}

/// All commands and flags, with their help arranged.
fn definition() -> clap::Command {
    help::arranged(Cli::command())
}

/// Does what the command line asks for; the exit code of the process.
#[must_use]
pub fn run(cli: &Cli) -> ExitCode {
    if let failure @ Err(_) = interrupt::prepare() {
        return terminal::exit_code(failure);
    }
    match &cli.command {
        Command::Evolve(args) => commands::evolve::evolve(args),
        #[cfg(feature = "view")]
        Command::View(args) => commands::view::view(args, commands::render::redraw),
        Command::Batch(args) => commands::batch::make(args, &cli.typed),
        Command::Render(args) => commands::render::render(args),
        Command::Timelapse(args) => commands::timelapse::make(args),
        Command::Devices(args) => commands::devices::list(args),
        Command::Paper(args) => commands::paper::make(args),
        Command::Gallery(args) => commands::gallery::make(args),
        Command::Score(args) => commands::score::score(args),
        Command::Show(args) => commands::show::show(args),
        Command::Plan(args) => commands::plan::plan(args, &cli.typed),
        Command::Merge(args) => commands::merge::merge(args),
        Command::Video(args) => commands::video::make(args),
        Command::Check(args) => commands::check::check(args),
        Command::Bench(args) => commands::bench::bench(args),
        Command::Plugins(args) => commands::plugins::plugins(args),
        Command::Completions(args) => commands::manual::completions(args, definition()),
        Command::Man(args) => commands::manual::man(args, definition()),
    }
}

/// The command that was typed, with its subcommand if that is one.
fn command_typed(tokens: &[OsString]) -> String {
    let whole = Cli::command();
    let command = tokens.get(1).and_then(|first| whole.find_subcommand(first));
    command.map_or_else(|| "smalti".to_owned(), |command| format!("smalti {}", command.get_name()))
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Evolve one picture into a mosaic
    ///
    /// Thousands of coloured tiles change step by step, until together they look like the picture. The same picture,
    /// options and seed give the same bytes on every device.
    Evolve(Box<EvolveArgs>),
    /// Open the window: watch a picture turn to tiles, and steer it
    ///
    /// Everything that smalti evolve can be asked for is a control there, and takes effect while one looks.
    #[cfg(feature = "view")]
    View(ViewArgs),
    /// Evolve many pictures
    ///
    /// If it is interrupted, the same command goes on from there. A bad picture does not stop the others: its line in
    /// the results tells what is wrong, and the exit code is 3.
    Batch(Box<BatchArgs>),
    /// Evolve a video into a moving mosaic that does not flicker
    ///
    /// Each frame begins with the tiles of the frame before it, so what holds still in the video holds still in the
    /// mosaic. If it is interrupted, the same command goes on from there.
    Video(Box<VideoArgs>),
    /// Draw saved tiles again, at any size or in another format
    ///
    /// The tiles come from a .npz file that `smalti evolve` wrote. At the size at which they evolved, the picture is
    /// the same one that `smalti evolve` draws.
    Render(Box<RenderArgs>),
    /// Make the figures and tables of the paper from your own pictures
    ///
    /// Each is a page with its pictures, plots and tables, to be opened in a browser.
    Paper(PaperArgs),
    /// Show every mask and every shader on the same pictures
    Gallery(GalleryArgs),
    /// Make an animation of how a mosaic evolved
    ///
    /// It is drawn, at any size, from the snapshots that `smalti evolve --save-run DIR` kept.
    Timelapse(Box<TimelapseArgs>),
    /// List the graphics cards of this machine, as Vulkan sees them
    Devices(DevicesArgs),
    /// Measure how close pictures come to a reference
    ///
    /// All figures are of 8-bit sRGB, after EXIF orientation and ICC profile have been applied, and can be recomputed
    /// with numpy, scipy and scikit-image. Of an animation the first frame is measured.
    Score(ScoreArgs),
    /// Show how a file was made, and the command that makes it again
    ///
    /// Reads what smalti wrote into its pictures, animations and populations.
    Show(ShowArgs),
    /// Prepare a batch for a cluster: Slurm, Kubernetes, or GNU parallel
    ///
    /// The batch is cut into shards, and scripts are written that run them.
    Plan(Box<PlanArgs>),
    /// Put the results of several batches or shards together
    ///
    /// Tells which pictures failed, and which are missing.
    Merge(MergeArgs),
    /// Check that a graphics card computes what the CPU computes
    ///
    /// Run it once on a new graphics card or driver.
    Check(CheckArgs),
    /// Measure how fast this machine evolves pictures
    Bench(BenchArgs),
    /// Install plug-ins for GIMP, Krita and Inkscape, and remove them
    ///
    /// The program carries them in itself.
    Plugins(PluginsArgs),
    /// Print what a shell needs to complete commands and flags
    Completions(CompletionsArgs),
    /// Print a manual page, or write all of them
    Man(ManArgs),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_of_the_command_line_is_consistent() {
        definition().debug_assert();
    }
}
