//! What to make of a picture: scheme or style, number of tiles, budget, masks, colours. Every value is checked when it
//! is set; what is not set has a default, which may depend on the picture.

use std::path::PathBuf;
use std::sync::Arc;

use super::choices::{Choices, Colors, GroutColor, InitSource, PaletteSource, Scheme, WeightSource};
use super::look::Mask;
use super::parameters::{contradiction, in_range, real_in_range};
use super::presets::PaperPreset;
use crate::error::{Error, Result};
use crate::evolve::scheme::MITOSIS_MAX;
use crate::evolve::style::Style;
use crate::evolve::{ColorMode, OnDry};
use crate::model::cells::rules::CANDIDATES_MAX;
use crate::model::population::FLY_COUNT_MAX;
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::model::{Backdrop, Blend, Population, Rgb};
use crate::photo::COLOR_COUNT_MAX;
use crate::shapes::Shader;

/// What a picture is to become.
///
/// The methods may be called in any order and take the values of the parameters of the same names; [`Recipe::check`]
/// and everything that makes a picture refuse the first value that was out of range, and values that contradict each
/// other. A recipe knows no picture and may serve many. The same recipe makes the same bytes of the same picture, on
/// every device and with any number of threads.
///
/// ```
/// let recipe = smalti::Recipe::mosaic().tiles(3_000).seed(7).grout_width(1.5);
/// assert!(recipe.check().is_ok());
/// let error = smalti::Recipe::new().tiles(0).check().unwrap_err();
/// assert_eq!(error.to_string(), "tiles 0: must be 1 to 1000000");
/// ```
#[derive(Clone, Debug, Default)]
pub struct Recipe {
    pub(crate) choices: Choices,
    pub(crate) numbers: Numbers,
    fault: Option<Error>,
}

/// Numbers, each with its bounds: fields of [`Numbers`] and methods of [`Recipe`] of the same names.
macro_rules! numbers {
    (
        whole { $($(#[$whole_doc:meta])* $whole:ident, $least:expr, $most:expr;)* }
        real { $($(#[$real_doc:meta])* $real:ident, $low:expr, $high:expr, $unit:expr;)* }
    ) => {
        /// The numbers that were set.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub(crate) struct Numbers {
            $(pub $whole: Option<u64>,)*
            $(pub $real: Option<f64>,)*
        }

        impl Numbers {
            /// These numbers, and where there is none, that of `other`.
            pub(crate) fn or(self, other: Self) -> Self {
                Self { $($whole: self.$whole.or(other.$whole),)* $($real: self.$real.or(other.$real),)* }
            }

            /// The first of the named numbers that is set.
            pub(super) fn first_set(&self, names: &[&'static str]) -> Option<&'static str> {
                let set = [$((stringify!($whole), self.$whole.is_some()),)* $((stringify!($real), self.$real.is_some()),)*];
                set.into_iter().find(|(name, is_set)| *is_set && names.contains(name)).map(|(name, _)| name)
            }
        }

        impl Recipe {
            $(
                $(#[$whole_doc])*
                #[must_use]
                pub fn $whole(mut self, value: u64) -> Self {
                    match in_range(stringify!($whole), value, $least..=$most) {
                        Ok(value) => self.numbers.$whole = Some(value),
                        Err(error) => self.refuse(error),
                    }
                    self
                }
            )*
            $(
                $(#[$real_doc])*
                #[must_use]
                pub fn $real(mut self, value: f64) -> Self {
                    match real_in_range(stringify!($real), value, $low..=$high, $unit) {
                        Ok(value) => self.numbers.$real = Some(value),
                        Err(error) => self.refuse(error),
                    }
                    self
                }
            )*
        }
    };
}

numbers! {
    whole {
        /// Number of tiles, 1 to 1,000,000. By default 2500 * sqrt(width * height) / 256, rounded (the paper's Table
        /// 2).
        tiles, 1, FLY_COUNT_MAX as u64;
        /// Longer side in px that the picture is reduced to before it is evolved, 1 to 65,535; never enlarged. By
        /// default 512, or as the preset has it. A search takes about 200 bytes of memory for each pixel, 350 with
        /// translucent tiles.
        size, 1, u64::from(TARGET_SIDE_MAX_PX);
        /// The number that decides every random choice. By default 0.
        seed, 0, u64::MAX;
        /// Ends a search in cells after so many children were evaluated. By default 400 for each tile.
        evals, 0, u64::MAX;
        /// Children that a search in cells tries in each step, 1 to 64, of which the best one counts; more is faster on
        /// a GPU. By default 1.
        candidates, 1, u64::from(CANDIDATES_MAX);
        /// Ends the work once the SAE is at most this. By default never.
        target_sae, 0, u64::MAX;
        /// Ends a search in cells after so many evals in which the error fell by less than a thousandth, and a run of
        /// the paper's scheme after so many births without improvement; at least 1. By default never.
        patience, 1, u64::MAX;
        /// Births of each run of the paper's scheme. By default 40,000 (Table 2).
        births, 0, u64::MAX;
        /// Births of the paper's scheme that are evaluated together, 1 to the number of tiles; 1, the default, is the
        /// published algorithm.
        batch_births, 1, FLY_COUNT_MAX as u64;
        /// Further runs of the paper's scheme, each from the best population so far, 0 to 1,000,000. By default 0, or
        /// as the preset has it.
        restarts, 0, 1_000_000;
        /// Begin the paper's scheme with N / 2^M tiles, each of which splits in two at each of the first M restarts, 0
        /// to 20. By default 0.
        mitosis, 0, u64::from(MITOSIS_MAX);
    }
    real {
        /// Width of the grout in px of the evolved picture, 0.02 to 64. By default that of the style, or a 16th of a
        /// tile's side where a colour of grout is asked for.
        grout_width, 0.02, 64.0, " px; `grout` none leaves it out";
        /// Opacity of whole tiles, 0.01 to 1. By default that of the style, or 1.
        opacity, 0.01, 1.0, "";
        /// Factor of all mutation steps of the paper's scheme at each restart, 0.00001 to 1. By default 1.
        cool, 0.00001, 1.0, "";
        /// Probability that a child of the paper's scheme mutates, 0 to 1. By default 1.
        p_mutation, 0.0, 1.0, "";
        /// Probability that a child of the paper's scheme is crossed from two good flies, 0 to 1. By default 0.
        p_crossover, 0.0, 1.0, "";
        /// Probability that a fresh random fly is born in the paper's scheme instead of a child, 0 to 1. By default 0.
        new_blood, 0.0, 1.0, "";
        /// First sides of the paper's scheme over those of its Eq. 1, 0.1 to 100. By default 1.
        tile_scale, 0.1, 100.0, "";
    }
}

impl Recipe {
    /// The closest likeness: a search in cells with tiles of any shape (style `free`).
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Whole tiles in rows along the contours, with grout between them.
    #[must_use]
    pub fn mosaic() -> Self {
        Self::of_style(Style::mosaic())
    }

    /// Brush strokes along the contours, broad ones first.
    #[must_use]
    pub fn paint() -> Self {
        Self::of_style(Style::paint())
    }

    /// Soft translucent discs.
    #[must_use]
    pub fn spray() -> Self {
        Self::of_style(Style::spray())
    }

    /// The published Fly algorithm as it is in the paper's Table 2.
    #[must_use]
    pub fn paper() -> Self {
        Self::default().scheme(Scheme::Paper)
    }

    /// A recipe by its name: a style (`free`, `mosaic`, `paint`, `spray`), or one of the 12 schemes of the paper's
    /// Table 1 (`paper-1` to `paper-12`).
    ///
    /// # Errors
    /// [`Error::Parameter`] that lists the names.
    pub fn named(name: &str) -> Result<Self> {
        if let Some(style) = Style::named(name) {
            return Ok(Self::of_style(style));
        }
        let refusal = || {
            let styles = Style::NAMES.join(", ");
            Error::value(
                "preset",
                name,
                format!("there is no such preset; there are {styles}, and paper-1 to paper-12"),
            )
        };
        PaperPreset::named(name).map(Self::of_paper).ok_or_else(refusal)
    }

    pub(crate) fn of_style(style: Style) -> Self {
        Self { choices: Choices { style: Some(style), ..Choices::default() }, ..Self::default() }
    }

    pub(crate) fn of_paper(preset: PaperPreset) -> Self {
        Self { choices: Choices { paper_preset: Some(preset), ..Choices::default() }, ..Self::default() }
    }

    /// How to evolve. By default by a search in cells, or as the preset needs.
    #[must_use]
    pub fn scheme(mut self, scheme: Scheme) -> Self {
        self.choices.scheme = Some(scheme);
        self
    }

    /// Reduces the picture to at most so many colours, 1 to 256, before it is evolved.
    #[must_use]
    pub fn colors(mut self, count: usize) -> Self {
        match in_range("colors", count as u64, 1..=COLOR_COUNT_MAX as u64) {
            Ok(count) => self.choices.colors = Some(Colors::Few(count as usize)),
            Err(error) => self.refuse(error),
        }
        self
    }

    /// Holds picture and tiles to these colours, 1 to 256 of them.
    #[must_use]
    pub fn palette(mut self, colors: &[Rgb]) -> Self {
        match in_range("palette", colors.len() as u64, 1..=COLOR_COUNT_MAX as u64) {
            Ok(_) => self.choices.colors = Some(Colors::Palette(PaletteSource::Colors(colors.to_vec()))),
            Err(error) => self.refuse(error),
        }
        self
    }

    /// As [`Recipe::palette`], with the colours of a file: a GIMP palette, a JASC palette, lines of colours, or a
    /// picture. It is read when a picture is made.
    #[must_use]
    pub fn palette_file(mut self, path: impl Into<PathBuf>) -> Self {
        self.choices.colors = Some(Colors::Palette(PaletteSource::File(path.into())));
        self
    }

    /// Where the colour of a new tile comes from. By default the median of what it would show; in the paper's scheme it
    /// is evolved.
    #[must_use]
    pub fn color_mode(mut self, mode: ColorMode) -> Self {
        self.choices.color_mode = Some(mode);
        self
    }

    /// The colour behind the tiles and behind transparent pixels, or [`Backdrop::Transparent`]: then the mosaic is
    /// transparent where no tile is, which counts as black while it evolves. By default the colour is that of the
    /// population to begin with, else that of the style; and what is transparent stays so, but not in the paper's
    /// scheme.
    #[must_use]
    pub fn background(mut self, background: impl Into<Backdrop>) -> Self {
        self.choices.background = Some(background.into());
        self
    }

    /// Tells where likeness matters: a luma of 0 to 255 for every pixel of the fitted picture, row by row. An error
    /// counts 16 times as much where it is 255 as where it is 0.
    #[must_use]
    pub fn weight(mut self, luma: Vec<u8>) -> Self {
        self.choices.weight = Some(WeightSource::Luma(luma));
        self
    }

    /// As [`Recipe::weight`], with a map as the bytes of a picture file with the proportions of the picture.
    #[must_use]
    pub fn weight_encoded(mut self, bytes: Vec<u8>) -> Self {
        self.choices.weight = Some(WeightSource::Encoded(bytes));
        self
    }

    /// As [`Recipe::weight`], with a map from a picture file. It is read when a picture is made.
    #[must_use]
    pub fn weight_file(mut self, path: impl Into<PathBuf>) -> Self {
        self.choices.weight = Some(WeightSource::File(path.into()));
        self
    }

    /// Begins with these flies, which are of a picture of the same size; they also give the number of tiles.
    #[must_use]
    pub fn init(mut self, population: Population) -> Self {
        self.choices.init = Some(InitSource::Population(Arc::new(population)));
        self
    }

    /// As [`Recipe::init`], with the population of a .npz file. It is read when a picture is made.
    #[must_use]
    pub fn init_file(mut self, path: impl Into<PathBuf>) -> Self {
        self.choices.init = Some(InitSource::File(path.into()));
        self
    }

    /// The shapes that tiles wear, a mix if there are several. By default squares, or as the style has it.
    #[must_use]
    pub fn masks(mut self, masks: impl IntoIterator<Item = Mask>) -> Self {
        self.choices.masks = masks.into_iter().collect();
        self
    }

    /// The shapes that all tiles change to at the first restart of the paper's scheme.
    #[must_use]
    pub fn restart_masks(mut self, masks: impl IntoIterator<Item = Mask>) -> Self {
        self.choices.restart_masks = masks.into_iter().collect();
        self
    }

    /// What the drawing of a mask becomes. By default its own shading, or as the style has it.
    #[must_use]
    pub fn shader(mut self, shader: Shader) -> Self {
        self.choices.shader = Some(shader);
        self
    }

    /// Whether a mask's coverage cuts the tile out or is its opacity. By default as the style, the shader and the
    /// opacity need it.
    #[must_use]
    pub fn blend(mut self, blend: Blend) -> Self {
        self.choices.blend = Some(blend);
        self
    }

    /// The colour of the grout. By default [`GroutColor::Auto`] if the style has grout, else none.
    #[must_use]
    pub fn grout(mut self, color: GroutColor) -> Self {
        self.choices.grout = Some(color);
        self
    }

    /// What the paper's scheme does when no bad tile is found. By default the worse of two dies.
    #[must_use]
    pub fn on_dry(mut self, on_dry: OnDry) -> Self {
        self.choices.on_dry = Some(on_dry);
        self
    }

    /// Turns no tile of the paper's scheme: all angles are 0.
    #[must_use]
    pub fn no_rotation(mut self) -> Self {
        self.choices.no_rotation = true;
        self
    }

    /// Takes of files that are cut short what is there: of the map of weights, and of the picture where the recipe
    /// reads it. A picture in memory is opened before ([`super::Picture::open_lenient`]).
    #[must_use]
    pub fn lenient(mut self) -> Self {
        self.choices.lenient = true;
        self
    }

    /// Calls `set` with a value, if there is one.
    #[must_use]
    pub fn set<T>(self, value: Option<T>, set: impl FnOnce(Self, T) -> Self) -> Self {
        match value {
            Some(value) => set(self, value),
            None => self,
        }
    }

    /// The scheme: as it was set, or as the preset needs.
    #[must_use]
    pub fn scheme_chosen(&self) -> Scheme {
        let of_preset = if self.choices.paper_preset.is_some() { Scheme::Paper } else { Scheme::Cells };
        self.choices.scheme.unwrap_or(of_preset)
    }

    /// The first refusal of a value.
    pub(super) fn fault(&self) -> Option<&Error> {
        self.fault.as_ref()
    }

    /// Refuses parameters that the scheme does not have.
    pub(super) fn check_scheme_knows(&self) -> Result<()> {
        let Choices { weight, style, grout, on_dry, no_rotation, restart_masks, .. } = &self.choices;
        let numbers = &self.numbers;
        let this = self.scheme_chosen();
        if this == Scheme::Paper && weight.is_some() {
            return Err(contradiction("weight", "the paper's scheme weighs all pixels alike; use `scheme` cells"));
        }
        let (other, set) = match this {
            Scheme::Paper => {
                let named = [("style", style.is_some()), ("grout", grout.is_some())];
                (Scheme::Cells, named.into_iter().chain(set(numbers, &OF_CELLS)).find(|(_, is_set)| *is_set))
            }
            Scheme::Cells => {
                let masks = ("restart_mask", !restart_masks.is_empty());
                let named = [masks, ("on_dry", on_dry.is_some()), ("no_rotation", *no_rotation)];
                (Scheme::Paper, named.into_iter().chain(set(numbers, &OF_PAPER)).find(|(_, is_set)| *is_set))
            }
        };
        set.map_or(Ok(()), |(name, _)| {
            let reason = format!("only `scheme` {other} has it, and this is `scheme` {this}; drop one of them");
            Err(contradiction(name, reason))
        })
    }

    /// Notes a refusal; the first one counts.
    fn refuse(&mut self, error: Error) {
        self.fault.get_or_insert(error);
    }
}

/// Numbers that only a search in cells has.
const OF_CELLS: [&str; 3] = ["evals", "candidates", "grout_width"];
/// Numbers that only the paper's scheme has.
const OF_PAPER: [&str; 9] =
    ["births", "batch_births", "restarts", "cool", "p_mutation", "p_crossover", "new_blood", "mitosis", "tile_scale"];

/// Which of these numbers is set, if one is.
fn set(numbers: &Numbers, names: &[&'static str]) -> Option<(&'static str, bool)> {
    numbers.first_set(names).map(|name| (name, true))
}
