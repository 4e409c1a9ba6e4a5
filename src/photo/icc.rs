//! ICC profiles: what the numbers of a picture mean, turned into sRGB.
//!
//! Cameras, editors and phones embed curves and a matrix. These are evaluated here, in double precision and with the
//! powers of `libm`, because `moxcms` fuses multiplications where the processor can and so rounds differently on
//! different machines. `moxcms` still parses every profile, and evaluates those that have only tables: of inks, and of
//! some scanners.

use std::sync::Arc;

use moxcms::{ColorProfile, DataColorSpace, Layout, ToneReprCurve, Transform16BitExecutor, TransformOptions};

use crate::guard;

/// From three channels to three.
pub(super) type Matrix = [[f64; 3]; 3];

/// Linear sRGB from XYZ under D50, the white of profiles (B. Lindbloom, Bradford-adapted).
pub(super) const SRGB_FROM_XYZ: Matrix = [
    [3.133_856_1, -1.616_866_7, -0.490_614_6],
    [-0.978_768_4, 1.916_141_5, 0.033_454_0],
    [0.071_945_3, -0.228_991_4, 1.405_242_7],
];
pub(super) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// Profiles round the primaries of sRGB in different ways. A profile this close to sRGB counts as sRGB, so that the
/// most common profile of all changes no pixel.
const SRGB_TOLERANCE: f64 = 1e-3;
/// Steps of a 16-bit channel.
const STEPS: usize = 65_535;

/// How the channels of a picture become sRGB.
pub(super) enum Profile {
    /// They are sRGB.
    Srgb,
    /// By curves and a matrix.
    Shaper(Box<Shaper>),
    /// By tables, which `moxcms` evaluates.
    Tables(Arc<Transform16BitExecutor>),
}

/// Whether a profile is for cyan, magenta, yellow and black.
pub(super) fn is_of_inks(icc: &[u8]) -> bool {
    ColorProfile::new_from_slice(icc).is_ok_and(|profile| profile.color_space == DataColorSpace::Cmyk)
}

/// The sRGB samples of inks, four bytes a pixel, by the tables of their profile.
pub(super) fn srgb_of_inks(icc: &[u8], inks: &[u8]) -> Result<Vec<u8>, String> {
    let unusable = |error: moxcms::CmsError| format!("it cannot be used ({error}); save the picture as sRGB");
    let profile = ColorProfile::new_from_slice(icc).map_err(unusable)?;
    let (srgb, options) = (ColorProfile::new_srgb(), TransformOptions::default());
    let transform = profile.create_transform_8bit(Layout::Rgba, &srgb, Layout::Rgb, options).map_err(unusable)?;
    let mut samples = vec![0; inks.len() / 4 * 3];
    transform.transform(inks, &mut samples).map_err(unusable)?;
    Ok(samples)
}

impl Profile {
    /// The profile in `icc` for a picture that has colour or is grey, or the reason why it cannot be used.
    pub(super) fn parse(icc: &[u8], has_color: bool) -> Result<Self, String> {
        guard::caught(|| Self::parse_unguarded(icc, has_color))
            .unwrap_or_else(|panicked| Err(format!("it is broken ({panicked})")))
    }

    fn parse_unguarded(icc: &[u8], has_color: bool) -> Result<Self, String> {
        let profile = ColorProfile::new_from_slice(icc).map_err(|error| format!("it is broken ({error})"))?;
        match (profile.color_space, has_color) {
            (DataColorSpace::Rgb | DataColorSpace::Gray, _) if profile.pcs == DataColorSpace::Xyz => {
                Shaper::new(&profile, has_color)
                    .map_or_else(|| Self::tables(&profile), |shaper| Ok(Self::Shaper(Box::new(shaper))))
            }
            (DataColorSpace::Rgb, _) => Self::tables(&profile),
            (other, _) => Err(format!("it is for {other:?} pixels; save the picture as sRGB")),
        }
    }

    fn tables(profile: &ColorProfile) -> Result<Self, String> {
        profile
            .create_transform_16bit(Layout::Rgba, &ColorProfile::new_srgb(), Layout::Rgba, TransformOptions::default())
            .map(Self::Tables)
            .map_err(|error| format!("it cannot be used ({error}); save the picture as sRGB"))
    }

    /// Brings a row of RGBA pixels, 16 bits per channel, to sRGB; alpha stays. `scratch` is overwritten.
    pub(super) fn apply(&self, row: &mut [[u16; 4]], scratch: &mut Vec<u16>) {
        match self {
            Self::Srgb => {}
            Self::Shaper(shaper) => row.iter_mut().for_each(|pixel| shaper.apply(pixel)),
            Self::Tables(transform) => {
                scratch.clear();
                scratch.extend_from_slice(row.as_flattened());
                transform.transform(scratch, row.as_flattened_mut()).expect("source and destination hold one row each");
            }
        }
    }
}

/// A profile of three curves and a matrix. A grey profile has equal curves and the identity.
pub(super) struct Shaper {
    /// For each channel, the linear light in [0, 1] of every 16-bit value.
    linear: [Vec<f64>; 3],
    /// Linear sRGB from the profile's linear channels.
    matrix: Matrix,
    /// 16-bit sRGB of linear light, at every 1/65,535.
    encoded: Vec<f64>,
}

impl Shaper {
    /// `None` if the profile has no curves or no matrix, or is grey and the picture is not.
    fn new(profile: &ColorProfile, has_color: bool) -> Option<Self> {
        let gray = profile.color_space == DataColorSpace::Gray;
        let (curves, matrix) = if gray && !has_color {
            let curve = profile.gray_trc.as_ref()?;
            ([curve; 3], IDENTITY)
        } else if !gray && profile.is_matrix_shaper() {
            let curves = [profile.red_trc.as_ref()?, profile.green_trc.as_ref()?, profile.blue_trc.as_ref()?];
            (curves, srgb_from_channels(profile))
        } else {
            return None;
        };
        let [red, green, blue] = curves.map(linear_values);
        Some(Self { linear: [red?, green?, blue?], matrix, encoded: encoded_values() })
    }

    /// Of one curve for all channels, which gives the light in [0, 1] of a value in [0, 1], and linear sRGB from that.
    pub(super) fn of_curve(light: impl Fn(f64) -> f64, matrix: Matrix) -> Self {
        let linear: Vec<f64> = (0..=STEPS).map(|step| light(step as f64 / STEPS as f64).clamp(0.0, 1.0)).collect();
        Self { linear: [linear.clone(), linear.clone(), linear], matrix, encoded: encoded_values() }
    }

    fn apply(&self, pixel: &mut [u16; 4]) {
        let [r, g, b] = [0, 1, 2].map(|channel| self.linear[channel][usize::from(pixel[channel])]);
        for (channel, row) in self.matrix.iter().enumerate() {
            pixel[channel] = self.encode(row[0] * r + row[1] * g + row[2] * b);
        }
    }

    /// The 16-bit sRGB value of linear light, clipped to [0, 1] and interpolated between the steps.
    fn encode(&self, linear: f64) -> u16 {
        let position = linear.clamp(0.0, 1.0) * STEPS as f64;
        let step = (position as usize).min(STEPS - 1);
        let (below, above) = (self.encoded[step], self.encoded[step + 1]);
        (below + (above - below) * (position - step as f64) + 0.5) as u16
    }
}

/// Linear sRGB from the linear channels of an RGB profile.
fn srgb_from_channels(profile: &ColorProfile) -> Matrix {
    let columns = [profile.red_colorant, profile.green_colorant, profile.blue_colorant];
    let matrix = SRGB_FROM_XYZ.map(|row| columns.map(|xyz| row[0] * xyz.x + row[1] * xyz.y + row[2] * xyz.z));
    if is_nearly_identity(&matrix) { IDENTITY } else { matrix }
}

/// Whether a matrix is that of sRGB but for rounding.
pub(super) fn is_nearly_identity(matrix: &Matrix) -> bool {
    let off = matrix.as_flattened().iter().zip(IDENTITY.as_flattened()).map(|(value, unit)| (value - unit).abs());
    off.fold(0.0, f64::max) < SRGB_TOLERANCE
}

/// 16-bit sRGB of linear light at every step.
fn encoded_values() -> Vec<f64> {
    (0..=STEPS).map(|step| STEPS as f64 * srgb_encoded(step as f64 / STEPS as f64)).collect()
}

/// Linear light of every 16-bit channel value under a curve (ICC.1:2022, 10.6 and 10.18).
fn linear_values(curve: &ToneReprCurve) -> Option<Vec<f64>> {
    let light: Box<dyn Fn(f64) -> f64> = match curve {
        ToneReprCurve::Lut(values) => match values[..] {
            [] => Box::new(|x| x),
            [gamma] => Box::new(move |x| libm::pow(x, f64::from(gamma) / 256.0)),
            _ => Box::new(|x| interpolated(values, x)),
        },
        ToneReprCurve::Parametric(parameters) => parametric(parameters)?,
    };
    Some((0..=STEPS).map(|step| light(step as f64 / STEPS as f64).clamp(0.0, 1.0)).collect())
}

/// The value at `x` in [0, 1] of a curve given by two or more equally spaced 16-bit values.
fn interpolated(values: &[u16], x: f64) -> f64 {
    let position = x * (values.len() - 1) as f64;
    let step = (position as usize).min(values.len() - 2);
    let (below, above) = (f64::from(values[step]), f64::from(values[step + 1]));
    (below + (above - below) * (position - step as f64)) / STEPS as f64
}

/// The function of the ICC's five parametric types, told apart by their number of parameters.
fn parametric(parameters: &[f32]) -> Option<Box<dyn Fn(f64) -> f64>> {
    let p: Vec<f64> = parameters.iter().copied().map(f64::from).collect();
    // Y = (aX + b)^g + e from X = d on, and cX + f below.
    let (g, a, b, c, d, e, f) = match p[..] {
        [g] => (g, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        [g, a, b] => (g, a, b, 0.0, -b / a, 0.0, 0.0),
        [g, a, b, c] => (g, a, b, 0.0, -b / a, c, c),
        [g, a, b, c, d] => (g, a, b, c, d, 0.0, 0.0),
        [g, a, b, c, d, e, f] => (g, a, b, c, d, e, f),
        _ => return None,
    };
    Some(Box::new(move |x| if x >= d { libm::pow(a * x + b, g) + e } else { c * x + f }))
}

/// The sRGB curve (IEC 61966-2-1): encoded value of linear light, both in [0, 1].
fn srgb_encoded(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use moxcms::{ColorProfile, ToneReprCurve};

    use super::{Shaper, linear_values, srgb_encoded};

    fn shaper(profile: &ColorProfile) -> Shaper {
        Shaper::new(profile, true).expect("it has curves and a matrix")
    }

    /// Random colours, one in eight channels at a bound.
    fn colors() -> impl Iterator<Item = [u16; 4]> {
        let mut state = 1_u64;
        std::iter::repeat_with(move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            [48, 32, 16].map(|shift| (state >> shift) as u16)
        })
        .map(|rgb| rgb.map(|value| if value % 8 == 0 { u16::MAX * (value / 8 % 2) } else { value }))
        .map(|[r, g, b]| [r, g, b, 12_345])
        .take(20_000)
    }

    #[test]
    fn the_srgb_profile_changes_no_8_bit_channel() {
        let shaper = shaper(&ColorProfile::new_srgb());
        for value in 0..=255 {
            let mut pixel = [value * 257, 65_535 - value * 257, 128 * 257, 7];
            let before = pixel;
            shaper.apply(&mut pixel);
            assert_eq!(
                pixel.map(|channel| (u32::from(channel) + 128) / 257),
                before.map(|channel| (u32::from(channel) + 128) / 257)
            );
        }
    }

    #[test]
    fn a_profile_is_evaluated_as_its_formulas_say() {
        let profile = ColorProfile::new_adobe_rgb();
        let shaper = shaper(&profile);
        for color in colors() {
            let light = [0, 1, 2].map(|i| (f64::from(color[i]) / 65_535.0).powf(2.199_218_75));
            let mut pixel = color;
            shaper.apply(&mut pixel);
            for (channel, row) in super::srgb_from_channels(&profile).iter().enumerate() {
                let linear = (0..3).map(|i| row[i] * light[i]).sum::<f64>().clamp(0.0, 1.0);
                let exact = srgb_encoded(linear) * 65_535.0;
                assert!((f64::from(pixel[channel]) - exact).abs() < 1.5, "{color:?} became {pixel:?}");
            }
            assert_eq!(pixel[3], color[3], "alpha stays");
        }
    }

    #[test]
    fn neutral_stays_neutral_in_a_profile_of_other_primaries() {
        let shaper = shaper(&ColorProfile::new_display_p3());
        for value in (0..=u16::MAX).step_by(257) {
            let mut pixel = [value, value, value, 0];
            shaper.apply(&mut pixel);
            assert!(pixel[..3].iter().all(|channel| channel.abs_diff(value) < 64), "{value} became {pixel:?}");
        }
    }

    #[test]
    fn curves_of_every_kind_give_their_light() {
        let at_half = |curve| linear_values(&curve).expect("a known curve")[32_768];
        let half = 32_768.0 / 65_535.0;
        let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-6, "{value} is not {expected}");
        near(at_half(ToneReprCurve::Lut(vec![])), half);
        near(at_half(ToneReprCurve::Lut(vec![512])), half * half);
        near(at_half(ToneReprCurve::Lut(vec![0, 65_535, 0])), 1.0 - (half * 2.0 - 1.0));
        near(at_half(ToneReprCurve::Parametric(vec![2.0])), half * half);
        near(at_half(ToneReprCurve::Parametric(vec![1.0, 0.5, 0.25])), half * 0.5 + 0.25);
        near(at_half(ToneReprCurve::Parametric(vec![1.0, 0.5, 0.0, 0.125])), half * 0.5 + 0.125);
        near(at_half(ToneReprCurve::Parametric(vec![1.0, 1.0, 0.0, 0.25, 0.75])), half * 0.25);
        near(at_half(ToneReprCurve::Parametric(vec![1.0, 1.0, 0.0, 0.25, 0.75, 0.0, 0.5])), half * 0.25 + 0.5);
        assert!(linear_values(&ToneReprCurve::Parametric(vec![1.0, 1.0])).is_none());
    }
}
