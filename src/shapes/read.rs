//! The user's own masks, from pictures and SVG.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::ink::Ink;
use super::resample::stretched;
use super::svg;
use super::template::{Source, Template};
use crate::error::{Error, Result};
use crate::guard;
use crate::photo::{self, Stencil};

/// Most bytes of a mask's file: 64 MiB.
pub const MASK_FILE_BYTES_MAX: u64 = 1 << 26;
/// First bytes of a gzip stream, as in `.svgz`.
const GZIP_SIGNATURE: [u8; 2] = [0x1F, 0x8B];

/// Reads the template in the file at `path`. Its content decides the format, not its name.
///
/// A picture (PNG, JPEG, JPEG XL, WebP, TIFF, BMP or GIF) is stretched to the square whatever its aspect. If any of its
/// pixels is transparent, its alpha becomes the template's alpha and its luma the intensity. Otherwise it is a stencil:
/// its luma becomes both, so black is a hole. An SVG keeps its aspect and is centred; its luma becomes the intensity.
///
/// Intensities are then scaled so that the brightest is 255. So a drawing in one colour, even in black, is evenly
/// bright.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, has more than [`MASK_FILE_BYTES_MAX`], is neither such a picture nor an
/// SVG, is broken, exceeds the limits of [`photo::read`], has text, pictures, patterns or filters in its SVG, or draws
/// nothing.
pub fn read(path: &Path) -> Result<Template> {
    let bytes = read_limited(path)?;
    let looks_like_svg = has_extension(path, "svg");
    let ink = ink_in(&bytes, looks_like_svg).map_err(|reason| Error::input(path, reason))?;
    Ok(Template::new(Source::File(path.to_owned()), ink))
}

/// As [`read`], of the mask that a file of these bytes would hold.
///
/// # Errors
/// A sentence without the mask's name.
pub fn decode(bytes: &[u8]) -> Result<Template, String> {
    Ok(Template::new(Source::Memory, ink_in(bytes, false)?))
}

/// As [`decode`], of a file that is called an SVG.
///
/// # Errors
/// A sentence without the mask's name.
pub fn decode_svg(bytes: &[u8]) -> Result<Template, String> {
    Ok(Template::new(Source::Memory, ink_in(bytes, true)?))
}

/// What the bytes of a file draw.
fn ink_in(bytes: &[u8], looks_like_svg: bool) -> Result<Vec<Ink>, String> {
    let mut ink = if bytes.is_empty() {
        Err("the file is empty (0 bytes); get it again".to_owned())
    } else if photo::is_picture(bytes) {
        guard::decoded(|| photo::decode_stencil(bytes))
            .map(|stencil| stretched(&ink_of(&stencil), stencil.width_px, stencil.height_px))
    } else if bytes.starts_with(&GZIP_SIGNATURE) {
        Err("is compressed; unpack it with gunzip and name the SVG".to_owned())
    } else if looks_like_svg || svg::is_svg(bytes) {
        svg::rasterised(bytes)
    } else if let photo::Kind::Foreign(foreign) = photo::kind_of(bytes) {
        Err(foreign.reason())
    } else {
        Err("not a mask that can be read; PNG, JPEG, JPEG XL, WebP, TIFF, BMP, GIF and SVG can".to_owned())
    }?;
    if ink.iter().all(|ink| ink.alpha == 0) {
        let reason = "the mask is empty: nothing in it is opaque, or all of it is black; draw the tile's shape in white, or \
                      on a transparent ground";
        return Err(reason.to_owned());
    }
    brighten(&mut ink);
    Ok(ink)
}

/// The bytes of the file, or an error if it is too large; it may even be endless.
fn read_limited(path: &Path) -> Result<Vec<u8>> {
    let unreadable = |error| Error::input(path, photo::why_unreadable(&error));
    let file = File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    file.take(MASK_FILE_BYTES_MAX + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MASK_FILE_BYTES_MAX {
        return Err(Error::input(path, "the file has more than 64 MiB, the limit for a mask; 256x256 px are enough"));
    }
    Ok(bytes)
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

/// What a picture draws: by its alpha, or as a stencil if it is opaque everywhere.
fn ink_of(stencil: &Stencil) -> Vec<Ink> {
    let is_opaque = stencil.pixels.iter().all(|[_, alpha]| *alpha == 255);
    let ink = |&[luma, alpha]: &[u8; 2]| Ink { alpha: if is_opaque { luma } else { alpha }, intensity: luma };
    stencil.pixels.iter().map(ink).collect()
}

/// Scales intensities so that the brightest well-covered texel becomes 255. If everything is black, everything becomes
/// 255.
fn brighten(ink: &mut [Ink]) {
    let most_opaque = ink.iter().map(|ink| ink.alpha).max().unwrap_or_default();
    let well_covered = ink.iter().filter(|ink| ink.alpha >= most_opaque.div_ceil(2));
    let brightest = u32::from(well_covered.map(|ink| ink.intensity).max().unwrap_or_default());
    for ink in ink {
        let scaled = (u32::from(ink.intensity) * 255 + brightest / 2).checked_div(brightest);
        ink.intensity = scaled.unwrap_or(255).min(255) as u8;
    }
}
