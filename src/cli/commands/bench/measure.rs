//! One measurement: work is repeated for a given time, and the median counts.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::error::Result;

/// Most repeats; more do not change the median.
const REPEATS_MAX: usize = 1_000;

/// The unit of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Unit {
    #[serde(rename = "evals/s")]
    EvalsPerS,
    #[serde(rename = "births/s")]
    BirthsPerS,
    #[serde(rename = "pictures/h")]
    PicturesPerHour,
    #[serde(rename = "ms")]
    Ms,
}

impl Unit {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::EvalsPerS => "evals/s",
            Self::BirthsPerS => "births/s",
            Self::PicturesPerHour => "pictures/h",
            Self::Ms => "ms",
        }
    }

    /// The value of a repeat.
    fn value(self, Lap { seconds, amount }: Lap) -> f64 {
        let (seconds, amount) = (seconds.max(1e-9), amount as f64);
        match self {
            Self::EvalsPerS | Self::BirthsPerS => amount / seconds,
            Self::PicturesPerHour => amount * 3_600.0 / seconds,
            Self::Ms => seconds * 1e3 / amount,
        }
    }

    /// How many times faster `new` is than `old`.
    pub(super) fn speed_up(self, old: f64, new: f64) -> f64 {
        if self == Self::Ms { old / new } else { new / old }
    }
}

/// A median, and how far the repeats spread.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Measurement {
    pub name: String,
    pub unit: Unit,
    /// The median of the repeats.
    pub value: f64,
    /// The smallest and the largest of them.
    pub low: f64,
    pub high: f64,
    pub repeats: usize,
}

/// One repeat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lap {
    pub seconds: f64,
    /// How much work was done.
    pub amount: u64,
}

impl Lap {
    /// The repeat that began then and ends now.
    pub(super) fn since(began: Instant, amount: u64) -> Self {
        Self { seconds: began.elapsed().as_secs_f64(), amount }
    }
}

impl Measurement {
    /// The median of `laps`.
    ///
    /// # Panics
    /// If there is no lap.
    pub(super) fn of(name: impl Into<String>, unit: Unit, laps: &[Lap]) -> Self {
        let mut values: Vec<f64> = laps.iter().map(|&lap| unit.value(lap)).collect();
        values.sort_by(f64::total_cmp);
        let (middle, last) = (values.len() / 2, values.len() - 1);
        let value =
            if values.len().is_multiple_of(2) { (values[middle - 1] + values[middle]) / 2.0 } else { values[middle] };
        Self { name: name.into(), unit, value, low: values[0], high: values[last], repeats: values.len() }
    }

    /// Whether both measure the same.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (&self.name, self.unit) == (&other.name, other.unit)
    }
}

/// Runs `work` once to warm up, and then repeats it until `budget` is spent. Returns the repeats. `work` times itself,
/// so that its preparations do not count.
pub(super) fn repeat<T>(budget: Duration, mut work: impl FnMut() -> Result<T>) -> Result<Vec<T>> {
    work()?;
    let began = Instant::now();
    let mut laps = vec![work()?];
    while began.elapsed() < budget && laps.len() < REPEATS_MAX {
        laps.push(work()?);
    }
    Ok(laps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_is_the_median_of_all_laps_but_the_first() {
        let mut seconds = [900.0, 4.0, 1.0, 2.0, 8.0].into_iter().cycle();
        let laps = repeat(Duration::ZERO, || Ok(seconds.next().unwrap_or_default())).expect("nothing fails");
        assert_eq!(laps, [4.0], "with no time at all there is still one repeat");
        let lap = |seconds, amount| Lap { seconds, amount };
        let of = |unit, laps: &[Lap]| {
            let Measurement { value, low, high, repeats, .. } = Measurement::of("some", unit, laps);
            (value, low, high, repeats)
        };
        assert_eq!(of(Unit::Ms, &[lap(4.0, 1), lap(1.0, 1), lap(2.0, 1)]), (2_000.0, 1_000.0, 4_000.0, 3));
        assert_eq!(of(Unit::EvalsPerS, &[lap(4.0, 8), lap(1.0, 8), lap(2.0, 8), lap(8.0, 8)]), (3.0, 1.0, 8.0, 4));
        assert_eq!(of(Unit::PicturesPerHour, &[lap(1.5, 1)]), (2_400.0, 2_400.0, 2_400.0, 1));
    }

    #[test]
    fn twice_as_fast_is_half_the_time_or_twice_the_rate() {
        assert_eq!(Unit::Ms.speed_up(10.0, 5.0), 2.0);
        assert_eq!(Unit::EvalsPerS.speed_up(10.0, 20.0), 2.0);
    }
}
