//! Errors of channels: integer sums of absolute and of squared differences, and the means that follow from them.

/// The differences between two pictures, summed over all pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Difference {
    absolute: [u64; 3],
    squares: u64,
    pixel_count: usize,
}

impl Difference {
    /// The differences between pictures of the same size.
    ///
    /// # Panics
    /// If one has more pixels than the other.
    #[must_use]
    pub fn between(one: &[[u8; 3]], other: &[[u8; 3]]) -> Self {
        assert_eq!(one.len(), other.len(), "the pictures have the same size");
        let (mut absolute, mut squares) = ([0; 3], 0);
        for (one, other) in one.iter().zip(other) {
            for channel in 0..3 {
                let difference = u64::from(one[channel].abs_diff(other[channel]));
                absolute[channel] += difference;
                squares += difference * difference;
            }
        }
        Self { absolute, squares, pixel_count: one.len() }
    }

    /// Sum of absolute errors of 8-bit red, green and blue (SAE).
    #[must_use]
    pub fn sae(&self) -> u64 {
        self.absolute.iter().sum()
    }

    /// Sum of squared errors of 8-bit red, green and blue.
    #[must_use]
    pub fn squares(&self) -> u64 {
        self.squares
    }

    /// Mean absolute error per channel value, 0 to 255.
    #[must_use]
    pub fn mae(&self) -> f64 {
        self.sae() as f64 / self.value_count()
    }

    /// Mean absolute error of red, green and blue, 0 to 255.
    #[must_use]
    pub fn mae_by_channel(&self) -> [f64; 3] {
        self.absolute.map(|sum| sum as f64 / self.pixel_count as f64)
    }

    /// Root of the mean squared error over pixels and channels, 0 to 255.
    #[must_use]
    pub fn rmse(&self) -> f64 {
        (self.squares as f64 / self.value_count()).sqrt()
    }

    /// Peak signal-to-noise ratio in dB over all channels; `None` if the pictures are equal.
    #[must_use]
    pub fn psnr_db(&self) -> Option<f64> {
        (self.squares > 0).then(|| 10.0 * (255.0_f64.powi(2) * self.value_count() / self.squares as f64).log10())
    }

    fn value_count(&self) -> f64 {
        self.pixel_count as f64 * 3.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_and_means_match_those_computed_by_hand() {
        let difference = Difference::between(&[[10, 20, 30], [0, 255, 7]], &[[13, 20, 26], [0, 0, 7]]);
        assert_eq!(difference.sae(), 3 + 4 + 255);
        assert_eq!(difference.squares(), 9 + 16 + 65_025);
        assert_eq!(difference.mae(), 262.0 / 6.0);
        assert_eq!(difference.mae_by_channel(), [1.5, 127.5, 2.0]);
        assert_eq!(difference.rmse(), (65_050.0_f64 / 6.0).sqrt());
    }

    #[test]
    fn white_against_black_has_a_ratio_of_0_db_and_a_tenth_of_it_20_db() {
        assert_eq!(Difference::between(&[[255; 3]; 5], &[[0; 3]; 5]).psnr_db(), Some(0.0));
        // One value of 100 is off by 255, which makes a root mean square of 25.5.
        let mut other = [[0; 3]; 100];
        for pixel in &mut other[..3] {
            pixel[1] = 255;
        }
        let ratio = Difference::between(&[[0; 3]; 100], &other).psnr_db().expect("they differ");
        assert!((ratio - 20.0).abs() < 1e-12, "{ratio}");
    }
}
