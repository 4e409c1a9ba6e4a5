//! How alike two pictures are: errors of channels, structure, gradients, edges.
//!
//! All figures are computed from stored 8-bit sRGB and defined as in numpy, scipy 1.17 and scikit-image 0.26, so others
//! can recompute them. They may be floats, since no evolution depends on them; the number of threads does not change
//! them. Works on borrowed pixels: knows no fly, no file and no device.

mod difference;
mod edges;
mod flicker;
mod gradient;
mod luma;
mod similarity;

pub use difference::Difference;
pub use edges::EdgeMatch;
pub use flicker::Flicker;
pub use gradient::GradientSimilarity;

use edges::EdgeMap;
use luma::Plane;

/// Least side in px of a picture that can be scored: the side of the window of the structural similarity.
pub const SIDE_MIN_PX: u32 = similarity::WINDOW_PX as u32;

/// The pixels of a picture: 8-bit sRGB, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// Width in px.
    pub width_px: u32,
    /// Height in px.
    pub height_px: u32,
    /// `width_px * height_px` colours.
    pub pixels: &'a [[u8; 3]],
}

/// How much a picture is like its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Errors of channels.
    pub difference: Difference,
    /// Mean structural similarity (Wang et al. 2004), at most 1: identical.
    pub ssim: f64,
    /// Similarity of gradients of luma.
    pub gradients: GradientSimilarity,
    /// How well the edges are kept.
    pub edges: EdgeMatch,
}

/// A picture that others are compared with.
#[derive(Debug)]
pub struct Reference<'a> {
    picture: Picture<'a>,
    gradients: Vec<f64>,
    edges: EdgeMap,
}

impl<'a> Reference<'a> {
    /// Prepares a picture that others are compared with.
    ///
    /// # Errors
    /// A sentence without the file's name if a side is below [`SIDE_MIN_PX`].
    ///
    /// # Panics
    /// If there are more or fewer pixels than the size says.
    pub fn new(picture: Picture<'a>) -> Result<Self, String> {
        let Picture { width_px, height_px, pixels } = picture;
        assert_eq!(pixels.len(), width_px as usize * height_px as usize, "every pixel and no more");
        if width_px.min(height_px) < SIDE_MIN_PX {
            return Err(format!(
                "the picture has {width_px}x{height_px} px, fewer than the {SIDE_MIN_PX}x{SIDE_MIN_PX} that a score \
                 needs; use a larger one"
            ));
        }
        let luma = Plane::luma(&picture);
        Ok(Self { picture, gradients: gradient::magnitudes(&luma), edges: EdgeMap::find(&luma) })
    }

    /// How much `other` is like this picture.
    ///
    /// # Errors
    /// A sentence without the file's name if the sizes differ.
    pub fn score(&self, other: Picture<'_>) -> Result<Score, String> {
        let (own, its) = ((self.picture.width_px, self.picture.height_px), (other.width_px, other.height_px));
        if own != its {
            return Err(format!(
                "the picture has {}x{} px and the reference {}x{}; resize one of them",
                its.0, its.1, own.0, own.1
            ));
        }
        let Reference { gradients, edges, .. } = Reference::new(other)?;
        Ok(Score {
            difference: Difference::between(self.picture.pixels, other.pixels),
            ssim: similarity::mean(&self.picture, &other),
            gradients: GradientSimilarity::between(&self.gradients, &gradients),
            edges: EdgeMatch::between(&self.edges, &edges),
        })
    }
}

/// Whether each pixel of `picture` belongs to an edge, as [`Score::edges`] sees it.
///
/// # Errors
/// As [`Reference::new`].
pub fn edge_pixels(picture: Picture<'_>) -> Result<Vec<bool>, String> {
    Ok(Reference::new(picture)?.edges.pixels())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width_px: u32, height_px: u32, pixels: &[[u8; 3]]) -> Picture<'_> {
        Picture { width_px, height_px, pixels }
    }

    fn score(reference: Picture<'_>, other: Picture<'_>) -> Result<Score, String> {
        Reference::new(reference)?.score(other)
    }

    #[test]
    fn a_picture_is_exactly_like_itself() {
        let pixels: Vec<[u8; 3]> =
            (0..12 * 9_u32).map(|i| [(i * 7) as u8, (i * i) as u8, (i / 12 * 29) as u8]).collect();
        let score = score(picture(12, 9, &pixels), picture(12, 9, &pixels)).expect("it is large enough");
        assert_eq!([score.difference.sae(), score.difference.squares()], [0, 0]);
        assert_eq!(score.difference.psnr_db(), None);
        assert_eq!([score.ssim, score.gradients.mean, score.gradients.deviation], [1.0, 1.0, 0.0]);
        assert_eq!(score.edges, EdgeMatch { precision: 1.0, recall: 1.0 });
    }

    #[test]
    fn pictures_too_small_or_of_unlike_sizes_are_refused_with_the_sizes() {
        let pixels = [[0; 3]; 70];
        let refusal = score(picture(10, 6, &pixels[..60]), picture(10, 7, &pixels)).expect_err("it is too low");
        assert!(refusal.contains("10x6") && refusal.contains("7x7"), "{refusal}");
        let refusal = score(picture(10, 7, &pixels), picture(7, 10, &pixels)).expect_err("it is upright");
        assert!(refusal.contains("7x10") && refusal.contains("10x7"), "{refusal}");
    }
}
