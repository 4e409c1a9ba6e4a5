//! A preset of the user's own: a TOML file with a style to begin from, what of it is different, and other options.
//!
//! Lengths are multiples of d, the mean side of a tile, as in [`crate::evolve::style`], here with decimals. Flags of the
//! command line go before what the file says.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{Deserializer, Error as _};

use super::GroutColor;
use crate::app::advice;
use crate::app::look::BlendName;
use crate::app::options::in_range;
use crate::app::picture::PictureArgs;
use crate::app::presets;
use crate::app::scheme::ColorModeName;
use crate::app::values;
use crate::error::{Error, Result};
use crate::evolve::style::{ClassStyle, Ground, GuideKind, Style};
use crate::model::cells::rules::{CANDIDATES_MAX, CLASSES_MAX};
use crate::model::population::FLY_COUNT_MAX;
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::shapes::Shader;

/// Fixed-point one of lengths over d.
const ONE_Q8: f64 = 256.0;

/// Everything that a file may say.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(in crate::app) struct PresetFile {
    style: Typed<String>,
    tiles: Option<u64>,
    size: Option<u64>,
    evals: Option<u64>,
    candidates: Option<u64>,
    patience: Option<u64>,
    target_sae: Option<u64>,
    colors: Typed<values::ColorCount>,
    color_mode: Option<ColorModeName>,
    background: Typed<crate::model::Rgb>,
    masks: Vec<PathBuf>,
    shader: Typed<Shader>,
    blend: Option<BlendName>,
    opacity: Option<Opacity>,
    grout: Typed<GroutColor>,
    grout_width: Option<Length>,
    side: Option<[Length; 2]>,
    aspect: Option<Aspect>,
    birth_side: Option<[Length; 2]>,
    stroke: Option<bool>,
    ground: Option<GroundName>,
    overlap: Option<Cost>,
    hole: Option<Cost>,
    turn: Option<Cost>,
    angle_spread_deg: Option<Degrees>,
    coherence: Option<u8>,
    recolor: Option<Share>,
    guide: Option<GuideName>,
    smoothing: Option<Length>,
    size_strength: Option<Share>,
    classes: Vec<ClassFile>,
}

/// A part of the population with tiles of its own size.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct ClassFile {
    share: Share,
    scale: Scale,
    #[serde(default)]
    first_round: u16,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum GuideName {
    Edges,
    Flow,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum GroundName {
    Black,
    Mean,
    Grout,
}

/// What a flag of the command line takes as text; none if the file does not tell it.
#[derive(Clone, Debug)]
struct Typed<T>(Option<T>);

impl<T> Default for Typed<T> {
    fn default() -> Self {
        Self(None)
    }
}

/// A value that people type.
trait FromText: Sized {
    fn from_text(text: &str) -> Result<Self, String>;
}

impl FromText for String {
    fn from_text(text: &str) -> Result<Self, String> {
        presets::parse_style(text)
    }
}

impl FromText for values::ColorCount {
    fn from_text(text: &str) -> Result<Self, String> {
        values::color_count(text)
    }
}

impl FromText for crate::model::Rgb {
    fn from_text(text: &str) -> Result<Self, String> {
        values::color(text)
    }
}

impl FromText for Shader {
    fn from_text(text: &str) -> Result<Self, String> {
        text.parse().map_err(|error| advice::sentence(&error))
    }
}

impl FromText for GroutColor {
    fn from_text(text: &str) -> Result<Self, String> {
        super::grout_color(text)
    }
}

impl<'de, T: FromText> Deserialize<'de> for Typed<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        T::from_text(&text).map(|value| Self(Some(value))).map_err(D::Error::custom)
    }
}

/// A number between bounds, in units of 1/`SCALE`.
fn bounded<'de, D: Deserializer<'de>>(deserializer: D, (least, most): (f64, f64), scale: f64) -> Result<u32, D::Error> {
    let number = f64::deserialize(deserializer)?;
    if (least..=most).contains(&number) {
        Ok((number * scale).round() as u32)
    } else {
        Err(D::Error::custom(format!("{number} is out of range, must be {least} to {most}")))
    }
}

macro_rules! number {
    ($(#[$doc:meta])* $name:ident, $bounds:expr, $scale:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        struct $name(u32);

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                bounded(deserializer, $bounds, $scale).map(Self)
            }
        }
    };
}

number!(
    /// A length over d, or a ratio, in 1/256.
    Length,
    (0.0, 16.0),
    ONE_Q8
);
number!(
    /// The d of a class over d, in 1/256.
    Scale,
    (0.0, 8.0),
    ONE_Q8
);
number!(
    /// How many times the shorter side the longer one may be, in 1/256; 64 is any.
    Aspect,
    (1.0, 64.0),
    ONE_Q8
);
number!(
    /// A share of one, in 1/65,536.
    Share,
    (0.0, 1.0),
    65_536.0
);
number!(
    /// What a pixel costs, as an error of three channels would; the sums over a child must fit 32 bits.
    Cost,
    (0.0, 1_000.0),
    1.0
);
number!(
    /// An angle in 1/65,536 of a turn.
    Degrees,
    (0.0, 180.0),
    65_536.0 / 360.0
);

/// The opacity of whole tiles, 0.01 to 1.
#[derive(Clone, Copy, Debug)]
struct Opacity(f64);

impl<'de> Deserialize<'de> for Opacity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number = f64::deserialize(deserializer)?;
        let sentence = || D::Error::custom(format!("{number} is out of range, must be 0.01 to 1"));
        (0.01..=1.0).contains(&number).then_some(Self(number)).ok_or_else(sentence)
    }
}

impl PresetFile {
    /// Reads the file at `path`. Masks that are files lie beside it, unless their paths are absolute.
    ///
    /// # Errors
    /// [`Error::Input`] that names the line and what is allowed.
    pub(in crate::app) fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => Error::input(path, "there is no such file"),
            _ => Error::input(path, format!("cannot be read as text ({error})")),
        })?;
        let mut file: Self = toml::from_str(&text).map_err(|error| {
            let line = error.span().map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            let place = line.map_or(String::new(), |line| format!("line {line}: "));
            let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
            Error::input(path, format!("{place}{message}"))
        })?;
        file.check().map_err(|reason| Error::input(path, reason))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for mask in file.masks.iter_mut().filter(|mask| mask.extension().is_some()) {
            *mask = folder.join(&mask);
        }
        Ok(file)
    }

    /// Why the file cannot be followed, though each of its words can be read.
    fn check(&self) -> Result<(), String> {
        for (word, value, bounds) in [
            ("tiles", self.tiles, (1, FLY_COUNT_MAX as u64)),
            ("size", self.size, (1, u64::from(TARGET_SIDE_MAX_PX))),
            ("candidates", self.candidates, (1, u64::from(CANDIDATES_MAX))),
            ("patience", self.patience, (1, u64::MAX)),
        ] {
            if let Some(value) = value {
                in_range(&format!("{word} ="), value, bounds).map_err(|error| advice::sentence(&error))?;
            }
        }
        if self.classes.len() > CLASSES_MAX {
            return Err(format!("has {} classes, and at most {CLASSES_MAX} are possible", self.classes.len()));
        }
        if self.has_no_grout() && self.grout_width.is_some() {
            return Err("grout = \"none\" and grout-width contradict each other; drop one".to_owned());
        }
        if self.blend == Some(BlendName::Opaque) && self.opacity.is_some_and(|opacity| opacity.0 < 1.0) {
            return Err("an opacity below 1 needs blend = \"translucent\", or none".to_owned());
        }
        let style = self.style();
        for (word, low, high) in
            [("side", style.side_min_q8, style.side_max_q8), ("birth-side", style.birth_min_q8, style.birth_max_q8)]
        {
            if low > high {
                return Err(format!(
                    "{word}: the smallest must not be larger than the largest, as in {word} = [0.6, 1.6]"
                ));
            }
        }
        Ok(())
    }

    fn has_no_grout(&self) -> bool {
        matches!(self.grout.0, Some(GroutColor::None))
    }

    /// `args`, with what the file says where they say nothing.
    pub(in crate::app) fn fill(&self, mut args: PictureArgs) -> PictureArgs {
        if args.init.is_none() {
            args.tiles = args.tiles.or(self.tiles);
        }
        args.size = args.size.or(self.size);
        args.cells.evals = args.cells.evals.or(self.evals);
        args.cells.candidates = args.cells.candidates.or(self.candidates);
        args.patience = args.patience.or(self.patience);
        args.target_sae = args.target_sae.or(self.target_sae);
        if args.palette.is_none() {
            args.colors = args.colors.or(self.colors.0);
        }
        args.color_mode = args.color_mode.or(self.color_mode);
        args.background = args.background.or(self.background.0);
        if args.look.masks.is_empty() {
            args.look.masks.clone_from(&self.masks);
        }
        args.look.shader = args.look.shader.or(self.shader.0);
        // What a flag contradicts is as good as not told.
        let (blend, opacity) = (args.look.blend, args.look.opacity);
        if blend != Some(BlendName::Opaque) {
            args.look.opacity = opacity.or(self.opacity.map(|opacity| opacity.0));
        }
        if opacity.is_none_or(|opacity| opacity >= 1.0) {
            args.look.blend = blend.or(self.blend);
        }
        if args.cells.grout_width.is_none() || !self.has_no_grout() {
            args.cells.grout = args.cells.grout.or(self.grout.0);
        }
        args
    }

    /// The style that the file begins from, as it changes it.
    pub(super) fn style(&self) -> Style {
        let mut style = self.style.0.as_deref().and_then(Style::named).unwrap_or_else(Style::free);
        let set = |place: &mut u32, value: Option<u32>| *place = value.unwrap_or(*place);
        set(&mut style.side_min_q8, self.side.map(|[low, _]| low.0.max(1)));
        set(&mut style.side_max_q8, self.side.map(|[_, high]| high.0.max(1)));
        set(&mut style.birth_min_q8, self.birth_side.map(|[low, _]| low.0.max(1)));
        set(&mut style.birth_max_q8, self.birth_side.map(|[_, high]| high.0.max(1)));
        set(&mut style.aspect_max_q8, self.aspect.map(|aspect| aspect.0));
        set(&mut style.overlap, self.overlap.map(|cost| cost.0));
        set(&mut style.hole, self.hole.map(|cost| cost.0));
        set(&mut style.turn, self.turn.map(|cost| cost.0));
        set(&mut style.angle_spread, self.angle_spread_deg.map(|spread| spread.0));
        set(&mut style.coherence, self.coherence.map(u32::from));
        set(&mut style.grout_q8, self.grout_width.map(|width| width.0));
        set(&mut style.recolor_q16, self.recolor.map(|share| share.0));
        style.is_stroke = self.stroke.unwrap_or(style.is_stroke);
        style.ground = match self.ground {
            Some(GroundName::Black) => Ground::Black,
            Some(GroundName::Mean) => Ground::Mean,
            Some(GroundName::Grout) => Ground::Grout,
            None => style.ground,
        };
        let flow = match style.guide {
            GuideKind::Flow { smoothing_q8, size_strength_q8 } => (smoothing_q8, size_strength_q8),
            GuideKind::Edges => (ONE_Q8 as u32, 0),
        };
        let is_flow = match self.guide {
            Some(guide) => matches!(guide, GuideName::Flow),
            None => matches!(style.guide, GuideKind::Flow { .. }),
        };
        style.guide = if is_flow {
            GuideKind::Flow {
                smoothing_q8: self.smoothing.map_or(flow.0, |length| length.0),
                size_strength_q8: self.size_strength.map_or(flow.1, |share| share.0 >> 8),
            }
        } else {
            GuideKind::Edges
        };
        if !self.classes.is_empty() {
            let class = |class: &ClassFile| ClassStyle {
                share_q16: class.share.0,
                scale_q8: class.scale.0.max(1),
                first_round: u32::from(class.first_round),
            };
            style.classes = self.classes.iter().map(class).collect();
        }
        style
    }
}
