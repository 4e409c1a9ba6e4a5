//! The outline of a mask: polygons around its solid texels.

use std::fmt::Write;

use crate::model::Mask;
use crate::model::mask::{COVERAGE_THRESHOLD, MASK_SIDE};

const SIDE: i32 = MASK_SIDE as i32;
/// Steps to the right, down, left and up.
const STEPS: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
/// For each step from a corner, the texel ahead on the right and the one ahead on the left.
const AHEAD: [[(i32, i32); 2]; 4] = [[(0, 0), (0, -1)], [(-1, 0), (0, 0)], [(-1, -1), (-1, 0)], [(0, -1), (-1, -1)]];

/// The corners of a polygon in order.
type Polygon = Vec<(i32, i32)>;

/// Polygons around the texels of `mask` with at least this coverage; none if there are no such texels.
///
/// A texel is one unit and the mask's centre the origin. Each polygon has those texels on its right, and a corner only
/// where it turns.
pub(crate) fn outline(mask: &Mask, covered_from: u8) -> Vec<Polygon> {
    let is_solid = |column: i32, row: i32| {
        let is_inside = (0..SIDE).contains(&column) && (0..SIDE).contains(&row);
        is_inside && mask.texel(column as u32, row as u32).coverage >= covered_from
    };
    let is_top = |x: i32, y: i32| is_solid(x, y) && !is_solid(x, y - 1);
    let mut seen = vec![false; MASK_SIDE * MASK_SIDE];
    let mut polygons = Vec::new();
    // Every polygon has upper sides, so this scan finds it at the leftmost texel of the highest one.
    for (y, x) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (y, x))) {
        if is_top(x, y) && !seen[(y * SIDE + x) as usize] {
            polygons.push(polygon((x, y), &is_solid, &mut seen));
        }
    }
    polygons
}

/// Walks around the polygon whose upper side leaves `start` to the right, and marks the texels of its upper sides.
fn polygon(start: (i32, i32), is_solid: &impl Fn(i32, i32) -> bool, seen: &mut [bool]) -> Polygon {
    let half = SIDE / 2;
    let (mut x, mut y) = start;
    let mut direction = 0;
    let mut corners = vec![(x - half, y - half)];
    loop {
        if direction == 0 {
            seen[(y * SIDE + x) as usize] = true;
        }
        x += STEPS[direction].0;
        y += STEPS[direction].1;
        let [right, left] = AHEAD[direction].map(|(column, row)| is_solid(x + column, y + row));
        // Where two texels touch at a corner only, turning right keeps their polygons apart.
        let next = match (right, left) {
            (false, _) => (direction + 1) % 4,
            (true, true) => (direction + 3) % 4,
            (true, false) => continue,
        };
        if (x, y) == start && next == 0 {
            return corners;
        }
        corners.push((x - half, y - half));
        direction = next;
    }
}

/// The solid texels of `mask` as SVG path data, for either fill rule; empty if there are none.
pub(super) fn path_data(mask: &Mask) -> String {
    let mut path = String::new();
    for polygon in outline(mask, COVERAGE_THRESHOLD) {
        let [(mut x, mut y), ref others @ ..] = polygon[..] else { continue };
        write!(path, "M{x} {y}").expect("a string takes everything");
        for &(next_x, next_y) in others {
            let (letter, length) = if next_y == y { ('h', next_x - x) } else { ('v', next_y - y) };
            write!(path, "{letter}{length}").expect("a string takes everything");
            (x, y) = (next_x, next_y);
        }
        path.push('z');
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::mask::Texel;

    /// A mask with these texels, (column, row), at the threshold, and all others just below.
    fn mask_of(is_solid: impl Fn(i32, i32) -> bool) -> Mask {
        let coverage = |index: i32| if is_solid(index % SIDE, index / SIDE) { 128 } else { 127 };
        Mask::new((0..SIDE * SIDE).map(|index| Texel { coverage: coverage(index), shade: 255 }).collect())
            .expect("whole")
    }

    #[test]
    fn squares_holes_and_texels_that_touch_at_a_corner_are_outlined() {
        assert_eq!(path_data(&Mask::square()), "M-128 -128h256v256h-256z");
        assert_eq!(path_data(&mask_of(|_, _| false)), "");
        let ring = mask_of(|x, y| (0..3).contains(&x) && (0..3).contains(&y) && (x, y) != (1, 1));
        assert_eq!(path_data(&ring), "M-128 -128h3v3h-3zM-127 -126h1v-1h-1z");
        let diagonal = mask_of(|x, y| x < 2 && y < 2 && x == y);
        assert_eq!(path_data(&diagonal), "M-128 -128h1v1h-1zM-127 -127h1v1h-1z");
    }

    /// The texels that a path covers by the even-odd rule: those with an odd number of vertical sides to their left.
    fn filled(path: &str) -> Vec<bool> {
        let mut crossings = vec![0; MASK_SIDE * MASK_SIDE];
        for polygon in path.split('z').filter(|polygon| !polygon.is_empty()) {
            let mut rest = polygon.strip_prefix('M').expect("it begins").split_inclusive(['h', 'v']);
            let first = rest.next().expect("a place").trim_end_matches(['h', 'v']);
            let (x, y) = first.split_once(' ').expect("two numbers");
            let start: (i32, i32) = (x.parse().expect("a number"), y.parse().expect("a number"));
            let mut corners = vec![start];
            let steps = polygon[1 + first.len()..].split(['h', 'v']).skip(1);
            for (letter, step) in polygon.chars().filter(char::is_ascii_lowercase).zip(steps) {
                let (x, y) = *corners.last().expect("the start");
                let step: i32 = step.parse().expect("a number");
                corners.push(if letter == 'h' { (x + step, y) } else { (x, y + step) });
            }
            corners.push(start);
            for pair in corners.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
                let (x, from, to) = (pair[0].0 + 128, pair[0].1.min(pair[1].1) + 128, pair[0].1.max(pair[1].1) + 128);
                for row in from..to {
                    (x..SIDE).for_each(|column| crossings[(row * SIDE + column) as usize] += 1);
                }
            }
        }
        crossings.into_iter().map(|count| count % 2 == 1).collect()
    }

    #[test]
    fn the_outline_of_any_mask_fills_to_exactly_its_solid_texels() {
        let mut state = 7_u64;
        for density in [1, 3, 8, 13] {
            let texels: Vec<bool> = (0..SIDE * SIDE)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    state >> 60 < density
                })
                .collect();
            assert_eq!(filled(&path_data(&mask_of(|x, y| texels[(y * SIDE + x) as usize]))), texels);
        }
        let disc: Vec<bool> =
            (0..SIDE * SIDE).map(|i| (i % SIDE - 90).pow(2) + (i / SIDE - 128).pow(2) < 12_000).collect();
        let path = path_data(&mask_of(|x, y| disc[(y * SIDE + x) as usize]));
        assert_eq!(filled(&path), disc);
        assert!(path.len() < 4_000, "{} bytes", path.len());
    }
}
