//! A guide: the direction and the size that tiles should have at each place of a picture.
//!
//! It is plain samples on a coarse grid, which the twin and a device read alike. The module `crate::guide` computes
//! them.

/// Side in px of the square of pixels that one sample stands for.
pub const GUIDE_PX: u32 = 4;
/// [`GuideSample::size_q12`] of a tile as large as the mean.
pub const SIZE_ONE: u32 = 1 << 12;

/// What a guide says about one square of pixels. On a device it is two words: the lower half of the first is the
/// direction and the upper half the coherence; the second is the size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct GuideSample {
    /// Direction along the contour in 16 bits of a turn, from +x towards +y; below half a turn, since opposite
    /// directions are the same. 0 where there is none.
    pub direction: u16,
    /// How sure the direction is: 0 where there is none, 255 on a strong, clean edge.
    pub coherence: u16,
    /// The side of a tile here, divided by the mean side, in units of 1/[`SIZE_ONE`].
    pub size_q12: u32,
}

/// The samples of a whole picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guide {
    /// Samples in a row: the picture's width over [`GUIDE_PX`], rounded up.
    pub columns: u32,
    /// Rows of samples: the picture's height over [`GUIDE_PX`], rounded up.
    pub rows: u32,
    /// All samples, row by row from the top.
    pub samples: Vec<GuideSample>,
}

impl Guide {
    /// The sample of the square that holds pixel `(x_px, y_px)`; beyond the picture, the nearest sample.
    #[inline]
    #[must_use]
    pub fn at(&self, x_px: i32, y_px: i32) -> GuideSample {
        let place = |px: i32, count: u32| (px.max(0) as u32 / GUIDE_PX).min(count - 1) as usize;
        self.samples[place(y_px, self.rows) * self.columns as usize + place(x_px, self.columns)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pixel_reads_the_sample_of_its_square_and_those_beyond_the_border_the_nearest() {
        let sample = |size_q12| GuideSample { direction: 0, coherence: 0, size_q12 };
        let guide = Guide { columns: 3, rows: 2, samples: (0..6).map(sample).collect() };
        let sizes = [(0, 0), (3, 3), (4, 3), (8, 4), (11, 7), (500, 500), (-1, -900), (-4, 6), (7, -1)]
            .map(|(x, y)| guide.at(x, y).size_q12);
        assert_eq!(sizes, [0, 0, 1, 5, 5, 5, 0, 3, 1]);
    }

    #[test]
    fn a_sample_is_two_words_with_the_direction_lowest() {
        let sample = GuideSample { direction: 0x1234, coherence: 0xff, size_q12: 0x1800 };
        assert_eq!(bytemuck::cast::<GuideSample, [u8; 8]>(sample), [0x34, 0x12, 0xff, 0, 0, 0x18, 0, 0]);
    }
}
