//! Maps that say where a picture matters.

use std::path::Path;

use image::DynamicImage;

use super::decode::{decode_raw, read_picture_file};
use super::kinds::{Coding, Kind, kind_of};
use super::raw::CutShort;
use super::{color, resize};
use crate::error::{Error, Result};
use crate::guard;

/// The luma of the map at `path`, resized to the size of its picture, row by row from the top. 0 is where the picture
/// matters least and 255 where it matters most.
///
/// Any picture that can be read can be a map. Grey counts as it is stored, colours by their luma, transparency as
/// black; EXIF orientation is applied. The bytes are the same on every machine.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, as for [`super::read`], or if its proportions differ from those of the
/// picture by more than a pixel at the smaller of the two sizes.
pub fn read_weights(path: &Path, size_px: (u32, u32), cut_short: CutShort) -> Result<Vec<u8>> {
    let (format, bytes) = read_picture_file(path)?;
    weights(&bytes, format, size_px, cut_short).map_err(|reason| Error::input(path, reason))
}

/// As [`read_weights`], of the map that a file of these bytes would hold.
///
/// # Errors
/// A sentence without the map's name.
pub fn decode_weights(bytes: &[u8], width_px: u32, height_px: u32) -> Result<Vec<u8>, String> {
    let format = match kind_of(bytes) {
        Kind::Read(format) => format,
        Kind::Foreign(foreign) => return Err(foreign.reason()),
        Kind::Other => return Err("not a picture that can be read".to_owned()),
    };
    weights(bytes, format, (width_px, height_px), CutShort::Refuse)
}

fn weights(bytes: &[u8], format: Coding, size_px: (u32, u32), cut_short: CutShort) -> Result<Vec<u8>, String> {
    guard::decoded(|| weights_unguarded(bytes, format, size_px, cut_short))
}

fn weights_unguarded(
    bytes: &[u8],
    format: Coding,
    size_px: (u32, u32),
    cut_short: CutShort,
) -> Result<Vec<u8>, String> {
    let raw = decode_raw(bytes, format, cut_short)?;
    let mut map = DynamicImage::ImageLuma8(color::to_luma_over_black(raw.image, &raw.space));
    map.apply_orientation(raw.orientation);
    let map = map.into_luma8();
    if !has_proportions_of(map.dimensions(), size_px) {
        let ((map_width_px, map_height_px), (width_px, height_px)) = (map.dimensions(), size_px);
        return Err(format!(
            "a map of {map_width_px}x{map_height_px} px does not fit a picture of {width_px}x{height_px} px; give it the \
             picture's proportions"
        ));
    }
    Ok(resize::fit_luma(&map, size_px))
}

/// Whether two sizes in px have the same proportions: reduced to the longer side of the smaller one, the larger one
/// differs from it by at most a pixel.
fn has_proportions_of(one: (u32, u32), other: (u32, u32)) -> bool {
    let long_side_px = |(width_px, height_px): (u32, u32)| width_px.max(height_px);
    let (small, large) = if long_side_px(one) <= long_side_px(other) { (one, other) } else { (other, one) };
    let (width_px, height_px) = resize::fitted_size(large, Some(long_side_px(small)));
    width_px.abs_diff(small.0) <= 1 && height_px.abs_diff(small.1) <= 1
}

#[cfg(test)]
mod tests {
    use super::has_proportions_of;

    #[test]
    fn proportions_are_compared_to_a_pixel_of_the_smaller_size() {
        let picture = (1000, 625);
        for like in [(1000, 625), (1000, 624), (100, 63), (100, 62), (512, 320), (8000, 5000), (4001, 2500), (8, 5)] {
            assert!(has_proportions_of(like, picture) && has_proportions_of(picture, like), "{like:?}");
        }
        for unlike in [(625, 1000), (1000, 627), (100, 60), (100, 65), (8000, 5020), (64, 64)] {
            assert!(!has_proportions_of(unlike, picture) && !has_proportions_of(picture, unlike), "{unlike:?}");
        }
    }
}
