//! The settings of a search in cells: what it goes by once the picture is known, and what of that is in the key.

use serde_json::{Map, Value, json};

use super::choices::Colors;
use super::grout::{self, GroutChoice};
use super::hex::hexadecimal;
use super::parameters::contradiction;
use super::recipe::Recipe;
use crate::error::Result;
use crate::evolve::cells::{Budget, EVALS_PER_FLY};
use crate::evolve::style::{Ground, GuideKind, Style};
use crate::evolve::{ColorMode, Palette};
use crate::guide::{self, Flow};
use crate::model::cells::Rules;
use crate::model::cells::rules::ColorSource;
use crate::model::operators::tile_side;
use crate::model::tile::pack;
use crate::model::{Blend, Grout, Guide, Rgb, Target};

/// The neighbouring mask layers that newborn tiles wear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MaskLayers {
    pub first: u32,
    pub count: u32,
}

/// The tiles of a picture, as its settings and the picture make them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Laid<'a> {
    pub target: &'a Target,
    pub fly_count: usize,
    pub background: Rgb,
    pub grout: Option<Grout>,
    pub mask_layers: MaskLayers,
}

/// The grout of tiles of which nothing was asked, and of those that are only to have some.
pub(super) struct UsualGrout {
    pub of_style: Option<Grout>,
    pub if_asked: Option<Grout>,
}

/// What was asked for of a search, checked.
#[derive(Clone, Debug)]
pub(crate) struct CellsSettings {
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

impl CellsSettings {
    /// The settings of a recipe.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if parameters contradict each other.
    pub(super) fn new(recipe: &Recipe) -> Result<Self> {
        let (choices, numbers) = (&recipe.choices, &recipe.numbers);
        Ok(Self {
            seed: numbers.seed.unwrap_or(0),
            evals: numbers.evals,
            target_sae: numbers.target_sae,
            patience: numbers.patience,
            candidates: numbers.candidates.unwrap_or(1) as u32,
            color: color_source(choices.color_mode, choices.colors.as_ref())?,
            style: choices.style.clone().unwrap_or_else(Style::free),
            grout: GroutChoice::new(choices.grout, numbers.grout_width)?,
        })
    }

    /// These settings for translucent tiles: they leave out what the style says of grout, overlap and holes.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if grout was asked for.
    pub(super) fn for_translucent_tiles(mut self) -> Result<Self> {
        if let Some(name) = self.grout.asking_parameter() {
            return Err(contradiction(name, "translucent tiles have no rings of grout; drop it, or use opaque masks"));
        }
        self.style = self.style.for_translucent_tiles();
        Ok(self)
    }

    /// The style.
    pub(crate) fn style(&self) -> &Style {
        &self.style
    }

    /// When the search of so many flies ends.
    pub(crate) fn budget(&self, fly_count: usize) -> Budget {
        Budget {
            evals: self.evals.unwrap_or(EVALS_PER_FLY * fly_count as u64),
            target_sae: self.target_sae,
            patience: self.patience,
        }
    }

    /// The grout of so many tiles.
    pub(crate) fn grout(&self, target: &Target, fly_count: usize) -> Option<Grout> {
        self.grout.of(self.style.grout_q8, side_of(target, fly_count), target)
    }

    /// The grout of so many tiles if none were asked for.
    pub(super) fn usual_grout(&self, target: &Target, fly_count: usize) -> UsualGrout {
        let side = side_of(target, fly_count);
        UsualGrout {
            of_style: GroutChoice::default().of(self.style.grout_q8, side, target),
            if_asked: GroutChoice::auto().of(self.style.grout_q8, side, target),
        }
    }

    /// Children that are tried in each step.
    pub(super) fn candidates(&self) -> u32 {
        self.candidates
    }

    /// Where colours come from.
    pub(super) fn color(&self) -> ColorSource {
        self.color
    }

    /// The colour behind the tiles, unless one is asked for.
    pub(crate) fn ground(&self, target: &Target, grout: Option<Grout>) -> Rgb {
        match (self.style.ground, grout) {
            (Ground::Grout, Some(grout)) => grout.color,
            (Ground::Black | Ground::Grout, _) => [0; 3],
            (Ground::Mean, _) => grout::mean_color(target),
        }
    }

    /// The rules of a search among these tiles.
    pub(crate) fn rules(&self, laid: &Laid<'_>) -> Rules {
        let side = side_of(laid.target, laid.fly_count);
        let grout_color = laid.grout.map_or([0; 3], |grout| grout.color);
        Rules {
            candidates: self.candidates,
            color: self.color,
            grout: laid.grout.map_or(0, |grout| grout.width),
            grout_color: pack(grout_color),
            mask_first: laid.mask_layers.first,
            mask_count: laid.mask_layers.count,
            ..self.style.rules(self.seed, side, laid.fly_count, laid.background, grout_color)
        }
    }

    /// The guide of so many tiles.
    pub(crate) fn guide(&self, target: &Target, fly_count: usize) -> Guide {
        match self.style.guide {
            GuideKind::Edges => guide::sharp(target),
            GuideKind::Flow { smoothing_q8, size_strength_q8 } => {
                let tile_side = side_of(target, fly_count);
                let smoothing = ((u64::from(tile_side) * u64::from(smoothing_q8)) >> 8) as u32;
                guide::flowing(target, &Flow { tile_side, smoothing, size_strength_q8, weights: target.weights() })
            }
        }
    }

    /// What decides the result beyond what does in every scheme; `layers_by_run` are those of the masks that were asked
    /// for.
    pub(super) fn decisive(
        &self,
        laid: &Laid<'_>,
        palette: Option<&Palette>,
        layers_by_run: Option<&Vec<Vec<u16>>>,
    ) -> Map<String, Value> {
        let Budget { evals, target_sae, patience } = self.budget(laid.fly_count);
        let grout = laid.grout.map(|grout| json!({"width": grout.width, "color": hexadecimal(&grout.color)}));
        let told = json!({
            "scheme": "cells",
            "seed": self.seed,
            "evals_planned": evals,
            "candidates": self.candidates,
            "patience": patience,
            "target_sae": target_sae,
            "color_mode": color_name(self.color),
            "style": style_told(&self.style),
            "grout_ring": grout,
            "mask_layers": layers_by_run,
        });
        let mut told = if let Value::Object(told) = told { told } else { Map::new() };
        // Given flies are held to the colours themselves, of which the target need not show all.
        if let Some(palette) = palette {
            let colors: Vec<String> = palette.colors().iter().map(|color| hexadecimal(color)).collect();
            told.insert("palette".to_owned(), colors.into());
        }
        told
    }

    /// What differs from the defaults, for people.
    pub(super) fn told(&self, grout: Option<Grout>, blend: Blend) -> Vec<String> {
        let worn = |style: Style| match blend {
            Blend::Opaque => style,
            Blend::Translucent => style.for_translucent_tiles(),
        };
        let style = Style::NAMES.into_iter().find(|name| Style::named(name).map(worn).as_ref() == Some(&self.style));
        let grout = grout.map(|grout| {
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
/// came out. Every field is named, so that a new one does not compile until it is told or left out on purpose.
fn style_told(style: &Style) -> Value {
    let Style {
        side_min_q8,
        side_max_q8,
        aspect_max_q8,
        birth_min_q8,
        birth_max_q8,
        is_stroke,
        overlap,
        hole,
        turn,
        angle_spread,
        coherence,
        guide,
        classes,
        recolor_q16,
        ground: _,
        grout_q8: _,
        masks: _,
        shader: _,
        blend: _,
        opacity: _,
    } = style;
    let classes: Vec<[u32; 3]> =
        classes.iter().map(|class| [class.share_q16, class.scale_q8, class.first_round]).collect();
    let guide = match guide {
        GuideKind::Edges => Value::Null,
        GuideKind::Flow { smoothing_q8, size_strength_q8 } => json!([smoothing_q8, size_strength_q8]),
    };
    json!({
        "side_q8": [side_min_q8, side_max_q8],
        "aspect_q8": aspect_max_q8,
        "birth_side_q8": [birth_min_q8, birth_max_q8],
        "is_stroke": is_stroke,
        "overlap": overlap,
        "hole": hole,
        "turn": turn,
        "angle_spread": angle_spread,
        "coherence": coherence,
        "recolor_q16": recolor_q16,
        "flow_q8": guide,
        "classes": classes,
    })
}

/// Where colours come from. The target's own pixels are the only ones that surely are of its palette.
fn color_source(mode: Option<ColorMode>, colors: Option<&Colors>) -> Result<ColorSource> {
    let has_palette = matches!(colors, Some(Colors::Palette(_)));
    let source = match mode {
        None if has_palette => ColorSource::Pick,
        None | Some(ColorMode::Median) => ColorSource::Median,
        Some(ColorMode::Mean) => ColorSource::Mean,
        Some(ColorMode::Pick) => ColorSource::Pick,
        Some(ColorMode::Evolved) => ColorSource::Evolved,
    };
    if has_palette && source != ColorSource::Pick {
        let reason =
            "`scheme` cells holds tiles to a palette only with `color_mode` pick; drop the mode, or use `scheme` paper";
        return Err(contradiction("palette", reason));
    }
    Ok(source)
}

pub(super) fn color_name(color: ColorSource) -> &'static str {
    match color {
        ColorSource::Median => "median",
        ColorSource::Mean => "mean",
        ColorSource::Pick => "pick",
        ColorSource::Evolved => "evolved",
    }
}
