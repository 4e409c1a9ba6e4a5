//! The picture as it is evolved: read or taken from memory, reduced, in few colours, weighed.

use std::path::Path;
use std::sync::Arc;

use super::choices::{Colors, PaletteSource, WeightSource};
use super::parameters::contradiction;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::model::target::weight_of_luma;
use crate::model::{Rgb, Target};
use crate::photo::{self, Background, CutShort, Loaded, Photo, ReadOptions};

/// Where the pixels of a job come from.
pub(super) enum Source<'a> {
    File(&'a Path),
    Picture(&'a photo::Decoded),
    /// A picture that is fitted already.
    Target(&'a Arc<Target>),
}

/// The target, and what is worth knowing about the picture that it is from.
#[derive(Debug)]
pub(super) struct Fitted {
    pub target: Arc<Target>,
    /// The colours that the tiles are held to, if they are.
    pub palette: Option<Vec<Rgb>>,
    pub original_size_px: (u32, u32),
    pub sha256: String,
    pub warnings: Vec<String>,
}

impl Fitted {
    /// Reads the picture, reduces its colours, and weighs its pixels; `background` shows through it if it is not to
    /// stay transparent.
    ///
    /// # Errors
    /// [`Error::Input`] about a file, [`Error::Parameter`] about what is in memory.
    pub fn new(source: &Source<'_>, settings: &Settings, background: Rgb) -> Result<Self> {
        let background =
            if settings.keeps_transparency() { Background::Transparent } else { Background::Color(background) };
        let cut_short = settings.cut_short;
        let reading = ReadOptions { background, long_side_px: Some(settings.long_side_px), cut_short };
        let loaded = match source {
            Source::File(path) => photo::read(path, &reading)?,
            Source::Picture(picture) => picture.fitted(&reading),
            Source::Target(target) => {
                let original_size_px = (target.width_px(), target.height_px());
                let (target, sha256, warnings) = (Arc::clone(target), String::new(), Vec::new());
                return Ok(Self { target, palette: None, original_size_px, sha256, warnings });
            }
        };
        let Loaded { mut photo, transparent, original_width_px, original_height_px, sha256, warnings } = loaded;
        if transparent.as_ref().is_some_and(|transparent| !transparent.contains(&false)) {
            let reason = "is transparent everywhere; give it a background colour, or name another picture";
            return Err(match source {
                Source::File(path) => Error::input(path, reason),
                Source::Picture(_) | Source::Target(_) => contradiction("picture", reason),
            });
        }
        let palette = reduce_colors(&mut photo, transparent.as_deref(), &settings.colors)?;
        let Photo { width_px, height_px, pixels } = photo;
        let mut target = Target::new(width_px, height_px, pixels)?;
        if let Some(transparent) = transparent {
            target = target.with_transparent(transparent)?;
        }
        if let Some(weight) = &settings.weight {
            let lumas = lumas(weight, (width_px, height_px), cut_short)?;
            target = target.with_weights(lumas.into_iter().map(weight_of_luma).collect())?;
        }
        let original_size_px = (original_width_px, original_height_px);
        Ok(Self { target: Arc::new(target), palette, original_size_px, sha256, warnings })
    }
}

/// How much each pixel of the fitted picture matters, 0 to 255.
fn lumas(weight: &WeightSource, (width_px, height_px): (u32, u32), cut_short: CutShort) -> Result<Vec<u8>> {
    match weight {
        WeightSource::File(path) => photo::read_weights(path, (width_px, height_px), cut_short),
        WeightSource::Encoded(bytes) => {
            photo::decode_weights(bytes, width_px, height_px).map_err(|reason| contradiction("weight", reason))
        }
        WeightSource::Luma(lumas) if lumas.len() as u64 == u64::from(width_px) * u64::from(height_px) => {
            Ok(lumas.clone())
        }
        WeightSource::Luma(lumas) => Err(contradiction(
            "weight",
            format!("has {} values, and the fitted picture has {width_px}x{height_px} px", lumas.len()),
        )),
    }
}

/// Reduces the picture to the colours asked for; returns those that the tiles are held to, too. What is transparent has
/// no colour, and does not count.
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
        Colors::Palette(source) => {
            let palette = match source {
                PaletteSource::File(path) => photo::read_palette(path)?,
                PaletteSource::Colors(colors) => colors.clone(),
            };
            photo::reduce(photo, &palette);
            Ok(Some(palette))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use tempfile::TempDir;

    use super::*;
    use crate::studio::Recipe;

    /// A folder with `cut.png`, whose left column is opaque and in two colours, `clear.png` without an opaque pixel,
    /// and `map.png`; the pictures have 2x2 px.
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

    /// The picture at `path` by a recipe, over black unless it stays transparent.
    fn fitted(path: &Path, recipe: &Recipe) -> Result<Fitted> {
        Fitted::new(&Source::File(path), &Settings::new(recipe).expect("the recipe is right"), [0; 3])
    }

    /// A recipe under which nothing stays transparent.
    fn over_black() -> Recipe {
        Recipe::new().background([0; 3])
    }

    #[test]
    fn a_target_has_the_planes_that_picture_and_map_give_it() {
        let (_folder, path) = folder();
        let cut = path("cut.png");
        let target = fitted(&cut, &Recipe::new().weight_file(path("map.png"))).expect("they fit together").target;
        assert_eq!(target.pixels(), [[200, 0, 0], [0; 3], [0, 0, 200], [0; 3]]);
        assert_eq!(target.transparent(), Some(&[false, true, false, true][..]));
        assert_eq!(target.weights(), Some(&[1, 16, 2, 1][..]));
        let plain = fitted(&cut, &over_black()).expect("it can be read").target;
        assert_eq!((plain.transparent(), plain.weights()), (None, None));
    }

    #[test]
    fn what_is_transparent_takes_no_place_among_few_colours() {
        let (_folder, path) = folder();
        let read = |recipe: Recipe| fitted(&path("cut.png"), &recipe.colors(2)).expect("it can be read").target;
        let kept = read(Recipe::new());
        assert_eq!([kept.pixels()[0], kept.pixels()[2]], [[200, 0, 0], [0, 0, 200]]);
        let over_black = read(over_black());
        assert_ne!([over_black.pixels()[0], over_black.pixels()[2]], [[200, 0, 0], [0, 0, 200]]);
    }

    #[test]
    fn a_picture_without_an_opaque_pixel_is_refused_unless_it_has_a_background() {
        let (_folder, path) = folder();
        let clear = path("clear.png");
        let refusal = fitted(&clear, &Recipe::new()).expect_err("no tile is wanted anywhere");
        assert!(refusal.to_string().contains("clear.png: is transparent everywhere"), "{refusal}");
        fitted(&clear, &over_black()).expect("it shows on black");
    }

    #[test]
    fn a_map_that_does_not_fit_or_is_not_there_is_refused_by_its_name() {
        let (_folder, path) = folder();
        let photo = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/rgb.png");
        let square = photo::encode_png_with_alpha(40, 40, &[[255; 4]; 1600], &vec![]).expect("1,600 pixels are 40x40");
        std::fs::write(path("square.png"), square).expect("the folder is ours");
        for (map, expected) in [("square.png", "a map of 40x40 px does not fit"), ("none.png", "there is no such file")]
        {
            let refusal = fitted(&photo, &Recipe::new().weight_file(path(map))).expect_err("it is no map of it");
            assert!(matches!(&refusal, Error::Input { reason, .. } if reason.contains(expected)), "{refusal}");
            assert!(refusal.to_string().contains(map), "{refusal}");
        }
    }
}
