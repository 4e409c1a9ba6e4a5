//! What an evolution begins from: the picture, fitted and opaque, and the population of `--init`.

use std::path::Path;
use std::sync::Arc;

use super::cells::CellsOptions;
use super::look::Dress;
use super::memory;
use super::options::{Colors, EvolveOptions, SchemeOptions};
use crate::archive;
use crate::error::{Error, Result};
use crate::evolve::{Palette, PaperScheme, begin_from, first_population};
use crate::model::cells::Course;
use crate::model::target::weight_of_luma;
use crate::model::{Backdrop, Blend, Fly, Grout, MaskSet, Population, Rgb, Scene, Target};
use crate::photo::{self, Background, Loaded, Photo, ReadOptions};

/// The inputs of one evolution, read and fitted together.
#[derive(Debug)]
pub(super) struct Job {
    pub target: Arc<Target>,
    /// Size in px of the upright picture before it was fitted.
    pub original_size_px: (u32, u32),
    /// SHA-256 of the input file, hexadecimal.
    pub input_sha256: String,
    /// What was ignored in the input, one sentence each.
    pub warnings: Vec<String>,
    pub background: Rgb,
    pub fly_count: usize,
    /// The scheme with what depends on files: in the paper's, the masks that flies wear and the palette of their colours.
    pub scheme: SchemeOptions,
    /// Colours that the tiles are held to, if they are.
    pub palette: Option<Palette>,
    /// How many colours the target was reduced to, if it was.
    pub color_count: Option<usize>,
    /// The ring of every tile, if a search gives them one.
    pub grout: Option<Grout>,
    /// The masks that were asked for; none leaves the flies as they are, which is square unless `init` says otherwise.
    pub dress: Option<Dress>,
    /// The population to begin with, if not a random one.
    pub init: Option<Population>,
}

impl Job {
    /// Reads the picture and the population.
    ///
    /// # Errors
    /// [`Error::Input`] if one of them cannot be used, or they do not fit together; [`Error::TooLarge`] if the block
    /// lists of the population do not fit into memory.
    pub(super) fn load(options: &EvolveOptions) -> Result<Self> {
        let init = options.init.as_deref().map(archive::read).transpose()?.map(|archive| archive.population);
        let of_init = init.as_ref().map(|population| population.background.color());
        let asked_for = options.background.or(of_init);
        let background = asked_for.unwrap_or_default();
        let behind = if keeps_transparency(options) { Background::Transparent } else { Background::Color(background) };
        let reading = ReadOptions { background: behind, long_side_px: Some(options.long_side_px) };
        let decoding = options.tracer.span("decode");
        let Picture { target, palette, original_size_px, sha256, warnings } =
            Picture::read(&options.input, &reading, &options.colors, options.weight.as_deref())?;
        drop(decoding);
        let dress = dress(options, init.as_ref())?;
        let palette = palette.map(Palette::new).transpose()?;
        let worn = dress.as_ref().map(|dress| &dress.masks).or(init.as_ref().map(|population| &population.masks));
        let is_translucent = worn.is_some_and(|masks| masks.blend() == Blend::Translucent);
        let scheme = match options.scheme.clone() {
            SchemeOptions::Paper(scheme) => SchemeOptions::Paper(fitted_out(scheme, dress.as_ref(), palette.as_ref())),
            SchemeOptions::Cells(cells) if is_translucent => SchemeOptions::Cells(cells.for_translucent_tiles()?),
            scheme @ SchemeOptions::Cells(_) => scheme,
        };
        if let (Some(population), Some(path)) = (&init, &options.init) {
            check_fit(population, path, &target)?;
            let pixel_count = u64::from(target.width_px()) * u64::from(target.height_px());
            let usual_bytes = memory::estimate_bytes(pixel_count, population.flies.len(), pixel_count);
            memory::check(usual_bytes.saturating_add(memory::list_bytes(population)))?;
        }
        let fly_count = init.as_ref().map(|population| population.flies.len()).or(options.fly_count);
        let fly_count = fly_count.unwrap_or_else(|| default_fly_count(target.width_px(), target.height_px()));
        let grout = match &scheme {
            SchemeOptions::Cells(cells) => cells.grout(&target, fly_count),
            SchemeOptions::Paper(_) => None,
        };
        let background = match &scheme {
            // Where nothing lies behind the tiles, an uncovered pixel counts as black.
            SchemeOptions::Cells(_) if target.transparent().is_some() => [0; 3],
            SchemeOptions::Cells(cells) if asked_for.is_none() => cells.ground(&target, grout),
            _ => background,
        };
        Ok(Self {
            fly_count,
            target: Arc::new(target),
            original_size_px,
            input_sha256: sha256,
            warnings,
            background,
            scheme,
            palette,
            color_count: if let Colors::Few(count) = options.colors { Some(count) } else { None },
            grout,
            dress,
            init,
        })
    }

    /// The tile shapes that the flies may wear.
    pub(super) fn masks(&self) -> MaskSet {
        let of_init = || self.init.as_ref().map_or_else(MaskSet::default, |population| population.masks.clone());
        self.dress.as_ref().map_or_else(of_init, |dress| dress.masks.clone())
    }

    /// These flies as a population of this picture.
    pub(super) fn population(&self, flies: Vec<Fly>) -> Population {
        let is_cut = self.target.transparent().is_some();
        Population {
            width_px: self.target.width_px(),
            height_px: self.target.height_px(),
            background: if is_cut { Backdrop::Transparent } else { self.background.into() },
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
    pub(super) fn first_flies(&self, scheme: &PaperScheme) -> Vec<Fly> {
        let random = || first_population(scheme, &self.target, self.fly_count);
        self.init.as_ref().map_or_else(random, |population| begin_from(scheme, population.flies.clone()))
    }

    /// The flies that a search begins with, if not with none, held to what was asked for.
    pub(super) fn given_flies(&self, seed: u64) -> Option<Vec<Fly>> {
        let population = self.init.as_ref()?;
        let scheme = PaperScheme { seed, ..PaperScheme::default() };
        let scheme = fitted_out(scheme, self.dress.as_ref(), self.palette.as_ref());
        Some(begin_from(&scheme, population.flies.clone()))
    }

    /// What a search in cells goes by.
    pub(super) fn course(&self, cells: &CellsOptions) -> Course {
        let masks = self.masks();
        Course {
            rules: cells.rules(self, self.layers_worn(&masks)),
            guide: Arc::new(cells.guide(&self.target, self.fly_count)),
            target: Arc::clone(&self.target),
            masks: Arc::new(masks),
            fly_count: self.fly_count,
        }
    }

    /// The first mask layer that newborn tiles wear, and how many: those that were asked for, or that given flies wear. A
    /// search knows only neighbouring layers; if given flies wear others, newborns wear those neighbours that most flies do.
    fn layers_worn(&self, masks: &MaskSet) -> (u32, u32) {
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
fn most_worn(wearers: &[usize]) -> (u32, u32) {
    let mut first = 0;
    let mut runs = Vec::new();
    for run in wearers.split(|&count| count == 0) {
        runs.push((run.iter().sum::<usize>(), first, run.len() as u32));
        first += run.len() as u32 + 1;
    }
    let most = runs.iter().map(|run| run.0).max().unwrap_or(0);
    let found = runs.into_iter().find(|run| run.0 == most && most > 0);
    found.map_or((0, 1), |(_, first, count)| (first, count))
}

/// A scheme whose flies wear these masks and are held to this palette.
fn fitted_out(mut scheme: PaperScheme, dress: Option<&Dress>, palette: Option<&Palette>) -> PaperScheme {
    if let Some(dress) = dress {
        scheme.masks.clone_from(&dress.layers_by_run);
    }
    scheme.color.palette = palette.cloned();
    scheme
}

/// The masks that were asked for, unless they are those that flies wear anyway.
fn dress(options: &EvolveOptions, init: Option<&Population>) -> Result<Option<Dress>> {
    if options.look.is_default() {
        return Ok(None);
    }
    if let Some(population) = init {
        return options.look.dress_over(&population.masks).map(Some);
    }
    Ok(Some(options.look.dress()?).filter(|dress| !dress.is_plain()))
}

/// Whether transparent pixels of the picture stay so: the paper knows only opaque pictures, and a background that was
/// asked for is meant to show.
fn keeps_transparency(options: &EvolveOptions) -> bool {
    matches!(options.scheme, SchemeOptions::Cells(_)) && options.background.is_none()
}

/// The target, and what is worth knowing about the file that it is from.
#[derive(Debug)]
struct Picture {
    target: Target,
    /// The colours that the tiles are held to, if they are.
    palette: Option<Vec<Rgb>>,
    original_size_px: (u32, u32),
    sha256: String,
    warnings: Vec<String>,
}

impl Picture {
    /// Reads the picture at `input`, reduces its colours, and weighs its pixels by the map at `weight`.
    fn read(input: &Path, reading: &ReadOptions, colors: &Colors, weight: Option<&Path>) -> Result<Self> {
        let Loaded { mut photo, transparent, original_width_px, original_height_px, sha256, warnings } =
            photo::read(input, reading)?;
        if transparent.as_ref().is_some_and(|transparent| !transparent.contains(&false)) {
            let reason = "is transparent everywhere; name a --background that it shows on, or another picture";
            return Err(Error::input(input, reason));
        }
        let palette = reduce_colors(&mut photo, transparent.as_deref(), colors)?;
        let Photo { width_px, height_px, pixels } = photo;
        let mut target = Target::new(width_px, height_px, pixels)?;
        if let Some(transparent) = transparent {
            target = target.with_transparent(transparent)?;
        }
        if let Some(map) = weight {
            let lumas = photo::read_weights(map, width_px, height_px)?;
            target = target.with_weights(lumas.into_iter().map(weight_of_luma).collect())?;
        }
        Ok(Self { target, palette, original_size_px: (original_width_px, original_height_px), sha256, warnings })
    }
}

/// Reduces the picture to the colours asked for; returns those that the tiles are held to, too. What is transparent has no
/// colour, and does not count.
fn reduce_colors(photo: &mut Photo, transparent: Option<&[bool]>, colors: &Colors) -> Result<Option<Vec<Rgb>>> {
    match colors {
        Colors::Full => Ok(None),
        Colors::Few(count) => {
            let palette = match transparent {
                None => photo::palette_of(&photo.pixels, *count)?,
                Some(transparent) => {
                    let is_opaque = |&(_, &is_transparent): &(&Rgb, &bool)| !is_transparent;
                    let opaque = photo.pixels.iter().zip(transparent).filter(is_opaque).map(|(&color, _)| color);
                    photo::palette_of(&opaque.collect::<Vec<Rgb>>(), *count)?
                }
            };
            photo::reduce(photo, &palette);
            Ok(None)
        }
        Colors::Palette(path) => {
            let palette = photo::read_palette(path)?;
            photo::reduce(photo, &palette);
            Ok(Some(palette))
        }
    }
}

fn check_fit(population: &Population, path: &Path, target: &Target) -> Result<()> {
    let (of_population, of_target) =
        ((population.width_px, population.height_px), (target.width_px(), target.height_px()));
    if of_population != of_target {
        return Err(Error::input(
            path,
            format!(
                "holds a population for a picture of {}x{} px and this one is {}x{} px; give the picture and --size that \
                 it was evolved with",
                of_population.0, of_population.1, of_target.0, of_target.1
            ),
        ));
    }
    if population.flies.is_empty() {
        return Err(Error::input(path, "holds no flies; give a population of at least one"));
    }
    Ok(())
}

/// Flies for a picture, so that a fly's share of it grows with its side: 2,500 at 256x256, 5,000 at 512x512 (Table 2).
pub(super) fn default_fly_count(width_px: u32, height_px: u32) -> usize {
    let pixels = f64::from(width_px) * f64::from(height_px);
    // IEEE 754 fixes the root and the product, so every machine agrees.
    (2500.0 * pixels.sqrt() / 256.0).round() as usize
}

#[cfg(test)]
pub(super) mod tests {
    use std::ffi::OsStr;
    use std::path::PathBuf;

    use clap::Parser;
    use tempfile::TempDir;

    use super::*;
    use crate::app::advice;
    use crate::app::cli::{Cli, Command};

    /// A folder with `cut.png`, whose left column is opaque and in two colours, `clear.png` without an opaque pixel, and
    /// `map.png`; the pictures have 2x2 px.
    fn folder() -> (TempDir, impl Fn(&str) -> PathBuf) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let root = folder.path().to_owned();
        let path = move |name: &str| root.join(name);
        let write = |name: &str, pixels: [[u8; 4]; 4]| {
            let png = photo::encode_png_with_alpha(2, 2, &pixels, &vec![]).expect("four pixels are 2x2");
            std::fs::write(path(name), png).expect("the folder is ours");
        };
        write("cut.png", [[200, 0, 0, 255], [0, 0, 9, 0], [0, 0, 200, 255], [0, 9, 0, 127]]);
        write("clear.png", [[255, 255, 255, 127]; 4]);
        write("map.png", [[0, 0, 0, 255], [255; 4], [17, 17, 17, 255], [255, 255, 255, 0]]);
        (folder, path)
    }

    /// What `smalti evolve` would do with this picture and these flags.
    pub(in crate::app) fn plan(input: &Path, flags: &[&str]) -> (EvolveOptions, Job) {
        let line = ["smalti", "evolve", "-o", "out.png"].into_iter().chain(flags.iter().copied()).map(OsStr::new);
        let cli = Cli::try_parse_from(line.chain([input.as_os_str()])).expect("the command is right");
        let Command::Evolve(args) = cli.command else { panic!("this is another command") };
        let options = EvolveOptions::new(&args).expect("the flags are right");
        let job = Job::load(&options).expect("the picture can be read");
        (options, job)
    }

    const KEPT: ReadOptions = ReadOptions { background: Background::Transparent, long_side_px: None };

    #[test]
    fn a_target_has_the_planes_that_picture_and_map_give_it() {
        let (_folder, path) = folder();
        let (cut, map) = (path("cut.png"), path("map.png"));
        let target = Picture::read(&cut, &KEPT, &Colors::Full, Some(&map)).expect("they fit together").target;
        assert_eq!(target.pixels(), [[200, 0, 0], [0; 3], [0, 0, 200], [0; 3]]);
        assert_eq!(target.transparent(), Some(&[false, true, false, true][..]));
        assert_eq!(target.weights(), Some(&[1, 16, 2, 1][..]));
        let plain = Picture::read(&cut, &ReadOptions::default(), &Colors::Full, None).expect("it can be read").target;
        assert_eq!((plain.transparent(), plain.weights()), (None, None));
    }

    #[test]
    fn what_is_transparent_takes_no_place_among_few_colours() {
        let (_folder, path) = folder();
        let read = |reading| Picture::read(&path("cut.png"), reading, &Colors::Few(2), None).map(|read| read.target);
        let kept = read(&KEPT).expect("it can be read");
        assert_eq!([kept.pixels()[0], kept.pixels()[2]], [[200, 0, 0], [0, 0, 200]]);
        let over_black = read(&ReadOptions::default()).expect("it can be read");
        assert_ne!([over_black.pixels()[0], over_black.pixels()[2]], [[200, 0, 0], [0, 0, 200]]);
    }

    #[test]
    fn a_picture_without_an_opaque_pixel_is_refused_unless_it_has_a_background() {
        let (_folder, path) = folder();
        let clear = path("clear.png");
        let refusal = Picture::read(&clear, &KEPT, &Colors::Full, None).expect_err("no tile is wanted anywhere");
        assert_eq!(advice::exit_code(&refusal), 2);
        assert!(refusal.to_string().contains("clear.png: is transparent everywhere"), "{refusal}");
        Picture::read(&clear, &ReadOptions::default(), &Colors::Full, None).expect("it shows on black");
    }

    #[test]
    fn a_map_that_does_not_fit_or_is_not_there_is_refused_by_its_name() {
        let (_folder, path) = folder();
        let photo = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/rgb.png");
        let square = photo::encode_png_with_alpha(40, 40, &[[255; 4]; 1600], &vec![]).expect("1,600 pixels are 40x40");
        std::fs::write(path("square.png"), square).expect("the folder is ours");
        for (map, reason) in [("square.png", "a map of 40x40 px does not fit"), ("none.png", "there is no such file")] {
            let refusal =
                Picture::read(&photo, &KEPT, &Colors::Full, Some(&path(map))).expect_err("it is no map of it");
            assert_eq!(advice::exit_code(&refusal), 2);
            assert!(refusal.to_string().contains(&format!("{map}: {reason}")), "{refusal}");
        }
    }

    #[test]
    fn the_papers_scheme_shows_transparent_pixels_on_the_background() {
        let (_folder, path) = folder();
        let (_, job) = plan(&path("cut.png"), &["--scheme", "paper"]);
        assert_eq!((job.target.transparent(), job.target.pixels()[3]), (None, [0, 4, 0]));
        let (_, job) = plan(&path("cut.png"), &["--scheme", "paper", "--background", "ffffff"]);
        assert_eq!((job.target.transparent(), job.target.pixels()[3]), (None, [128, 132, 128]));
    }

    #[test]
    fn newborn_tiles_wear_the_neighbouring_layers_that_most_given_flies_wear() {
        for (wearers, expected) in [
            (&[5][..], (0, 1)),
            (&[0, 0], (0, 1)),
            (&[0, 3, 1, 2], (1, 3)),
            (&[0, 3, 0, 2], (1, 1)),
            (&[2, 0, 3], (2, 1)),
            (&[4, 0, 3, 2, 0], (2, 2)),
            (&[4, 0, 2, 2], (0, 1)),
        ] {
            assert_eq!(most_worn(wearers), expected, "{wearers:?}");
        }
    }

    #[test]
    fn translucent_tiles_drop_what_a_style_says_of_grout_and_gaps_and_no_flag() {
        let (_folder, path) = folder();
        let flags = ["--style", "mosaic", "--mask", "disc", "--shader", "soft"];
        let (_, job) = plan(&path("map.png"), &flags);
        let SchemeOptions::Cells(cells) = &job.scheme else { panic!("it is a search") };
        assert_eq!((job.grout, cells.style().overlap, cells.style().hole), (None, 0, 0));
        assert!(cells.told(&job).contains(&"style mosaic".to_owned()));
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
