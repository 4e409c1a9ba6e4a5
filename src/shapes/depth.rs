//! How far inside a drawing each texel lies: an exact Euclidean distance transform in integers (Meijster, Roerdink and
//! Hesselink, "A general algorithm for computing distance transforms in linear time", 2000).

use super::ink::Ink;
use crate::model::mask::MASK_SIDE;

/// Units of a depth per texel.
pub(super) const DEPTH_PER_TEXEL: i64 = 16;

const SIDE: i64 = MASK_SIDE as i64;

/// For each texel, the distance from its centre to the drawing's edge, in 1/[`DEPTH_PER_TEXEL`] texel; 0 outside the
/// drawing.
#[derive(Clone, Debug)]
pub(super) struct Depth {
    texels: Vec<i64>,
}

impl Depth {
    /// The depths of a drawing; everything outside the square counts as a hole.
    ///
    /// A texel is inside the drawing if its alpha is at least a quarter, so that thin paint is no hole. If no texel is
    /// that opaque, half of the highest alpha is enough.
    pub(super) fn of(ink: &[Ink]) -> Self {
        let highest = ink.iter().map(|ink| ink.alpha).max().unwrap_or_default();
        let threshold = (highest / 2 + 1).min(64);
        let to_hole_above_or_below = column_distances(|index| ink[index].alpha >= threshold);
        let mut texels = Vec::with_capacity(ink.len());
        for row in to_hole_above_or_below.chunks_exact(MASK_SIDE) {
            texels.extend(row_distances(row).into_iter().map(|square| {
                // The distance is from centre to centre, and the edge lies half a texel before the hole's centre.
                ((square * DEPTH_PER_TEXEL * DEPTH_PER_TEXEL).isqrt() - DEPTH_PER_TEXEL / 2).max(0)
            }));
        }
        Self { texels }
    }

    /// The depths, row by row.
    pub(super) fn texels(&self) -> &[i64] {
        &self.texels
    }

    /// The greatest depth, at least 1.
    pub(super) fn greatest(&self) -> i64 {
        self.texels.iter().copied().max().unwrap_or_default().max(1)
    }
}

/// For each texel, the distance to the nearest hole in its column.
fn column_distances(is_inside: impl Fn(usize) -> bool) -> Vec<i64> {
    let mut distances = vec![0; MASK_SIDE * MASK_SIDE];
    for column in 0..MASK_SIDE {
        let mut run = 0;
        for index in (column..distances.len()).step_by(MASK_SIDE) {
            run = if is_inside(index) { run + 1 } else { 0 };
            distances[index] = run;
        }
        run = 0;
        for index in (column..distances.len()).step_by(MASK_SIDE).rev() {
            run = if is_inside(index) { run + 1 } else { 0 };
            distances[index] = run.min(distances[index]);
        }
    }
    distances
}

/// For each texel of a row, the squared distance to the nearest hole, given the distances within the columns. It is the
/// lower envelope of one parabola per column, with a hole beyond each end.
fn row_distances(columns: &[i64]) -> Vec<i64> {
    let height = |column: i64| if (0..SIDE).contains(&column) { columns[column as usize] } else { 0 };
    let at = |x: i64, column: i64| (x - column) * (x - column) + height(column) * height(column);
    // The parabolas of the envelope, each with the first place where it is the lowest.
    let mut envelope: Vec<(i64, i64)> = vec![(-1, -1)];
    for column in 0..=SIDE {
        while envelope.last().is_some_and(|&(lowest, first)| at(first, lowest) > at(first, column)) {
            envelope.pop();
        }
        let Some(&(lowest, _)) = envelope.last() else {
            envelope.push((column, -1));
            continue;
        };
        let (square, before) = (height(column) * height(column), height(lowest) * height(lowest));
        let crossing = (column * column - lowest * lowest + square - before).div_euclid(2 * (column - lowest));
        if crossing < SIDE {
            envelope.push((column, crossing + 1));
        }
    }
    let mut squares = vec![0; columns.len()];
    let mut last = SIDE - 1;
    for &(column, first) in envelope.iter().rev() {
        for x in first.max(0)..=last {
            squares[x as usize] = at(x, column);
        }
        last = last.min(first - 1);
    }
    squares
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ink(is_inside: impl Fn(i64, i64) -> bool) -> Vec<Ink> {
        let alpha = |index: i64| if is_inside(index % SIDE, index / SIDE) { 255 } else { 0 };
        (0..SIDE * SIDE).map(|index| Ink { alpha: alpha(index), intensity: 255 }).collect()
    }

    #[test]
    fn depths_are_those_of_a_search_of_all_holes() {
        let blots = [(40, 60, 30), (150, 100, 80), (200, 220, 50), (255, 0, 20)];
        let is_inside =
            |x: i64, y: i64| blots.iter().any(|(a, b, r)| (x - a) * (x - a) + (y - b) * (y - b) < r * r) && x % 97 != 5;
        let depth = Depth::of(&ink(is_inside));
        let is_hole = |x, y| !(0..SIDE).contains(&x) || !(0..SIDE).contains(&y) || !is_inside(x, y);
        let holes: Vec<(i64, i64)> =
            (-1..=SIDE).flat_map(|y| (-1..=SIDE).map(move |x| (x, y))).filter(|&(x, y)| is_hole(x, y)).collect();
        for index in (0..SIDE * SIDE).step_by(61) {
            let (x, y) = (index % SIDE, index / SIDE);
            let square = holes.iter().map(|(a, b)| (x - a) * (x - a) + (y - b) * (y - b)).min().unwrap_or_default();
            let expected = ((square * 256).isqrt() - 8).max(0);
            assert_eq!(depth.texels()[index as usize], expected, "at {x}, {y}");
        }
    }

    #[test]
    fn the_middle_of_the_full_square_is_half_a_side_deep() {
        let depth = Depth::of(&ink(|_, _| true));
        assert_eq!(depth.greatest(), SIDE / 2 * DEPTH_PER_TEXEL - DEPTH_PER_TEXEL / 2);
        assert_eq!(depth.texels()[0], DEPTH_PER_TEXEL / 2);
    }

    #[test]
    fn a_faint_drawing_has_depth_too() {
        let faint: Vec<Ink> = ink(|_, _| true).into_iter().map(|ink| Ink { alpha: ink.alpha / 5, ..ink }).collect();
        assert!(Depth::of(&faint).greatest() > 1000);
    }
}
