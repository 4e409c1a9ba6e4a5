//! Masks from SVG, rasterised by resvg.
//!
//! It computes with single-precision floats, so another kind of processor may round an edge's alpha differently.
//! Therefore the texels of a mask decide a result, not the file that they come from.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{ImageHrefResolver, Options, Tree, roxmltree};

use super::ink::Ink;
use crate::model::mask::MASK_SIDE;

/// The root element is searched for in this many bytes at the beginning of a file.
const HEAD_BYTES: usize = 4096;

/// Whether these bytes begin like an SVG: text with the root element `svg`.
pub(super) fn is_svg(bytes: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(HEAD_BYTES)]);
    let head = head.trim_start_matches('\u{feff}').trim_start();
    head.starts_with('<') && (head.contains("<svg") || head.contains(":svg"))
}

/// The whole drawing of an SVG, centred in the square with its aspect kept; or the reason why there is none.
pub(super) fn rasterised(bytes: &[u8]) -> Result<Vec<Ink>, String> {
    let unparsable = |detail: String| format!("the SVG does not parse ({detail}); correct it or export it again");
    let text = std::str::from_utf8(bytes).map_err(|error| unparsable(error.to_string()))?;
    let parsing = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let document =
        roxmltree::Document::parse_with_options(text, parsing).map_err(|error| unparsable(error.to_string()))?;
    refuse_what_is_not_drawn(&document)?;
    // An image element could name any file of this machine.
    let no_pictures =
        ImageHrefResolver { resolve_data: Box::new(|_, _, _| None), resolve_string: Box::new(|_, _| None) };
    let options = Options { image_href_resolver: no_pictures, ..Options::default() };
    let tree = Tree::from_xmltree(&document, &options).map_err(|error| unparsable(error.to_string()))?;

    // resvg limits neither the memory of a pattern nor the parameters of a filter.
    let costly = [("a pattern", !tree.patterns().is_empty()), ("a filter", !tree.filters().is_empty())];
    if let Some((what, _)) = costly.iter().find(|(_, is_used)| *is_used) {
        return Err(format!("the SVG uses {what}, which is not drawn; export it as PNG with a transparent ground"));
    }

    let side = MASK_SIDE as f32;
    let (width, height) = (tree.size().width(), tree.size().height());
    let scale = side / width.max(height);
    let fit = Transform::from_row(scale, 0.0, 0.0, scale, (side - width * scale) / 2.0, (side - height * scale) / 2.0);
    let mut pixmap = Pixmap::new(MASK_SIDE as u32, MASK_SIDE as u32).expect("the side is neither 0 nor huge");
    resvg::render(&tree, fit, &mut pixmap.as_mut());
    Ok(pixmap
        .pixels()
        .iter()
        .map(|pixel| {
            let color = pixel.demultiply();
            Ink { alpha: color.alpha(), intensity: luma([color.red(), color.green(), color.blue()]) }
        })
        .collect())
}

/// Refuses elements that would be left out, so that the drawing would not look as its author sees it: there are no
/// fonts here, and embedded pictures are not drawn.
fn refuse_what_is_not_drawn(document: &roxmltree::Document<'_>) -> Result<(), String> {
    for element in document.descendants().filter(roxmltree::Node::is_element) {
        match element.tag_name().name() {
            "text" => {
                return Err("the SVG has text, which is not drawn since fonts differ between machines; convert it to \
                            paths"
                    .to_owned());
            }
            name @ ("image" | "foreignObject") => {
                return Err(format!("the SVG has an element `{name}`, which is not drawn; replace it with paths"));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Brightness of a stored sRGB colour, with the weights of Rec. 709.
fn luma([r, g, b]: [u8; 3]) -> u8 {
    ((u32::from(r) * 2126 + u32::from(g) * 7152 + u32::from(b) * 722 + 5000) / 10_000) as u8
}
