//! The options of `smalti timelapse`.

use std::path::PathBuf;

use clap::Args;

use super::frames::Spacing;
use crate::cli::args::computing::{Computing, ComputingArgs};
use crate::cli::files::destination::Overwrite;
use crate::cli::film::{AnimationFile, AnimationFormat, FRAMES_PER_S_MAX};
use crate::cli::terminal::progress::ProgressKind;
use crate::cli::values::{self, in_range};
use crate::error::{Error, Result};
use crate::model::Backdrop;
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::photo::{GIF_FRAMES_PER_S_MAX, Timing};
use crate::studio::backdrop;
use crate::vk::Validation;

/// Longest time in seconds that the last frame may be shown. Its hundredths must fit into 16 bits.
const HOLD_S_MAX: f64 = 600.0;

const EXAMPLES: &str = "\
Examples:
  smalti evolve photo.jpg -o mosaic.png --save-run run
  smalti timelapse run -o mosaic.gif --output-size 256
  smalti timelapse run -o mosaic.mp4 -o mosaic.webm --output-size 1080 --fps 30
  smalti timelapse run -o mosaic.png --frames 60 --hold 3 --loop 1";

#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct TimelapseArgs {
    /// Folder of snapshots that smalti evolve --save-run wrote
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,

    /// Animation to write: .gif .png .apng, and with ffmpeg .mp4 .webm; repeat it for more
    #[arg(short, long = "output", value_name = "OUT", required = true, help_heading = "Output")]
    pub outputs: Vec<PathBuf>,
    /// Longer side of the frames, 1 to 65,535 px [default: that at which it evolved]
    ///
    /// Every mosaic is drawn anew at this size.
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Output")]
    pub output_size: Option<u64>,
    /// Colour behind the tiles, such as navy or #f80, or none [default: that of the snapshots]
    ///
    /// A .mp4 or .webm cannot be transparent: instead of none, it has black.
    #[arg(long, value_name = "COLOR", value_parser = backdrop, help_heading = "Output")]
    pub background: Option<Backdrop>,
    /// Replace files that smalti did not write, or wrote with other options
    #[arg(long, help_heading = "Output")]
    pub force: bool,

    /// Frames a second, 1 to 120; at most 50 in a GIF
    #[arg(long, value_name = "N", value_parser = values::count, default_value = "20", help_heading = "Time")]
    pub fps: u64,
    /// Show at most this many snapshots [default: half of them with --spacing error, else all]
    #[arg(long, value_name = "N", value_parser = values::count, help_heading = "Time")]
    pub frames: Option<u64>,
    /// What grows evenly from frame to frame
    #[arg(long, value_enum, value_name = "WHAT", default_value = "error", help_heading = "Time")]
    pub spacing: Spacing,
    /// How long the last frame is shown, 0 to 600 seconds
    #[arg(long, value_name = "SECONDS", value_parser = values::number, default_value_t = 1.5, help_heading = "Time")]
    pub hold: f64,
    /// How often a .png, .apng or .gif is played, 0 to 65,535; 0 never ends
    #[arg(long = "loop", value_name = "N", value_parser = values::count, default_value = "0", help_heading = "Time")]
    pub plays: u64,

    #[command(flatten)]
    pub computing: ComputingArgs,

    /// How to show progress on stderr
    ///
    /// A bar needs a terminal; elsewhere it becomes plain lines.
    #[arg(long, value_enum, value_name = "KIND", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressKind,
    /// Say nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

/// All options of `smalti timelapse`.
#[derive(Clone, Debug)]
pub(super) struct TimelapseOptions {
    pub folder: PathBuf,
    pub outputs: Vec<AnimationFile>,
    /// Longer side of the frames in px; `None` draws them as evolved.
    pub long_side_px: Option<u32>,
    /// `None` takes the background of the snapshots.
    pub background: Option<Backdrop>,
    pub overwrite: Overwrite,
    pub frames_per_s: u16,
    /// Most frames; `None` lets the spacing decide.
    pub frame_count: Option<usize>,
    pub spacing: Spacing,
    hold_cs: u16,
    plays: u16,
    pub computing: Computing,
    pub progress: ProgressKind,
    pub is_quiet: bool,
}

impl TimelapseOptions {
    /// Checks the flags.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag and its range.
    pub(super) fn new(args: &TimelapseArgs) -> Result<Self> {
        let sides = 1..=u64::from(TARGET_SIDE_MAX_PX);
        let long_side_px = args.output_size.map(|px| in_range("--output-size", px, sides)).transpose()?;
        let frame_count = args.frames.map(|count| in_range("--frames", count, 1..=u64::from(u32::MAX))).transpose()?;
        let frames_per_s = in_range("--fps", args.fps, 1..=FRAMES_PER_S_MAX)? as u16;
        if !(0.0..=HOLD_S_MAX).contains(&args.hold) {
            return Err(Error::Usage(format!("--hold {}: must be 0 to {HOLD_S_MAX} seconds", args.hold)));
        }
        let outputs = args.outputs.iter().map(|path| AnimationFile::new(path)).collect::<Result<Vec<_>>>()?;
        if frames_per_s > GIF_FRAMES_PER_S_MAX && outputs.iter().any(|output| output.format == AnimationFormat::Gif) {
            return Err(Error::Usage(format!("--fps {frames_per_s}: a GIF has at most {GIF_FRAMES_PER_S_MAX}")));
        }
        let shortest_cs = 100_u16.div_ceil(frames_per_s);
        Ok(Self {
            folder: args.folder.clone(),
            outputs,
            long_side_px: long_side_px.map(|px| px as u32),
            background: args.background,
            overwrite: if args.force { Overwrite::Force } else { Overwrite::Refuse },
            frames_per_s,
            frame_count: frame_count.map(|count| count as usize),
            spacing: args.spacing,
            hold_cs: ((args.hold * 100.0).round() as u16).max(shortest_cs),
            plays: in_range("--loop", args.plays, 0..=u64::from(u16::MAX))? as u16,
            computing: args.computing.check(Validation::Off)?,
            progress: args.progress.unless(args.quiet),
            is_quiet: args.quiet,
        })
    }

    /// The timing of this many frames.
    pub(super) fn timing(&self, frame_count: usize) -> Timing {
        Timing {
            frame_count: frame_count as u32,
            frames_per_s: self.frames_per_s,
            last_cs: self.hold_cs,
            plays: self.plays,
        }
    }
}
