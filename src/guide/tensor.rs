//! The structure tensor: in which direction, and how strongly, colour changes in each square of pixels.

use rayon::prelude::*;

use super::smooth::smoothed;
use crate::model::Target;
use crate::model::guide::GUIDE_PX;

const SQUARE: usize = GUIDE_PX as usize;
const CHANNELS: usize = 3;
/// Scharr's weights of a pixel and of its two neighbours: the 3x3 gradient with the least error of direction.
const MIDDLE: i32 = 10;
const SIDE: i32 = 3;
/// The trace of a square where every channel changes by one level per pixel, about what noise does.
pub(super) const TRACE_OF_ONE_LEVEL: i64 =
    ((2 * (MIDDLE + 2 * SIDE)) as i64).pow(2) * (CHANNELS * SQUARE * SQUARE) as i64;

/// For each square of pixels, sums over pixels and channels of products of the gradient `(gx, gy)`.
pub(super) struct Tensors {
    pub columns: usize,
    pub rows: usize,
    /// `gx gx - gy gy`.
    pub difference: Vec<i64>,
    /// `2 gx gy`.
    pub twice_mixed: Vec<i64>,
    /// `gx gx + gy gy`.
    pub trace: Vec<i64>,
}

impl Tensors {
    /// The tensors of a picture, each from the pixels of its own square.
    pub(super) fn of(target: &Target) -> Self {
        let (width, height) = (target.width_px() as usize, target.height_px() as usize);
        let (columns, rows) = (width.div_ceil(SQUARE), height.div_ceil(SQUARE));
        let mut sums = vec![[0; 3]; columns * rows];
        sums.par_chunks_mut(columns).enumerate().for_each_init(
            || Gradients::new(width),
            |gradients, (row, sums)| {
                gradients.clear();
                for y in row * SQUARE..((row + 1) * SQUARE).min(height) {
                    gradients.add_row(target, y);
                }
                gradients.write(sums);
            },
        );
        let plane = |of: fn([i64; 3]) -> i64| sums.iter().map(|&sums| of(sums)).collect();
        Self {
            columns,
            rows,
            difference: plane(|[xx, yy, _]| xx - yy),
            twice_mixed: plane(|[_, _, xy]| 2 * xy),
            trace: plane(|[xx, yy, _]| xx + yy),
        }
    }

    /// The tensors with the outermost ring of squares replaced by the ring within it. Scans and exports often leave a
    /// dark line along the border, which is no contour of the picture.
    pub(super) fn without_frame(&self) -> Self {
        let inside = |place: usize, count: usize| if count > 2 { place.clamp(1, count - 2) } else { place };
        let plane = |plane: &[i64]| {
            let place = |y: usize, x: usize| inside(y, self.rows) * self.columns + inside(x, self.columns);
            (0..self.rows)
                .flat_map(|y| (0..self.columns).map(move |x| (y, x)))
                .map(|(y, x)| plane[place(y, x)])
                .collect()
        };
        Self {
            columns: self.columns,
            rows: self.rows,
            difference: plane(&self.difference),
            twice_mixed: plane(&self.twice_mixed),
            trace: plane(&self.trace),
        }
    }

    /// The tensors smoothed by a bell of deviation `sigma`, in squares.
    pub(super) fn smoothed(&self, sigma: f64) -> Self {
        let smooth = |plane: &[i64]| smoothed(plane, self.columns, sigma);
        Self {
            columns: self.columns,
            rows: self.rows,
            difference: smooth(&self.difference),
            twice_mixed: smooth(&self.twice_mixed),
            trace: smooth(&self.trace),
        }
    }

    /// Of the square at `place`: cosine and sine of twice the angle *along* the contour, times the difference of the
    /// eigenvalues.
    pub(super) fn along(&self, place: usize) -> (f64, f64) {
        (-self.difference[place] as f64, -self.twice_mixed[place] as f64)
    }

    /// Of the square at `place`: the share of its changes that agree on a direction, 0 to 1; small where hardly
    /// anything changes.
    pub(super) fn coherence(&self, place: usize) -> f64 {
        let (x, y) = self.along(place);
        (x * x + y * y).sqrt() / (self.trace[place] + TRACE_OF_ONE_LEVEL) as f64
    }
}

/// Products of gradients, summed over the pixel rows of one row of squares, for each channel value of a row.
struct Gradients {
    /// A row and the rows before and after it, weighted for the gradient along x; the border repeats before and after.
    smooth: Vec<i32>,
    /// The row after a row minus the row before it; the border repeats before and after.
    rise: Vec<i32>,
    /// `gx gx`, `gy gy` and `gx gy`.
    sums: [Vec<i32>; 3],
}

impl Gradients {
    fn new(width: usize) -> Self {
        let values = width * CHANNELS;
        let padded = || vec![0; values + 2 * CHANNELS];
        Self { smooth: padded(), rise: padded(), sums: std::array::from_fn(|_| vec![0; values]) }
    }

    fn clear(&mut self) {
        self.sums.iter_mut().for_each(|sums| sums.fill(0));
    }

    /// Adds the gradients of a row of pixels; beyond the picture, its border repeats.
    fn add_row(&mut self, target: &Target, y: usize) {
        let width = target.width_px() as usize;
        let last = target.height_px() as usize - 1;
        let row = |y: usize| target.pixels()[y * width..][..width].as_flattened();
        let (above, here, below) = (row(y.saturating_sub(1)), row(y), row((y + 1).min(last)));
        let values = here.len();
        let smooth = &mut self.smooth[CHANNELS..][..values];
        let rise = &mut self.rise[CHANNELS..][..values];
        for i in 0..values {
            let (above, here, below) = (i32::from(above[i]), i32::from(here[i]), i32::from(below[i]));
            smooth[i] = SIDE * (above + below) + MIDDLE * here;
            rise[i] = below - above;
        }
        for line in [&mut self.smooth, &mut self.rise] {
            line.copy_within(CHANNELS..2 * CHANNELS, 0);
            line.copy_within(values..values + CHANNELS, values + CHANNELS);
        }
        let (left, right) = (&self.smooth[..values], &self.smooth[2 * CHANNELS..][..values]);
        let [before, at, after] = [0, CHANNELS, 2 * CHANNELS].map(|first| &self.rise[first..][..values]);
        let [xx, yy, xy] = self.sums.each_mut().map(|sums| &mut sums[..values]);
        for i in 0..values {
            let gx = right[i] - left[i];
            let gy = SIDE * (before[i] + after[i]) + MIDDLE * at[i];
            xx[i] += gx * gx;
            yy[i] += gy * gy;
            xy[i] += gx * gy;
        }
    }

    /// Sums the squares. No sum has more than 48 products of gradients up to 4,080, so it fits 32 bits.
    fn write(&self, squares: &mut [[i64; 3]]) {
        for (sum, values) in self.sums.iter().enumerate() {
            for (square, values) in squares.iter_mut().zip(values.chunks(SQUARE * CHANNELS)) {
                square[sum] = i64::from(values.iter().sum::<i32>());
            }
        }
    }
}
