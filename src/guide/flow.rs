//! The flowing field: strong contours keep their direction, and the areas between take theirs from the contours around
//! them.
//!
//! A direction is a vector with twice its angle, so opposite directions are equal. The contours ask for the vector `u`
//! with the weight `w`, and the field `v` minimises `sum of w |v - u|^2 + lambda |gradient of v|^2`. Where there is no
//! contour, the field is harmonic and rows of tiles continue in parallel. It is solved from coarse to fine by damped
//! Jacobi sweeps, whose result does not depend on the order of places.

use rayon::prelude::*;

use super::tensor::Tensors;

/// Sweeps at each level of the pyramid.
const SWEEPS: usize = 16;
/// Share of a sweep's change that is applied; the whole change would leave a checkerboard.
const DAMPING: f32 = 0.8;
/// Rows per task of a sweep.
const BAND_ROWS: usize = 64;

/// Vectors on a grid.
#[derive(Clone)]
pub(super) struct Field {
    columns: usize,
    rows: usize,
    /// The vectors, row by row.
    pub vectors: Vec<[f32; 2]>,
}

/// What the contours ask for on a grid: sums of weighted vectors and of weights.
struct Contours {
    columns: usize,
    rows: usize,
    pulls: Vec<[f32; 2]>,
    weights: Vec<f32>,
}

impl Contours {
    /// The contours of a picture; only their strength relative to each other matters.
    fn of(tensors: &Tensors) -> Self {
        let count = tensors.trace.len();
        let strength = |place: usize| {
            let (x, y) = tensors.along(place);
            (x * x + y * y).sqrt()
        };
        // Steepness is the root of the strength. Its mean, weighted by itself, is the typical steepness of contours,
        // even if they take up little of the picture.
        let (mut strengths, mut steepness) = (0, 0);
        for strength in (0..count).map(strength) {
            strengths += libm::rint(strength) as i64;
            steepness += libm::rint(strength.sqrt()) as i64;
        }
        let scale = if steepness > 0 { strengths as f64 / steepness as f64 } else { 1.0 };
        let mut contours = Self { columns: tensors.columns, rows: tensors.rows, pulls: vec![], weights: vec![] };
        for place in 0..count {
            let ((x, y), strength) = (tensors.along(place), strength(place));
            let coherence = tensors.coherence(place);
            let relative = (2.0 * strength / (scale * scale)).min(1.0);
            let weight = relative * relative.sqrt() * coherence * coherence;
            let share = if strength > 0.0 { weight / strength } else { 0.0 };
            contours.pulls.push([(x * share) as f32, (y * share) as f32]);
            contours.weights.push(weight as f32);
        }
        contours
    }

    /// The same contours on a grid of half as many columns and rows.
    fn halved(&self) -> Self {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let mut half = Self { columns, rows, pulls: Vec::new(), weights: Vec::new() };
        for y in 0..rows {
            for x in 0..columns {
                // Opposite corners are added first, so that a turned picture has exactly the turned sums.
                let corners = [(0, 0), (1, 1), (1, 0), (0, 1)].map(|(right, down)| {
                    let (x, y) = (2 * x + right, 2 * y + down);
                    let place = y * self.columns + x;
                    if x < self.columns && y < self.rows {
                        (self.pulls[place], self.weights[place])
                    } else {
                        ([0.0; 2], 0.0)
                    }
                });
                let sum = |of: &dyn Fn(usize) -> f32| (of(0) + of(1)) + (of(2) + of(3));
                half.pulls.push([0, 1].map(|axis| sum(&|corner| corners[corner].0[axis])));
                half.weights.push(sum(&|corner| corners[corner].1));
            }
        }
        half
    }

    /// The field that follows these contours; `lambda` is the stiffness, in squares of the grid's spacing.
    fn follow(&self, lambda: f32) -> Field {
        let mut field = if self.columns.max(self.rows) > 1 {
            self.halved().follow(lambda).doubled(self.columns, self.rows)
        } else {
            Field { columns: 1, rows: 1, vectors: vec![[0.0; 2]] }
        };
        let mut next = field.clone();
        for _ in 0..SWEEPS {
            let rows = next.vectors.par_chunks_mut(self.columns * BAND_ROWS).enumerate();
            rows.for_each(|(band, vectors)| self.sweep(&field, lambda, band * BAND_ROWS, vectors));
            std::mem::swap(&mut field, &mut next);
        }
        field
    }

    /// One sweep over the rows from `first`; beyond the border the outermost vectors repeat.
    fn sweep(&self, field: &Field, lambda: f32, first: usize, vectors: &mut [[f32; 2]]) {
        for (y, row) in (first..).zip(vectors.chunks_mut(self.columns)) {
            let line = |y: usize| &field.vectors[y * self.columns..][..self.columns];
            let (above, here, below) = (line(y.saturating_sub(1)), line(y), line((y + 1).min(self.rows - 1)));
            for (x, vector) in row.iter_mut().enumerate() {
                let (left, right) = (here[x.saturating_sub(1)], here[(x + 1).min(self.columns - 1)]);
                let place = y * self.columns + x;
                let share = DAMPING / (self.weights[place] + 4.0 * lambda);
                let stay = 1.0 - DAMPING;
                *vector = [0, 1].map(|axis| {
                    let around = (left[axis] + right[axis]) + (above[x][axis] + below[x][axis]);
                    stay * here[x][axis] + share * (self.pulls[place][axis] + lambda * around)
                });
            }
        }
    }
}

impl Field {
    /// The field on a grid of about twice as many columns and rows, by bilinear interpolation.
    fn doubled(&self, columns: usize, rows: usize) -> Self {
        let mut vectors = Vec::with_capacity(columns * rows);
        let near = |place: usize, count: usize| {
            let nearest = place / 2;
            let next = if place.is_multiple_of(2) { nearest.saturating_sub(1) } else { (nearest + 1).min(count - 1) };
            (nearest, next)
        };
        for y in 0..rows {
            let (row, next_row) = near(y, self.rows);
            for x in 0..columns {
                let (column, next_column) = near(x, self.columns);
                let at = |row: usize, column: usize| self.vectors[row * self.columns + column];
                let corners = [at(row, column), at(row, next_column), at(next_row, column), at(next_row, next_column)];
                let [nearest, beside, under, far] = corners;
                vectors.push(
                    [0, 1].map(|axis| (9.0 * nearest[axis] + 3.0 * (beside[axis] + under[axis]) + far[axis]) * 0.0625),
                );
            }
        }
        Self { columns, rows, vectors }
    }
}

/// The field that flows along the contours of `tensors`, smoothed over about `smoothing` of their squares.
///
/// The stiffness is a sixteenth of the square of `smoothing`; a contour that is `smoothing` long then still bends the
/// rows beside it.
pub(super) fn flow(tensors: &Tensors, smoothing: f64) -> Field {
    // Without any stiffness there would be no field where there is no contour.
    let smoothing = smoothing.max(0.25);
    Contours::of(tensors).follow((smoothing * smoothing / 16.0) as f32)
}
