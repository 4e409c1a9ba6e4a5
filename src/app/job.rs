//! What an evolution begins from: the picture, fitted and opaque, and the population of `--init`.

use std::path::Path;
use std::sync::Arc;

use super::look::Dress;
use super::memory;
use super::options::{Colors, EvolveOptions};
use crate::archive;
use crate::error::{Error, Result};
use crate::evolve::{Palette, PaperScheme, begin_from, first_population};
use crate::model::{Fly, MaskSet, Population, Rgb, Scene, Target};
use crate::photo::{self, Loaded, Photo, ReadOptions};

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
    /// The scheme with what depends on files: the masks that flies wear, and the palette of their colours.
    pub scheme: PaperScheme,
    /// How many colours the target was reduced to, if it was.
    pub color_count: Option<usize>,
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
        let background = options.background.or(of_init).unwrap_or_default();
        let reading = ReadOptions { background, long_side_px: Some(options.long_side_px) };
        let Loaded { mut photo, original_width_px, original_height_px, sha256, warnings } =
            photo::read(&options.input, &reading)?;
        let palette = reduce_colors(&mut photo, &options.colors)?;
        let dress = dress(options, init.as_ref())?;
        let mut scheme = options.scheme.clone();
        if let Some(dress) = &dress {
            scheme.masks.clone_from(&dress.layers_by_run);
        }
        scheme.color.palette = palette.map(Palette::new).transpose()?;
        let target = Target::new(photo.width_px, photo.height_px, photo.pixels)?;
        if let (Some(population), Some(path)) = (&init, &options.init) {
            check_fit(population, path, &target)?;
            let pixel_count = u64::from(target.width_px()) * u64::from(target.height_px());
            let usual_bytes = memory::estimate_bytes(pixel_count, population.flies.len(), pixel_count);
            memory::check(usual_bytes.saturating_add(memory::list_bytes(population)))?;
        }
        let fly_count = init.as_ref().map(|population| population.flies.len()).or(options.fly_count);
        Ok(Self {
            fly_count: fly_count.unwrap_or_else(|| default_fly_count(target.width_px(), target.height_px())),
            target: Arc::new(target),
            original_size_px: (original_width_px, original_height_px),
            input_sha256: sha256,
            warnings,
            background,
            scheme,
            color_count: if let Colors::Few(count) = options.colors { Some(count) } else { None },
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
        Population {
            width_px: self.target.width_px(),
            height_px: self.target.height_px(),
            background: self.background.into(),
            grout: None,
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

    /// The flies to begin with.
    pub(super) fn first_flies(&self) -> Vec<Fly> {
        let random = || first_population(&self.scheme, &self.target, self.fly_count);
        self.init.as_ref().map_or_else(random, |population| begin_from(&self.scheme, population.flies.clone()))
    }
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

/// Reduces the picture to the colours asked for; returns those that the tiles are held to, too.
fn reduce_colors(photo: &mut Photo, colors: &Colors) -> Result<Option<Vec<Rgb>>> {
    match colors {
        Colors::Full => Ok(None),
        Colors::Few(count) => {
            let palette = photo::palette_of(photo, *count)?;
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
mod tests {
    use super::default_fly_count;

    #[test]
    fn the_default_number_of_flies_gives_both_rows_of_table_2() {
        assert_eq!(default_fly_count(256, 256), 2500);
        assert_eq!(default_fly_count(512, 512), 5000);
        assert_eq!(default_fly_count(1, 1), 10);
    }
}
