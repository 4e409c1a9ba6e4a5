//! The flags that decide a picture: how it is read, how its tiles look, and how it evolves. All commands that evolve
//! the user's pictures share them.

use std::path::{Path, PathBuf};
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
use crate::studio::{Colors, Preset, Recipe, Scheme, Settings, backdrop, color, color_count};

/// The flags.
#[derive(Clone, Debug, Args)]
pub(crate) struct PictureArgs {
    /// Longer side of the written picture in px [default: that at which it evolved]
    ///
    /// The mosaic is drawn anew at this size, so its tiles stay sharp. 1 to 65,535 px.
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Output")]
    pub output_size: Option<u64>,
    /// Number of tiles, such as 4000 or 2.5k [default: by the size; 5,000 at 512x512]
    ///
    /// 1 to 1,000,000. The default is 2500 * sqrt(width * height) / 256.
    #[arg(short = 'n', long, value_name = "N", value_parser = values::count, help_heading = "Picture")]
    pub tiles: Option<u64>,
    /// Longer side in px at which the picture evolves [default: 512]
    ///
    /// More px show finer detail and take more time. A larger picture is reduced to this size first; a smaller one is
    /// never enlarged. For the size of the result there is --output-size. 1 to 65,535 px.
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Picture")]
    pub size: Option<u64>,
    /// Reduce the picture to this many colours first: 1 to 256, or full for all of them [default: full]
    ///
    /// A tile over several of them may take one in between. With --palette every tile has one of the colours.
    #[arg(long, value_name = "K", value_parser = color_count, help_heading = "Picture", conflicts_with = "palette")]
    pub colors: Option<Colors>,
    /// Use only the colours in this file, for the picture and for the tiles: .gpl, .pal, .hex (one colour a line), or
    /// a picture of at most 256 colours
    ///
    /// The grout does not keep to them, unless --grout names one.
    #[arg(long, value_name = "FILE", help_heading = "Picture")]
    pub palette: Option<PathBuf>,
    /// Colour behind the tiles and behind transparent pixels, or none for a transparent background
    ///
    /// A colour is a name such as navy, or hexadecimal digits such as #f80 or ff8800. Without this flag, the
    /// tiles of --init or the style decide, and otherwise it is black. Transparent parts of the picture then
    /// stay transparent, except with --scheme paper.
    #[arg(long, value_name = "COLOR", value_parser = backdrop, help_heading = "Picture")]
    pub background: Option<Backdrop>,
    /// Picture that tells where likeness matters most: white parts count 16 times as much as black ones
    ///
    /// It must have the proportions of IN. Without it, all parts count the same.
    #[arg(long, value_name = "MAP", help_heading = "Picture")]
    pub weight: Option<PathBuf>,
    /// If the file of the picture is cut short, use the part that is there
    #[arg(long, help_heading = "Picture")]
    pub lenient: bool,
    /// Begin with the tiles that this file holds, instead of random ones
    ///
    /// It must come from a picture of the same size. It also sets the number of tiles.
    #[arg(long, value_name = "POP.npz", help_heading = "Picture", conflicts_with = "tiles")]
    pub init: Option<PathBuf>,

    #[command(flatten)]
    pub look: LookArgs,

    /// How to search: cells comes closest by far, paper is the published Fly algorithm [default: cells, or what
    /// --preset needs]
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Search")]
    pub scheme: Option<SchemeName>,
    /// Begin with these settings: a style, a scheme of the paper (paper-1 to paper-12), or your own .toml file
    ///
    /// Other flags change parts of it.
    #[arg(long, value_name = "NAME|FILE", value_parser = preset::parse, help_heading = "Search")]
    pub preset: Option<PresetChoice>,
    /// Where the colour of a new tile comes from [default: median, or evolved with --scheme paper]
    #[arg(long, value_enum, value_name = "MODE", help_heading = "Search")]
    pub color_mode: Option<ColorModeName>,
    /// Stop when the sum of absolute errors (SAE, as smalti show tells it) is this small (40k, 2M) [default: never]
    #[arg(long, value_name = "S", value_parser = values::count, help_heading = "Search")]
    pub target_sae: Option<u64>,
    /// Stop after trying this many children without progress (40k, 2M) [default: never]
    ///
    /// Progress means that the error falls by at least a thousandth. With --scheme paper, this many births without any
    /// improvement end a run.
    #[arg(long, value_name = "E", value_parser = values::count, help_heading = "Search")]
    pub patience: Option<u64>,
    /// Stop after this time, such as 90, 30s, 2m or 1h30m [default: no limit]
    ///
    /// The search may end earlier, when it has spent --evals.
    #[arg(long, value_name = "TIME", value_parser = values::duration, help_heading = "Search")]
    pub time: Option<Duration>,
    /// Number that decides every random choice; the same seed gives the same picture
    #[arg(long, value_name = "S", value_parser = values::seed, default_value_t = 0, help_heading = "Search")]
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
        if let Some(path) = &self.palette {
            check_palette_file(path)?;
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

/// Refuses colours in the place of a file of colours.
fn check_palette_file(path: &Path) -> Result<()> {
    let text = path.to_string_lossy();
    if path.exists() || !text.split(',').all(|word| color(word.trim()).is_ok()) {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "--palette {text}: names a file of colours; write them into one, one a line, such as colors.hex"
    )))
}
