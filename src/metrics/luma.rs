//! The brightness of a picture, on which gradients and edges are measured.

use super::Picture;

/// Shares of red, green and blue (Rec. 601).
const SHARES: [f64; 3] = [0.299, 0.587, 0.114];

/// One number per pixel, row by row from the top.
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f64>,
}

impl Plane {
    /// Luma of a picture, 0 to 1.
    ///
    /// Operations have the same order as in numpy's product of matrix and vector on x86-64 with AVX-512. Where two
    /// pixels of an edge are equally steep, the last bit decides which of them Canny keeps.
    pub(super) fn luma(picture: &Picture<'_>) -> Self {
        let luma = |pixel: &[u8; 3]| {
            let [r, g, b] = pixel.map(f64::from);
            b.mul_add(SHARES[2], r.mul_add(SHARES[0], g * SHARES[1])) / 255.0
        };
        let values = picture.pixels.iter().map(luma).collect();
        Self { width: picture.width_px as usize, height: picture.height_px as usize, values }
    }

    pub(super) fn row(&self, y: usize) -> &[f64] {
        &self.values[y * self.width..][..self.width]
    }

    /// The rows before, at and after `y`; beyond the border the outermost row repeats.
    pub(super) fn rows_around(&self, y: usize) -> [&[f64]; 3] {
        [y.saturating_sub(1), y, (y + 1).min(self.height - 1)].map(|y| self.row(y))
    }
}

/// The columns before, at and after `x`; beyond the border the outermost column repeats.
pub(super) fn columns_around(x: usize, width: usize) -> [usize; 3] {
    [x.saturating_sub(1), x, (x + 1).min(width - 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luma_weighs_the_channels_and_ends_at_one() {
        let pixels = [[0; 3], [255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3], [100, 50, 10]];
        let plane = Plane::luma(&Picture { width_px: 3, height_px: 2, pixels: &pixels });
        for (value, expected) in plane.values.iter().zip([0.0, 0.299, 0.587, 0.114, 1.0, 60.39 / 255.0]) {
            assert!((value - expected).abs() < 1e-15, "{value} is not {expected}");
        }
    }

    #[test]
    fn rows_and_columns_repeat_beyond_the_border() {
        let plane = Plane { width: 2, height: 3, values: vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0] };
        assert_eq!(plane.rows_around(0), [[0.0, 1.0], [0.0, 1.0], [2.0, 3.0]]);
        assert_eq!(plane.rows_around(2), [[2.0, 3.0], [4.0, 5.0], [4.0, 5.0]]);
        assert_eq!([0, 1].map(|x| columns_around(x, 2)), [[0, 0, 1], [0, 1, 1]]);
    }
}
