//! What an evolution begins from: the fitted picture, its masks and colours, and the population that is given.

use std::path::Path;
use std::sync::Arc;

use super::cells::{CellsSettings, Laid, MaskLayers};
use super::choices::{Colors, InitSource};
use super::fitted::{Fitted, Source};
use super::look::Dress;
use super::memory;
use super::paper;
use super::parameters::contradiction;
use super::settings::{SchemeSettings, Settings};
use crate::archive;
use crate::engine::{PaperTask, SearchTask, Task};
use crate::error::{Error, Result};
use crate::evolve::{Palette, PaperScheme, begin_from, first_population};
use crate::model::cells::Course;
use crate::model::population::FLY_COUNT_MAX;
use crate::model::{Backdrop, Blend, Fly, Grout, MaskSet, Population, Rgb, Scene, Target};
use crate::{photo, threads};

/// The inputs of one evolution, read and fitted together.
#[derive(Debug)]
pub(crate) struct Job {
    pub target: Arc<Target>,
    /// Size in px of the upright picture before it was fitted.
    pub original_size_px: (u32, u32),
    /// SHA-256 of the input file, hexadecimal.
    pub input_sha256: String,
    /// What was ignored in the input, one sentence each.
    pub warnings: Vec<String>,
    /// The colour behind the tiles; black if nothing is.
    pub background: Rgb,
    /// Whether nothing lies behind the tiles although the picture is opaque.
    pub is_bare: bool,
    pub fly_count: usize,
    /// The scheme with what depends on files: in the paper's, the masks that flies wear and the palette of their
    /// colours.
    pub scheme: SchemeSettings,
    /// Colours that the tiles are held to, if they are.
    pub palette: Option<Palette>,
    /// How many colours the target was reduced to, if it was.
    pub color_count: Option<usize>,
    /// The ring of every tile, if a search gives them one.
    pub grout: Option<Grout>,
    /// The masks that were asked for; none leaves the flies as they are, which is square unless `init` says otherwise.
    pub dress: Option<Dress>,
    /// The population to begin with, if not a random one.
    pub init: Option<Arc<Population>>,
}

impl Job {
    /// Reads the picture at `path`, and the files of the settings.
    ///
    /// # Errors
    /// [`Error::Input`] if one of them cannot be used, or they do not fit together; [`Error::Parameter`] if the
    /// settings do not fit the picture.
    pub(crate) fn load(path: &Path, settings: &Settings) -> Result<Self> {
        Self::new(&Source::File(path), settings)
    }

    /// As [`Job::load`], of a picture that is decoded.
    ///
    /// # Errors
    /// As [`Job::load`]; [`Error::Parameter`] about the picture.
    pub(super) fn of_picture(picture: &photo::Decoded, settings: &Settings) -> Result<Self> {
        Self::new(&Source::Picture(picture), settings)
    }

    /// As [`Job::load`], of a picture that is fitted already, and whose colours and weights stay as they are.
    ///
    /// # Errors
    /// As [`Job::load`].
    pub(super) fn of_target(target: &Arc<Target>, settings: &Settings) -> Result<Self> {
        Self::new(&Source::Target(target), settings)
    }

    fn new(source: &Source<'_>, settings: &Settings) -> Result<Self> {
        // What is made of a picture is made in parallel from here on.
        threads::start(None)?;
        let init = settings.init.as_ref().map(population).transpose()?;
        let of_init = init.as_ref().map(|population| population.background.color());
        let asked_for = settings.background.map(Backdrop::color).or(of_init);
        let Fitted { target, palette, original_size_px, sha256, warnings } =
            Fitted::new(source, settings, asked_for.unwrap_or_default())?;
        let dress = dress(settings, init.as_deref())?;
        let palette = palette.map(Palette::new).transpose()?;
        let worn = dress.as_ref().map(|dress| &dress.masks).or(init.as_ref().map(|population| &population.masks));
        let is_translucent = worn.is_some_and(|masks| masks.blend() == Blend::Translucent);
        let scheme = match settings.scheme.clone() {
            SchemeSettings::Paper(scheme) => {
                SchemeSettings::Paper(fitted_out(scheme, dress.as_ref(), palette.as_ref()))
            }
            SchemeSettings::Cells(cells) if is_translucent => SchemeSettings::Cells(cells.for_translucent_tiles()?),
            scheme @ SchemeSettings::Cells(_) => scheme,
        };
        let init = init.map(|population| fit(population, settings.init_file(), &target)).transpose()?;
        let fly_count = init.as_ref().map(|population| population.flies.len()).or(settings.fly_count);
        let fly_count = fly_count.unwrap_or_else(|| default_fly_count(target.width_px(), target.height_px()));
        let grout = match &scheme {
            SchemeSettings::Cells(cells) => cells.grout(&target, fly_count),
            SchemeSettings::Paper(_) => None,
        };
        let background = match &scheme {
            // Where nothing lies behind the tiles, an uncovered pixel counts as black.
            SchemeSettings::Cells(_) if target.transparent().is_some() => [0; 3],
            SchemeSettings::Cells(cells) if asked_for.is_none() => cells.ground(&target, grout),
            _ => asked_for.unwrap_or_default(),
        };
        let is_bare = settings.background == Some(Backdrop::Transparent) && target.transparent().is_none();
        Ok(Self {
            fly_count,
            is_bare,
            target,
            original_size_px,
            input_sha256: sha256,
            warnings,
            background,
            scheme,
            palette,
            color_count: if let Colors::Few(count) = settings.colors { Some(count) } else { None },
            grout,
            dress,
            init,
        })
    }

    /// Refuses a scheme that so many tiles cannot have.
    ///
    /// # Errors
    /// [`Error::Parameter`].
    pub(crate) fn check(&self) -> Result<()> {
        match &self.scheme {
            SchemeSettings::Cells(_) => Ok(()),
            SchemeSettings::Paper(scheme) => paper::check_fly_count(scheme, self.fly_count),
        }
    }

    /// Children that are evaluated if nothing ends the work before; in the paper's scheme each is a birth.
    pub(crate) fn evals_planned(&self) -> u64 {
        self.scheme.evals_planned(self.fly_count)
    }

    /// What there is to do.
    pub(crate) fn task(&self) -> Task {
        match &self.scheme {
            SchemeSettings::Cells(cells) => Task::Search(SearchTask {
                course: self.course(cells),
                first: self.given_flies(cells.seed),
                budget: cells.budget(self.fly_count),
            }),
            SchemeSettings::Paper(scheme) => Task::Paper(PaperTask {
                scene: self.scene(),
                scheme: scheme.clone(),
                first_flies: self.first_flies(scheme),
            }),
        }
    }

    /// About how many bytes it takes to evolve, and to draw so many pixels for outputs.
    pub(crate) fn memory_bytes(&self, output_pixel_count: u64) -> u64 {
        let pixel_count = u64::from(self.target.width_px()) * u64::from(self.target.height_px());
        let search_bytes = match &self.scheme {
            SchemeSettings::Cells(_) => memory::search_bytes(pixel_count, self.masks().blend()),
            SchemeSettings::Paper(_) => 0,
        };
        let list_bytes = self.init.as_deref().map_or(0, memory::list_bytes);
        memory::estimate_bytes(pixel_count, self.fly_count, output_pixel_count)
            .saturating_add(list_bytes)
            .saturating_add(search_bytes)
    }

    /// The parameters that differ from their defaults, for people; masks and colours are told elsewhere.
    pub(crate) fn told(&self) -> Vec<String> {
        match &self.scheme {
            SchemeSettings::Paper(scheme) => paper::told(scheme),
            SchemeSettings::Cells(cells) => cells.told(self.grout, self.masks().blend()),
        }
    }

    /// The tiles as a search lays them.
    pub(super) fn laid(&self, mask_layers: MaskLayers) -> Laid<'_> {
        let Self { target, fly_count, background, grout, .. } = self;
        Laid { target, fly_count: *fly_count, background: *background, grout: *grout, mask_layers }
    }

    /// The tile shapes that the flies may wear.
    pub(crate) fn masks(&self) -> MaskSet {
        let of_init = || self.init.as_ref().map_or_else(MaskSet::default, |population| population.masks.clone());
        self.dress.as_ref().map_or_else(of_init, |dress| dress.masks.clone())
    }

    /// These flies as a population of this picture.
    pub(crate) fn population(&self, flies: Vec<Fly>) -> Population {
        let is_open = self.is_bare || self.target.transparent().is_some();
        Population {
            width_px: self.target.width_px(),
            height_px: self.target.height_px(),
            background: if is_open { Backdrop::Transparent } else { self.background.into() },
            grout: self.grout,
            masks: self.masks(),
            flies,
        }
    }

    /// The lane that the job becomes.
    pub(super) fn scene(&self) -> Scene {
        Scene {
            target: Arc::clone(&self.target),
            masks: Arc::new(self.masks()),
            background: self.background,
            fly_count: self.fly_count,
        }
    }

    /// The flies that an evolution by the paper's `scheme` begins with.
    fn first_flies(&self, scheme: &PaperScheme) -> Vec<Fly> {
        let random = || first_population(scheme, &self.target, self.fly_count);
        self.init.as_ref().map_or_else(random, |population| begin_from(scheme, self.wearable(population)))
    }

    /// The flies that a search begins with, if not with none, held to what was asked for.
    pub(super) fn given_flies(&self, seed: u64) -> Option<Vec<Fly>> {
        let population = self.init.as_ref()?;
        let scheme = PaperScheme { seed, ..PaperScheme::default() };
        let scheme = fitted_out(scheme, self.dress.as_ref(), self.palette.as_ref());
        Some(begin_from(&scheme, self.wearable(population)))
    }

    /// The flies of a population; absent ones, which nobody dresses, wear squares where their masks are not those of
    /// the job.
    fn wearable(&self, population: &Population) -> Vec<Fly> {
        let layer_count = self.masks().layers().len();
        let mut flies = population.flies.clone();
        for fly in flies.iter_mut().filter(|fly| !fly.alive && usize::from(fly.mask) >= layer_count) {
            fly.mask = 0;
        }
        flies
    }

    /// The given flies as they are, but for colours that they are held to.
    pub(super) fn kept_flies(&self) -> Option<Vec<Fly>> {
        let population = self.init.as_ref()?;
        let scheme = fitted_out(PaperScheme::default(), None, self.palette.as_ref());
        Some(begin_from(&scheme, population.flies.clone()))
    }

    /// What a search in cells goes by.
    pub(crate) fn course(&self, cells: &CellsSettings) -> Course {
        let masks = self.masks();
        Course {
            rules: cells.rules(&self.laid(self.layers_worn(&masks))),
            guide: Arc::new(cells.guide(&self.target, self.fly_count)),
            target: Arc::clone(&self.target),
            masks: Arc::new(masks),
            fly_count: self.fly_count,
        }
    }

    /// The first mask layer that newborn tiles wear, and how many: those that were asked for, or that given flies wear.
    /// A search knows only neighbouring layers; if given flies wear others, newborns wear those neighbours that most
    /// flies do.
    fn layers_worn(&self, masks: &MaskSet) -> MaskLayers {
        let mut wearers = vec![0_usize; masks.layers().len()];
        let named = self.dress.iter().flat_map(|dress| dress.layers_by_run.iter().flatten().copied());
        let given = self.init.iter().flat_map(|population| &population.flies);
        let given = given.filter(|fly| fly.alive && self.dress.is_none()).map(|fly| fly.mask);
        for layer in named.chain(given) {
            wearers[usize::from(layer).min(masks.layers().len() - 1)] += 1;
        }
        most_worn(&wearers)
    }
}

/// The first and the number of those neighbouring layers that have most wearers together, by the wearers of each; the
/// first such, and the first layer alone if nobody wears any.
fn most_worn(wearers: &[usize]) -> MaskLayers {
    let mut first = 0;
    let mut runs = Vec::new();
    for run in wearers.split(|&count| count == 0) {
        runs.push((run.iter().sum::<usize>(), first, run.len() as u32));
        first += run.len() as u32 + 1;
    }
    let most = runs.iter().map(|run| run.0).max().unwrap_or(0);
    let found = runs.into_iter().find(|run| run.0 == most && most > 0);
    found.map_or(MaskLayers { first: 0, count: 1 }, |(_, first, count)| MaskLayers { first, count })
}

/// A scheme whose flies wear these masks and are held to this palette.
fn fitted_out(mut scheme: PaperScheme, dress: Option<&Dress>, palette: Option<&Palette>) -> PaperScheme {
    if let Some(dress) = dress {
        scheme.masks.clone_from(&dress.layers_by_run);
    }
    scheme.color.palette = palette.cloned();
    scheme
}

/// The population to begin with.
fn population(source: &InitSource) -> Result<Arc<Population>> {
    match source {
        InitSource::File(path) => Ok(Arc::new(archive::read(path)?.population)),
        InitSource::Population(population) => Ok(Arc::clone(population)),
    }
}

/// The masks that were asked for, unless they are those that flies wear anyway.
fn dress(settings: &Settings, init: Option<&Population>) -> Result<Option<Dress>> {
    if settings.look.is_default() {
        return Ok(None);
    }
    if let Some(population) = init {
        return settings.look.dress_over(&population.masks).map(Some);
    }
    Ok(Some(settings.look.dress()?).filter(|dress| !dress.is_plain()))
}

/// The population, with every gene within its bounds, if it is of a picture of this size; `path` is its file, if it has
/// one.
fn fit(mut population: Arc<Population>, path: Option<&Path>, target: &Target) -> Result<Arc<Population>> {
    let refuse = |reason: String| match path {
        Some(path) => Error::input(path, reason),
        None => contradiction("init", reason),
    };
    let (width_px, height_px) = (target.width_px(), target.height_px());
    if (population.width_px, population.height_px) != (width_px, height_px) {
        return Err(refuse(format!(
            "holds a population for a picture of {}x{} px and this one is {width_px}x{height_px} px; give the picture and the \
             size that it was evolved with",
            population.width_px, population.height_px
        )));
    }
    let fly_count = population.flies.len();
    if fly_count == 0 {
        return Err(refuse("holds no flies; give a population of at least one".to_owned()));
    }
    if fly_count > FLY_COUNT_MAX {
        return Err(refuse(format!("holds {fly_count} flies, more than the limit of {FLY_COUNT_MAX}")));
    }
    let layer_count = population.masks.layers().len();
    if let Some(fly) = population.flies.iter().find(|fly| usize::from(fly.mask) >= layer_count) {
        return Err(refuse(format!("holds a fly that wears mask {}, and has {layer_count} masks", fly.mask)));
    }
    let is_outside = |fly: &Fly| *fly != fly.clamped(width_px, height_px);
    if population.flies.iter().any(is_outside) {
        for fly in &mut Arc::make_mut(&mut population).flies {
            *fly = fly.clamped(width_px, height_px);
        }
    }
    Ok(population)
}

/// Flies for a picture, so that a fly's share of it grows with its side: 2,500 at 256x256, 5,000 at 512x512 (Table 2).
pub(crate) fn default_fly_count(width_px: u32, height_px: u32) -> usize {
    let pixels = f64::from(width_px) * f64::from(height_px);
    // IEEE 754 fixes the root and the product, so every machine agrees.
    (2500.0 * pixels.sqrt() / 256.0).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;
    use crate::studio::{Mask, Recipe};

    /// What there is to do about pixels, of which each has a red, a green, a blue and an alpha.
    fn job(width_px: u32, height_px: u32, pixels: &[u8], recipe: &Recipe) -> Job {
        let decoded = photo::Decoded::from_pixels(width_px, height_px, 4, pixels).expect("these are so many pixels");
        Job::of_picture(&decoded, &Settings::new(recipe).expect("the recipe is right")).expect("they fit together")
    }

    #[test]
    fn the_papers_scheme_shows_transparent_pixels_on_the_background() {
        let half_green = [200, 0, 0, 255, 0, 9, 0, 127];
        let black = job(2, 1, &half_green, &Recipe::paper());
        assert_eq!((black.target.transparent(), black.target.pixels()[1]), (None, [0, 4, 0]));
        let white = job(2, 1, &half_green, &Recipe::paper().background([255; 3]));
        assert_eq!((white.target.transparent(), white.target.pixels()[1]), (None, [128, 132, 128]));
    }

    #[test]
    fn newborn_tiles_wear_the_neighbouring_layers_that_most_given_flies_wear() {
        for (wearers, first, count) in [
            (&[5][..], 0, 1),
            (&[0, 0], 0, 1),
            (&[0, 3, 1, 2], 1, 3),
            (&[0, 3, 0, 2], 1, 1),
            (&[2, 0, 3], 2, 1),
            (&[4, 0, 3, 2, 0], 2, 2),
            (&[4, 0, 2, 2], 0, 1),
        ] {
            let MaskLayers { first: found, count: many } = most_worn(wearers);
            assert_eq!((found, many), (first, count), "{wearers:?}");
        }
    }

    #[test]
    fn translucent_tiles_drop_what_a_style_says_of_grout_and_gaps() {
        let disc = Mask::named("disc").expect("it is built in");
        let job = job(1, 1, &[9, 9, 9, 255], &Recipe::mosaic().masks([disc]).shader(shapes::Shader::Soft));
        let SchemeSettings::Cells(cells) = &job.scheme else { panic!("it is a search") };
        assert_eq!((job.grout, cells.style().overlap, cells.style().hole), (None, 0, 0));
        assert!(job.told().contains(&"style mosaic".to_owned()));
        let rules = job.course(cells).rules;
        assert_eq!((rules.grout, rules.penalties.overlap, rules.penalties.hole), (0, 0, 0));
        assert!(rules.penalties.turn > 0);
    }

    #[test]
    fn the_default_number_of_flies_gives_both_rows_of_table_2() {
        assert_eq!(default_fly_count(256, 256), 2500);
        assert_eq!(default_fly_count(512, 512), 5000);
        assert_eq!(default_fly_count(1, 1), 10);
    }
}
