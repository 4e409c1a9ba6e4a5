//! Smoothing by three boxes with fractional ends (Gwosdek et al. 2011). It is nearly a Gaussian, and its time does not
//! grow with the width. Sums are integers, so running sums are exact.

/// Passes of a box.
const PASSES: usize = 3;
/// Weight of a value well inside a box.
const WEIGHT_ONE: i64 = 128;
/// Widest box on one side of its middle: with values below 2^31, sums of 511 x 511 weighted values stay below 2^63.
const RADIUS_MAX: usize = 254;

/// A box: values up to `radius` away have the weight [`WEIGHT_ONE`], and the next one on each side has the weight
/// `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Extent {
    radius: usize,
    end: i64,
}

impl Extent {
    /// The box that has the deviation `sigma` after three passes, or the widest box.
    fn of(sigma: f64) -> Self {
        let variance = sigma * sigma / PASSES as f64;
        let radius = libm::floor(((12.0 * variance + 1.0).sqrt() - 1.0) / 2.0).min(RADIUS_MAX as f64);
        let inner = (2.0 * radius + 1.0) * (radius * (radius + 1.0) - 3.0 * variance);
        let share = inner / (6.0 * (variance - (radius + 1.0) * (radius + 1.0)));
        let end = libm::round(share * WEIGHT_ONE as f64) as i64;
        Self { radius: radius as usize, end: end.clamp(0, WEIGHT_ONE) }
    }

    /// The weight of that part of the box around `place` which lies in `0..count`.
    fn weight_inside(self, place: usize, count: usize) -> i64 {
        let inner = (place + self.radius).min(count - 1) + 1 - place.saturating_sub(self.radius);
        let ends = usize::from(place > self.radius) + usize::from(place + self.radius + 1 < count);
        inner as i64 * WEIGHT_ONE + ends as i64 * self.end
    }
}

/// The plane with rows of `columns` values, smoothed by a bell of deviation `sigma`; near the border, by the part of
/// the bell that lies inside. Values must be below 2^31.
pub(super) fn smoothed(plane: &[i64], columns: usize, sigma: f64) -> Vec<i64> {
    let extent = Extent::of(sigma);
    let mut plane = plane.to_vec();
    if extent != (Extent { radius: 0, end: 0 }) {
        for _ in 0..PASSES {
            plane = boxed(&plane, columns, extent);
        }
    }
    plane
}

/// One pass of a box over both axes, each mean rounded.
fn boxed(plane: &[i64], columns: usize, extent: Extent) -> Vec<i64> {
    let rows = plane.len() / columns;
    let reach = extent.radius + 1;
    let row = |y: usize| &plane[y * columns..][..columns];
    let shares: Vec<f64> = (0..columns).map(|x| 1.0 / extent.weight_inside(x, columns) as f64).collect();
    let mut result = Vec::with_capacity(plane.len());
    // The sum of the rows within the radius of one; a row is added one step ahead.
    let mut inner = vec![0_i64; columns];
    let mut line = vec![0_i64; columns];
    for y in 0..extent.radius.min(rows) {
        inner.iter_mut().zip(row(y)).for_each(|(sum, value)| *sum += value);
    }
    for y in 0..rows {
        if y + extent.radius < rows {
            inner.iter_mut().zip(row(y + extent.radius)).for_each(|(sum, value)| *sum += value);
        }
        if y >= reach {
            inner.iter_mut().zip(row(y - reach)).for_each(|(sum, value)| *sum -= value);
        }
        line.iter_mut().zip(&inner).for_each(|(sum, inner)| *sum = WEIGHT_ONE * inner);
        for end in [y.checked_sub(reach), Some(y + reach).filter(|&y| y < rows)].into_iter().flatten() {
            line.iter_mut().zip(row(end)).for_each(|(sum, value)| *sum += extent.end * value);
        }
        let share = 1.0 / extent.weight_inside(y, rows) as f64;
        across(&line, extent, |x, sum| result.push(libm::rint(sum as f64 * (share * shares[x])) as i64));
    }
    result
}

/// The weighted sums of the box along a line, from its first place to its last.
fn across(line: &[i64], extent: Extent, mut give: impl FnMut(usize, i64)) {
    let reach = extent.radius + 1;
    let mut inner: i64 = line.iter().take(extent.radius).sum();
    for x in 0..line.len() {
        let after = |distance: usize| line.get(x + distance).copied().unwrap_or(0);
        let before = if x >= reach { line[x - reach] } else { 0 };
        inner += after(extent.radius) - before;
        give(x, WEIGHT_ONE * inner + extent.end * (before + after(reach)));
    }
}
