//! The options of `smalti video`.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use crate::cli::args::computing::{Computing, ComputingArgs};
use crate::cli::args::messages::MessageArgs;
use crate::cli::args::picture::PictureArgs;
use crate::cli::files::destination::Overwrite;
use crate::cli::film::{AnimationFile, AnimationFormat, FRAMES_PER_S_MAX};
use crate::cli::jobs::options::PictureOptions;
use crate::cli::terminal::progress::ProgressKind;
use crate::cli::values::{self, in_range};
use crate::error::{Error, Result};
use crate::evolve::held::NOISE_MAX;
use crate::model::cells::leash::LEASH_MAX;
use crate::model::fly::UNITS_PER_PX;
use crate::photo::GIF_FRAMES_PER_S_MAX;
use crate::studio::Scheme;
use crate::vk::Validation;

/// Default mean difference that counts as noise.
pub(super) const NOISE: u64 = 6;
/// Default mean difference above which a frame begins a shot.
pub(super) const SCENE_CUT: u32 = 32;
/// Frames per second of a sequence without a rate.
const FRAMES_PER_S: u64 = 25;

const EXAMPLES: &str = "\
Examples:
  smalti video frames -o mosaic                       # a folder of frames, to a folder of frames
  smalti video clip.mp4 -o clip-mosaic.mp4            # through ffmpeg
  smalti video shots/*.jpg -o mosaic -o mosaic.gif --style mosaic -n 3000 --fps 12
  smalti video frames --shots                         # which frames begin a shot
  smalti video frames -o mosaic --frames 120..240     # one shot, on another machine";

#[derive(Clone, Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct VideoArgs {
    /// Folder of frames, frames in their order, an animation (GIF, APNG, WebP), or a video that ffmpeg reads
    #[arg(value_name = "FRAMES", required = true)]
    pub inputs: Vec<PathBuf>,

    /// Folder for the frames, or an animation: .gif .png .apng, and with ffmpeg .mp4 .webm; repeat it for more
    #[arg(short, long = "output", value_name = "OUT", required_unless_present = "shots", help_heading = "Output")]
    pub outputs: Vec<PathBuf>,
    /// Format of the frames in a folder
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "png", help_heading = "Output")]
    pub format: FrameFormat,
    /// Folder that keeps the tiles of each frame, so that the same command can go on after an interruption [default:
    /// `populations` in the folder of frames, or OUT.populations beside an animation]
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    pub populations: Option<PathBuf>,
    /// Frames a second of an animation, 1 to 120 [default: as in the video, else 25]
    ///
    /// A GIF has at most 50.
    #[arg(long, value_name = "N", value_parser = values::count, help_heading = "Output")]
    pub fps: Option<u64>,
    /// Replace files that smalti did not write, or wrote with other options
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Print one line of JSON for each frame to stdout, and one for all
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// Write what threads and devices did at what time, to be seen in ui.perfetto.dev; the result stays the same
    #[arg(long, value_name = "FILE", help_heading = "Seeing inside")]
    pub trace: Option<PathBuf>,
    /// Only find the shots and print them, as a table or with --json as lines of JSON
    #[arg(long, help_heading = "Output")]
    pub shots: bool,

    /// Whether a frame begins with the tiles of the frame before it
    #[arg(long, value_enum, value_name = "WHETHER", default_value = "on", help_heading = "Sequence")]
    pub warm_start: WarmStart,
    /// Children to try for a frame that begins with the tiles of the frame before (500k, 2M) [default: a quarter of
    /// --evals]
    #[arg(long, value_name = "E", value_parser = values::count, help_heading = "Sequence")]
    pub warm_evals: Option<u64>,
    /// Begin a new shot where two frames differ by more than this on average, 0 to 255; off for never
    #[arg(long, value_name = "T", value_parser = cut, default_value_t = Limit::At(SCENE_CUT), help_heading = "Sequence")]
    pub scene_cut: Limit,
    /// Begin anew after this many frames of a shot [default: never]
    #[arg(long, value_name = "K", value_parser = values::count, help_heading = "Sequence")]
    pub keyframe_every: Option<u64>,
    /// Ignore changes of a pixel that are smaller than this, 0 to 63 of 255
    #[arg(long, value_name = "T", value_parser = values::count, default_value_t = NOISE, help_heading = "Sequence")]
    pub noise: u64,
    /// How far a tile may move between two frames, in px [default: anywhere]
    ///
    /// Up to 512 px, for its centre and each of its edges. New tiles may be anywhere.
    #[arg(long, value_name = "PX", value_parser = leash, help_heading = "Sequence")]
    pub max_tile_move: Option<Leash>,
    /// Only make the frames from A up to B, without B, counted from 0
    ///
    /// Frame A begins anew. If a shot begins there, the frames are the same as in a run over all frames.
    #[arg(long, value_name = "A..B", value_parser = span, help_heading = "Sequence")]
    pub frames: Option<Span>,

    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub computing: ComputingArgs,
    #[command(flatten)]
    pub messages: MessageArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FrameFormat {
    Png,
    Jpg,
    Webp,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum WarmStart {
    /// Tiles move from frame to frame
    On,
    /// Every frame is evolved by itself, as by `smalti evolve`
    Off,
}

/// A number, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Limit {
    At(u32),
    Off,
}

impl fmt::Display for Limit {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::At(value) => value.fmt(out),
            Self::Off => out.write_str("off"),
        }
    }
}

/// A distance in 1/64 px, at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Leash(pub u32);

/// Frames from the first up to, but not, the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub first: usize,
    pub end: usize,
}

fn cut(text: &str) -> Result<Limit, String> {
    match (text, text.parse::<u32>()) {
        ("off", _) => Ok(Limit::Off),
        (_, Ok(value)) if value <= 255 => Ok(Limit::At(value)),
        _ => Err("expected off or a difference from 0 to 255, such as 32".to_owned()),
    }
}

fn leash(text: &str) -> Result<Leash, String> {
    // Rounded down, so that a tile never moves farther than allowed.
    let units = text.parse::<f64>().ok().map(|px| (px * f64::from(UNITS_PER_PX)).floor());
    let units = units.filter(|units| (1.0..=f64::from(LEASH_MAX)).contains(units));
    units
        .map(|units| Leash(units as u32))
        .ok_or_else(|| "expected a distance from 0.02 to 512 px, such as 4".to_owned())
}

fn span(text: &str) -> Result<Span, String> {
    let wrong = || "expected frames such as 120..240".to_owned();
    let (first, end) = text.split_once("..").ok_or_else(wrong)?;
    match (first.parse(), end.parse()) {
        (Ok(first), Ok(end)) if first < end => Ok(Span { first, end }),
        _ => Err(wrong()),
    }
}

/// All options of `smalti video`.
#[derive(Clone, Debug)]
pub(super) struct VideoOptions {
    pub inputs: Vec<PathBuf>,
    /// The options that all frames share.
    pub pictures: PictureOptions,
    pub computing: Computing,
    /// The folder for frames, if they are written.
    pub folder: Option<PathBuf>,
    pub format: FrameFormat,
    pub films: Vec<AnimationFile>,
    /// The folder for populations.
    pub populations: PathBuf,
    pub overwrite: Overwrite,
    /// `None` takes the rate of the input.
    frames_per_s: Option<u16>,
    pub warm_start: WarmStart,
    pub warm_evals: Option<u64>,
    pub scene_cut: Limit,
    pub keyframe_every: Option<usize>,
    pub noise: u32,
    pub max_tile_move: Option<Leash>,
    pub span: Option<Span>,
    pub progress: ProgressKind,
}

impl VideoOptions {
    /// Checks the flags.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag and its range.
    pub(super) fn new(args: &VideoArgs) -> Result<Self> {
        let computing: Computing = args.computing.check(Validation::Off)?;
        let pictures = PictureOptions::new(&args.picture, args.messages.verbosity())?;
        check_pictures(&pictures)?;
        let (folder, films) = outputs(&args.outputs)?;
        let usual = || usual_populations(folder.as_deref(), &films);
        let rate = |fps| in_range("--fps", fps, 1..=FRAMES_PER_S_MAX).map(|fps| fps as u16);
        let frames_per_s = args.fps.map(rate).transpose()?;
        if let Some(fps) = frames_per_s.filter(|&fps| u64::from(fps) > most_frames_per_s(&films)) {
            return Err(Error::Usage(format!("--fps {fps}: a GIF has at most {GIF_FRAMES_PER_S_MAX}")));
        }
        let every = |every| in_range("--keyframe-every", every, 1..=u64::from(u32::MAX)).map(|every| every as usize);
        Ok(Self {
            inputs: args.inputs.clone(),
            pictures,
            computing,
            populations: args.populations.clone().unwrap_or_else(usual),
            folder,
            format: args.format,
            films,
            overwrite: if args.force { Overwrite::Force } else { Overwrite::Refuse },
            frames_per_s,
            warm_start: args.warm_start,
            warm_evals: args.warm_evals,
            scene_cut: args.scene_cut,
            keyframe_every: args.keyframe_every.map(every).transpose()?,
            noise: in_range("--noise", args.noise, 0..=u64::from(NOISE_MAX))? as u32,
            max_tile_move: args.max_tile_move,
            span: args.frames,
            progress: args.messages.progress.unless(args.messages.quiet),
        })
    }

    /// Frames per second of an animation. `of_input` is the rate of the video that was read, if any.
    pub(super) fn rate(&self, of_input: Option<u64>) -> u16 {
        let usual = || of_input.unwrap_or(FRAMES_PER_S).clamp(1, most_frames_per_s(&self.films)) as u16;
        self.frames_per_s.unwrap_or_else(usual)
    }

    /// Ending of the files of frames.
    pub(super) fn ending(&self) -> &'static str {
        match self.format {
            FrameFormat::Png => "png",
            FrameFormat::Jpg => "jpg",
            FrameFormat::Webp => "webp",
        }
    }
}

fn most_frames_per_s(films: &[AnimationFile]) -> u64 {
    let has_gif = films.iter().any(|film| film.format == AnimationFormat::Gif);
    if has_gif { u64::from(GIF_FRAMES_PER_S_MAX) } else { FRAMES_PER_S_MAX }
}

/// Refuses options that make no sense if frames continue from each other.
fn check_pictures(pictures: &PictureOptions) -> Result<()> {
    let refusal = if pictures.settings.init.is_some() {
        "--init: a sequence begins each shot by itself; drop it"
    } else if pictures.settings.time_limit.is_some() {
        "--time: frames that depend on the clock could not be continued; use --evals and --warm-evals"
    } else if pictures.scheme() == Scheme::Paper {
        "--scheme paper: a sequence needs a search that keeps what is good already; use --scheme cells"
    } else {
        return Ok(());
    };
    Err(Error::Usage(refusal.to_owned()))
}

/// Sorts the outputs into the folder and the animations. A path without an ending, or of an existing folder, is the
/// folder.
fn outputs(paths: &[PathBuf]) -> Result<(Option<PathBuf>, Vec<AnimationFile>)> {
    let (mut folders, mut films) = (Vec::new(), Vec::new());
    for path in paths {
        let last = path.as_os_str().as_encoded_bytes().last();
        let ends_like_one = last.is_some_and(|&last| std::path::is_separator(char::from(last)));
        if path == Path::new("-") {
            return Err(Error::Usage("-o -: a sequence is many files; name a folder or an animation".to_owned()));
        }
        if path.is_dir() || ends_like_one || path.extension().is_none() {
            folders.push(path.clone());
        } else {
            films.push(AnimationFile::new(path)?);
        }
    }
    if let Some(second) = folders.get(1) {
        return Err(Error::Usage(format!("{}: one folder of frames is enough; drop it", second.display())));
    }
    Ok((folders.pop(), films))
}

fn usual_populations(folder: Option<&Path>, films: &[AnimationFile]) -> PathBuf {
    let beside_film = || {
        let film = films.first().map_or(Path::new("video"), |film| &film.path);
        let mut name = film.file_name().unwrap_or(OsStr::new("video")).to_owned();
        name.push(".populations");
        film.with_file_name(name)
    };
    folder.map_or_else(beside_film, |folder| folder.join("populations"))
}
