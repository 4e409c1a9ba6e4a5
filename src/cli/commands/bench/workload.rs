//! The workload of measurements: a picture in two sizes, and the searches and scenes made from it.

use std::path::Path;
use std::sync::Arc;

use crate::cli::built_in;
use crate::cli::terminal::{self, Verbosity};
use crate::error::{Error, Result};
use crate::model::{Scene, Target};
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
        let [small, large] = SIDES_PX.map(|side_px| built_in::picture(side_px, [side_px; 2]));
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
