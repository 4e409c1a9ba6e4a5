//! How well edges are kept: those that Canny's detector (1986) finds in the luma of both pictures, matched within 2 px.
//!
//! The detector repeats `skimage.feature.canny` with sigma 1 and thresholds 0.1 and 0.2, operation by operation. The
//! gradient is equally steep on both sides of a sharp step, so the last bit decides which side is the edge.

use rayon::prelude::*;

use super::luma::{Plane, columns_around};

/// How far in px the smoothing reaches: four times its sigma of 1.
const RADIUS: usize = 4;
/// Taps of the smoothing.
const TAPS: usize = 2 * RADIUS + 1;
/// Least gradient of an edge that continues a steeper one, in single precision as in scikit-image.
const LOW: f32 = 0.1;
/// Least gradient of an edge on its own.
const HIGH: f64 = 0.2;
/// How far in px an edge may have moved, as the square of the Euclidean distance.
const TOLERANCE_SQUARED: isize = 4;
/// Rows whose gradients are in memory at once, per thread.
const BAND_ROWS: usize = 32;

/// How well the edges of a reference are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeMatch {
    /// Share of the picture's edge pixels within 2 px of an edge pixel of the reference; 1 if neither has any.
    pub precision: f64,
    /// Share of the reference's edge pixels within 2 px of an edge pixel of the picture; 1 if neither has any.
    pub recall: f64,
}

impl EdgeMatch {
    /// Compares pictures of the same size.
    pub(super) fn between(reference: &EdgeMap, picture: &EdgeMap) -> Self {
        if reference.places.is_empty() && picture.places.is_empty() {
            return Self { precision: 1.0, recall: 1.0 };
        }
        Self { precision: picture.share_near(reference), recall: reference.share_near(picture) }
    }

    /// Harmonic mean of precision and recall, 0 to 1.
    #[must_use]
    pub fn f1(&self) -> f64 {
        let total = self.precision + self.recall;
        if total > 0.0 { 2.0 * self.precision * self.recall / total } else { 0.0 }
    }
}

/// How certain it is that a pixel belongs to an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Strength {
    None,
    /// It belongs to an edge only if it is connected to a sure pixel.
    Weak,
    Sure,
}

/// The edge pixels of a picture; the outermost rows and columns have none.
#[derive(Debug)]
pub(super) struct EdgeMap {
    width: usize,
    strengths: Vec<Strength>,
    /// Indices of the edge pixels.
    places: Vec<usize>,
}

impl EdgeMap {
    /// The edges in the luma of a picture of at least 3x3 px.
    pub(super) fn find(luma: &Plane) -> Self {
        let smooth = smoothed(luma);
        let mut strengths = vec![Strength::None; smooth.values.len()];
        strengths.par_chunks_mut(BAND_ROWS * smooth.width).enumerate().for_each(|(band, strengths)| {
            Gradients::of_band(&smooth, band * BAND_ROWS).thin(strengths);
        });
        let places = connect(&mut strengths, smooth.width);
        Self { width: smooth.width, strengths, places }
    }

    /// Whether each pixel belongs to an edge.
    pub(super) fn pixels(&self) -> Vec<bool> {
        self.strengths.iter().map(|&strength| strength == Strength::Sure).collect()
    }

    /// Share of the edge pixels that lie within the tolerance of one of `others`; 0 if there are none.
    fn share_near(&self, others: &Self) -> f64 {
        let near = self.places.iter().filter(|&&place| others.is_near(place)).count();
        near as f64 / self.places.len().max(1) as f64
    }

    /// Whether there is an edge pixel within the tolerance of a place.
    fn is_near(&self, place: usize) -> bool {
        let (width, height) = (self.width as isize, (self.strengths.len() / self.width) as isize);
        let (x, y) = (place as isize % width, place as isize / width);
        (-2..=2_isize).flat_map(|dy| (-2..=2_isize).map(move |dx| (dx, dy))).any(|(dx, dy)| {
            dx * dx + dy * dy <= TOLERANCE_SQUARED
                && (0..width).contains(&(x + dx))
                && (0..height).contains(&(y + dy))
                && self.strengths[((y + dy) * width + x + dx) as usize] == Strength::Sure
        })
    }
}

/// The luma smoothed by a Gaussian; near the border, by the part of the Gaussian that lies inside.
fn smoothed(luma: &Plane) -> Plane {
    let (width, height) = (luma.width, luma.height);
    let weights = gaussian();
    let outside = vec![0.0; width];
    let mut values = vec![0.0; luma.values.len()];
    values.par_chunks_mut(width).enumerate().for_each_init(
        || (vec![0.0; width + 2 * RADIUS], vec![0.0; width + 2 * RADIUS]),
        |(column_sums, inside), (y, row)| {
            let row_at = |tap: usize| (y + tap).checked_sub(RADIUS).filter(|&y| y < height);
            let lines: [&[f64]; TAPS] =
                std::array::from_fn(|tap| row_at(tap).map_or(outside.as_slice(), |y| luma.row(y)));
            let share = weighted(&weights, |tap| if row_at(tap).is_some() { 1.0 } else { 0.0 });
            for x in 0..width {
                column_sums[RADIUS + x] = weighted(&weights, |tap| lines[tap][x]);
            }
            inside[RADIUS..][..width].fill(share);
            for (x, value) in row.iter_mut().enumerate() {
                let share = weighted(&weights, |tap| inside[x + tap]) + f64::EPSILON;
                *value = weighted(&weights, |tap| column_sums[x + tap]) / share;
            }
        },
    );
    Plane { width, height, values }
}

/// The weights of a Gaussian with a sigma of 1, from its farthest tap to its middle.
fn gaussian() -> [f64; RADIUS + 1] {
    let bell = |distance: usize| libm::exp(-0.5 * (distance * distance) as f64);
    let sum: f64 = (0..TAPS).map(|tap| bell(tap.abs_diff(RADIUS))).sum();
    std::array::from_fn(|tap| bell(RADIUS - tap) / sum)
}

/// The weighted sum of nine values: the middle first, then pairs from the farthest to the nearest, as scipy does.
fn weighted(weights: &[f64; RADIUS + 1], value: impl Fn(usize) -> f64) -> f64 {
    let middle = value(RADIUS) * weights[RADIUS];
    (0..RADIUS).fold(middle, |sum, tap| sum + (value(tap) + value(TAPS - 1 - tap)) * weights[tap])
}

/// Sobel gradients of a band of rows, with a row before and after it where there is one.
struct Gradients {
    width: usize,
    /// Rows before the band, 0 or 1.
    rows_before: usize,
    down: Vec<f64>,
    across: Vec<f64>,
    magnitude: Vec<f64>,
}

impl Gradients {
    /// The gradients of the band that begins with row `first`.
    fn of_band(smooth: &Plane, first: usize) -> Self {
        let rows_before = usize::from(first > 0);
        let end = (first + BAND_ROWS + 1).min(smooth.height);
        let (mut down, mut across) = (Vec::new(), Vec::new());
        for y in first - rows_before..end {
            let [above, here, below] = smooth.rows_around(y);
            for x in 0..smooth.width {
                let [left, middle, right] = columns_around(x, smooth.width);
                let rise = |x: usize| below[x] - above[x];
                let run = |row: &[f64]| row[right] - row[left];
                down.push(rise(middle) * 2.0 + (rise(left) + rise(right)));
                across.push(run(here) * 2.0 + (run(above) + run(below)));
            }
        }
        let magnitude = down.iter().zip(&across).map(|(down, across)| (down * down + across * across).sqrt()).collect();
        Self { width: smooth.width, rows_before, down, across, magnitude }
    }

    /// Writes how certain it is that each pixel of the band belongs to an edge; the outermost rows and columns are left
    /// out.
    fn thin(&self, strengths: &mut [Strength]) {
        let rows = self.magnitude.len() / self.width;
        for y in 1..rows - 1 {
            let row = &mut strengths[(y - self.rows_before) * self.width..][..self.width];
            for (x, strength) in row.iter_mut().enumerate().take(self.width - 1).skip(1) {
                *strength = self.strength(y * self.width + x);
            }
        }
    }

    /// How certain it is that a pixel belongs to an edge. It does not if the gradient is steeper next to it, before or
    /// behind it along the direction of the gradient, interpolated between two neighbours.
    fn strength(&self, place: usize) -> Strength {
        let magnitude = self.magnitude[place];
        if magnitude < f64::from(LOW) {
            return Strength::None;
        }
        let (down, across) = (self.down[place], self.across[place]);
        let row = if (down <= 0.0) == (across <= 0.0) { self.width as isize } else { -(self.width as isize) };
        let is_steep = down.abs() > across.abs();
        let straight = if is_steep { row } else { 1 };
        let share = if is_steep { across.abs() / down.abs() } else { down.abs() / across.abs() };
        let side = |sign: isize| {
            let at = |offset: isize| self.magnitude[place.wrapping_add_signed(sign * offset)];
            at(row + 1) * share + at(straight) * (1.0 - share)
        };
        if side(1) > magnitude || side(-1) > magnitude {
            return Strength::None;
        }
        if magnitude >= HIGH { Strength::Sure } else { Strength::Weak }
    }
}

/// Makes weak pixels sure if they are connected to sure ones, even if only by a corner. Returns the indices of all sure
/// pixels.
fn connect(strengths: &mut [Strength], width: usize) -> Vec<usize> {
    let mut places: Vec<usize> = (0..strengths.len()).filter(|&place| strengths[place] == Strength::Sure).collect();
    let mut done = 0;
    while let Some(&place) = places.get(done) {
        done += 1;
        for row in [place - width, place, place + width] {
            for (strength, neighbour) in strengths[row - 1..=row + 1].iter_mut().zip(row - 1..) {
                if *strength == Strength::Weak {
                    *strength = Strength::Sure;
                    places.push(neighbour);
                }
            }
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(width: usize, height: usize, value: impl Fn(usize, usize) -> f64) -> Plane {
        let values = (0..width * height).map(|place| value(place % width, place / width)).collect();
        Plane { width, height, values }
    }

    /// Columns of all edge pixels, each once.
    fn columns(edges: &EdgeMap) -> Vec<usize> {
        let mut columns: Vec<usize> = edges.places.iter().map(|place| place % edges.width).collect();
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    #[test]
    fn the_weights_of_the_gaussian_are_those_of_numpy_to_the_last_bit() {
        let numpy = [0x3f21_8a9c_4fd5_36c6, 0x3f72_2724_cb7e_b269, 0x3fab_a4b9_9d17_99ab, 0x3fce_f8eb_9ad4_99ba]
            .map(f64::from_bits);
        assert_eq!(gaussian()[..RADIUS], numpy);
        assert_eq!(gaussian()[RADIUS], f64::from_bits(0x3fd9_884a_3075_94fb));
    }

    #[test]
    fn smoothing_keeps_a_flat_picture_up_to_its_corners() {
        let smooth = smoothed(&plane(7, 9, |_, _| 0.5));
        assert!(smooth.values.iter().all(|value| (value - 0.5).abs() < 1e-14), "{:?}", smooth.values);
    }

    #[test]
    fn a_ridge_one_pixel_wide_has_an_edge_on_either_side() {
        let edges = EdgeMap::find(&plane(21, 70, |x, _| if x == 10 { 1.0 } else { 0.0 }));
        assert_eq!(columns(&edges), [9, 11]);
        // All rows but the outermost, also where the bands of rows meet.
        assert_eq!(edges.places.len(), 2 * 68);
    }

    #[test]
    fn a_weak_edge_counts_only_where_it_continues_a_strong_one() {
        // A smoothed step of one rises by 0.399 + 0.242, the Gaussian's middle weights, over two px: a gradient of
        // 2.56.
        let step = |height: &dyn Fn(usize) -> f64| {
            let edges = EdgeMap::find(&plane(30, 70, |x, y| if x < 15 { 0.0 } else { height(y) }));
            let mut rows: Vec<usize> = edges.places.iter().map(|place| place / 30).collect();
            rows.sort_unstable();
            rows.dedup();
            rows
        };
        assert_eq!(step(&|_| 0.07), [0; 0], "0.18 is weak");
        assert_eq!(step(&|_| 0.09), (1..69).collect::<Vec<_>>(), "0.23 is sure");
        let one_end = step(&|y| if y < 8 { 0.09 } else { 0.07 });
        assert_eq!(one_end, (1..69).collect::<Vec<_>>(), "all of it is connected to its sure end");
        let interrupted = step(&|y| {
            if y < 8 {
                0.09
            } else if (30..40).contains(&y) {
                0.02
            } else {
                0.07
            }
        });
        assert!(interrupted.contains(&25) && interrupted.iter().all(|&y| y < 40), "{interrupted:?}");
    }

    #[test]
    fn an_edge_is_found_again_within_two_pixels_and_no_farther() {
        let ridge = |at: usize| EdgeMap::find(&plane(40, 20, |x, _| if x == at { 1.0 } else { 0.0 }));
        let reference = ridge(10);
        for (at, share) in [(10, 1.0), (11, 1.0), (12, 1.0), (13, 0.5), (14, 0.5), (15, 0.0)] {
            let found = EdgeMatch::between(&reference, &ridge(at));
            // Moved by 3 or 4 px, its left edge lies within 2 px of where the right edge was.
            assert_eq!(found, EdgeMatch { precision: share, recall: share }, "at {at}");
            assert_eq!(found.f1(), share);
        }
    }

    #[test]
    fn distance_is_euclidean() {
        let dot = |places: &[usize]| {
            let mut strengths = vec![Strength::None; 100];
            places.iter().for_each(|&place| strengths[place] = Strength::Sure);
            EdgeMap { width: 10, strengths, places: places.to_vec() }
        };
        // From (5, 5): (7, 5) and (6, 6) are within 2 px, (7, 6) is not.
        let found = EdgeMatch::between(&dot(&[55]), &dot(&[57, 66, 67, 99]));
        assert_eq!(found, EdgeMatch { precision: 0.5, recall: 1.0 });
        assert_eq!(found.f1(), 2.0 / 3.0);
        // Rows do not wrap: (9, 4) and (0, 5) are neighbours in memory only.
        assert_eq!(EdgeMatch::between(&dot(&[49]), &dot(&[50])).f1(), 0.0);
    }

    #[test]
    fn without_edges_nothing_can_be_lost_and_none_must_be_found() {
        let (flat, edged) =
            (EdgeMap::find(&plane(9, 9, |_, _| 0.0)), EdgeMap::find(&plane(9, 9, |x, _| (x / 4) as f64)));
        assert_eq!(EdgeMatch::between(&flat, &flat).f1(), 1.0);
        for found in [EdgeMatch::between(&flat, &edged), EdgeMatch::between(&edged, &flat)] {
            assert_eq!([found.precision, found.recall, found.f1()], [0.0; 3]);
        }
    }
}
