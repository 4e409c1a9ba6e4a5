//! Gradient-magnitude similarity of luma and its deviation (GMSD, Xue et al. 2014): means of 2x2 px, of which every
//! second one is kept, then Prewitt's gradient and c = 170.

use super::luma::{Plane, columns_around};

/// The constant c of the paper, for luma of 0 to 1 instead of 0 to 255.
const C: f64 = 170.0 / 65_025.0;

/// How alike the gradients of two pictures are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientSimilarity {
    /// Mean of the similarity of all pixels (GMSM), at most 1: identical.
    pub mean: f64,
    /// Standard deviation of the similarity (GMSD), 0: identical.
    pub deviation: f64,
}

impl GradientSimilarity {
    /// Compares the gradient magnitudes of two pictures of the same size.
    pub(super) fn between(one: &[f64], other: &[f64]) -> Self {
        let similarity = |(a, b): (&f64, &f64)| (2.0 * a * b + C) / (a * a + b * b + C);
        let map: Vec<f64> = one.iter().zip(other).map(similarity).collect();
        let mean = map.iter().sum::<f64>() / map.len() as f64;
        let variance = map.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / map.len() as f64;
        Self { mean, deviation: variance.sqrt() }
    }
}

/// Gradient magnitudes of a picture at half its size, rounded up.
pub(super) fn magnitudes(luma: &Plane) -> Vec<f64> {
    let half = halved(luma);
    let mut magnitudes = Vec::with_capacity(half.values.len());
    for y in 0..half.height {
        let [above, here, below] = half.rows_around(y);
        magnitudes.extend((0..half.width).map(|x| {
            let [left, middle, right] = columns_around(x, half.width);
            let across: f64 = [above, here, below].iter().map(|row| row[right] - row[left]).sum();
            let down: f64 = [left, middle, right].iter().map(|&x| below[x] - above[x]).sum();
            (across * across + down * down).sqrt() / 3.0
        }));
    }
    magnitudes
}

/// Every second pixel along both axes, as the mean of itself and its neighbours to the left, above, and above left.
fn halved(luma: &Plane) -> Plane {
    let (width, height) = (luma.width.div_ceil(2), luma.height.div_ceil(2));
    let mut values = Vec::with_capacity(width * height);
    for y in 0..height {
        let [above, here, _] = luma.rows_around(2 * y);
        values.extend((0..width).map(|x| {
            let [left, middle, _] = columns_around(2 * x, luma.width);
            (above[left] + above[middle] + here[left] + here[middle]) / 4.0
        }));
    }
    Plane { width, height, values }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8x7 px, black on the left half and white on the right.
    fn step() -> Plane {
        Plane { width: 8, height: 7, values: (0..56).map(|i| if i % 8 < 4 { 0.0 } else { 1.0 }).collect() }
    }

    #[test]
    fn a_step_has_its_gradient_across_it_and_none_along_it() {
        let magnitudes = magnitudes(&step());
        // The halved rows are 0, 0, 1/2, 1.
        assert_eq!(magnitudes.len(), 16);
        for row in magnitudes.chunks(4) {
            assert!(
                row.iter().zip([0.0, 0.5, 1.0, 0.5]).all(|(value, wanted)| (value - wanted).abs() < 1e-15),
                "{row:?}"
            );
        }
    }

    #[test]
    fn the_similarity_of_a_step_to_black_matches_the_one_computed_by_hand() {
        let similarity = GradientSimilarity::between(&magnitudes(&step()), &[0.0; 16]);
        let (weak, strong) = (170.0 / (127.5 * 127.5 + 170.0), 170.0 / (255.0 * 255.0 + 170.0));
        let mean = (1.0 + 2.0 * weak + strong) / 4.0;
        let squares = (1.0 + 2.0 * weak * weak + strong * strong) / 4.0;
        assert!((similarity.mean - mean).abs() < 1e-12, "{similarity:?}");
        assert!((similarity.deviation - (squares - mean * mean).sqrt()).abs() < 1e-12, "{similarity:?}");
    }
}
