//! The elements of single flies.

use super::push;
use crate::model::tables::TURN_STEPS;
use crate::model::target::hexadecimal;
use crate::model::{Fly, Grout};

/// Appends the tile of one fly: a rectangle turned about its centre, or a mask that is stretched, turned and moved into
/// place.
///
/// `number` must be unique within the document.
pub(super) fn push_fly(svg: &mut String, number: usize, fly: &Fly, grout: Option<Grout>) {
    if fly.mask > 0 {
        push_mask(svg, number, fly, grout);
        return;
    }
    let Some(Grout { width, color }) = grout else {
        push_rectangle(svg, fly, 0, &hexadecimal(fly.color()));
        return;
    };
    push_rectangle(svg, fly, 0, &hexadecimal(color));
    if has_inside(fly, width) {
        push_rectangle(svg, fly, width, &hexadecimal(fly.color()));
    }
}

/// Whether a ring of `width` leaves any of the tile's inside.
fn has_inside(fly: &Fly, width: u32) -> bool {
    fly.w.min(fly.h) > 2 * width
}

/// The rectangle of a fly, made smaller by `ring` units of a gene at each edge.
fn push_rectangle(svg: &mut String, fly: &Fly, ring: u32, color: &str) {
    let ring = 2 * i64::from(ring);
    let (x, y) = (2 * i64::from(fly.x), 2 * i64::from(fly.y));
    let (w, h) = (i64::from(fly.w) - ring, i64::from(fly.h) - ring);
    let (left, top, width, height) = (x - w, y - h, 2 * w, 2 * h);
    push(svg, format_args!("<path d=\"M{left} {top}h{width}v{height}h-{width}z\""));
    let degrees = degrees(fly);
    if degrees != "0" {
        push(svg, format_args!(" transform=\"rotate({degrees} {x} {y})\""));
    }
    push(svg, format_args!(" fill=\"{color}\"/>\n"));
}

/// The mask of a fly. With grout, it is the outline (`#o1`, `#o2`, ..) under the part of the mask inside the ring.
fn push_mask(svg: &mut String, number: usize, fly: &Fly, grout: Option<Grout>) {
    let degrees = degrees(fly);
    let rotate = if degrees == "0" { String::new() } else { format!("rotate({degrees})") };
    // A gene of w makes a side of 2w user units, and a mask has 256 units.
    let [across, along] = [fly.w, fly.h].map(|side| f64::from(side) / 128.0);
    let transform = format!("translate({} {}){rotate}scale({across} {along})", 2 * fly.x, 2 * fly.y);
    let (mask, color) = (fly.mask, hexadecimal(fly.color()));
    let Some(Grout { width, color: of_grout }) = grout else {
        push(svg, format_args!("<use xlink:href=\"#m{mask}\" transform=\"{transform}\" fill=\"{color}\"/>\n"));
        return;
    };
    let of_grout = hexadecimal(of_grout);
    if !has_inside(fly, width) {
        push(svg, format_args!("<use xlink:href=\"#o{mask}\" transform=\"{transform}\" fill=\"{of_grout}\"/>\n"));
        return;
    }
    let half = [fly.w, fly.h].map(|side| 128.0 - f64::from(width) * 256.0 / f64::from(side));
    let [half_w, half_h] = half.map(four_decimals);
    let [full_w, full_h] = half.map(|half| four_decimals(2.0 * half));
    push(
        svg,
        format_args!(
            "<clipPath id=\"i{number}\"><path d=\"M-{half_w}-{half_h}h{full_w}v{full_h}h-{full_w}z\"/></clipPath>\
             <g transform=\"{transform}\"><use xlink:href=\"#o{mask}\" fill=\"{of_grout}\"/>\
             <g clip-path=\"url(#i{number})\"><use xlink:href=\"#m{mask}\" fill=\"{color}\"/></g></g>\n"
        ),
    );
}

/// The angle of a fly in degrees, rounded down to one of 4,096 directions as in the engine.
fn degrees(fly: &Fly) -> String {
    let direction = (usize::from(fly.angle) * TURN_STEPS) >> 16;
    four_decimals(direction as f64 * 360.0 / TURN_STEPS as f64)
}

/// An angle in degrees or a coordinate in a mask, rounded by at most 0.00005: a corner of the largest tile moves by
/// less than a gene's unit.
fn four_decimals(degrees: f64) -> String {
    let text = format!("{degrees:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_as_short_as_they_can_be() {
        assert_eq!(
            [0.087_890_625, 45.0, 359.912_109_375, 90.5, 100.0].map(four_decimals),
            ["0.0879", "45", "359.9121", "90.5", "100"]
        );
    }
}
