//! The settings of a recipe: every parameter checked against the others, every default filled in that needs no picture.

use std::path::Path;
use std::time::Duration;

use super::cells::CellsSettings;
use super::choices::{Choices, Colors, GroutColor, InitSource, PaletteSource, Scheme, WeightSource};
use super::look::{Look, LookChoices};
use super::paper::paper_scheme;
use super::parameters::contradiction;
use super::recipe::Recipe;
use crate::error::Result;
use crate::evolve::PaperScheme;
use crate::model::{Backdrop, Blend};
use crate::photo::CutShort;

/// Longer side in px that pictures are reduced to.
pub(crate) const LONG_SIDE_PX: u64 = 512;

/// How to evolve.
#[derive(Clone, Debug)]
pub(crate) enum SchemeSettings {
    Cells(CellsSettings),
    Paper(PaperScheme),
}

impl SchemeSettings {
    /// Which it is.
    pub(crate) fn name(&self) -> Scheme {
        match self {
            Self::Cells(_) => Scheme::Cells,
            Self::Paper(_) => Scheme::Paper,
        }
    }

    /// The number that decides every random choice.
    pub(crate) fn seed(&self) -> u64 {
        match self {
            Self::Cells(cells) => cells.seed,
            Self::Paper(scheme) => scheme.seed,
        }
    }

    /// Children that are evaluated if nothing ends the work before; in the paper's scheme each is a birth.
    pub(crate) fn evals_planned(&self, fly_count: usize) -> u64 {
        match self {
            Self::Cells(cells) => cells.budget(fly_count).evals,
            Self::Paper(scheme) => scheme.births.saturating_mul(u64::from(scheme.restarts) + 1),
        }
    }
}

/// A recipe that was checked.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub scheme: SchemeSettings,
    pub look: Look,
    pub colors: Colors,
    /// Number of flies; `None` leaves it to the picture's size, or to `init`.
    pub fly_count: Option<usize>,
    /// Longer side in px that the picture is reduced to.
    pub long_side_px: u32,
    /// `None` means the one of `init`, else that of the style.
    pub background: Option<Backdrop>,
    pub weight: Option<WeightSource>,
    pub init: Option<InitSource>,
    /// What is done about pictures that end too early.
    pub cut_short: CutShort,
    /// Whoever drives the work ends it after this time. It is in the key, since it decides the result.
    pub time_limit: Option<Duration>,
}

impl Settings {
    /// The settings of a recipe.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] about the first value that was refused, or if parameters contradict each other.
    pub(crate) fn new(recipe: &Recipe) -> Result<Self> {
        if let Some(fault) = recipe.fault() {
            return Err(fault.clone());
        }
        recipe.check_scheme_knows()?;
        let (choices, numbers) = (&recipe.choices, &recipe.numbers);
        let preset = choices.paper_preset.filter(|_| recipe.scheme_chosen() == Scheme::Paper);
        let scheme = match recipe.scheme_chosen() {
            Scheme::Cells => SchemeSettings::Cells(CellsSettings::new(recipe)?),
            Scheme::Paper => SchemeSettings::Paper(paper_scheme(recipe)?),
        };
        let look = LookChoices {
            masks: choices.masks.clone(),
            shader: choices.shader,
            blend: choices.blend,
            opacity: numbers.opacity,
        };
        let styled = match &scheme {
            SchemeSettings::Cells(cells) => look.or_style(cells.style())?,
            SchemeSettings::Paper(_) => look,
        };
        let look = Look::new(&styled, &choices.restart_masks, preset)?;
        let restarts = if let SchemeSettings::Paper(scheme) = &scheme { scheme.restarts } else { 0 };
        if look.changes_at_restart() && restarts == 0 {
            return Err(if choices.restart_masks.is_empty() {
                contradiction("restarts", "this preset changes its masks at a restart; drop `restarts` 0")
            } else {
                contradiction("restart_mask", "needs a restart; add `restarts`")
            });
        }
        let colors = choices.colors.clone();
        let of_preset = || preset.and_then(|preset| preset.color_count).map_or(Colors::Full, Colors::Few);
        let preset_side = preset.map(|preset| u64::from(preset.side_px));
        Ok(Self {
            scheme,
            look,
            colors: colors.unwrap_or_else(of_preset),
            fly_count: numbers.tiles.map(|count| count as usize),
            long_side_px: numbers.size.or(preset_side).unwrap_or(LONG_SIDE_PX) as u32,
            background: choices.background,
            weight: choices.weight.clone(),
            init: choices.init.clone(),
            cut_short: if choices.lenient { CutShort::Take } else { CutShort::Refuse },
            time_limit: None,
        })
    }

    /// The file of the map of weights, if there is one.
    pub(crate) fn weight_file(&self) -> Option<&Path> {
        if let Some(WeightSource::File(path)) = &self.weight { Some(path) } else { None }
    }

    /// The file of the population to begin with, if there is one.
    pub(crate) fn init_file(&self) -> Option<&Path> {
        if let Some(InitSource::File(path)) = &self.init { Some(path) } else { None }
    }

    /// The files that are read besides the picture: map, population, palette and masks. The name of a mask that is
    /// built in is the name of no file.
    pub(crate) fn files_read(&self) -> impl Iterator<Item = &Path> {
        let palette =
            if let Colors::Palette(PaletteSource::File(path)) = &self.colors { Some(path.as_path()) } else { None };
        let masks = self.look.mask_paths().filter(|name| name.exists());
        self.weight_file().into_iter().chain(self.init_file()).chain(palette).chain(masks)
    }

    /// Whether transparent pixels of the picture stay so: the paper knows only opaque pictures, and a colour that was
    /// asked for is meant to show.
    pub(super) fn keeps_transparency(&self) -> bool {
        matches!(self.scheme, SchemeSettings::Cells(_)) && !matches!(self.background, Some(Backdrop::Color(_)))
    }
}

impl Recipe {
    /// Checks all parameters, as far as that needs no picture.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] about the first value that was out of range, or about parameters that contradict
    /// each other.
    pub fn check(&self) -> Result<()> {
        Settings::new(self).map(|_| ())
    }

    /// This recipe, with what `preset` says where it says nothing. What it contradicts counts as not said.
    #[must_use]
    pub fn over(mut self, preset: &Self) -> Self {
        let (own, other) = (&mut self.choices, &preset.choices);
        let (mut of_own, mut of_other) = (self.numbers, preset.numbers);
        if own.init.is_some() {
            of_other.tiles = None;
        }
        if own.blend == Some(Blend::Opaque) {
            of_other.opacity = None;
        }
        let blends = of_own.opacity.is_none_or(|opacity| opacity >= 1.0);
        let has_grout = of_own.grout_width.is_none() || other.grout != Some(GroutColor::None);
        of_own = of_own.or(of_other);
        let Choices { style, colors, color_mode, background, masks, shader, blend, grout, .. } = other.clone();
        own.paper_preset = own.paper_preset.or(other.paper_preset);
        own.style = own.style.take().or(style);
        own.colors = own.colors.take().or(colors);
        own.color_mode = own.color_mode.or(color_mode);
        own.background = own.background.or(background);
        if own.masks.is_empty() {
            own.masks = masks;
        }
        own.shader = own.shader.or(shader);
        own.blend = own.blend.or(blend.filter(|_| blends));
        own.grout = own.grout.or(grout.filter(|_| has_grout));
        self.numbers = of_own;
        self
    }
}
