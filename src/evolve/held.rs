//! Decides which pixels of a sequence of pictures hold still, so that their tiles can, too: a target with hysteresis.
//!
//! A pixel keeps its value, the mean of its latest pictures, while the pictures stay near it, so noise moves no tile.
//! When a picture departs from that value, the pixel and its surroundings take the new value, and are free to be
//! evolved for some frames. Still pixels are refined in turns: in each frame, some squares of them are free, too.
//! Integers only; nothing here knows a file or a device.

use crate::error::Result;
use crate::model::{Mosaic, Rgb, Target};

/// Number of frames for which a changed pixel is free: the one in which it changed, and those in which its tiles
/// settle.
const FREE_FRAMES: u8 = 3;
/// Side of the squares that are refined in turns, in px.
const SQUARE_PX: usize = 32;
/// Number of frames until a square has its turn again.
const TURNS: usize = 4;
/// Most frames in the mean of a pixel.
const MEAN_FRAMES: u8 = 16;
/// Distance in px within which the pixels around a changed one are free, too, since tiles that show there must be able
/// to make room.
const MARGIN_PX: usize = 2;
/// Half the side, without the middle, of the square whose mean difference distinguishes a change from noise, in px.
const WINDOW_PX: usize = 2;
/// A single pixel counts as changed if it differs by this many times the noise.
const ALONE: i32 = 4;
/// Largest noise.
pub const NOISE_MAX: u32 = 63;
/// Columns and rows of the squares by which pictures are compared to find cuts.
const SQUARES: usize = 32;

/// The pixels that a sequence is evolved towards.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held {
    width_px: usize,
    height_px: usize,
    noise: i32,
    /// Number of frames since the first one.
    frames: usize,
    /// The means, with 8 fractional bits.
    means_q8: Vec<[u16; 3]>,
    /// Number of frames in each mean, at most [`MEAN_FRAMES`].
    counts: Vec<u8>,
    transparent: Option<Vec<bool>>,
    /// Number of frames since each pixel changed, at most [`FREE_FRAMES`].
    ages: Vec<u8>,
}

impl Held {
    /// Begins with the first picture of a shot, which is evolved anew. In later pictures a mean difference of up to
    /// `noise`, 0 to [`NOISE_MAX`] of 255, does not count as a change.
    #[must_use]
    pub fn new(target: &Target, noise: u32) -> Self {
        Self {
            width_px: target.width_px() as usize,
            height_px: target.height_px() as usize,
            noise: noise.min(NOISE_MAX) as i32,
            frames: 0,
            means_q8: target.pixels().iter().map(|&color| exact(color)).collect(),
            counts: vec![1; target.pixels().len()],
            transparent: target.transparent().map(<[bool]>::to_vec),
            ages: vec![FREE_FRAMES; target.pixels().len()],
        }
    }

    /// Goes on to the next picture.
    ///
    /// # Panics
    /// If its size differs.
    pub fn advance(&mut self, target: &Target) {
        assert_eq!(target.pixels().len(), self.means_q8.len(), "the pictures of a shot have one size");
        let changed = widened(&self.changes(target), self.width_px);
        let old = self.transparent.take();
        let is_clear = |plane: Option<&[bool]>, pixel: usize| plane.is_some_and(|plane| plane[pixel]);
        if old.is_some() || target.transparent().is_some() {
            let plane = (0..changed.len()).map(|pixel| {
                if changed[pixel] { is_clear(target.transparent(), pixel) } else { is_clear(old.as_deref(), pixel) }
            });
            self.transparent = Some(plane.collect());
        }
        for (pixel, &has_changed) in changed.iter().enumerate() {
            let new = exact(target.pixels()[pixel]);
            if has_changed {
                (self.means_q8[pixel], self.counts[pixel], self.ages[pixel]) = (new, 1, 0);
                continue;
            }
            self.ages[pixel] = (self.ages[pixel] + 1).min(FREE_FRAMES);
            let count = (self.counts[pixel] + 1).min(MEAN_FRAMES);
            self.counts[pixel] = count;
            for (mean, new) in self.means_q8[pixel].iter_mut().zip(new) {
                *mean = (i32::from(*mean) + (i32::from(new) - i32::from(*mean)) / i32::from(count)) as u16;
            }
        }
        self.frames += 1;
    }

    /// Whether a pixel is to look as it did in the frame before.
    #[must_use]
    pub fn is_still(&self, pixel: usize) -> bool {
        let (column, row) = (pixel % self.width_px / SQUARE_PX, pixel / self.width_px / SQUARE_PX);
        // Neighbouring squares have their turns at different times.
        self.ages[pixel] >= FREE_FRAMES && !(column + 2 * row + self.frames).is_multiple_of(TURNS)
    }

    /// The picture that is held, with the weights of `target`.
    ///
    /// # Errors
    /// [`crate::error::Error::Parameter`] if the weights do not fit.
    pub fn picture(&self, target: &Target) -> Result<Target> {
        self.with_planes(self.colors().collect(), target)
    }

    /// The target of the next frame. Where the picture is still, it is what `shown`, the mosaic of the frame before,
    /// shows there, so that a change costs as much as it would flicker. Elsewhere it is the held picture.
    ///
    /// # Errors
    /// As [`Held::picture`].
    pub fn target(&self, shown: &Mosaic, target: &Target) -> Result<Target> {
        let is_covered = |pixel: usize| shown.alpha.as_ref().is_none_or(|alpha| alpha[pixel] == 255);
        let color = |(pixel, held): (usize, Rgb)| {
            if self.is_still(pixel) && is_covered(pixel) { shown.pixels[pixel] } else { held }
        };
        self.with_planes(self.colors().enumerate().map(color).collect(), target)
    }

    fn colors(&self) -> impl Iterator<Item = Rgb> {
        self.means_q8.iter().map(|mean| mean.map(|channel| ((channel + 127) >> 8) as u8))
    }

    fn with_planes(&self, pixels: Vec<Rgb>, target: &Target) -> Result<Target> {
        let mut held = Target::new(target.width_px(), target.height_px(), pixels)?;
        if let Some(transparent) = &self.transparent {
            held = held.with_transparent(transparent.clone())?;
        }
        if let Some(weights) = target.weights() {
            held = held.with_weights(weights.to_vec())?;
        }
        Ok(held)
    }

    /// The pixels that count as changed.
    fn changes(&self, target: &Target) -> Vec<bool> {
        let clear = |plane: Option<&[bool]>, pixel: usize| plane.is_some_and(|plane| plane[pixel]);
        let (old, new) = (self.transparent.as_deref(), target.transparent());
        let mut changes: Vec<bool> =
            (0..self.counts.len()).map(|pixel| clear(old, pixel) != clear(new, pixel)).collect();
        for channel in 0..3 {
            let pairs = target.pixels().iter().zip(self.colors());
            let off: Vec<i32> = pairs.map(|(new, old)| i32::from(new[channel]) - i32::from(old[channel])).collect();
            let sums = window_sums(&off, self.width_px);
            for (pixel, change) in changes.iter_mut().enumerate() {
                let (sum, count) = sums[pixel];
                *change |= off[pixel].abs() > ALONE * self.noise || sum.abs() > self.noise * count;
            }
        }
        changes
    }
}

/// A colour with 8 fractional bits.
fn exact(color: Rgb) -> [u16; 3] {
    color.map(|channel| u16::from(channel) << 8)
}

/// Sum and number of the values in the window around each place. At the border the window is moved inwards, since a
/// smaller one would take noise for a change.
fn window_sums(values: &[i32], width_px: usize) -> Vec<(i32, i32)> {
    let window = |middle: usize, size: usize| {
        let side = (2 * WINDOW_PX + 1).min(size);
        let first = middle.saturating_sub(WINDOW_PX).min(size - side);
        first..first + side
    };
    let rows: Vec<i32> =
        values.chunks(width_px).flat_map(|row| (0..width_px).map(|x| row[window(x, width_px)].iter().sum())).collect();
    let height_px = values.len() / width_px;
    let sum = |place: usize| {
        let (x, lines) = (place % width_px, window(place / width_px, height_px));
        let count = lines.len() * window(x, width_px).len();
        (lines.map(|y| rows[y * width_px + x]).sum(), count as i32)
    };
    (0..values.len()).map(sum).collect()
}

/// The places together with those around them.
fn widened(places: &[bool], width_px: usize) -> Vec<bool> {
    let height_px = places.len() / width_px;
    let mut wide = vec![false; places.len()];
    for place in (0..places.len()).filter(|&place| places[place]) {
        let (x, y) = (place % width_px, place / width_px);
        for row in y.saturating_sub(MARGIN_PX)..(y + MARGIN_PX + 1).min(height_px) {
            let start = row * width_px;
            wide[start + x.saturating_sub(MARGIN_PX)..start + (x + MARGIN_PX + 1).min(width_px)].fill(true);
        }
    }
    wide
}

/// A picture reduced to a few squares, for comparison with its neighbours in a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Glance {
    means: Vec<Rgb>,
}

impl Glance {
    /// The means of up to 32x32 squares of a picture.
    #[must_use]
    pub fn of(target: &Target) -> Self {
        let (width_px, height_px) = (target.width_px() as usize, target.height_px() as usize);
        let (columns, rows) = (width_px.min(SQUARES), height_px.min(SQUARES));
        let mut sums = vec![([0_u64; 3], 0_u64); columns * rows];
        for (place, color) in target.pixels().iter().enumerate() {
            let (x, y) = (place % width_px, place / width_px);
            let (sum, count) = &mut sums[y * rows / height_px * columns + x * columns / width_px];
            sum.iter_mut().zip(color).for_each(|(sum, &value)| *sum += u64::from(value));
            *count += 1;
        }
        Self { means: sums.into_iter().map(|(sum, count)| sum.map(|sum| (sum / count) as u8)).collect() }
    }

    /// The mean difference per channel of two pictures of the same size, 0 to 255, rounded down.
    ///
    /// # Panics
    /// If they do not have the same number of squares.
    #[must_use]
    pub fn difference(&self, other: &Self) -> u32 {
        assert_eq!(self.means.len(), other.means.len(), "the pictures have one size");
        let pairs = self.means.iter().flatten().zip(other.means.iter().flatten());
        let sum: u64 = pairs.map(|(&a, &b)| u64::from(a.abs_diff(b))).sum();
        (sum / (3 * self.means.len() as u64)) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 64;

    fn target(color: impl Fn(u32, u32) -> Rgb) -> Target {
        let pixels = (0..SIDE * SIDE).map(|place| color(place % SIDE, place / SIDE)).collect();
        Target::new(SIDE, SIDE, pixels).expect("the pixels are of this size")
    }

    fn mosaic(color: Rgb) -> Mosaic {
        Mosaic { width_px: SIDE, height_px: SIDE, pixels: vec![color; (SIDE * SIDE) as usize], alpha: None }
    }

    /// A number that differs from place to place and from frame to frame, -5 to 5.
    fn noise(x: u32, y: u32, frame: u32) -> i32 {
        let mixed = x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ frame.wrapping_mul(83_492_791);
        let mixed = mixed.wrapping_mul(2_654_435_761);
        (mixed >> 16) as i32 % 11 - 5
    }

    fn noisy(frame: u32) -> Target {
        target(|x, y| [(100 + noise(x, y, frame)) as u8; 3])
    }

    #[test]
    fn noise_is_averaged_and_frees_nothing_but_the_squares_whose_turn_it_is() {
        let mut held = Held::new(&noisy(0), 6);
        for frame in 1..12 {
            held.advance(&noisy(frame));
            let free = (0..(SIDE * SIDE) as usize).filter(|&pixel| !held.is_still(pixel)).count();
            assert!(free <= (SIDE * SIDE) as usize / 2, "{free} pixels are free in frame {frame}");
            assert_eq!(free % (SQUARE_PX * SQUARE_PX), 0, "whole squares only");
        }
        let off =
            |target: &Target| -> u32 { target.pixels().iter().map(|color| u32::from(color[0].abs_diff(100))).sum() };
        let picture = held.picture(&noisy(0)).expect("it has no weights");
        assert!(2 * off(&picture) < off(&noisy(0)), "{} against {}", off(&picture), off(&noisy(0)));
    }

    #[test]
    fn each_square_has_its_turn_once_in_so_many_frames() {
        let flat = target(|_, _| [50; 3]);
        let mut held = Held::new(&flat, 6);
        let mut turns = vec![0; (SIDE * SIDE) as usize];
        for _ in 0..2 * TURNS {
            held.advance(&flat);
            turns.iter_mut().enumerate().for_each(|(pixel, turns)| *turns += u32::from(!held.is_still(pixel)));
        }
        assert!(turns.iter().all(|&turns| turns == 2));
    }

    #[test]
    fn a_change_takes_the_new_value_at_once_and_is_free_until_it_has_settled() {
        let dot = |x: u32, y: u32| if (20..24).contains(&x) && (40..44).contains(&y) { [200; 3] } else { [50; 3] };
        let mut held = Held::new(&target(|_, _| [50; 3]), 6);
        let (inside, far) = (41 * SIDE as usize + 21, 5 * SIDE as usize + 5);
        for frame in 1..=u32::from(FREE_FRAMES) {
            held.advance(&target(dot));
            assert!(!held.is_still(inside), "in frame {frame}");
            let shown = mosaic([9; 3]);
            let aim = held.target(&shown, &target(dot)).expect("it has no weights");
            assert_eq!(aim.pixels()[inside], [200; 3]);
            if held.is_still(far) {
                assert_eq!(aim.pixels()[far], [9; 3]);
            }
        }
        let mut turns = 0;
        for _ in 0..TURNS {
            held.advance(&target(dot));
            turns += usize::from(!held.is_still(inside));
        }
        assert_eq!(turns, 1, "then it has its turns as everything else");
    }

    #[test]
    fn a_single_bright_pixel_and_a_faint_large_area_are_changes_and_no_noise_is_every_difference() {
        let flat = target(|_, _| [50; 3]);
        let changed = |noise: u32, other: &Target| Held::new(&flat, noise).changes(other).contains(&true);
        let pixel = target(|x, y| if (x, y) == (9, 9) { [80, 50, 50] } else { [50; 3] });
        let area = target(|x, _| if x < 9 { [58, 50, 50] } else { [50; 3] });
        let faint = target(|_, _| [56, 44, 50]);
        assert_eq!(
            [changed(6, &pixel), changed(6, &area), changed(6, &faint), changed(0, &faint)],
            [true, true, false, true]
        );
        let clear = flat.clone().with_transparent((0..SIDE * SIDE).map(|place| place == 7).collect()).expect("it fits");
        assert!(changed(6, &clear));
    }

    #[test]
    fn what_a_mosaic_leaves_open_is_evolved_towards_what_is_held() {
        let flat = target(|_, _| [50; 3]);
        let mut held = Held::new(&flat, 6);
        held.advance(&flat);
        let open = Mosaic { alpha: Some(vec![0; (SIDE * SIDE) as usize]), ..mosaic([0; 3]) };
        assert_eq!(held.target(&open, &flat).expect("it has no weights"), flat);
    }

    #[test]
    fn other_scenes_differ_more_at_a_glance_than_small_changes() {
        let one = Glance::of(&target(|x, y| [(x * 4) as u8, (y * 4) as u8, 0]));
        let moved = Glance::of(&target(|x, y| [(x * 4) as u8, (y * 4) as u8, if x < 8 { 200 } else { 0 }]));
        let other = Glance::of(&target(|x, y| [255 - (x * 4) as u8, (y * 2) as u8, 128]));
        assert_eq!(one.difference(&one), 0);
        assert!(one.difference(&moved) < 12 && one.difference(&other) > 60);
    }
}
