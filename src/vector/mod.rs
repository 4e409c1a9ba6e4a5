//! Populations as SVG: one element per living fly, the farthest first, so that the document's order is the depth order.
//!
//! Geometry follows from the integer genes alone. A user unit is 1/128 px, half of a gene's unit, so the corners of
//! tiles are whole numbers before they are turned. The view box begins at -64, since the origin is the centre of pixel
//! (0, 0). Each mask is defined once in `<defs>` (`shapes.rs`). A tile with grout is drawn twice: its shape in the
//! grout's colour, and over that the part inside its ring. A transparent picture has no background element. The
//! document is plain SVG 1.1 without scripts, fonts or links, with the same bytes every time.

pub(crate) mod base64;
mod outline;
mod shapes;
mod tiles;

use std::fmt::Write;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde_json::{Map, Value};

use crate::error::{Error, Result};
use crate::model::blocks::{depth_order, index_of};
use crate::model::target::hexadecimal;
use crate::model::{Backdrop, Blend, Canvas, Fly, Population};
use crate::photo::{self, xml};

#[cfg(feature = "view")]
pub(crate) use outline::outline;
use shapes::Shapes;
use tiles::push_fly;

/// User units per pixel of the picture that evolved.
const UNITS_PER_PX: f64 = 128.0;
/// Element that holds the metadata.
const RESULT: &str = "smalti:result";
/// Metadata is searched for in this many bytes of a file; ours begins within the first three hundred.
const HEADER_BYTES: u64 = 1 << 20;

/// The population as an SVG document with the `width` and `height` of `canvas`; `meta` is its metadata.
///
/// # Errors
/// [`Error::Encoding`] if the picture of a mask cannot be encoded.
pub fn encode(population: &Population, canvas: &Canvas, meta: &Map<String, Value>) -> Result<Vec<u8>> {
    let order = depth_order(&population.flies);
    let flies: Vec<&Fly> =
        order.iter().rev().map(|&key| &population.flies[index_of(key) as usize]).filter(|fly| fly.alive).collect();
    // Translucent tiles have no ring.
    let grout = population.grout.filter(|_| population.masks.blend() == Blend::Opaque);
    let shapes = Shapes::of(population, &flies)?;
    let mut svg = head(canvas, flies.len(), meta);
    svg.push_str(shapes.definitions());
    if let Backdrop::Color(color) = population.background {
        let ((width, height), color) = (extent(canvas), hexadecimal(color));
        push(&mut svg, format_args!("<path d=\"M-64-64h{width}v{height}h-{width}z\" fill=\"{color}\"/>\n"));
    }
    for (number, fly) in flies.into_iter().enumerate() {
        push_fly(&mut svg, number, fly, grout);
    }
    svg.push_str("</svg>\n");
    Ok(svg.into_bytes())
}

/// Everything before the drawing.
fn head(canvas: &Canvas, fly_count: usize, meta: &Map<String, Value>) -> String {
    let (width, height) = extent(canvas);
    let meta = xml::escape(&Value::Object(meta.clone()).to_string());
    let Canvas { width_px, height_px, .. } = canvas;
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" \
         width=\"{width_px}\" height=\"{height_px}\" viewBox=\"-64 -64 {width} {height}\">\n\
         <title>Mosaic of {fly_count} tiles</title>\n\
         <metadata xmlns:smalti=\"urn:smalti:\"><{RESULT}>{meta}</{RESULT}></metadata>\n"
    )
}

/// Width and height of the view box: the canvas in user units. A side that was rounded to whole pixels shows a little
/// more or less of the mosaic, as in raster pictures; nothing is stretched.
fn extent(canvas: &Canvas) -> (f64, f64) {
    let (numerator, denominator) = canvas.scale;
    let side = |px: u32| f64::from(px) * UNITS_PER_PX * f64::from(denominator) / f64::from(numerator);
    (side(canvas.width_px), side(canvas.height_px))
}

/// Appends to a text, which cannot fail.
fn push(svg: &mut String, text: std::fmt::Arguments<'_>) {
    svg.write_fmt(text).expect("a string takes everything");
}

/// The metadata of the SVG file at `path`; `None` if smalti did not write it.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub fn read_meta(path: &Path) -> Result<Option<Map<String, Value>>> {
    let mut header = Vec::new();
    File::open(path)
        .and_then(|file| file.take(HEADER_BYTES).read_to_end(&mut header))
        .map_err(|error| Error::input(path, photo::why_unreadable(&error)))?;
    let header = String::from_utf8_lossy(&header);
    let meta = xml::contents(&header, RESULT).next().map(xml::unescape);
    Ok(meta.and_then(|meta| serde_json::from_str(&meta).ok()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_view_box_of_a_rounded_canvas_keeps_the_scale() {
        assert_eq!(extent(&Canvas::evaluation(600, 401)), (76_800.0, 51_328.0));
        assert_eq!(extent(&Canvas::scaled(600, 401, 100)), (76_800.0, 402.0 * 128.0));
    }
}
