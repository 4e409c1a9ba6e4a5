//! What was typed: commands and flags with their help. What they mean is decided in `options`.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Arg, ArgAction, Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

use super::batch::BatchArgs;
use super::bench::BenchArgs;
use super::computing::ComputingArgs;
use super::gallery::GalleryArgs;
use super::inside::InsideArgs;
use super::manual::{CompletionsArgs, ManArgs};
use super::merge::MergeArgs;
use super::paper::PaperArgs;
use super::picture::PictureArgs;
use super::plan::PlanArgs;
use super::render::RenderArgs;
use super::score::ScoreArgs;
use super::timelapse::TimelapseArgs;
use super::video::VideoArgs;
use super::{advice, config, report, values};
use crate::error::{Error, Result};

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
    /// Flags in a TOML file; those that are typed go before it
    #[arg(long, global = true, value_name = "FILE", env = "SMALTI_CONFIG", help_heading = "Options")]
    config: Option<PathBuf>,
    /// What was typed, the name of the program first, and what the file of `--config` added to it.
    #[arg(skip)]
    pub(super) typed: Vec<OsString>,
}

impl Cli {
    /// The command line of this process; if it is wrong, or only asks for help, the exit code after having said so.
    ///
    /// # Errors
    /// The exit code to end with: 0 after help or version, 2 after a wrong command line.
    pub fn from_command_line() -> Result<Self, ExitCode> {
        let mut definition = Self::command();
        definition.build();
        let typed = config::expand(std::env::args_os().collect(), &definition).map_err(|error| {
            report::error(&advice::sentence(&error));
            ExitCode::from(advice::exit_code(&error))
        })?;
        Self::try_parse_from(&typed).map(|cli| Self { typed, ..cli }).map_err(|error| {
            if error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
                report::error(&one_sentence(&error.to_string(), &command_typed()));
            } else {
                // Only a closed pipe can fail here: nobody wants the rest of the help.
                let _ = error.print();
            }
            ExitCode::from(if error.use_stderr() { 2 } else { 0 })
        })
    }

    /// Whether `flag`, which takes a value, was typed, rather than set by the environment.
    pub(super) fn has_typed(&self, flag: &str) -> bool {
        let tokens = self.typed.iter().map(|token| token.to_string_lossy()).take_while(|token| token != "--");
        tokens
            .into_iter()
            .any(|token| token.strip_prefix(flag).is_some_and(|rest| rest.is_empty() || rest.starts_with('=')))
    }

    /// The flags that decide a picture, if `flags` were typed, too; each of them goes before what was typed.
    ///
    /// # Errors
    /// [`Error::Usage`] if one of them decides no picture, or is wrong.
    pub(super) fn picture_with(&self, flags: &[String]) -> Result<PictureArgs> {
        let known = PictureArgs::augment_args(clap::Command::new("picture"));
        let is_known = |name: &str| known.get_arguments().any(|argument| argument.get_long() == Some(name));
        let names: Vec<&str> =
            flags.iter().filter_map(|flag| flag.trim_start_matches("--").split('=').next()).collect();
        if let Some(name) = names.iter().find(|name| !is_known(name)) {
            return Err(Error::Usage(format!(
                "params: {name} is no flag that decides a picture; see smalti evolve --help"
            )));
        }
        // Of flags that may come several times, those of the row would be added to those that were typed.
        let lists = known.get_arguments().filter(|argument| matches!(argument.get_action(), ArgAction::Append));
        let replaced: Vec<&str> = lists.filter_map(Arg::get_long).filter(|name| names.contains(name)).collect();
        let end = self.typed.iter().position(|token| token == "--").unwrap_or(self.typed.len());
        let (before, after) = self.typed.split_at(end);
        let tokens = without(before, &replaced).chain(flags.iter().map(OsString::from)).chain(after.iter().cloned());
        // Given twice, the last one counts.
        let command = ["batch", "plan"]
            .into_iter()
            .fold(Self::command(), |cli, name| cli.mut_subcommand(name, |command| command.args_override_self(true)));
        let wrong = |error: clap::Error| Error::Usage(one_sentence(&error.to_string(), "smalti batch"));
        let matches = command.try_get_matches_from(tokens).map_err(wrong)?;
        match Self::from_arg_matches(&matches).map_err(wrong)?.command {
            Command::Batch(args) => Ok(args.picture),
            Command::Plan(args) => Ok(args.batch.picture),
            _ => Err(Error::Internal("a batch was typed as another command".to_owned())),
        }
    }
}

/// Tokens of a command line without these flags and their values.
fn without<'a>(tokens: &'a [OsString], flags: &'a [&str]) -> impl Iterator<Item = OsString> + 'a {
    let mut is_value = false;
    tokens
        .iter()
        .filter(move |token| {
            let text = token.to_string_lossy();
            let name = text.strip_prefix("--").filter(|_| !is_value);
            let is_left_out =
                is_value || name.is_some_and(|name| flags.iter().any(|flag| name.split('=').next() == Some(flag)));
            is_value = !is_value && is_left_out && !text.contains('=');
            !is_left_out
        })
        .cloned()
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
    /// Evolve many pictures, and go on where it was interrupted
    ///
    /// One bad picture never stops the others: the reason is in its line of the results, and the exit code is 3.
    Batch(Box<BatchArgs>),
    /// Evolve a sequence of pictures into mosaics whose tiles move instead of flickering
    ///
    /// Each frame begins with the tiles of the one before, and what holds still in the pictures holds still in the mosaics. The same command goes on where it was ended.
    Video(Box<VideoArgs>),
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
    /// Cut a batch into shards, with scripts that run them on Slurm, Kubernetes, or GNU parallel
    Plan(Box<PlanArgs>),
    /// Put the results of several shards or runs together
    ///
    /// Tells which pictures failed, and which are missing.
    Merge(MergeArgs),
    /// Measure how fast this machine evolves pictures
    Bench(BenchArgs),
    /// Print what a shell needs to complete commands and flags
    Completions(CompletionsArgs),
    /// Print a manual page, or write all of them
    Man(ManArgs),
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

    #[command(flatten)]
    pub picture: PictureArgs,

    #[command(flatten)]
    pub computing: ComputingArgs,
    /// Watch every Vulkan call with the validation layer; any message is an error
    #[arg(long, help_heading = "Computing")]
    pub validate: bool,
    #[command(flatten)]
    pub inside: InsideArgs,

    #[command(flatten)]
    pub messages: MessageArgs,
}

/// How much to say on stderr, and how.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Messages")]
pub(super) struct MessageArgs {
    /// How to show progress on stderr; a bar needs a terminal, elsewhere it becomes plain lines
    #[arg(long, value_enum, value_name = "KIND", env = "SMALTI_PROGRESS", default_value = "auto")]
    pub progress: ProgressKind,
    /// Say more
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Say nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(Debug, Args)]
pub(super) struct DevicesArgs {
    /// Print JSON to stdout instead of a table
    #[arg(long)]
    pub json: bool,
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
    fn a_flag_is_left_out_with_its_value_however_it_was_written() {
        let tokens = ["batch", "--mask", "disc", "in", "--mask=a,b", "--masks", "--restart-mask", "--mask"];
        let tokens = tokens.map(OsString::from);
        let left: Vec<OsString> = without(&tokens, &["mask"]).collect();
        assert_eq!(left, ["batch", "in", "--masks", "--restart-mask"]);
        assert_eq!(without(&tokens, &[]).count(), tokens.len());
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
