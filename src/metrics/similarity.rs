//! Structural similarity (Wang et al. 2004), with the defaults of `skimage.metrics.structural_similarity`: a uniform
//! window of 7x7 px that lies inside the picture, sample covariance, mean over the channels.

use rayon::prelude::*;

use super::Picture;

/// Side of the window in px.
pub(super) const WINDOW_PX: usize = 7;
/// Pixels in the window.
const COUNT: f64 = (WINDOW_PX * WINDOW_PX) as f64;
/// (K1 L)² with K1 = 0.01 and L = 255.
const C1: f64 = 2.55 * 2.55;
/// (K2 L)² with K2 = 0.03.
const C2: f64 = 7.65 * 7.65;

/// Mean structural similarity of two pictures of the same size, at least a window wide and high; 1 if they are equal.
pub(super) fn mean(one: &Picture<'_>, other: &Picture<'_>) -> f64 {
    let channels: Vec<f64> = (0..3).into_par_iter().map(|channel| mean_of_channel(one, other, channel)).collect();
    channels.iter().sum::<f64>() / 3.0
}

/// Sums over the pixels of a column or of a window: x, y, x², y², xy; those of a window fit 32 bits many times over.
#[derive(Clone, Copy, Default)]
struct Sums([u32; 5]);

impl Sums {
    fn of_pixel(x: u8, y: u8) -> Self {
        let (x, y) = (u32::from(x), u32::from(y));
        Self([x, y, x * x, y * y, x * y])
    }

    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }

    fn minus(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }

    /// The similarity of the two pictures within a window.
    fn similarity(self) -> f64 {
        let [x, y, xx, yy, xy] = self.0.map(f64::from);
        let means = |product: f64| product / (COUNT * COUNT);
        let covariance = |sum: f64, product: f64| (COUNT * sum - product) / (COUNT * (COUNT - 1.0));
        let luminance = (2.0 * means(x * y) + C1) / (means(x * x) + means(y * y) + C1);
        let structure = (2.0 * covariance(xy, x * y) + C2) / (covariance(xx, x * x) + covariance(yy, y * y) + C2);
        luminance * structure
    }
}

fn mean_of_channel(one: &Picture<'_>, other: &Picture<'_>, channel: usize) -> f64 {
    let (width, height) = (one.width_px as usize, one.height_px as usize);
    let row = |y: usize| {
        let pixels = y * width..(y + 1) * width;
        let pairs = one.pixels[pixels.clone()].iter().zip(&other.pixels[pixels]);
        pairs.map(|(one, other)| Sums::of_pixel(one[channel], other[channel]))
    };
    let mut columns = vec![Sums::default(); width];
    let mut total = 0.0;
    for y in 0..height {
        columns.iter_mut().zip(row(y)).for_each(|(column, entering)| *column = column.plus(entering));
        if y + 1 < WINDOW_PX {
            continue;
        }
        total += sum_of_windows(&columns);
        columns.iter_mut().zip(row(y + 1 - WINDOW_PX)).for_each(|(column, leaving)| *column = column.minus(leaving));
    }
    total / ((width + 1 - WINDOW_PX) * (height + 1 - WINDOW_PX)) as f64
}

/// Sum of the similarities of all windows of a row of columns, each of a window's height.
fn sum_of_windows(columns: &[Sums]) -> f64 {
    let (first, rest) = columns.split_at(WINDOW_PX - 1);
    let mut window = first.iter().fold(Sums::default(), |window, column| window.plus(*column));
    let mut total = 0.0;
    for (leaving, entering) in columns.iter().zip(rest) {
        window = window.plus(*entering);
        total += window.similarity();
        window = window.minus(*leaving);
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;

    fn similarity(one: &[[u8; 3]], other: &[[u8; 3]], width_px: u32, height_px: u32) -> f64 {
        mean(&Picture { width_px, height_px, pixels: one }, &Picture { width_px, height_px, pixels: other })
    }

    #[test]
    fn flat_pictures_differ_by_luminance_only() {
        let value = similarity(&[[10; 3]; 49], &[[20; 3]; 49], 7, 7);
        assert!((value - 406.5025 / 506.5025).abs() < 1e-12, "{value}");
    }

    #[test]
    fn a_dot_on_black_has_the_variance_of_one_sample_of_49() {
        let mut dot = [[0; 3]; 49];
        dot[5][1] = 255;
        // Mean 255/49 and sample variance 255²/49 against nothing, in one of three channels.
        let luminance = C1 / ((255.0_f64 / 49.0).powi(2) + C1);
        let structure = C2 / (65_025.0 / 49.0 + C2);
        let value = similarity(&dot, &[[0; 3]; 49], 7, 7);
        assert!((value - (2.0 + luminance * structure) / 3.0).abs() < 1e-12, "{value}");
    }

    #[test]
    fn sliding_sums_are_those_of_every_window_anew() {
        let (width, height) = (11, 9);
        let pixel = |i: usize, factor: usize| [(i * factor % 256) as u8, (i * i % 251) as u8, (i / 5) as u8];
        let one: Vec<[u8; 3]> = (0..width * height).map(|i| pixel(i, 37)).collect();
        let other: Vec<[u8; 3]> = (0..width * height).map(|i| pixel(i + 3, 41)).collect();
        let mut total = 0.0;
        for channel in 0..3 {
            for corner in (0..=height - 7).flat_map(|y| (0..=width - 7).map(move |x| y * width + x)) {
                let places = (0..49).map(|i| corner + i / 7 * width + i % 7);
                let sums = places.map(|place| Sums::of_pixel(one[place][channel], other[place][channel]));
                total += sums.fold(Sums::default(), Sums::plus).similarity();
            }
        }
        let value = similarity(&one, &other, width as u32, height as u32);
        assert!((value - total / 45.0).abs() < 1e-12, "{value}");
    }
}
