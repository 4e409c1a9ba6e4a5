//! The flags that decide a picture: how it is read, how its tiles look, and how it evolves. All commands that evolve
//! the user's pictures share them.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};

use super::cells::CellsArgs;
use super::look::{LookArgs, masks};
use super::paper::{ColorModeName, PaperSchemeArgs};
use super::preset::{self, PresetChoice};
use crate::cli::files::places;
use crate::cli::values;
use crate::error::{Error, Result};
use crate::evolve::style::Style;
use crate::evolve::{ColorMode, OnDry};
use crate::model::{Backdrop, Blend};
use crate::studio::{Colors, Preset, Recipe, Scheme, Settings, backdrop, color_count};

/// The flags.
#[derive(Clone, Debug, Args)]
pub(crate) struct PictureArgs {
    /// Longer side of the written picture, 1 to 65,535 px; the mosaic is drawn anew at that size [default: as evolved]
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Output")]
    pub output_size: Option<u64>,
    /// Number of tiles, 1 to 1,000,000 (suffixes k, M) [default: 2500 * sqrt(width * height) / 256, rounded]
    #[arg(short = 'n', long, value_name = "N", value_parser = values::count, help_heading = "Picture")]
    pub tiles: Option<u64>,
    /// Longer side that the picture is reduced to before it is evolved, 1 to 65,535 px; never enlarged [default: 512]
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Picture")]
    pub size: Option<u64>,
    /// Colours that the picture is reduced to before it is evolved: full, or 1 to 256 [default: full]
    #[arg(long, value_name = "K", value_parser = color_count, help_heading = "Picture", conflicts_with = "palette")]
    pub colors: Option<Colors>,
    /// Palette that picture and tiles are held to: .gpl, .pal, .hex (lines of RRGGBB), or the colours of a picture
    #[arg(long, value_name = "FILE", help_heading = "Picture")]
    pub palette: Option<PathBuf>,
    /// Colour behind the tiles and behind transparent pixels: black, white or RRGGBB; or none, and the mosaic is
    /// transparent where no tile is [default: as in --init or the style, or black; what is transparent stays so, but
    /// not with --scheme paper]
    #[arg(long, value_name = "COLOR", value_parser = backdrop, help_heading = "Picture")]
    pub background: Option<Backdrop>,
    /// Map that tells where likeness matters, a picture with the proportions of IN: an error counts 16 times as much
    /// where the map is white as where it is black [default: alike everywhere]
    #[arg(long, value_name = "MAP", help_heading = "Picture")]
    pub weight: Option<PathBuf>,
    /// Take of a picture that is cut short what is there, with a warning
    #[arg(long, help_heading = "Picture")]
    pub lenient: bool,
    /// Population to begin with, a .npz file of the same picture size; it also gives the number of tiles
    #[arg(long, value_name = "POP.npz", help_heading = "Picture", conflicts_with = "tiles")]
    pub init: Option<PathBuf>,

    #[command(flatten)]
    pub look: LookArgs,

    /// How to evolve: `cells` comes closest by far, `paper` is the published Fly algorithm [default: cells, or as
    /// --preset needs]
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Evolution")]
    pub scheme: Option<SchemeName>,
    /// What other options begin from and change parts of: one of the paper's 12 schemes (Table 1), paper-1 to paper-12;
    /// a style; or a file of your own that ends in .toml
    #[arg(long, value_name = "NAME|FILE", value_parser = preset::parse, help_heading = "Evolution")]
    pub preset: Option<PresetChoice>,
    /// Where the colour of a new tile comes from [default: median, or evolved with --scheme paper]
    #[arg(long, value_enum, value_name = "MODE", help_heading = "Evolution")]
    pub color_mode: Option<ColorModeName>,
    /// Stop once the sum of absolute errors is at most this (suffixes k, M) [default: never]
    #[arg(long, value_name = "S", value_parser = values::count, help_heading = "Evolution")]
    pub target_sae: Option<u64>,
    /// Stop after this many evals in which the error fell by less than a thousandth, at least 1 (suffixes k, M); with
    /// --scheme paper, end a run after this many births without improvement [default: never]
    #[arg(long, value_name = "E", value_parser = values::count, help_heading = "Evolution")]
    pub patience: Option<u64>,
    /// Stop after this time even if evals are left: 90, 30s, 2m, 1h30m [default: never]
    #[arg(long, value_name = "TIME", value_parser = values::duration, help_heading = "Evolution")]
    pub time: Option<Duration>,
    /// Number that decides every random choice
    #[arg(long, value_name = "S", value_parser = values::seed, default_value_t = 0, help_heading = "Evolution")]
    pub seed: u64,
    #[command(flatten)]
    pub cells: CellsArgs,
    #[command(flatten)]
    pub paper: PaperSchemeArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SchemeName {
    Cells,
    Paper,
}

impl From<SchemeName> for Scheme {
    fn from(name: SchemeName) -> Self {
        match name {
            SchemeName::Cells => Self::Cells,
            SchemeName::Paper => Self::Paper,
        }
    }
}

impl PictureArgs {
    /// The scheme: the one that was named, or else the one that the preset needs.
    pub(crate) fn scheme(&self) -> Scheme {
        let of_paper = matches!(self.preset, Some(PresetChoice::Paper(_)));
        self.scheme.map_or(if of_paper { Scheme::Paper } else { Scheme::Cells }, Scheme::from)
    }

    /// The settings that the flags ask for.
    ///
    /// # Errors
    /// [`Error::Parameter`] or [`Error::Usage`] that names the flag and what it may be; [`Error::Input`] about a preset
    /// file.
    pub(crate) fn settings(&self) -> Result<Settings> {
        let recipe = self.recipe();
        let (this, preset) = (self.scheme(), self.preset.as_ref());
        let other = match (this, preset) {
            (Scheme::Cells, Some(PresetChoice::Paper(_))) => Some(Scheme::Paper),
            (Scheme::Paper, Some(PresetChoice::Style(_) | PresetChoice::File(_))) => Some(Scheme::Cells),
            _ => None,
        };
        if let (Some(other), Some(preset)) = (other, preset) {
            return Err(Error::Usage(format!(
                "--preset {preset}: only --scheme {other} has it, and this is --scheme {this}; drop one of them"
            )));
        }
        let recipe = match preset {
            Some(PresetChoice::File(path)) => {
                places::note_flags_read(path);
                recipe.over(&Preset::read(path)?.recipe())
            }
            _ => recipe,
        };
        Ok(Settings { time_limit: self.time, ..Settings::new(&recipe)? })
    }

    /// The flags as a recipe, without those of a preset file.
    fn recipe(&self) -> Recipe {
        let Self { look, cells, paper, .. } = self;
        let begun = match &self.preset {
            Some(PresetChoice::Paper(preset)) => Recipe::of_paper(*preset),
            Some(PresetChoice::Style(name)) => Style::named(name).map_or_else(Recipe::new, Recipe::of_style),
            Some(PresetChoice::File(_)) | None => Recipe::new(),
        };
        let style = cells.style.as_deref().and_then(Style::named);
        let mut recipe = begun
            .scheme(self.scheme())
            .set(self.tiles, Recipe::tiles)
            .set(self.size, Recipe::size)
            .set(self.palette.as_ref(), Recipe::palette_file)
            .set(self.background, Recipe::background)
            .set(self.weight.as_ref(), Recipe::weight_file)
            .set(self.init.as_ref(), Recipe::init_file)
            .set(self.color_mode.map(ColorMode::from), Recipe::color_mode)
            .set(self.target_sae, Recipe::target_sae)
            .set(self.patience, Recipe::patience)
            .seed(self.seed)
            .masks(masks(&look.masks))
            .set(look.shader, Recipe::shader)
            .set(look.blend.map(Blend::from), Recipe::blend)
            .set(look.opacity, Recipe::opacity)
            .set(cells.evals, Recipe::evals)
            .set(cells.candidates, Recipe::candidates)
            .set(cells.grout, Recipe::grout)
            .set(cells.grout_width, Recipe::grout_width)
            .set(paper.births, Recipe::births)
            .set(paper.batch_births, Recipe::batch_births)
            .set(paper.restarts, Recipe::restarts)
            .restart_masks(masks(&paper.restart_masks))
            .set(paper.cool, Recipe::cool)
            .set(paper.on_dry.map(OnDry::from), Recipe::on_dry)
            .set(paper.p_mutation, Recipe::p_mutation)
            .set(paper.p_crossover, Recipe::p_crossover)
            .set(paper.new_blood, Recipe::new_blood)
            .set(paper.mitosis, Recipe::mitosis)
            .set(paper.tile_scale, Recipe::tile_scale);
        if paper.no_rotation {
            recipe = recipe.no_rotation();
        }
        if self.lenient {
            recipe = recipe.lenient();
        }
        recipe.choices.style = style.or(recipe.choices.style);
        recipe.choices.colors = self.colors.clone().or(recipe.choices.colors);
        recipe
    }
}
