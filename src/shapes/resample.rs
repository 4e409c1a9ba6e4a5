//! Resizes a drawing of any size to the size of a mask, with integers.

use super::ink::Ink;
use crate::model::mask::MASK_SIDE;

/// Fractional steps of the values between the two passes.
const FRACTION: u64 = 16;

/// The drawing of `width_px` x `height_px` stretched to [`MASK_SIDE`] x [`MASK_SIDE`] texels.
///
/// The filter is a triangle as wide as a texel or a pixel, whichever is larger: it averages when it reduces and
/// interpolates when it enlarges. Intensity is weighted by alpha, so holes do not affect the colour of their
/// neighbours.
pub(super) fn stretched(ink: &[Ink], width_px: u32, height_px: u32) -> Vec<Ink> {
    let columns = weights(width_px as usize);
    let mut narrow = Vec::with_capacity(MASK_SIDE * height_px as usize);
    for row in ink.chunks_exact(width_px as usize) {
        narrow.extend(columns.iter().map(|Taps { first, weights, sum }| {
            let part = weighted(
                weights,
                row[*first..].iter().map(|ink| {
                    let alpha = u64::from(ink.alpha);
                    [alpha * 255, alpha * u64::from(ink.intensity)]
                }),
            );
            part.map(|value| (value * FRACTION + sum / 2) / sum)
        }));
    }
    let mut texels = Vec::with_capacity(MASK_SIDE * MASK_SIDE);
    for Taps { first, weights, sum } in weights(height_px as usize) {
        for column in 0..MASK_SIDE {
            let below = narrow[first * MASK_SIDE + column..].iter().step_by(MASK_SIDE);
            let [alpha, premultiplied] = weighted(&weights, below.copied());
            let full = sum * FRACTION * 255;
            texels.push(Ink {
                alpha: ((alpha + full / 2) / full) as u8,
                intensity: (premultiplied * 255 + alpha / 2).checked_div(alpha).unwrap_or(255) as u8,
            });
        }
    }
    texels
}

/// The pixels that contribute to one texel along one axis.
struct Taps {
    first: usize,
    weights: Vec<u64>,
    sum: u64,
}

/// For each texel along an axis of `side_px` pixels, its pixels, with weights that fall linearly with the distance of
/// centres.
fn weights(side_px: usize) -> Vec<Taps> {
    let (side, texels) = (side_px as i64, MASK_SIDE as i64);
    // Coordinates are in 1 / (2 * texels) px: pixel i lies at (2 i + 1) * texels, texel k at (2 k + 1) * side.
    let support = 2 * side.max(texels);
    let taps = |texel: i64| {
        let centre = (2 * texel + 1) * side;
        let weight = |pixel: i64| support - (centre - (2 * pixel + 1) * texels).abs();
        let first = ((centre - support) / (2 * texels) - 1).max(0);
        let last = ((centre + support) / (2 * texels) + 1).min(side - 1);
        let near: Vec<i64> = (first..=last).filter(|&pixel| weight(pixel) > 0).collect();
        let weights: Vec<u64> = near.iter().map(|&pixel| weight(pixel) as u64).collect();
        Taps { first: near[0] as usize, sum: weights.iter().sum(), weights }
    };
    (0..texels).map(taps).collect()
}

fn weighted(weights: &[u64], values: impl Iterator<Item = [u64; 2]>) -> [u64; 2] {
    let add = |[a, b]: [u64; 2], (weight, [c, d]): (&u64, [u64; 2])| [a + weight * c, b + weight * d];
    weights.iter().zip(values).fold([0, 0], add)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_of_the_right_size_stays_as_it_is() {
        let ink: Vec<Ink> = (0..MASK_SIDE * MASK_SIDE)
            .map(|index| Ink { alpha: 1 + (index * 7 % 255) as u8, intensity: (index * 31 % 256) as u8 })
            .collect();
        assert_eq!(stretched(&ink, 256, 256), ink);
    }

    #[test]
    fn an_even_drawing_of_any_size_stays_even() {
        let even = Ink { alpha: 201, intensity: 77 };
        for (width_px, height_px) in [(1, 1), (1, 900), (3, 2), (255, 257), (1021, 12)] {
            let ink = vec![even; (width_px * height_px) as usize];
            assert!(stretched(&ink, width_px, height_px).iter().all(|&ink| ink == even), "{width_px}x{height_px}");
        }
    }

    #[test]
    fn the_intensity_of_a_hole_does_not_show_beside_it() {
        let checked = |index| if index % 2 == 0 { Ink { alpha: 255, intensity: 200 } } else { Ink::default() };
        let ink: Vec<Ink> = (0..1023).map(checked).collect();
        assert!(stretched(&ink, 1023, 1).iter().all(|ink| ink.intensity == 200 && (100..160).contains(&ink.alpha)));
    }
}
