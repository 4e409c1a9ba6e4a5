//! A preset of the user's own: a TOML file with a style to begin from, what of it is different, and other parameters.
//!
//! Lengths are multiples of d, the mean side of a tile, as in [`crate::evolve::style`], here with decimals.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use serde_json::{Map, Value};

use super::choices::{Colors, GroutColor};
use super::look::{MASK_COUNT_MAX, Mask};
use super::parameters::in_range;
use super::recipe::Recipe;
use super::text_file::{SETTINGS_BYTES_MAX, read_text, toml_mistake};
use super::words;
use crate::error::{Error, Result};
use crate::evolve::ColorMode;
use crate::evolve::style::{ClassStyle, Ground, GuideKind, Style};
use crate::model::cells::rules::{CANDIDATES_MAX, CLASSES_MAX};
use crate::model::population::FLY_COUNT_MAX;
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::model::{Backdrop, Blend};
use crate::shapes::Shader;

/// Fixed-point one of lengths over d.
const ONE_Q8: f64 = 256.0;

/// Everything that a file may say.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct Preset {
    style: Typed<String>,
    tiles: Option<u64>,
    size: Option<u64>,
    evals: Option<u64>,
    candidates: Option<u64>,
    patience: Option<u64>,
    target_sae: Option<u64>,
    colors: Typed<Colors>,
    color_mode: Option<ColorModeName>,
    background: Typed<Backdrop>,
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

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ColorModeName {
    Evolved,
    Pick,
    Mean,
    Median,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum BlendName {
    Opaque,
    Translucent,
}

/// A value that is written as text; none if the file does not tell it.
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
        let name = text.trim().to_ascii_lowercase();
        let known = Style::named(&name).map(|_| name);
        known.ok_or_else(|| format!("there is no such style; there are {}", Style::NAMES.join(", ")))
    }
}

impl FromText for Colors {
    fn from_text(text: &str) -> Result<Self, String> {
        words::color_count(text)
    }
}

impl FromText for Backdrop {
    fn from_text(text: &str) -> Result<Self, String> {
        words::backdrop(text)
    }
}

impl FromText for Shader {
    fn from_text(text: &str) -> Result<Self, String> {
        text.parse().map_err(|error: Error| error.to_string())
    }
}

impl FromText for GroutColor {
    fn from_text(text: &str) -> Result<Self, String> {
        words::grout_color(text)
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

impl Preset {
    /// Reads the file at `path`. Masks that are files lie beside it, unless their paths are absolute.
    ///
    /// # Errors
    /// [`Error::Input`] that names the line and what is allowed.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = read_text(path, "a preset", SETTINGS_BYTES_MAX)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&text, folder).map_err(|reason| Error::input(path, reason))
    }

    /// Reads a preset; masks that are files lie in `folder`, unless their paths are absolute.
    fn parse(text: &str, folder: &Path) -> Result<Self, String> {
        let mut file: Self = toml::from_str(text).map_err(|error| toml_mistake(text, &error))?;
        file.check()?;
        for mask in file.masks.iter_mut().filter(|mask| mask.extension().is_some()) {
            *mask = folder.join(&mask);
        }
        Ok(file)
    }

    /// A preset of these words, whose masks are built in.
    pub(super) fn of_words(words: Map<String, Value>) -> Result<Self, String> {
        let preset = Self::deserialize(Value::Object(words)).map_err(|error| error.to_string())?;
        preset.check().map(|()| preset)
    }

    /// Why the file cannot be followed, though each of its words can be read.
    fn check(&self) -> Result<(), String> {
        for (word, value, bounds) in [
            ("tiles", self.tiles, 1..=FLY_COUNT_MAX as u64),
            ("size", self.size, 1..=u64::from(TARGET_SIDE_MAX_PX)),
            ("candidates", self.candidates, 1..=u64::from(CANDIDATES_MAX)),
            ("patience", self.patience, 1..=u64::MAX),
        ] {
            if let Some(value) = value {
                in_range(&format!("{word} ="), value, bounds).map_err(|error| error.to_string())?;
            }
        }
        if self.classes.len() > CLASSES_MAX {
            return Err(format!("has {} classes, and at most {CLASSES_MAX} are possible", self.classes.len()));
        }
        if self.masks.len() > MASK_COUNT_MAX {
            return Err(format!(
                "names {} masks, and at most {MASK_COUNT_MAX} are possible; drop some",
                self.masks.len()
            ));
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

    /// The recipe of the file.
    pub(crate) fn recipe(&self) -> Recipe {
        let mode = self.color_mode.map(|mode| match mode {
            ColorModeName::Evolved => ColorMode::Evolved,
            ColorModeName::Pick => ColorMode::Pick,
            ColorModeName::Mean => ColorMode::Mean,
            ColorModeName::Median => ColorMode::Median,
        });
        let blend = self.blend.map(|blend| match blend {
            BlendName::Opaque => Blend::Opaque,
            BlendName::Translucent => Blend::Translucent,
        });
        let mut recipe = Recipe::of_style(self.style())
            .set(self.tiles, Recipe::tiles)
            .set(self.size, Recipe::size)
            .set(self.evals, Recipe::evals)
            .set(self.candidates, Recipe::candidates)
            .set(self.patience, Recipe::patience)
            .set(self.target_sae, Recipe::target_sae)
            .set(mode, Recipe::color_mode)
            .set(self.background.0, Recipe::background)
            .set(self.shader.0, Recipe::shader)
            .set(blend, Recipe::blend)
            .set(self.opacity.map(|opacity| opacity.0), Recipe::opacity)
            .set(self.grout.0, Recipe::grout)
            .masks(self.masks.iter().map(Mask::named_or_file));
        recipe.choices.colors.clone_from(&self.colors.0);
        recipe
    }

    /// The style that the file begins from, as it changes it.
    fn style(&self) -> Style {
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

impl Recipe {
    /// A recipe from the text of a preset (docs/styles.md). Masks that are files are looked for in the current folder.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the line and what is allowed.
    pub fn from_toml(text: &str) -> Result<Self> {
        let preset = Preset::parse(text, Path::new(""));
        preset.map(|preset| preset.recipe()).map_err(|reason| Error::parameter("preset", reason))
    }

    /// A recipe from the preset file at `path` (docs/styles.md). Masks that are files lie beside it.
    ///
    /// # Errors
    /// [`Error::Input`] that names the line and what is allowed.
    pub fn from_preset_file(path: impl AsRef<Path>) -> Result<Self> {
        Preset::read(path.as_ref()).map(|preset| preset.recipe())
    }
}
