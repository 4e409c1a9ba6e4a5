//! Masks from SVG, rasterised by resvg.
//!
//! It computes with single-precision floats, so another kind of processor may round an edge's alpha differently.
//! Therefore the texels of a mask decide a result, not the file that they come from.
//!
//! A few bytes of SVG can ask for any amount of work: elements repeat others, and layers nest. So what a drawing comes
//! to is counted before it is converted (`expansion`) and again before it is drawn (`extent`).

mod expansion;
mod extent;
mod patience;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{ImageHrefResolver, Options, Tree, roxmltree};

use super::ink::Ink;
use crate::guard;
use crate::model::mask::MASK_SIDE;

/// The root element is searched for in this many bytes at the beginning of a file.
const HEAD_BYTES: usize = 4096;
/// Most bytes of an SVG: 8 MiB.
const BYTES_MAX: usize = 1 << 23;
/// Most nodes of the text: elements, and what stands between them.
const NODES_MAX: u32 = 200_000;
/// Most declarations of namespaces: each takes as much memory as all that are declared around it.
const NAMESPACES_MAX: usize = 10_000;

/// Whether these bytes begin like an SVG: text with the root element `svg`.
pub(super) fn is_svg(bytes: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(HEAD_BYTES)]);
    let head = head.trim_start_matches('\u{feff}').trim_start();
    head.starts_with('<') && (head.contains("<svg") || head.contains(":svg"))
}

/// The whole drawing of an SVG, centred in the square with its aspect kept; or the reason why there is none.
pub(super) fn rasterised(bytes: &[u8]) -> Result<Vec<Ink>, String> {
    if bytes.len() > BYTES_MAX {
        return Err("the SVG has more than 8 MiB; simplify it, or export it as PNG".to_owned());
    }
    let bytes = bytes.to_owned();
    patience::drawn_in_time(move || guard::decoded(|| drawn(&bytes)))
}

fn drawn(bytes: &[u8]) -> Result<Vec<Ink>, String> {
    let text = std::str::from_utf8(bytes).map_err(|error| unparsable(&error))?;
    if text.contains("<!ENTITY") {
        return Err("the SVG declares entities, which are not expanded; export it again as plain SVG".to_owned());
    }
    if text.matches("xmlns").nth(NAMESPACES_MAX).is_some() {
        return Err("the SVG declares too many namespaces; export it again as plain SVG".to_owned());
    }
    let parsing = roxmltree::ParsingOptions { allow_dtd: true, nodes_limit: NODES_MAX, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(text, parsing).map_err(|error| match error {
        roxmltree::Error::NodesLimitReached => expansion::TOO_MANY_ELEMENTS.to_owned(),
        error => unparsable(&error),
    })?;
    refuse_what_is_not_drawn(&document)?;
    expansion::check(&document)?;
    // An image element could name any file of this machine.
    let no_pictures =
        ImageHrefResolver { resolve_data: Box::new(|_, _, _| None), resolve_string: Box::new(|_, _| None) };
    let options = Options { image_href_resolver: no_pictures, ..Options::default() };
    let tree = Tree::from_xmltree(&document, &options).map_err(|error| unparsable(&error))?;

    // resvg limits neither the memory of a pattern nor the parameters of a filter.
    let costly = [("a pattern", !tree.patterns().is_empty()), ("a filter", !tree.filters().is_empty())];
    if let Some((what, _)) = costly.iter().find(|(_, is_used)| *is_used) {
        return Err(format!("the SVG uses {what}, which is not drawn; export it as PNG with a transparent ground"));
    }

    let side = MASK_SIDE as f32;
    let (width, height) = (tree.size().width(), tree.size().height());
    let scale = side / width.max(height);
    let fit = Transform::from_row(scale, 0.0, 0.0, scale, (side - width * scale) / 2.0, (side - height * scale) / 2.0);
    extent::check(&tree, fit)?;
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

fn unparsable(detail: &dyn std::fmt::Display) -> String {
    format!("the SVG does not parse ({detail}); correct it or export it again")
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
