//! Populations as OpenRaster files (`.ora`): the mosaic is cut into bands of depth, each of which is a layer with
//! alpha. The background is a layer below them, unless it is transparent.
//!
//! A [`Painter`] draws each band over black and over white; the difference gives its transparency. Dates, order and
//! compression are fixed: the same population gives the same bytes. The format: <https://www.openraster.org>.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipArchive, ZipWriter};

use crate::error::{Error, Result};
use crate::guard;
use crate::model::blocks::{depth_order, index_of};
use crate::model::{Backdrop, Canvas, Fly, Mosaic, Painter, Population, Rgb};
use crate::photo::{self, Format, Metadata, Photo};

/// Default number of depth bands.
pub const BAND_COUNT: usize = 8;

/// The longer side in px of the thumbnail that the format asks for.
const THUMBNAIL_SIDE_PX: u32 = 256;
/// Samples along each side of a pixel of the thumbnail.
const THUMBNAIL_SUPERSAMPLING: u32 = 4;
/// Member that holds the whole picture, whose metadata is that of the file.
const MERGED_MEMBER: &str = "mergedimage.png";
/// Metadata is searched for in this many bytes of the whole picture.
const METADATA_BYTES: u64 = 1 << 20;

/// The parts of a file that have to be drawn, apart from the whole picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layers {
    width_px: u32,
    height_px: u32,
    /// Names and PNG files of the layers, the background first if there is one.
    layers: Vec<(String, Vec<u8>)>,
    thumbnail: Vec<u8>,
}

impl Layers {
    /// Draws `population` on `canvas` in `band_count` bands, or in fewer if there are fewer living flies. The numbers
    /// of flies in any two bands differ by at most one.
    ///
    /// Composed in order, the bands give the whole picture. For opaque masks and one sample per pixel this is exact;
    /// otherwise pixels may differ by rounding, and where several bands share a pixel.
    ///
    /// # Errors
    /// If the device fails.
    pub fn draw(
        painter: &mut dyn Painter,
        population: &Population,
        canvas: &Canvas,
        supersampling: u32,
        band_count: usize,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Self> {
        let Canvas { width_px, height_px, .. } = *canvas;
        let pixel_count = width_px as usize * height_px as usize;
        let mut layers = Vec::new();
        if let Backdrop::Color([r, g, b]) = population.background {
            let background = photo::encode_png_with_alpha(
                width_px,
                height_px,
                &vec![[r, g, b, 255]; pixel_count],
                &Metadata::new(),
            )?;
            layers.push(("Background".to_owned(), background));
        }
        let bands = bands(&population.flies, band_count);
        for (number, flies) in (1..).zip(&bands) {
            let mut over = |background: Rgb| {
                let (background, masks, flies) = (background.into(), population.masks.clone(), flies.clone());
                let band = Population { background, masks, flies, ..*population };
                painter.draw(&band, canvas, supersampling)
            };
            let (black, white) = (over([0; 3])?, over([255; 3])?);
            let png = photo::encode_png_with_alpha(width_px, height_px, &cut_out(&black, &white), &Metadata::new())?;
            layers.push((band_name(number, bands.len()), png));
            watch(number as f64 / bands.len() as f64);
        }
        let longest = population.width_px.max(population.height_px);
        let thumbnail =
            Canvas::scaled(population.width_px, population.height_px, THUMBNAIL_SIDE_PX.min(width_px.max(height_px)));
        let supersampling =
            if thumbnail.width_px.max(thumbnail.height_px) == longest { 1 } else { THUMBNAIL_SUPERSAMPLING };
        let Mosaic { width_px: w, height_px: h, pixels, alpha } =
            painter.draw(population, &thumbnail, supersampling)?;
        let thumbnail = Photo { width_px: w, height_px: h, pixels };
        let thumbnail = photo::encode_with_alpha(Format::Png, &thumbnail, alpha.as_deref(), &Metadata::new())?;
        Ok(Self { width_px, height_px, layers, thumbnail })
    }
}

/// The living flies cut into bands, the farthest band first. Within a band the nearest fly comes first, so flies of
/// equal depth keep their order.
fn bands(flies: &[Fly], band_count: usize) -> Vec<Vec<Fly>> {
    let order = depth_order(flies).into_iter().map(|key| flies[index_of(key) as usize]);
    let living: Vec<Fly> = order.filter(|fly| fly.alive).collect();
    let count = band_count.min(living.len());
    let cut = |band: usize| living.len() * band / count;
    (0..count).rev().map(|band| living[cut(band)..cut(band + 1)].to_vec()).collect()
}

fn band_name(number: usize, count: usize) -> String {
    let place = match number {
        1 => ", farthest",
        _ if number == count => ", nearest",
        _ => "",
    };
    format!("Tiles {number} of {count}{place}")
}

/// The pixels that were drawn over black and over white, without these backgrounds and with their opacity; not
/// premultiplied.
fn cut_out(over_black: &Mosaic, over_white: &Mosaic) -> Vec<[u8; 4]> {
    let pixel = |(black, white): (&Rgb, &Rgb)| {
        // Each channel was rounded separately, so the three may differ by one.
        let sum: u32 = black.iter().zip(white).map(|(&black, &white)| 255 - u32::from(white.abs_diff(black))).sum();
        let alpha = (sum + 1) / 3;
        let channel = |value: u8| (u32::from(value) * 255 + alpha / 2).checked_div(alpha).unwrap_or(0).min(255) as u8;
        let [r, g, b] = black.map(channel);
        [r, g, b, alpha as u8]
    };
    over_black.pixels.iter().zip(&over_white.pixels).map(pixel).collect()
}

/// The OpenRaster file of `layers` and of `merged`, the whole picture as a PNG file that holds the metadata.
///
/// # Errors
/// [`Error::Encoding`] if the zip file would be larger than its format allows.
pub fn encode(layers: &Layers, merged: &[u8]) -> Result<Vec<u8>> {
    write_members(layers, merged).map_err(|error| Error::picture_as("OpenRaster", &error))
}

fn write_members(layers: &Layers, merged: &[u8]) -> zip::result::ZipResult<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644)
        .system(System::Unix);
    let (stored, deflated) = (
        options.compression_method(CompressionMethod::Stored),
        options.compression_method(CompressionMethod::Deflated),
    );
    let mut add = |name: &str, options: SimpleFileOptions, bytes: &[u8]| {
        zip.start_file(name, options)?;
        zip.write_all(bytes).map_err(zip::result::ZipError::from)
    };
    // This member comes first and uncompressed, so the first bytes of the file show its format.
    add("mimetype", stored, b"image/openraster")?;
    add("stack.xml", deflated.compression_level(Some(6)), stack(layers).as_bytes())?;
    for (number, (_, png)) in layers.layers.iter().enumerate() {
        add(&member_of_layer(number), stored, png)?;
    }
    add(MERGED_MEMBER, stored, merged)?;
    add("Thumbnails/thumbnail.png", stored, &layers.thumbnail)?;
    Ok(zip.finish()?.into_inner())
}

fn member_of_layer(number: usize) -> String {
    format!("data/layer{number}.png")
}

/// The description of the layers, the topmost first.
fn stack(layers: &Layers) -> String {
    let layer = |(number, (name, _)): (usize, &(String, Vec<u8>))| {
        let member = member_of_layer(number);
        format!(
            "    <layer name=\"{name}\" src=\"{member}\" x=\"0\" y=\"0\" opacity=\"1.0\" visibility=\"visible\" \
             composite-op=\"svg:src-over\"/>\n"
        )
    };
    let stacked: String = layers.layers.iter().enumerate().rev().map(layer).collect();
    let Layers { width_px, height_px, .. } = layers;
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <image version=\"0.0.3\" w=\"{width_px}\" h=\"{height_px}\">\n  <stack>\n{stacked}  </stack>\n</image>\n"
    )
}

/// The metadata of the OpenRaster file at `path`, which is that of its whole picture; empty for any other file.
///
/// # Errors
/// [`Error::Input`] if the file cannot be opened.
pub fn read_metadata(path: &Path) -> Result<Metadata> {
    let file = File::open(path).map_err(|error| Error::input(path, photo::why_unreadable(&error)))?;
    let begin_of_merged = || -> Option<Vec<u8>> {
        let mut header = Vec::new();
        let mut zip = ZipArchive::new(BufReader::new(file)).ok()?;
        zip.by_name(MERGED_MEMBER).ok()?.take(METADATA_BYTES).read_to_end(&mut header).ok()?;
        Some(header)
    };
    let header = guard::caught(begin_of_merged).ok().flatten().unwrap_or_default();
    Ok(photo::png_metadata(&header))
}

/// Whether the file at `path` is a whole zip file: every member is there, and has its checksum.
#[must_use]
pub fn is_whole(path: &Path) -> bool {
    let check = || -> io::Result<()> {
        let mut zip = ZipArchive::new(BufReader::new(File::open(path)?))?;
        for index in 0..zip.len() {
            io::copy(&mut zip.by_index(index)?, &mut io::sink())?;
        }
        Ok(())
    };
    guard::caught(check).is_ok_and(|checked| checked.is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_hold_equally_many_living_flies_and_together_all_of_them() {
        let fly =
            |index: u32| Fly { z: 97 * index % 101, x: index as i32, alive: !index.is_multiple_of(5), ..Fly::ABSENT };
        let flies: Vec<Fly> = (0..101).map(fly).collect();
        let bands = bands(&flies, 8);
        assert_eq!(bands.iter().map(Vec::len).collect::<Vec<_>>(), [10; 8]);
        let depths: Vec<u32> = bands.iter().rev().flatten().map(|fly| fly.z).collect();
        assert!(depths.is_sorted() && depths.len() == 80);
        assert_eq!(super::bands(&flies[..3], 8).len(), 2);
        assert!(super::bands(&flies[..1], 8).is_empty());
    }

    #[test]
    fn a_colour_of_any_opacity_is_found_again() {
        for alpha in [0, 1, 128, 254, 255_u32] {
            let over = |background: u32| {
                let channel = |color: u32| ((color * alpha + background * (255 - alpha) + 127) / 255) as u8;
                Mosaic { width_px: 1, height_px: 1, pixels: vec![[200, 0, 255].map(channel)], alpha: None }
            };
            let found = cut_out(&over(0), &over(255));
            let expected = if alpha == 0 { [0; 3] } else { [200, 0, 255] };
            assert_eq!(u32::from(found[0][3]), alpha);
            let off = found[0].iter().zip(expected).map(|(&a, b)| a.abs_diff(b)).max();
            assert!(off <= Some((128 / alpha.max(1)) as u8), "{found:?} at {alpha}");
        }
    }
}
