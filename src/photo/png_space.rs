//! What the chunks gAMA, cHRM and cICP of a PNG say about colours, as browsers take them.
//!
//! Curves and matrices are evaluated in double precision with the powers of `libm`, as those of ICC profiles are, so
//! that the pixels are the same on every machine.

use png::CodingIndependentCodePoints;

use super::icc::{IDENTITY, Matrix, SRGB_FROM_XYZ, is_nearly_identity};

/// Places of white, red, green and blue in the CIE diagram.
type Primaries = [[f64; 2]; 4];

const D65: [f64; 2] = [0.3127, 0.3290];
/// White of CIE illuminant C.
const C: [f64; 2] = [0.310, 0.316];
/// XYZ of D50, the white of profiles.
const D50: [f64; 3] = [0.9642, 1.0, 0.8249];
/// To the cones' answers, in which white is adapted (Bradford).
const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
/// Gamma in 1/100,000 that stands for the curve of sRGB: writers say 45455 when they mean it, and libpng takes what is
/// this close for it.
const GAMMA_OF_SRGB: std::ops::RangeInclusive<u32> = 45_000..=46_000;

/// From a channel to light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Curve {
    Srgb,
    /// Rec. ITU-R BT.709.
    Video,
    /// Light is this power of a channel.
    Power(f64),
}

impl Curve {
    /// Light in [0, 1] of a channel in [0, 1].
    pub(super) fn light(self, x: f64) -> f64 {
        match self {
            Self::Srgb if x <= 0.040_45 => x / 12.92,
            Self::Srgb => libm::pow((x + 0.055) / 1.055, 2.4),
            Self::Video if x < 0.081 => x / 4.5,
            Self::Video => libm::pow((x + 0.099) / 1.099, 1.0 / 0.45),
            Self::Power(power) => libm::pow(x, power),
        }
    }
}

/// What channels mean: their curve, and linear sRGB from their light.
#[derive(Clone, Copy, Debug)]
pub(super) struct PngSpace {
    pub(super) curve: Curve,
    pub(super) matrix: Matrix,
}

impl PngSpace {
    /// None if it comes to sRGB, so that no pixel changes.
    fn unless_srgb(curve: Curve, matrix: Option<Matrix>) -> Result<Option<Self>, String> {
        let matrix = matrix.ok_or("its primaries make no colours; save the picture as sRGB")?;
        let is_srgb = curve == Curve::Srgb && is_nearly_identity(&matrix);
        Ok((!is_srgb).then_some(Self { curve, matrix }))
    }
}

/// What gAMA, in 1/100,000, and cHRM say, if it is not sRGB; what is missing is that of sRGB.
pub(super) fn of_gamma_and_primaries(
    gamma: Option<u32>,
    primaries: Option<Primaries>,
) -> Result<Option<PngSpace>, String> {
    let curve = match gamma {
        None => Curve::Srgb,
        Some(gamma) if GAMMA_OF_SRGB.contains(&gamma) => Curve::Srgb,
        // Nobody means less than a hundredth or more than ten.
        Some(gamma) if (1_000..=1_000_000).contains(&gamma) => Curve::Power(100_000.0 / f64::from(gamma)),
        Some(gamma) => return Err(format!("a gamma of {:.5} means nothing", f64::from(gamma) / 100_000.0)),
    };
    PngSpace::unless_srgb(curve, primaries.map_or(Some(IDENTITY), |primaries| matrix(&primaries)))
}

/// What cICP says (Rec. ITU-T H.273), if it is not sRGB.
pub(super) fn of_code_points(coded: CodingIndependentCodePoints) -> Result<Option<PngSpace>, String> {
    let CodingIndependentCodePoints { color_primaries, transfer_function, is_video_full_range_image, .. } = coded;
    let primaries = match color_primaries {
        1 => [D65, [0.640, 0.330], [0.300, 0.600], [0.150, 0.060]],
        4 => [C, [0.67, 0.33], [0.21, 0.71], [0.14, 0.08]],
        5 => [D65, [0.64, 0.33], [0.29, 0.60], [0.15, 0.06]],
        6 | 7 => [D65, [0.630, 0.340], [0.310, 0.595], [0.155, 0.070]],
        8 => [C, [0.681, 0.319], [0.243, 0.692], [0.145, 0.049]],
        9 => [D65, [0.708, 0.292], [0.170, 0.797], [0.131, 0.046]],
        11 => [[0.314, 0.351], [0.680, 0.320], [0.265, 0.690], [0.150, 0.060]],
        12 => [D65, [0.680, 0.320], [0.265, 0.690], [0.150, 0.060]],
        22 => [D65, [0.630, 0.340], [0.295, 0.605], [0.155, 0.077]],
        other => return Err(format!("primaries of number {other} are not known")),
    };
    let curve = match transfer_function {
        1 | 6 | 14 | 15 => Curve::Video,
        4 => Curve::Power(2.2),
        5 => Curve::Power(2.8),
        8 => Curve::Power(1.0),
        13 => Curve::Srgb,
        16 | 18 => return Err("it is HDR; save the picture as sRGB".to_owned()),
        other => return Err(format!("a curve of number {other} is not known")),
    };
    if !is_video_full_range_image {
        return Err("it is of narrow range; save the picture as sRGB".to_owned());
    }
    PngSpace::unless_srgb(curve, matrix(&primaries))
}

/// Linear sRGB from light of these primaries, or `None` if they make no colours.
fn matrix(primaries: &Primaries) -> Option<Matrix> {
    let xyz = |[x, y]: [f64; 2]| (y > 1e-6).then(|| [x / y, 1.0, (1.0 - x - y) / y]);
    let [white, red, green, blue] = primaries.map(xyz);
    let (white, columns) = (white?, transposed(&[red?, green?, blue?]));
    let shares = applied(&inverse(&columns)?, white);
    let scaled = columns.map(|row| [row[0] * shares[0], row[1] * shares[1], row[2] * shares[2]]);
    let (from, to) = (applied(&BRADFORD, white), applied(&BRADFORD, D50));
    if from.iter().any(|answer| answer.abs() < 1e-6) {
        return None;
    }
    let ratio = |cone: usize, column: usize| if cone == column { to[cone] / from[cone] } else { 0.0 };
    let adapted = [0, 1, 2].map(|cone| [0, 1, 2].map(|column| ratio(cone, column)));
    let adaptation = product(&inverse(&BRADFORD)?, &product(&adapted, &BRADFORD));
    Some(product(&SRGB_FROM_XYZ, &product(&adaptation, &scaled)))
}

fn applied(matrix: &Matrix, [x, y, z]: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * x + row[1] * y + row[2] * z)
}

fn transposed(matrix: &Matrix) -> Matrix {
    [0, 1, 2].map(|column| matrix.map(|row| row[column]))
}

fn product(left: &Matrix, right: &Matrix) -> Matrix {
    transposed(&transposed(right).map(|column| applied(left, column)))
}

fn inverse(matrix: &Matrix) -> Option<Matrix> {
    let [a, b, c] = *matrix;
    let cross =
        |u: [f64; 3], v: [f64; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let columns = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = a[0] * columns[0][0] + a[1] * columns[0][1] + a[2] * columns[0][2];
    (determinant.abs() > 1e-9).then(|| transposed(&columns).map(|row| row.map(|value| value / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coded(
        color_primaries: u8,
        transfer_function: u8,
        is_video_full_range_image: bool,
    ) -> Result<Option<PngSpace>, String> {
        of_code_points(CodingIndependentCodePoints {
            color_primaries,
            transfer_function,
            matrix_coefficients: 0,
            is_video_full_range_image,
        })
    }

    #[test]
    fn what_means_srgb_is_srgb() {
        let srgb = Some([D65, [0.64, 0.33], [0.30, 0.60], [0.15, 0.06]]);
        for (gamma, primaries) in [(None, None), (Some(45_455), None), (None, srgb), (Some(45_455), srgb)] {
            assert!(matches!(of_gamma_and_primaries(gamma, primaries), Ok(None)), "{gamma:?} {primaries:?}");
        }
        assert!(matches!(coded(1, 13, true), Ok(None)));
    }

    #[test]
    fn white_stays_white_and_display_p3_has_the_matrix_that_is_published() {
        // CSS Color 4, "Sample code for color conversions": linear Display P3 to linear sRGB.
        let expected = [[1.22494, -0.22494, 0.0], [-0.04206, 1.04206, 0.0], [-0.01964, -0.07864, 1.09827]];
        let Ok(Some(space)) = coded(12, 13, true) else { panic!("it is not sRGB") };
        for (found, expected) in space.matrix.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 5e-4, "{:?}", space.matrix);
        }
        for primaries in [1, 4, 5, 6, 8, 9, 11, 12, 22] {
            let Ok(Some(space)) = coded(primaries, 8, true) else { panic!("{primaries} is linear") };
            assert!(applied(&space.matrix, [1.0; 3]).iter().all(|channel| (channel - 1.0).abs() < 5e-4), "{primaries}");
        }
    }

    #[test]
    fn what_means_nothing_is_refused_with_a_reason() {
        for (primaries, transfer, is_full) in
            [(2, 13, true), (1, 2, true), (9, 16, true), (9, 18, true), (1, 13, false)]
        {
            assert!(coded(primaries, transfer, is_full).is_err(), "{primaries} {transfer} {is_full}");
        }
        assert!(of_gamma_and_primaries(Some(1), None).is_err());
        for primaries in [[[0.3, 0.0]; 4], [[0.3, 0.3]; 4]] {
            assert!(of_gamma_and_primaries(None, Some(primaries)).is_err(), "{primaries:?}");
        }
    }

    #[test]
    fn curves_begin_at_black_end_at_white_and_rise() {
        for curve in [Curve::Srgb, Curve::Video, Curve::Power(1.0), Curve::Power(2.2)] {
            assert_eq!(curve.light(0.0), 0.0, "{curve:?}");
            assert!((curve.light(1.0) - 1.0).abs() < 1e-12, "{curve:?}");
            assert!(
                (1..100).all(|step| curve.light(f64::from(step) / 100.0) < curve.light(f64::from(step + 1) / 100.0))
            );
        }
    }
}
