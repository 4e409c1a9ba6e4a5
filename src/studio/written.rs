//! A recipe as plain values that a file can hold: what a window sets, and a script keeps.
//!
//! Words are those of presets and flags, and mean the same. Files are not named but carried, so that what is written
//! needs nothing beside it.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value};

use super::choices::Scheme;
use super::look::Mask;
use super::parameters::{contradiction, wrong};
use super::preset::Preset;
use super::recipe::Recipe;
use super::words;
use crate::error::{Error, Result};
use crate::model::Rgb;
use crate::vector::base64;

/// A recipe as plain values; what is not set has its default. Everything is checked by [`WrittenRecipe::recipe`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct WrittenRecipe {
    /// `free`, `mosaic`, `paint` or `spray`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub style: Option<String>,
    /// What differs from the style.
    #[serde(skip_serializing_if = "WrittenBounds::is_default")]
    pub bounds: WrittenBounds,
    /// As [`Recipe::tiles`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles: Option<u64>,
    /// As [`Recipe::size`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<u64>,
    /// As [`Recipe::seed`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// As [`Recipe::evals`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evals: Option<u64>,
    /// As [`Recipe::candidates`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub candidates: Option<u64>,
    /// As [`Recipe::patience`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patience: Option<u64>,
    /// As [`Recipe::target_sae`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_sae: Option<u64>,
    /// As [`Recipe::colors`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colors: Option<u64>,
    /// As [`Recipe::palette`]: colours such as `ff8800`. Empty holds the tiles to none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub palette: Vec<String>,
    /// `evolved`, `pick`, `mean` or `median`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color_mode: Option<String>,
    /// `none`, or a colour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub background: Option<String>,
    /// The shapes of the tiles.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub masks: Vec<WrittenMask>,
    /// The name of a shader.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shader: Option<String>,
    /// `opaque` or `translucent`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blend: Option<String>,
    /// As [`Recipe::opacity`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opacity: Option<f64>,
    /// `none`, `auto`, or a colour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grout: Option<String>,
    /// As [`Recipe::grout_width`], in px.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grout_width: Option<f64>,
    /// The bytes of a picture file that tells where likeness matters, as [`Recipe::weight_encoded`]; base64 in a file.
    #[serde(skip_serializing_if = "Option::is_none", with = "optional_base64")]
    pub weight: Option<Vec<u8>>,
    /// `cells` or `paper`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scheme: Option<String>,
    /// As [`Recipe::births`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub births: Option<u64>,
    /// As [`Recipe::restarts`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub restarts: Option<u64>,
}

/// What of a style is different, in the words of a preset (docs/styles.md). Lengths are multiples of d, the mean side
/// of a tile.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct WrittenBounds {
    /// Shortest and longest side of a tile.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub side: Option<[f64; 2]>,
    /// How many times the shorter side the longer one may be, 1 to 64.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aspect: Option<f64>,
    /// Shortest and longest side of new tiles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub birth_side: Option<[f64; 2]>,
    /// Whether the longer side of a new tile lies along the guide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stroke: Option<bool>,
    /// What lies behind the tiles, unless a colour is asked for: `black`, `mean` or `grout`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground: Option<String>,
    /// What each further tile on a pixel costs, 0 to 1,000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlap: Option<f64>,
    /// What a pixel costs that no tile covers, 0 to 1,000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hole: Option<f64>,
    /// What each pixel of a tile costs that lies 45 degrees off the guide, 0 to 1,000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn: Option<f64>,
    /// Standard deviation of the angles of new tiles around the guide, in degrees, 0 to 180.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle_spread_deg: Option<f64>,
    /// From which certainty of the guide on new tiles follow it, 0 to 255.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coherence: Option<u8>,
    /// Chance that a changed tile is recoloured, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recolor: Option<f64>,
    /// `edges` or `flow`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guide: Option<String>,
    /// How far a flow is smoothed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smoothing: Option<f64>,
    /// How much smaller tiles are where there is detail, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_strength: Option<f64>,
    /// Width of the grout; [`WrittenRecipe::grout_width`] is in px, and overrides it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grout_width: Option<f64>,
    /// Parts of the population with tiles of their own sizes; empty leaves those of the style.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub classes: Vec<WrittenClass>,
}

/// A part of the population with tiles of its own size.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct WrittenClass {
    /// Its share of the tiles, 0 to 1.
    pub share: f64,
    /// Its d over that of the population, 0 to 8.
    pub scale: f64,
    /// The round in which its first tiles are born.
    #[serde(default)]
    pub first_round: u16,
}

/// The shape of tiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a mask is the name of a shape that comes with smalti, or has name, kind and bytes")]
pub enum WrittenMask {
    /// The name of a shape that comes with smalti.
    Named(String),
    /// The content of a file.
    Carried(CarriedMask),
}

/// A mask that is no shape of smalti's own: the content of its file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct CarriedMask {
    /// What people know it by; it decides nothing.
    pub name: String,
    /// What its bytes are.
    pub kind: MaskKind,
    /// The bytes of the file; base64 in a script.
    #[serde(with = "as_base64")]
    pub bytes: Vec<u8>,
}

/// What the bytes of a mask are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MaskKind {
    /// A drawing.
    Svg,
    /// A picture: a PNG, or another one that can be a mask.
    Png,
}

impl WrittenBounds {
    /// Whether all is as in the style.
    #[must_use]
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl WrittenMask {
    fn mask(&self) -> Result<Mask> {
        match self {
            Self::Named(name) => Mask::named(name),
            Self::Carried(CarriedMask { name, kind, bytes }) => match kind {
                MaskKind::Svg => Mask::from_svg(bytes),
                MaskKind::Png => Mask::from_encoded(bytes),
            }
            .map_err(|error| match error {
                Error::Parameter { reason, .. } => Error::value("mask", name, reason),
                other => other,
            }),
        }
    }
}

impl WrittenRecipe {
    /// The recipe.
    ///
    /// # Errors
    /// [`Error::Parameter`] about the first value that is wrong, or about values that contradict each other.
    pub fn recipe(&self) -> Result<Recipe> {
        if self.colors.is_some() && !self.palette.is_empty() {
            return Err(contradiction("colors", "the colours are those of `palette`; drop one of them"));
        }
        let preset = Preset::of_words(self.words()?).map_err(|reason| Error::parameter("recipe", reason))?;
        let palette: Vec<Rgb> = self
            .palette
            .iter()
            .map(|text| words::color(text).map_err(|reason| wrong("palette", text, reason)))
            .collect::<Result<_>>()?;
        let masks: Vec<Mask> = self.masks.iter().map(WrittenMask::mask).collect::<Result<_>>()?;
        let mut recipe = preset
            .recipe()
            .set(self.scheme()?, Recipe::scheme)
            .set(self.tiles, Recipe::tiles)
            .set(self.size, Recipe::size)
            .set(self.seed, Recipe::seed)
            .set(self.evals, Recipe::evals)
            .set(self.candidates, Recipe::candidates)
            .set(self.patience, Recipe::patience)
            .set(self.target_sae, Recipe::target_sae)
            .set(self.colors, |recipe, count| recipe.colors(usize::try_from(count).unwrap_or(usize::MAX)))
            .set((!palette.is_empty()).then_some(&palette), |recipe, palette| recipe.palette(palette))
            .set(self.opacity, Recipe::opacity)
            .set(self.grout_width, Recipe::grout_width)
            .set(self.weight.clone(), Recipe::weight_encoded)
            .set(self.births, Recipe::births)
            .set(self.restarts, Recipe::restarts)
            .masks(masks);
        if self.style.is_none() && self.bounds.is_default() {
            // Only one of the schemes has a style.
            recipe.choices.style = None;
        }
        recipe.check().map(|()| recipe)
    }

    /// The flags of `smalti evolve` that ask for the same, and lead to the same bytes; none if flags alone cannot say
    /// it: what differs from a style, colours of a palette, and files that are carried.
    #[must_use]
    pub fn flags(&self) -> Option<Vec<String>> {
        if !self.bounds.is_default() || !self.palette.is_empty() || self.weight.is_some() {
            return None;
        }
        let name = |mask: &WrittenMask| match mask {
            WrittenMask::Named(name) => Some(name.clone()),
            WrittenMask::Carried(_) => None,
        };
        let masks = self.masks.iter().map(name).collect::<Option<Vec<String>>>()?;
        let number = |value: Option<u64>| value.map(|value| value.to_string());
        let flags = [
            ("scheme", self.scheme.clone()),
            ("style", self.style.clone()),
            ("tiles", number(self.tiles)),
            ("size", number(self.size)),
            ("seed", number(self.seed)),
            ("evals", number(self.evals)),
            ("births", number(self.births)),
            ("restarts", number(self.restarts)),
            ("candidates", number(self.candidates)),
            ("patience", number(self.patience)),
            ("target-sae", number(self.target_sae)),
            ("colors", number(self.colors)),
            ("color-mode", self.color_mode.clone()),
            ("background", self.background.clone()),
            ("mask", (!masks.is_empty()).then(|| masks.join(","))),
            ("shader", self.shader.clone()),
            ("blend", self.blend.clone()),
            ("opacity", self.opacity.map(|opacity| opacity.to_string())),
            ("grout", self.grout.clone()),
            ("grout-width", self.grout_width.map(|width| width.to_string())),
        ];
        let set = flags.into_iter().filter_map(|(flag, value)| Some([format!("--{flag}"), value?]));
        Some(set.flatten().collect())
    }

    /// What of it a preset says in the same words.
    fn words(&self) -> Result<Map<String, Value>> {
        let bounds = serde_json::to_value(&self.bounds);
        let bounds = bounds.map_err(|error| Error::Internal(format!("bounds cannot be written, since {error}")))?;
        let mut words = if let Value::Object(words) = bounds { words } else { Map::new() };
        for (word, text) in [
            ("style", &self.style),
            ("color-mode", &self.color_mode),
            ("background", &self.background),
            ("shader", &self.shader),
            ("blend", &self.blend),
            ("grout", &self.grout),
        ] {
            if let Some(text) = text {
                words.insert(word.to_owned(), text.clone().into());
            }
        }
        Ok(words)
    }

    fn scheme(&self) -> Result<Option<Scheme>> {
        let scheme = |word: &String| {
            let known = [Scheme::Cells, Scheme::Paper].into_iter().find(|scheme| scheme.word() == word);
            known.ok_or_else(|| wrong("scheme", word, "there is no such scheme; there are cells and paper"))
        };
        self.scheme.as_ref().map(scheme).transpose()
    }
}

/// Bytes as base64.
mod as_base64 {
    use serde::de::Error as _;

    use super::{Deserialize as _, Deserializer, Serializer, base64};

    pub fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&base64::encode(bytes))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(deserializer)?;
        base64::decode(&text).ok_or_else(|| D::Error::custom("bytes that are not padded base64 in one line"))
    }
}

/// Bytes that may be absent as base64.
mod optional_base64 {
    use super::{Deserializer, Serializer, as_base64};

    pub fn serialize<S: Serializer>(bytes: &Option<Vec<u8>>, serializer: S) -> Result<S::Ok, S::Error> {
        match bytes {
            Some(bytes) => as_base64::serialize(bytes, serializer),
            None => serializer.serialize_none(),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<u8>>, D::Error> {
        as_base64::deserialize(deserializer).map(Some)
    }
}
