//! An axis: from values to pixels, and where its ticks are.
//!
//! Ticks are computed here, and the logarithm is that of `libm`, so no platform's rounding moves a line or drops a
//! tick.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};

/// How an axis is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Equal steps are equal distances.
    #[default]
    Linear,
    /// Equal ratios are equal distances; values below 1 are drawn as 1.
    Log,
}

impl Scale {
    /// The scale that shows these values best: logarithmic if all are at least 1 and they span a factor of five or
    /// more.
    #[must_use]
    pub fn fitting(values: impl Iterator<Item = f64>) -> Self {
        let (least, most) = extremes(values);
        if least >= 1.0 && most >= 5.0 * least { Self::Log } else { Self::Linear }
    }
}

/// An axis that covers a range of values.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    scale: Scale,
    from: f64,
    to: f64,
}

impl Axis {
    /// An axis from the least to the greatest of the values, all finite; wider if they are equal.
    pub(super) fn over(scale: Scale, values: impl Iterator<Item = f64>) -> Self {
        let (least, most) = extremes(values);
        let least = if scale == Scale::Log { least.max(1.0) } else { least };
        let most = most.max(least);
        let to = if most > least { most } else { least + least.abs().max(1.0) };
        Self { scale, from: least, to }
    }

    /// The same axis with room at its end. A linear axis begins at 0 if no value is negative.
    pub(super) fn with_room(self) -> Self {
        match self.scale {
            Scale::Linear if self.from >= 0.0 => Self { from: 0.0, to: self.to * 1.08, ..self },
            Scale::Linear => Self { to: self.to + (self.to - self.from) * 0.08, ..self },
            Scale::Log => Self { from: (self.from * 0.8).max(1.0), to: self.to * 1.5, ..self },
        }
    }

    /// How far along the axis a value is, 0 to 1.
    fn share(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.from) / (self.to - self.from),
            Scale::Log => {
                let from = libm::log(self.from);
                (libm::log(value.max(1.0)) - from) / (libm::log(self.to) - from)
            }
        }
    }

    /// The ticks: at most about `most` round numbers.
    fn ticks(&self, most: usize) -> Vec<f64> {
        match self.scale {
            Scale::Linear => {
                let step = nice_step((self.to - self.from) / most.max(1) as f64);
                let (first, last) = ((self.from / step).ceil() as i64, (self.to / step).floor() as i64);
                (first..=last).map(|number| number as f64 * step).collect()
            }
            Scale::Log => {
                let multiples: [&[f64]; 3] = [&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0], &[1.0, 2.0, 5.0], &[1.0]];
                let inside = |multiples: &[f64]| -> Vec<f64> {
                    let decades = (0..16).map(|exponent| POWERS_OF_TEN[exponent]);
                    let all = decades.flat_map(|power| multiples.iter().map(move |multiple| multiple * power));
                    all.filter(|tick| (self.from..=self.to).contains(tick)).collect()
                };
                let choices = multiples.map(inside);
                let fitting = choices.iter().find(|ticks| ticks.len() <= most);
                fitting.unwrap_or(&choices[2]).clone()
            }
        }
    }
}

/// 10^0 to 10^15, exactly.
const POWERS_OF_TEN: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// The least of 1, 2 or 5 times a power of ten from 0.001 on that is at least `step`.
fn nice_step(step: f64) -> f64 {
    let powers = [1e-3, 1e-2, 1e-1].into_iter().chain(POWERS_OF_TEN);
    let mut steps = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|multiple| multiple * power));
    steps.find(|&nice| nice >= step).unwrap_or(step)
}

fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (least.min(value), most.max(value)))
}

/// A number as `0.05`, `40k` or `2.5M`.
pub(super) fn short_number(value: f64) -> String {
    let (divisor, suffix) = match value.abs() {
        1e9.. => (1e9, "G"),
        1e6.. => (1e6, "M"),
        1e3.. => (1e3, "k"),
        _ => (1.0, ""),
    };
    let digits = format!("{:.3}", value / divisor);
    format!("{}{suffix}", digits.trim_end_matches('0').trim_end_matches('.'))
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        limit.0 + (f64::from(limit.1 - limit.0) * self.share(*value).clamp(0.0, 1.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        self.ticks(hint.bold_points())
    }

    fn range(&self) -> Range<f64> {
        self.from..self.to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let linear = Axis::over(Scale::Linear, [0.0, 40_000.0].into_iter());
        assert_eq!(linear.ticks(10), [0.0, 5e3, 10e3, 15e3, 20e3, 25e3, 30e3, 35e3, 40e3]);
        let log = Axis::over(Scale::Log, [1.5e6, 2.5e7].into_iter());
        assert_eq!(log.ticks(6), [2e6, 5e6, 10e6, 20e6]);
        assert_eq!(Axis::over(Scale::Log, [3e6, 9e6].into_iter()).ticks(10), [3e6, 4e6, 5e6, 6e6, 8e6]);
    }

    #[test]
    fn a_log_axis_makes_equal_ratios_equal_distances() {
        let axis = Axis::over(Scale::Log, [10.0, 100_000.0].into_iter());
        assert_eq!([10.0, 100.0, 1e3, 1e5].map(|value| axis.map(&value, (400, 0))), [400, 300, 200, 0]);
    }

    #[test]
    fn values_of_many_sizes_ask_for_a_log_scale() {
        assert_eq!(Scale::fitting([4e6, 2.1e7].into_iter()), Scale::Log);
        assert_eq!(Scale::fitting([5e6, 2.1e7].into_iter()), Scale::Linear);
        assert_eq!(Scale::fitting([0.0, 2.1e7].into_iter()), Scale::Linear);
    }

    #[test]
    fn numbers_are_written_shortly() {
        assert_eq!(
            [0.0, 0.05, 999.0, 40_000.0, 2_500_000.0, -1.5e9].map(short_number),
            ["0", "0.05", "999", "40k", "2.5M", "-1.5G"]
        );
    }
}
