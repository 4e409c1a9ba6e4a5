//! From the pixels of a decoder to 8-bit sRGB: ICC profile, then alpha, then 8 bits with a single rounding.
//!
//! Rows are converted one at a time in 16 bits per channel, so a 16-bit picture in a linear profile keeps its shadows.

use image::{DynamicImage, GrayAlphaImage, GrayImage, ImageBuffer, Pixel, RgbImage, RgbaImage};

use super::Background;
use super::icc::{IDENTITY, Profile, Shaper};
use super::raw::Space;

/// The picture in sRGB over `background`, as RGB. If transparency is kept and some pixel is not opaque, it is RGBA
/// instead, with the colours that are stored, not multiplied by alpha.
///
/// A profile that cannot be used is ignored with a warning.
pub(super) fn to_srgb(
    image: DynamicImage,
    space: &Space,
    background: Background,
    warnings: &mut Vec<String>,
) -> DynamicImage {
    let profile = profile_of(space, image.color().has_color()).unwrap_or_else(|reason| {
        warnings.push(format!("its ICC profile is ignored, so colours may be off: {reason}"));
        Profile::Srgb
    });
    match background {
        Background::Color(color) => Conversion { profile, background: color }.over_background(image).into(),
        Background::Transparent => {
            // Nothing shows the background: here it only stands behind pictures that are opaque.
            let conversion = Conversion { profile, background: [0; 3] };
            if has_transparency(&image) {
                conversion.with_alpha(image).into()
            } else {
                conversion.over_background(image).into()
            }
        }
    }
}

/// What a picture says of itself, which has colour or is grey, or the reason why it cannot be used.
fn profile_of(space: &Space, has_color: bool) -> Result<Profile, String> {
    match space {
        Space::Srgb => Ok(Profile::Srgb),
        Space::Icc(icc) => Profile::parse(icc, has_color),
        Space::Png(space) => {
            // Grey has no primaries.
            let matrix = if has_color { space.matrix } else { IDENTITY };
            Ok(Profile::Shaper(Box::new(Shaper::of_curve(|x| space.curve.light(x), matrix))))
        }
    }
}

/// Whether some pixel is not opaque.
fn has_transparency(image: &DynamicImage) -> bool {
    match image {
        DynamicImage::ImageLumaA8(image) => image.pixels().any(|pixel| pixel.0[1] != u8::MAX),
        DynamicImage::ImageRgba8(image) => image.pixels().any(|pixel| pixel.0[3] != u8::MAX),
        DynamicImage::ImageLumaA16(image) => image.pixels().any(|pixel| pixel.0[1] != u16::MAX),
        DynamicImage::ImageRgba16(image) => image.pixels().any(|pixel| pixel.0[3] != u16::MAX),
        DynamicImage::ImageRgba32F(image) => image.pixels().any(|pixel| quantised(pixel.0[3]) != u16::MAX),
        image => image.color().has_alpha(),
    }
}

/// The luma (weights of Rec. 709, of stored sRGB values) and the alpha of a picture.
///
/// A profile that cannot be used is left out: it would hardly change the luma.
pub(super) fn to_luma_and_alpha(image: DynamicImage, space: &Space) -> GrayAlphaImage {
    let profile = profile_of(space, image.color().has_color()).unwrap_or(Profile::Srgb);
    let image = image.into_rgba16();
    let mut stencil = Vec::with_capacity(image.width() as usize * image.height() as usize * 2);
    let (mut row, mut scratch) = (Vec::new(), Vec::new());
    for pixels in image.rows() {
        row.clear();
        row.extend(pixels.map(|pixel| pixel.0));
        profile.apply(&mut row, &mut scratch);
        for &[r, g, b, alpha] in &row {
            let luma = u64::from(r) * 2126 + u64::from(g) * 7152 + u64::from(b) * 722;
            stencil.push(((luma + 10_000 * 257 / 2) / (10_000 * 257)) as u8);
            stencil.push(narrowed(alpha));
        }
    }
    GrayAlphaImage::from_raw(image.width(), image.height(), stencil).expect("every row has been converted")
}

/// The luma of a picture over black: weights of Rec. 709, of stored sRGB values. Grey stays as it is stored, whatever
/// its profile, since somebody drew its values.
///
/// A profile that cannot be used is left out: it would hardly change the luma.
pub(super) fn to_luma_over_black(image: DynamicImage, space: &Space) -> GrayImage {
    let has_color = image.color().has_color();
    let profile = if has_color { profile_of(space, true).unwrap_or(Profile::Srgb) } else { Profile::Srgb };
    let image = image.into_rgba16();
    let mut lumas = Vec::with_capacity(image.width() as usize * image.height() as usize);
    let (mut row, mut scratch) = (Vec::new(), Vec::new());
    for pixels in image.rows() {
        row.clear();
        row.extend(pixels.map(|pixel| pixel.0));
        profile.apply(&mut row, &mut scratch);
        lumas.extend(row.iter().map(|&[r, g, b, alpha]| {
            let luma = (u64::from(r) * 2126 + u64::from(g) * 7152 + u64::from(b) * 722) * u64::from(alpha);
            let one = 10_000 * 65_535 * 257;
            ((luma + one / 2) / one) as u8
        }));
    }
    GrayImage::from_raw(image.width(), image.height(), lumas).expect("every row has been converted")
}

/// An 8-bit channel in 16 bits: 0 stays 0, 255 becomes 65,535.
fn widen(channel: u8) -> u16 {
    u16::from(channel) * 257
}

/// A 16-bit channel in 8 bits, rounded to the nearest.
fn narrowed(channel: u16) -> u8 {
    ((u32::from(channel) + 128) / 257) as u8
}

/// A float channel in 16 bits: [0, 1] becomes [0, 65,535], what lies outside is clipped, NaN is 0.
fn quantised(channel: f32) -> u16 {
    (channel * 65_535.0 + 0.5) as u16
}

/// How every row is brought to 8-bit sRGB over a background.
struct Conversion {
    profile: Profile,
    background: [u8; 3],
}

impl Conversion {
    /// The picture without its alpha.
    fn over_background(&self, image: DynamicImage) -> RgbImage {
        let (width_px, height_px) = (image.width(), image.height());
        let over = |pixel| self.composite(pixel);
        let opaque = match image {
            DynamicImage::ImageRgb8(image) if matches!(self.profile, Profile::Srgb) => return image,
            DynamicImage::ImageLuma8(image) => self.convert(&image, widen, over),
            DynamicImage::ImageLumaA8(image) => self.convert(&image, widen, over),
            DynamicImage::ImageRgb8(image) => self.convert(&image, widen, over),
            DynamicImage::ImageRgba8(image) => self.convert(&image, widen, over),
            DynamicImage::ImageRgb32F(image) => self.convert(&image, quantised, over),
            DynamicImage::ImageRgba32F(image) => self.convert(&image, quantised, over),
            image => self.convert(&image.into_rgba16(), |channel| channel, over),
        };
        RgbImage::from_raw(width_px, height_px, opaque).expect("every row has been converted")
    }

    /// The picture as it is stored, and its alpha beside that. A colour mixed with black would be a dark fringe around
    /// everything that has soft edges.
    fn with_alpha(&self, image: DynamicImage) -> RgbaImage {
        let (width_px, height_px) = (image.width(), image.height());
        let beside = |pixel: [u16; 4]| pixel.map(narrowed);
        let cut = match image {
            DynamicImage::ImageLumaA8(image) => self.convert(&image, widen, beside),
            DynamicImage::ImageRgba8(image) => self.convert(&image, widen, beside),
            DynamicImage::ImageRgba32F(image) => self.convert(&image, quantised, beside),
            image => self.convert(&image.into_rgba16(), |channel| channel, beside),
        };
        RgbaImage::from_raw(width_px, height_px, cut).expect("every row has been converted")
    }

    /// The channels of every pixel, widened, brought to sRGB and then to 8 bits.
    fn convert<P: Pixel, const CHANNELS: usize>(
        &self,
        image: &ImageBuffer<P, Vec<P::Subpixel>>,
        to_16_bits: impl Fn(P::Subpixel) -> u16,
        to_8_bits: impl Fn([u16; 4]) -> [u8; CHANNELS],
    ) -> Vec<u8> {
        let (width_px, height_px) = image.dimensions();
        let mut converted = Vec::with_capacity(width_px as usize * height_px as usize * CHANNELS);
        let mut row = Vec::with_capacity(width_px as usize);
        let mut scratch = Vec::new();
        for pixels in image.rows() {
            row.clear();
            row.extend(pixels.map(|pixel| pixel.to_rgba().0.map(&to_16_bits)));
            self.profile.apply(&mut row, &mut scratch);
            converted.extend(row.iter().flat_map(|&pixel| to_8_bits(pixel)));
        }
        converted
    }

    /// One pixel over the background, rounded once to 8 bits: for 8-bit input `(c*a + b*(255-a) + 127) / 255`.
    fn composite(&self, [r, g, b, alpha]: [u16; 4]) -> [u8; 3] {
        let alpha = u64::from(alpha);
        let over = |channel: u16, behind: u8| {
            let sum = u64::from(channel) * alpha + u64::from(behind) * 257 * (65_535 - alpha);
            ((sum + 65_535 * 257 / 2) / (65_535 * 257)) as u8
        };
        let [behind_r, behind_g, behind_b] = self.background;
        [over(r, behind_r), over(g, behind_g), over(b, behind_b)]
    }
}

#[cfg(test)]
mod tests {
    use super::{Conversion, Profile, quantised, widen};

    #[test]
    fn compositing_8_bit_channels_rounds_to_the_nearest_8_bit_value() {
        for alpha in 0..=255_u8 {
            for channel in [0, 1, 77, 128, 254, 255] {
                let conversion = Conversion { profile: Profile::Srgb, background: [0, 100, 255] };
                let pixel = [widen(channel), widen(channel), widen(channel), widen(alpha)];
                let expected = [0_u32, 100, 255].map(|behind| {
                    let (channel, alpha) = (u32::from(channel), u32::from(alpha));
                    ((channel * alpha + behind * (255 - alpha) + 127) / 255) as u8
                });
                assert_eq!(conversion.composite(pixel), expected, "channel {channel} at alpha {alpha}");
            }
        }
    }

    #[test]
    fn sixteen_bit_channels_are_rounded_to_the_nearest_8_bit_value() {
        let conversion = Conversion { profile: Profile::Srgb, background: [0; 3] };
        for channel in 0..=u16::MAX {
            let nearest = (f64::from(channel) / 257.0).round() as u8;
            assert_eq!(conversion.composite([channel, channel, channel, u16::MAX]), [nearest; 3], "channel {channel}");
        }
    }

    #[test]
    fn float_channels_are_clipped_and_rounded() {
        let cases = [(-1.0, 0), (0.0, 0), (0.5, 32_768), (1.0, 65_535), (7.0, 65_535), (f32::NAN, 0)];
        for (channel, expected) in cases {
            assert_eq!(quantised(channel), expected, "{channel}");
        }
    }
}
