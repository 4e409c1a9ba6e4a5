//! The workload of measurements: a picture in two sizes, and the searches and scenes made from it.

use std::path::Path;
use std::sync::Arc;

use crate::cli::terminal::{self, Verbosity};
use crate::error::{Error, Result};
use crate::model::cells::random::hash;
use crate::model::{Rgb, Scene, Target};
use crate::photo::{self, Loaded, Photo, ReadOptions};
use crate::studio::{self, Recipe, Work, default_fly_count};

/// Longer sides in px of the two sizes, as in Table 2 of the paper.
pub(super) const SIDES_PX: [u32; 2] = [256, 512];

/// A picture in both sizes.
#[derive(Debug)]
pub(super) struct Pictures {
    /// `built-in`, or the SHA-256 of its file.
    pub name: String,
    /// In the order of [`SIDES_PX`].
    pub targets: [Arc<Target>; 2],
}

impl Pictures {
    /// A picture that needs no file.
    ///
    /// # Errors
    /// Never, as its size is valid.
    pub(super) fn built_in() -> Result<Self> {
        let [small, large] = SIDES_PX.map(|side_px| {
            let places = (0..side_px).flat_map(|y| (0..side_px).map(move |x| (x, y)));
            Target::new(side_px, side_px, places.map(|(x, y)| painted(x, y, side_px)).collect())
        });
        Ok(Self { name: "built-in".to_owned(), targets: [Arc::new(small?), Arc::new(large?)] })
    }

    /// The picture at `path`.
    ///
    /// # Errors
    /// [`Error::Input`] if it cannot be read or is too small.
    pub(super) fn read(path: &Path, verbosity: Verbosity) -> Result<Self> {
        let reading = ReadOptions { long_side_px: Some(SIDES_PX[1]), ..ReadOptions::default() };
        let Loaded { photo, sha256, warnings, .. } = photo::read(path, &reading)?;
        if verbosity > Verbosity::Quiet {
            warnings.iter().for_each(|warning| terminal::error(&format!("{}: {warning}", path.display())));
        }
        if photo.width_px.max(photo.height_px) < SIDES_PX[1] {
            let reason =
                format!("is {}x{} px; the longer side must be at least 512 px", photo.width_px, photo.height_px);
            return Err(Error::input(path, reason));
        }
        let target = |Photo { width_px, height_px, pixels }| Target::new(width_px, height_px, pixels).map(Arc::new);
        let small = target(photo::fitted(&photo, SIDES_PX[0]))?;
        Ok(Self { name: sha256, targets: [small, target(photo)?] })
    }
}

/// A pixel of the built-in picture: a fading sky, a disc, a ring, slanted bars, and noise on half of it.
fn painted(x: u32, y: u32, side_px: u32) -> Rgb {
    // Coordinates are scaled to a width of 1,024 px, so that both sizes show the same.
    let [u, v] = [x, y].map(|place| ((2 * place + 1) * 512 / side_px) as i32);
    let square_to = |x: i32, y: i32| (u - x) * (u - x) + (v - y) * (v - y);
    let is_barred = u + 2 * v > 1_900 && (u - v / 2).rem_euclid(96) < 40;
    let base = if square_to(340, 330) < 210 * 210 {
        [230, 90 + v / 8, 40]
    } else if (150 * 150..200 * 200).contains(&square_to(740, 420)) {
        [240, 230, 200 - u / 10]
    } else if is_barred {
        [20, 60 + u / 20, 50]
    } else {
        [u / 6, 120 + v / 10, 220 - v / 6]
    };
    let amplitude = if u > 512 { 24 } else { 4 };
    let noise = ((hash(y * side_px + x) >> 16) as i32 % amplitude) - amplitude / 2;
    base.map(|channel| (channel + noise).clamp(0, 255) as u8)
}

/// The default number of tiles of a picture.
pub(super) fn fly_count(target: &Target) -> usize {
    default_fly_count(target.width_px(), target.height_px())
}

/// The scene of the published algorithm.
pub(super) fn scene(target: &Arc<Target>) -> Scene {
    let fly_count = fly_count(target);
    Scene { target: Arc::clone(target), masks: Arc::default(), background: [0; 3], fly_count }
}

/// The search that a style makes from a picture, with this many candidates per step.
///
/// # Errors
/// [`Error::Internal`] if no style has this name.
pub(super) fn search(target: &Arc<Target>, style: &str, candidates: u32) -> Result<Work> {
    let recipe = Recipe::named(style)?.tiles(fly_count(target) as u64).candidates(u64::from(candidates));
    studio::work(target, &recipe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_picture_is_the_same_motif_in_both_sizes() {
        let Pictures { targets: [small, large], .. } = Pictures::built_in().expect("its sizes are valid");
        let mean = |target: &Target| {
            let pixels = target.pixels();
            [0, 1, 2].map(|channel| pixels.iter().map(|p| f64::from(p[channel])).sum::<f64>() / pixels.len() as f64)
        };
        for (one, other) in mean(&small).into_iter().zip(mean(&large)) {
            assert!((one - other).abs() < 1.0, "{one} {other}");
            assert!((40.0..200.0).contains(&one), "{one}");
        }
    }
}
