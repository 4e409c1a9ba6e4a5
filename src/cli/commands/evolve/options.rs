//! The options of `smalti evolve`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use crate::cli::args::computing::{Computing, ComputingArgs};
use crate::cli::args::messages::MessageArgs;
use crate::cli::args::picture::PictureArgs;
use crate::cli::files::curve_file::CurveFile;
use crate::cli::files::destination::{self, Destination, Overwrite};
use crate::cli::files::snapshots::SaveRun;
use crate::cli::jobs::options::PictureOptions;
use crate::cli::jobs::replay::Replay;
use crate::cli::trace::TraceArgs;
use crate::cli::values;
use crate::error::Result;
use crate::photo::CutShort;
use crate::vk::Validation;

const EVOLVE_EXAMPLES: &str = "\
Examples:
  smalti evolve photo.jpg -o mosaic.png
  smalti evolve photo.jpg -o mosaic.png -o flies.npz -n 10k --evals 20M
  smalti evolve photo.jpg -o mosaic.png --style mosaic --grout auto -n 4000
  smalti evolve photo.jpg -o paper.png --scheme paper --births 200k --restarts 3 --cool 0.5
  smalti evolve photo.jpg -o poster.png --output-size 4096 --time 2m
  smalti evolve photo.jpg -o better.png --init flies.npz --seed 1
  smalti evolve photo.jpg -o - --quiet > mosaic.png";

/// What a script decides, or what cannot be told of one that is followed.
const NOT_WITH_REPLAY: [&str; 40] = [
    "tiles",
    "size",
    "colors",
    "palette",
    "background",
    "weight",
    "init",
    "masks",
    "shader",
    "blend",
    "opacity",
    "scheme",
    "preset",
    "color_mode",
    "target_sae",
    "patience",
    "time",
    "seed",
    "style",
    "evals",
    "candidates",
    "grout",
    "grout_width",
    "births",
    "batch_births",
    "restarts",
    "restart_masks",
    "cool",
    "on_dry",
    "p_mutation",
    "p_crossover",
    "new_blood",
    "mitosis",
    "no_rotation",
    "tile_scale",
    "curves",
    "save_run",
    "save_target",
    "trace",
    "capture",
];

#[derive(Clone, Debug, Args)]
#[command(after_long_help = EVOLVE_EXAMPLES)]
pub(crate) struct EvolveArgs {
    /// Picture to evolve: PNG, JPEG, JPEG XL, WebP, TIFF, BMP or GIF; - reads it from stdin
    #[arg(value_name = "IN", value_parser = values::input())]
    pub input: PathBuf,

    /// File to write: .png .jpg .webp .svg .ora .npz .csv .json; repeat it for more
    ///
    /// .npz, .csv and .json hold the tiles themselves; smalti render draws a .npz again. - writes to stdout what
    /// --format says.
    #[arg(short, long = "output", value_name = "OUT", required = true, help_heading = "Output")]
    pub outputs: Vec<PathBuf>,
    /// Format of what -o - writes: png, jpg, webp, svg, ora, npz, csv or json [default: png]
    #[arg(long, value_name = "EXT", value_parser = values::ending, help_heading = "Output")]
    pub format: Option<String>,
    /// Do again what was done in the window: the script that it saved decides all but the picture and the outputs
    #[arg(long, value_name = "SCRIPT", conflicts_with_all = NOT_WITH_REPLAY, help_heading = "Picture")]
    pub replay: Option<PathBuf>,
    /// Also write the picture that the mosaic imitates, at the size at which it evolves, as a PNG
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub save_target: Option<PathBuf>,
    /// Also write how the error fell, as a table (.csv) or a plot (.svg); repeat it for more
    #[arg(long = "curve", value_name = "FILE", help_heading = "Output")]
    pub curves: Vec<PathBuf>,
    /// Also keep about 250 snapshots of the evolution in this folder, for smalti timelapse
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    pub save_run: Option<PathBuf>,
    /// Take a snapshot after every B tried tiles (40k, 2M), and more often at the beginning [default: a 100th of all]
    #[arg(long, value_name = "B", value_parser = values::count, requires = "save_run", help_heading = "Output")]
    pub save_every: Option<u64>,
    /// Replace files that smalti did not write, or wrote with other options
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Only check everything and say what would be done; write nothing
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,
    /// Print one line of JSON about the result to stdout
    #[arg(long, help_heading = "Output")]
    pub json: bool,

    #[command(flatten)]
    pub picture: PictureArgs,

    #[command(flatten)]
    pub computing: ComputingArgs,
    /// Check every Vulkan call with the validation layer; any message is an error
    #[arg(long, help_heading = "Computing")]
    pub validate: bool,
    #[command(flatten)]
    pub trace: TraceArgs,

    #[command(flatten)]
    pub messages: MessageArgs,
}

/// Whether to do the work, or only to say what would be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    Work,
    DryRun,
}

/// Where everything goes that is not an output of the picture.
#[derive(Clone, Debug)]
pub(super) struct Files {
    pub save_target: Option<Destination>,
    /// Where the curve of the evolution goes.
    pub curves: Vec<CurveFile>,
    /// Where to keep snapshots.
    pub save_run: Option<SaveRun>,
    pub overwrite: Overwrite,
}

/// All options of `smalti evolve`.
#[derive(Clone, Debug)]
pub(super) struct EvolveOptions {
    pub picture: PictureOptions,
    pub files: Files,
    pub mode: Mode,
    pub computing: Computing,
}

impl EvolveOptions {
    /// Checks the flags.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] or [`crate::Error::Parameter`] that names the flag and its range.
    pub fn new(args: &EvolveArgs) -> Result<Self> {
        let validation = if args.validate { Validation::On } else { Validation::Off };
        let outputs = Destination::for_results(&args.outputs, args.format.as_deref())?;
        let files = Files {
            save_target: args.save_target.as_deref().map(Destination::for_target).transpose()?,
            curves: args.curves.iter().map(|path| CurveFile::new(path)).collect::<Result<_>>()?,
            save_run: args.save_run.as_deref().map(|folder| SaveRun::new(folder, args.save_every)).transpose()?,
            overwrite: if args.force { Overwrite::Force } else { Overwrite::Refuse },
        };
        let computing = args.computing.check(validation)?;
        let mut picture = PictureOptions {
            input: args.input.clone(),
            outputs,
            progress: args.messages.progress.unless(args.messages.quiet),
            ..PictureOptions::new(&args.picture, args.messages.verbosity())?
        };
        if let Some(path) = &args.replay {
            let cut_short = if args.picture.lenient { CutShort::Take } else { CutShort::Refuse };
            let replay = Replay::read(path, cut_short)?;
            picture.settings = Arc::new(replay.settings()?);
            picture.replay = Some(Arc::new(replay));
        }
        if args.json {
            destination::check_stdout_is_free(&picture.outputs)?;
        }
        destination::check_size_has_use(&picture.outputs, picture.output_long_side_px)?;
        Ok(Self { picture, files, mode: if args.dry_run { Mode::DryRun } else { Mode::Work }, computing })
    }

    /// Every picture or population that will be written.
    pub fn destinations(&self) -> impl Iterator<Item = &Destination> {
        self.picture.outputs.iter().chain(&self.files.save_target)
    }

    /// Every file that will be written.
    pub fn files_written(&self) -> impl Iterator<Item = &Path> {
        let curves = self.files.curves.iter().map(|file| file.path.as_path());
        self.destinations().map(|destination| destination.path.as_path()).chain(curves)
    }
}

#[cfg(test)]
mod tests {
    use clap::{Args, Command};

    use super::*;

    #[test]
    fn a_script_decides_all_that_flags_decide_of_a_picture() {
        let of_picture = PictureArgs::augment_args(Command::new("picture"));
        let of_evolve = EvolveArgs::augment_args(Command::new("evolve"));
        let ids = |command: &Command| -> Vec<String> {
            command.get_arguments().map(|argument| argument.get_id().to_string()).collect()
        };
        for id in ids(&of_picture).iter().filter(|id| !["output_size", "lenient"].contains(&id.as_str())) {
            assert!(NOT_WITH_REPLAY.contains(&id.as_str()), "{id} is ignored");
        }
        let known = ids(&of_evolve);
        assert!(NOT_WITH_REPLAY.iter().all(|id| known.iter().any(|known| known == id)), "{known:?}");
    }
}
