//! The built-in templates that are defined by an outline.

use super::drawing::{HALF, UNITS_PER_TEXEL, drawn, ramp, rounded};
use super::ink::Ink;

/// The directions, 60 degrees apart, of the petals that reach into the upper right quarter.
const PETALS: [(i64, i64); 2] = [(0, -1024), (887, -512)];
/// Length of each direction of [`PETALS`].
const ONE: i64 = 1024;

/// All of the square, evenly bright.
pub(super) fn square() -> Vec<Ink> {
    drawn(|_, _| Some(255))
}

/// The square with a dark ring along its edge: a sixteenth of a side still shows on a tile of 12 px.
pub(super) fn border() -> Vec<Ink> {
    drawn(|x, y| {
        let from_edge = HALF - x.abs().max(y.abs());
        Some(ramp(from_edge, (19 * UNITS_PER_TEXEL, 25 * UNITS_PER_TEXEL), (90, 255)))
    })
}

/// Four cords along x with round ends, brighter along their middle. The gaps are wider than an eighth of a side, so
/// they show on tiles of 8 px.
pub(super) fn lines() -> Vec<Ink> {
    let (pitch, radius) = (73 * UNITS_PER_TEXEL, 37 * UNITS_PER_TEXEL / 2);
    drawn(move |x, y| {
        let across = (y + HALF) % pitch - radius;
        let beyond = (x.abs() - (HALF - radius)).max(0);
        let distance = (across * across + beyond * beyond).isqrt();
        (distance < radius).then(|| 255 - rounded(75 * across * across, radius * radius))
    })
}

/// Six petals that are darker towards the middle and along their fold, and a dark-rimmed disc on top.
pub(super) fn flower() -> Vec<Ink> {
    drawn(|x, y| {
        let radius = (x * x + y * y).isqrt();
        if radius < 600 {
            return Some(if radius > 520 { 70 } else { 165 - rounded(60 * radius * radius, 520 * 520) });
        }
        PETALS.into_iter().filter_map(|direction| petal(x.abs(), -y.abs(), direction)).max()
    })
}

/// The intensity of the petal along `(dx, dy)`, an ellipse; `None` outside it.
fn petal(x: i64, y: i64, (dx, dy): (i64, i64)) -> Option<i64> {
    const CENTRE: i64 = 1210;
    const LENGTH: i64 = 832;
    const WIDTH: i64 = 590;
    let along = (x * dx + y * dy) / ONE;
    let across = ((y * dx - x * dy) / ONE).abs();
    let off = along - CENTRE;
    // `level` is 0 in the middle of the petal and 4096 on its edge.
    let level = 4096 * off * off / (LENGTH * LENGTH) + 4096 * across * across / (WIDTH * WIDTH);
    let depth = ramp(along, (600, 1500), (150, 255));
    let fold = ramp(across, (20, 90), (60, 0)) * ramp(along, (1100, 1800), (255, 0)) / 255;
    let rim = ramp(level, (2400, 4096), (0, 45));
    (level < 4096).then_some(depth - fold - rim)
}

/// A circle that is darker towards its edge.
pub(super) fn disc() -> Vec<Ink> {
    drawn(|x, y| {
        let square = x * x + y * y;
        (square < HALF * HALF).then(|| 255 - rounded(70 * square * square, HALF.pow(4)))
    })
}

/// A triangle with its tip up and three facets that meet inside, lit from the upper left.
pub(super) fn triangle() -> Vec<Ink> {
    drawn(|x, y| {
        let from_base = HALF - y;
        // Twice the distances to the other two sides, measured along x: 0 on the side, 4 `HALF` at the opposite corner.
        let (from_left, from_right) = (HALF + y + 2 * x, HALF + y - 2 * x);
        let inside = from_base > 0 && from_left > 0 && from_right > 0;
        let nearest = (2 * from_base).min(from_left).min(from_right);
        let facet = if 2 * from_base == nearest {
            170
        } else if from_left == nearest {
            255
        } else {
            215
        };
        inside.then_some(facet)
    })
}

/// A hexagon with its tips up and down, shaded as a cube seen from a corner.
pub(super) fn hexagon() -> Vec<Ink> {
    drawn(|x, y| {
        let inside = 2 * y.abs() + x.abs() < 2 * HALF;
        // Edges run from the middle down and to the upper corners, where 2 y = -|x|.
        let under_top = 2 * y + x.abs();
        let face = if under_top < 0 {
            255
        } else if x < 0 {
            212
        } else {
            165
        };
        inside.then_some(face)
    })
}
