//! What the command line means: every value checked, every default filled in that needs no picture.

use std::iter;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::cells::{CellsOptions, PresetFile};
use super::cli::{EvolveArgs, MessageArgs, ProgressKind};
use super::computing::Computing;
use super::curve_file::CurveFile;
use super::destination::{self, Destination};
use super::inside::Tracer;
use super::look::Look;
use super::picture::{PictureArgs, SchemeName};
use super::presets::{Preset, PresetChoice};
use super::scheme;
use super::snapshots::SaveRun;
use super::values::ColorCount;
use crate::error::{Error, Result};
use crate::evolve::PaperScheme;
use crate::model::Rgb;
use crate::model::population::FLY_COUNT_MAX;
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::vk::Validation;

/// What to do about outputs that exist already and are not what the same command would write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Overwrite {
    Refuse,
    Force,
}

/// Whether to do the work or only to say what it would be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    Work,
    DryRun,
}

/// How much to say on stderr.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Verbosity {
    Quiet,
    Normal,
    Verbose,
}

/// Which colours the target keeps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Colors {
    Full,
    /// At most so many of its own.
    Few(usize),
    /// Those of a palette file, and the tiles too.
    Palette(PathBuf),
}

/// How to evolve.
#[derive(Clone, Debug)]
pub(super) enum SchemeOptions {
    Cells(CellsOptions),
    Paper(PaperScheme),
}

impl SchemeOptions {
    fn new(args: &PictureArgs, file: Option<&PresetFile>) -> Result<Self> {
        match scheme_name(args) {
            SchemeName::Cells => CellsOptions::new(args, file).map(Self::Cells),
            SchemeName::Paper => {
                let preset = args.preset.as_ref().and_then(PresetChoice::paper);
                scheme::paper_scheme(args, preset).map(Self::Paper)
            }
        }
    }
}

impl MessageArgs {
    /// How much to say.
    pub(super) fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        }
    }
}

/// Longer side in px that pictures are reduced to.
const LONG_SIDE_PX: u64 = 512;

/// Everything that `smalti evolve` was asked to do.
#[derive(Clone, Debug)]
pub(super) struct EvolveOptions {
    pub input: PathBuf,
    pub outputs: Vec<Destination>,
    pub save_target: Option<Destination>,
    /// Where the curve of the evolution goes.
    pub curves: Vec<CurveFile>,
    /// Where to keep snapshots.
    pub save_run: Option<SaveRun>,
    /// Longer side of the written picture in px; `None` writes it as evolved.
    pub output_long_side_px: Option<u32>,
    pub overwrite: Overwrite,
    pub mode: Mode,
    /// Number of flies; `None` leaves it to the picture's size, or to `init`.
    pub fly_count: Option<usize>,
    /// Longer side in px that the picture is reduced to.
    pub long_side_px: u32,
    pub colors: Colors,
    /// Map of where likeness matters; `None` means alike everywhere.
    pub weight: Option<PathBuf>,
    pub look: Look,
    /// `None` means the one of `init`, else black.
    pub background: Option<Rgb>,
    pub init: Option<PathBuf>,
    pub scheme: SchemeOptions,
    pub time_limit: Option<Duration>,
    pub computing: Computing,
    pub progress: ProgressKind,
    pub verbosity: Verbosity,
    /// Where all work on the picture tells what it does.
    pub tracer: Tracer,
}

impl EvolveOptions {
    /// Checks what was typed.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag and what it may be.
    pub(super) fn new(args: &EvolveArgs) -> Result<Self> {
        let validation = if args.validate { Validation::On } else { Validation::Off };
        let options = Self {
            input: args.input.clone(),
            outputs: args.outputs.iter().map(|path| Destination::for_result(path)).collect::<Result<_>>()?,
            save_target: args.save_target.as_deref().map(Destination::for_target).transpose()?,
            curves: args.curves.iter().map(|path| CurveFile::new(path)).collect::<Result<_>>()?,
            save_run: args.save_run.as_deref().map(|folder| SaveRun::new(folder, args.save_every)).transpose()?,
            overwrite: if args.force { Overwrite::Force } else { Overwrite::Refuse },
            mode: if args.dry_run { Mode::DryRun } else { Mode::Work },
            progress: args.messages.progress.unless(args.messages.quiet),
            ..Self::of_pictures(&args.picture, args.computing.check(validation)?, args.messages.verbosity())?
        };
        if args.json {
            check_stdout_is_free(&options.outputs)?;
        }
        destination::check_size_has_use(&options.outputs, options.output_long_side_px)?;
        Ok(options)
    }

    /// What all pictures have in common that are evolved with these flags; the options of one have its input and outputs
    /// besides.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag and what it may be.
    pub(super) fn of_pictures(args: &PictureArgs, computing: Computing, verbosity: Verbosity) -> Result<Self> {
        check_scheme_knows(args)?;
        let file = if let Some(PresetChoice::File(path)) = &args.preset { Some(PresetFile::read(path)?) } else { None };
        let filled = file.as_ref().map(|file| file.fill(args.clone()));
        let args = filled.as_ref().unwrap_or(args);
        let preset = args.preset.as_ref().and_then(PresetChoice::paper);
        let scheme = SchemeOptions::new(args, file.as_ref())?;
        let styled = match &scheme {
            SchemeOptions::Cells(cells) => args.look.or_style(cells.style())?,
            SchemeOptions::Paper(_) => args.look.clone(),
        };
        let look = Look::new(&styled, &args.paper.restart_masks, preset)?;
        let restarts = if let SchemeOptions::Paper(scheme) = &scheme { scheme.restarts } else { 0 };
        if look.changes_at_restart() && restarts == 0 {
            let sentence = if args.paper.restart_masks.is_empty() {
                "this preset changes its masks at a restart; drop --restarts 0"
            } else {
                "--restart-mask needs a restart; add --restarts"
            };
            return Err(Error::Usage(sentence.to_owned()));
        }
        let fly_count = args.tiles.map(|count| in_range("--tiles", count, (1, FLY_COUNT_MAX as u64))).transpose()?;
        let preset_side = preset.map(|preset| u64::from(preset.side_px));
        Ok(Self {
            input: PathBuf::new(),
            outputs: Vec::new(),
            save_target: None,
            curves: Vec::new(),
            save_run: None,
            output_long_side_px: args.output_size.map(|px| side_px("--output-size", px)).transpose()?,
            overwrite: Overwrite::Refuse,
            mode: Mode::Work,
            fly_count: fly_count.map(|count| count as usize),
            long_side_px: side_px("--size", args.size.unwrap_or(preset_side.unwrap_or(LONG_SIDE_PX)))?,
            colors: colors(args, preset),
            weight: args.weight.clone(),
            look,
            background: args.background,
            init: args.init.clone(),
            scheme,
            time_limit: args.time,
            computing,
            progress: ProgressKind::None,
            verbosity,
            tracer: Tracer::default(),
        })
    }

    /// The pictures that decide the target, none of which may be written over.
    pub(super) fn picture_inputs(&self) -> Vec<&Path> {
        iter::once(&self.input).chain(&self.weight).map(PathBuf::as_path).collect()
    }

    /// The files that all pictures share, none of which may be written over: map, population, palette and masks. The name of a
    /// mask that is built in is the name of no file.
    pub(super) fn shared_inputs(&self) -> impl Iterator<Item = &Path> {
        let palette = if let Colors::Palette(path) = &self.colors { Some(path) } else { None };
        let masks = self.look.named_masks().filter(|name| name.exists());
        self.weight.iter().chain(&self.init).chain(palette).chain(masks).map(PathBuf::as_path)
    }

    /// Every file that will be written.
    pub(super) fn destinations(&self) -> impl Iterator<Item = &Destination> {
        self.outputs.iter().chain(&self.save_target)
    }
}

/// The value of a flag that is a side of a picture.
pub(super) fn side_px(flag: &str, px: u64) -> Result<u32> {
    in_range(flag, px, (1, u64::from(TARGET_SIDE_MAX_PX))).map(|px| px as u32)
}

/// Refuses a picture on the stdout that the row of `--json` goes to.
pub(super) fn check_stdout_is_free(outputs: &[Destination]) -> Result<()> {
    if outputs.iter().any(Destination::is_stdout) {
        return Err(Error::Usage("-o - and --json both write to stdout; drop one of them".to_owned()));
    }
    Ok(())
}

fn colors(args: &PictureArgs, preset: Option<Preset>) -> Colors {
    let of_preset = preset.and_then(|preset| preset.color_count);
    match (&args.palette, args.colors) {
        (Some(path), _) => Colors::Palette(path.clone()),
        (None, Some(ColorCount::Few(count))) => Colors::Few(count),
        (None, Some(ColorCount::Full)) => Colors::Full,
        (None, None) => of_preset.map_or(Colors::Full, Colors::Few),
    }
}

/// The scheme that was asked for, by name or by what needs it.
pub(super) fn scheme_name(args: &PictureArgs) -> SchemeName {
    let of_paper = matches!(args.preset, Some(PresetChoice::Paper(_)));
    args.scheme.unwrap_or(if of_paper { SchemeName::Paper } else { SchemeName::Cells })
}

/// Refuses flags that the scheme has no use for.
fn check_scheme_knows(args: &PictureArgs) -> Result<()> {
    let this = scheme_name(args);
    let of_paper = matches!(args.preset, Some(PresetChoice::Paper(_)));
    let preset = args.preset.as_ref().filter(|_| of_paper != (this == SchemeName::Paper));
    let (other, given) = match this {
        SchemeName::Paper if args.weight.is_some() => {
            let sentence = "--weight: the paper's scheme weighs all pixels alike; use --scheme cells";
            return Err(Error::Usage(sentence.to_owned()));
        }
        SchemeName::Paper => (SchemeName::Cells, args.cells.given()),
        SchemeName::Cells => (SchemeName::Paper, args.paper.given()),
    };
    let given = given.map(str::to_owned).or(preset.map(|preset| format!("--preset {preset}")));
    given.map_or(Ok(()), |flag| {
        let (other, this) = (other.word(), this.word());
        Err(Error::Usage(format!(
            "{flag}: only --scheme {other} has it, and this is --scheme {this}; drop one of them"
        )))
    })
}

/// `value`, if it lies between the bounds, both included.
pub(super) fn in_range(flag: &str, value: u64, (least, most): (u64, u64)) -> Result<u64> {
    if (least..=most).contains(&value) {
        Ok(value)
    } else if most == u64::MAX {
        Err(Error::Usage(format!("{flag} {value}: must be at least {least}")))
    } else {
        Err(Error::Usage(format!("{flag} {value}: must be {least} to {most}")))
    }
}
