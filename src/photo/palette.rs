//! Few colours: palettes made from a picture or read from a file, and pictures reduced to them.
//!
//! In the paper, the schemes with even numbers evolve towards pictures of 60 colours (Table 1). All distances are
//! between stored 8-bit sRGB values, in integers, so that every machine reduces a picture to the same pixels.

use std::collections::HashSet;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use quantette::PaletteSize;
use quantette::deps::palette::Srgb;
use quantette::deps::palette::cast::from_array_slice;
use quantette::wu::{BinnerU8x3, WuU8x3};

use super::Photo;
use super::color_words::color;
use super::decode::{ReadOptions, is_picture, read, why_unreadable};
use crate::error::{Error, Result};

/// Most colours of a palette.
pub const COLOR_COUNT_MAX: usize = 256;
/// Most bytes of a palette file in text form.
const TEXT_BYTES_MAX: u64 = 1 << 20;

/// The `color_count` colours (1 to [`COLOR_COUNT_MAX`]) that represent `pixels` best, in rising order. They come from
/// Wu's quantiser, or are the pixels' own colours if there are no more than `color_count`.
///
/// # Errors
/// [`Error::Parameter`] if there are no pixels.
pub fn palette_of(pixels: &[[u8; 3]], color_count: usize) -> Result<Vec<[u8; 3]>> {
    let size = PaletteSize::from_usize_clamped(color_count);
    let mut palette = distinct_colors(pixels, size.as_usize()).map_or_else(
        || {
            let colors: &[Srgb<u8>] = from_array_slice(pixels);
            let counted = WuU8x3::run_slice(colors, BinnerU8x3::rgb()).map_err(|error| {
                Error::parameter("pixels", format!("they cannot be reduced to few colours: {error}"))
            })?;
            Ok(counted.palette(size).into_vec().into_iter().map(<[u8; 3]>::from).collect())
        },
        Ok::<Vec<[u8; 3]>, Error>,
    )?;
    palette.sort_unstable();
    palette.dedup();
    Ok(palette)
}

/// The colours of `pixels` in the order of their first appearance, unless there are more than `count_max`.
fn distinct_colors(pixels: &[[u8; 3]], count_max: usize) -> Option<Vec<[u8; 3]>> {
    let (mut seen, mut colors) = (HashSet::new(), Vec::new());
    for &color in pixels {
        if seen.insert(color) {
            colors.push(color);
        }
        if colors.len() > count_max {
            return None;
        }
    }
    Some(colors)
}

/// Gives every pixel of `photo` the nearest colour of `palette`, which must not be empty. The nearest colour has the
/// least squared distance of the 8-bit channels; among equals, the first one wins.
pub fn reduce(photo: &mut Photo, palette: &[[u8; 3]]) {
    // Neighbouring pixels are often equal, and a search takes up to 256 comparisons.
    let mut last = None;
    for pixel in &mut photo.pixels {
        let nearest = match last {
            Some((color, nearest)) if color == *pixel => nearest,
            _ => nearest(*pixel, palette),
        };
        last = Some((*pixel, nearest));
        *pixel = nearest;
    }
}

/// The nearest colour of `palette`, as [`reduce`] takes it.
pub(super) fn nearest(color: [u8; 3], palette: &[[u8; 3]]) -> [u8; 3] {
    let distance =
        |other: &[u8; 3]| -> u32 { color.iter().zip(other).map(|(&a, &b)| u32::from(a.abs_diff(b)).pow(2)).sum() };
    palette.iter().copied().min_by_key(distance).unwrap_or(color)
}

/// The palette in the file at `path`: a picture's colours in reading order, a GIMP palette (`.gpl`), a JASC palette
/// (`.pal`), or lines of colours, as hexadecimal RRGGBB or by name (`.hex`). Repeated colours are left out.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, is none of these, or has no colour or more than [`COLOR_COUNT_MAX`].
pub fn read_palette(path: &Path) -> Result<Vec<[u8; 3]>> {
    let refused = |reason: String| Error::input(path, reason);
    let too_many = || {
        refused(format!("has more than {COLOR_COUNT_MAX} colours; reduce it, or ask for a number of colours instead"))
    };
    if is_picture(path)? {
        let picture = read(path, &ReadOptions::default())?.photo;
        return distinct_colors(&picture.pixels, COLOR_COUNT_MAX).ok_or_else(too_many);
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(TEXT_BYTES_MAX + 1).read_to_end(&mut bytes))
        .map_err(|error| refused(why_unreadable(&error)))?;
    if bytes.len() as u64 > TEXT_BYTES_MAX {
        return Err(refused("has more than 1 MiB, the limit for a palette; name another file".to_owned()));
    }
    let listed = parse_palette(&String::from_utf8_lossy(&bytes)).map_err(|line| {
        refused(format!(
            "is not a palette: line {line} is not a colour; use a GIMP palette, a JASC palette, \
             lines of RRGGBB or of names of colours, or a picture"
        ))
    })?;
    match distinct_colors(&listed, COLOR_COUNT_MAX) {
        None => Err(too_many()),
        Some(colors) if colors.is_empty() => {
            Err(refused("is an empty palette; put at least one colour in it".to_owned()))
        }
        Some(colors) => Ok(colors),
    }
}

/// The colours of a palette in text form, or the number of the first line that holds no colour.
fn parse_palette(text: &str) -> Result<Vec<[u8; 3]>, usize> {
    let first = text.lines().next().unwrap_or_default().trim_start_matches('\u{feff}').trim();
    let is_gimp = first == "GIMP Palette";
    let is_jasc = first == "JASC-PAL";
    let parse = if is_gimp || is_jasc { parse_decimal } else { color };
    let header_lines = if is_gimp {
        1
    } else if is_jasc {
        3
    } else {
        0
    };
    let mut colors = Vec::new();
    for (number, line) in (1_usize..).zip(text.lines()).skip(header_lines) {
        let line = line.trim_start_matches('\u{feff}').trim();
        let is_comment = line.is_empty() || line.starts_with("//") || line.starts_with(';');
        let is_gimp_header =
            is_gimp && (line.starts_with('#') || line.starts_with("Name:") || line.starts_with("Columns:"));
        if !is_comment && !is_gimp_header {
            colors.push(parse(line).ok_or(number)?);
        }
    }
    Ok(colors)
}

/// `R G B`, perhaps with a name after them.
fn parse_decimal(line: &str) -> Option<[u8; 3]> {
    let mut channels = line.split_whitespace().map(|word| word.parse::<u8>().ok());
    Some([channels.next()??, channels.next()??, channels.next()??])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient() -> Photo {
        let pixels = (0..64 * 64_u32).map(|i| [(i % 64 * 4) as u8, (i / 64 * 4) as u8, (i / 16) as u8]).collect();
        Photo { width_px: 64, height_px: 64, pixels }
    }

    #[test]
    fn a_picture_is_reduced_to_as_many_colours_as_asked_for_and_each_is_the_nearest() {
        for count in [1, 2, 60, 256] {
            let mut photo = gradient();
            let palette = palette_of(&photo.pixels, count).expect("there are pixels");
            assert!(palette.len() <= count && palette.len() * 10 >= count * 9, "{} for {count}", palette.len());
            let before = photo.pixels.clone();
            reduce(&mut photo, &palette);
            for (old, new) in before.iter().zip(&photo.pixels) {
                let distance = |a: &[u8; 3]| (0..3).map(|k| (i32::from(a[k]) - i32::from(old[k])).pow(2)).sum::<i32>();
                assert!(palette.iter().all(|color| distance(new) <= distance(color)));
            }
        }
    }

    #[test]
    fn a_picture_of_few_colours_stays_as_it_is() {
        let pixels = vec![[1, 2, 3], [1, 2, 4], [200, 2, 3], [1, 2, 3]];
        let mut photo = Photo { width_px: 2, height_px: 2, pixels: pixels.clone() };
        let palette = palette_of(&photo.pixels, 3).expect("there are pixels");
        assert_eq!(palette, [[1, 2, 3], [1, 2, 4], [200, 2, 3]]);
        reduce(&mut photo, &palette);
        assert_eq!(photo.pixels, pixels);
    }

    #[test]
    fn palettes_are_read_in_the_forms_that_tools_write() {
        let gimp = "GIMP Palette\nName: Two\nColumns: 2\n#\n  1   2   3\tfirst\n255 0 9\n";
        assert_eq!(parse_palette(gimp), Ok(vec![[1, 2, 3], [255, 0, 9]]));
        let jasc = "JASC-PAL\r\n0100\r\n2\r\n1 2 3\r\n255 0 9\r\n";
        assert_eq!(parse_palette(jasc), Ok(vec![[1, 2, 3], [255, 0, 9]]));
        assert_eq!(parse_palette("#010203\n\n; a comment\nFF0009\n"), Ok(vec![[1, 2, 3], [255, 0, 9]]));
        assert_eq!(parse_palette("010203\nTeal\n"), Ok(vec![[1, 2, 3], [0, 128, 128]]));
        assert_eq!(parse_palette("010203\nreddish\n"), Err(2));
        assert_eq!(parse_palette("GIMP Palette\n1 2\n"), Err(2));
        assert_eq!(parse_palette("GIMP Palette\n1 2 256\n"), Err(2));
    }
}
