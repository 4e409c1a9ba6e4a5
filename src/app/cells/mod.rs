//! The `cells` scheme at the command line: its flags, what they ask for, and what of that is in the key.

mod curve;
mod grout;
mod preset_file;
mod work;

use clap::Args;
use serde_json::{Map, Value, json};

pub(super) use self::curve::CSV_HEADER;
pub(super) use self::grout::GroutColor;
use self::grout::{GroutChoice, grout_color};
pub(super) use self::preset_file::PresetFile;
pub(super) use self::work::{finish_search, search_job};
use super::job::Job;
use super::options::in_range;
use super::picture::PictureArgs;
use super::presets::{self, PresetChoice};
use super::scheme::ColorModeName;
use super::values;
use crate::error::{Error, Result};
use crate::evolve::cells::{Budget, CELLS_VERSION, EVALS_PER_FLY};
use crate::evolve::style::{Ground, GuideKind, Style};
use crate::guide::{self, Flow};
use crate::model::cells::Rules;
use crate::model::cells::rules::{CANDIDATES_MAX, ColorSource};
use crate::model::operators::tile_side;
use crate::model::tile::pack;
use crate::model::{Blend, Grout, Guide, Rgb, Target};

/// The flags that only the `cells` scheme has.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Evolution with --scheme cells")]
pub(super) struct CellsArgs {
    /// How tiles lie: free (closest likeness), mosaic (whole tiles in rows along the contours), paint (brush strokes) or
    /// spray (soft translucent discs) [default: free]
    #[arg(long, value_name = "NAME", value_parser = presets::parse_style, conflicts_with = "preset")]
    pub style: Option<String>,
    /// Stop after so many children were evaluated (suffixes k, M) [default: 400 for each tile]
    #[arg(long, value_name = "E", value_parser = values::count)]
    pub evals: Option<u64>,
    /// Children tried in each step, 1 to 64, of which the best one counts; more is faster on a GPU [default: 1]
    #[arg(long, value_name = "K", value_parser = values::count)]
    pub candidates: Option<u64>,
    /// Colour of the grout, the ring of each tile: none, auto (keeps the picture's brightness), black, white or RRGGBB
    /// [default: auto if the style has grout, else none]
    #[arg(long, value_name = "COLOR", value_parser = grout_color)]
    pub grout: Option<GroutColor>,
    /// Width of the grout in px of the evolved picture, 0.02 to 64 [default: as in the style, or a 16th of a tile's side]
    #[arg(long, value_name = "PX", value_parser = values::number)]
    pub grout_width: Option<f64>,
}

impl CellsArgs {
    /// The first of these flags that was given.
    pub(super) fn given(&self) -> Option<&'static str> {
        let given = [
            ("--style", self.style.is_some()),
            ("--evals", self.evals.is_some()),
            ("--candidates", self.candidates.is_some()),
            ("--grout", self.grout.is_some()),
            ("--grout-width", self.grout_width.is_some()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(flag, _)| flag)
    }
}

/// What was asked for, checked.
#[derive(Clone, Debug)]
pub(super) struct CellsOptions {
    pub seed: u64,
    /// Children to evaluate; `None` leaves it to the number of flies.
    evals: Option<u64>,
    target_sae: Option<u64>,
    patience: Option<u64>,
    candidates: u32,
    color: ColorSource,
    style: Style,
    grout: GroutChoice,
}

impl CellsOptions {
    /// Checks the flags; `file` is the preset that filled them in, if it is a file.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag and what it may be.
    pub(super) fn new(args: &PictureArgs, file: Option<&PresetFile>) -> Result<Self> {
        let candidates = args.cells.candidates.unwrap_or(1);
        let patience = args.patience.map(|evals| in_range("--patience", evals, (1, u64::MAX))).transpose()?;
        let name = match &args.preset {
            Some(PresetChoice::Style(name)) => Some(name),
            _ => args.cells.style.as_ref(),
        };
        let named = name.and_then(|name| Style::named(name));
        Ok(Self {
            seed: args.seed,
            evals: args.cells.evals,
            target_sae: args.target_sae,
            patience,
            candidates: in_range("--candidates", candidates, (1, u64::from(CANDIDATES_MAX)))? as u32,
            color: color_source(args)?,
            style: file.map(PresetFile::style).or(named).unwrap_or_else(Style::free),
            grout: GroutChoice::new(args.cells.grout, args.cells.grout_width)?,
        })
    }

    /// These options for translucent tiles, which what a style says of grout, overlap and holes does not concern.
    ///
    /// # Errors
    /// [`Error::Usage`] if grout was asked for.
    pub(super) fn for_translucent_tiles(mut self) -> Result<Self> {
        if let Some(flag) = self.grout.asking_flag() {
            return Err(Error::Usage(format!(
                "{flag}: translucent tiles have no rings of grout; drop it, or use opaque masks"
            )));
        }
        self.style = self.style.for_translucent_tiles();
        Ok(self)
    }

    /// The style.
    pub(super) fn style(&self) -> &Style {
        &self.style
    }

    /// When the search of so many flies ends.
    pub(super) fn budget(&self, fly_count: usize) -> Budget {
        Budget {
            evals: self.evals.unwrap_or(EVALS_PER_FLY * fly_count as u64),
            target_sae: self.target_sae,
            patience: self.patience,
        }
    }

    /// The grout of so many tiles.
    pub(super) fn grout(&self, target: &Target, fly_count: usize) -> Option<Grout> {
        self.grout.of(self.style.grout_q8, side_of(target, fly_count), target)
    }

    /// The colour behind the tiles, unless one is asked for.
    pub(super) fn ground(&self, target: &Target, grout: Option<Grout>) -> Rgb {
        match (self.style.ground, grout) {
            (Ground::Grout, Some(grout)) => grout.color,
            (Ground::Black | Ground::Grout, _) => [0; 3],
            (Ground::Mean, _) => grout::mean_color(target),
        }
    }

    /// The rules for a job whose flies wear the mask layers from `layers.0` on, `layers.1` of them.
    pub(super) fn rules(&self, job: &Job, layers: (u32, u32)) -> Rules {
        let side = side_of(&job.target, job.fly_count);
        let grout_color = job.grout.map_or([0; 3], |grout| grout.color);
        Rules {
            candidates: self.candidates,
            color: self.color,
            grout: job.grout.map_or(0, |grout| grout.width),
            grout_color: pack(grout_color),
            mask_first: layers.0,
            mask_count: layers.1,
            ..self.style.rules(self.seed, (side, job.fly_count), job.background, grout_color)
        }
    }

    /// The guide of so many tiles.
    pub(super) fn guide(&self, target: &Target, fly_count: usize) -> Guide {
        match self.style.guide {
            GuideKind::Edges => guide::sharp(target),
            GuideKind::Flow { smoothing_q8, size_strength_q8 } => {
                let tile_side = side_of(target, fly_count);
                let smoothing = ((u64::from(tile_side) * u64::from(smoothing_q8)) >> 8) as u32;
                guide::flowing(target, &Flow { tile_side, smoothing, size_strength_q8, weights: target.weights() })
            }
        }
    }

    /// What decides the result beyond what does in every scheme.
    pub(super) fn decisive(&self, job: &Job) -> Map<String, Value> {
        let Budget { evals, target_sae, patience } = self.budget(job.fly_count);
        let hexadecimal = |color: Rgb| super::provenance::hexadecimal(&color);
        let grout = job.grout.map(|grout| json!({"width": grout.width, "color": hexadecimal(grout.color)}));
        let told = json!({
            "algorithm": CELLS_VERSION,
            "scheme": "cells",
            "seed": self.seed,
            "evals_planned": evals,
            "candidates": self.candidates,
            "patience": patience,
            "target_sae": target_sae,
            "color_mode": color_name(self.color),
            "style": style_told(&self.style),
            "grout_ring": grout,
            "mask_layers": job.dress.as_ref().map(|dress| &dress.layers_by_run),
        });
        let mut told = if let Value::Object(told) = told { told } else { Map::new() };
        // Given flies are held to the colours themselves, of which the target need not show all.
        if let Some(palette) = &job.palette {
            let colors: Vec<String> = palette.colors().iter().map(|&color| hexadecimal(color)).collect();
            told.insert("palette".to_owned(), colors.into());
        }
        told
    }

    /// What differs from the defaults, for people.
    pub(super) fn told(&self, job: &Job) -> Vec<String> {
        let worn = |style: Style| match job.masks().blend() {
            Blend::Opaque => style,
            Blend::Translucent => style.for_translucent_tiles(),
        };
        let style = Style::NAMES.into_iter().find(|name| Style::named(name).map(worn).as_ref() == Some(&self.style));
        let grout = job.grout.map(|grout| {
            let color = crate::model::target::hexadecimal(grout.color);
            format!("grout of {:.2} px in {color}", f64::from(grout.width) / 64.0)
        });
        let parts = [
            (self.style != Style::free(), format!("style {}", style.unwrap_or("of one's own"))),
            (grout.is_some(), grout.unwrap_or_default()),
            (self.candidates != 1, format!("the best of {} children a step", self.candidates)),
            (self.color != ColorSource::Median, format!("colours by {}", color_name(self.color))),
        ];
        parts.into_iter().filter(|(differs, _)| *differs).map(|(_, part)| part).collect()
    }
}

/// The mean side of so many tiles in 1/64 px.
fn side_of(target: &Target, fly_count: usize) -> u32 {
    tile_side(target.width_px(), target.height_px(), fly_count)
}

/// The numbers of a style, so that another number is another key; what it says of grout, ground and masks is told as it
/// came out.
fn style_told(style: &Style) -> Value {
    let classes: Vec<[u32; 3]> =
        style.classes.iter().map(|class| [class.share_q16, class.scale_q8, class.first_round]).collect();
    let guide = match style.guide {
        GuideKind::Edges => Value::Null,
        GuideKind::Flow { smoothing_q8, size_strength_q8 } => json!([smoothing_q8, size_strength_q8]),
    };
    json!({
        "side_q8": [style.side_min_q8, style.side_max_q8],
        "aspect_q8": style.aspect_max_q8,
        "birth_side_q8": [style.birth_min_q8, style.birth_max_q8],
        "is_stroke": style.is_stroke,
        "overlap": style.overlap,
        "hole": style.hole,
        "turn": style.turn,
        "angle_spread": style.angle_spread,
        "coherence": style.coherence,
        "recolor_q16": style.recolor_q16,
        "flow_q8": guide,
        "classes": classes,
    })
}

/// Where colours come from. The target's own pixels are the only ones that surely are of its palette.
fn color_source(args: &PictureArgs) -> Result<ColorSource> {
    let source = match args.color_mode {
        None if args.palette.is_some() => ColorSource::Pick,
        None | Some(ColorModeName::Median) => ColorSource::Median,
        Some(ColorModeName::Mean) => ColorSource::Mean,
        Some(ColorModeName::Pick) => ColorSource::Pick,
        Some(ColorModeName::Evolved) => ColorSource::Evolved,
    };
    if args.palette.is_some() && source != ColorSource::Pick {
        let sentence = "--palette: --scheme cells holds tiles to a palette only with --color-mode pick; drop the mode, or \
                        use --scheme paper";
        return Err(Error::Usage(sentence.to_owned()));
    }
    Ok(source)
}

fn color_name(color: ColorSource) -> &'static str {
    match color {
        ColorSource::Median => "median",
        ColorSource::Mean => "mean",
        ColorSource::Pick => "pick",
        ColorSource::Evolved => "evolved",
    }
}
