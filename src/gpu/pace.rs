//! How much work a submission takes on. A driver ends a submission that lasts too long (Windows after two seconds,
//! others after about ten), and one that is over at once leaves the device waiting for the host. So the amount follows
//! the time that the last submissions took. No result depends on it.

use std::time::Duration;

use crate::vk::DeviceKind;

/// A submission that takes longer is too long.
const LONGEST: Duration = Duration::from_millis(200);
/// What a submission that was too long is cut to.
const AIM: Duration = Duration::from_millis(100);
/// A submission that takes less may be longer.
const SHORTEST: Duration = Duration::from_millis(50);

/// The most units of work of a submission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pace {
    units: u64,
    /// Whether it follows the time.
    is_measured: bool,
}

impl Pace {
    /// Begins with so many units on hardware. Software Vulkan has no watchdog: there a submission takes what it is
    /// given.
    pub fn new(kind: DeviceKind, first: u64) -> Self {
        let is_measured = kind != DeviceKind::Cpu;
        Self { units: if is_measured { first.max(1) } else { u64::MAX }, is_measured }
    }

    /// The most units of the next submission.
    pub fn units(&self) -> u64 {
        self.units
    }

    /// Learns from a submission of so many units, and of nothing else.
    pub fn note(&mut self, units: u64, took: Duration) {
        if units == 0 || !self.is_measured {
            return;
        }
        if took > LONGEST {
            let share = AIM.as_secs_f64() / took.as_secs_f64();
            // Less than it had, whatever is rounded.
            self.units = ((units as f64 * share) as u64).min(self.units).max(1);
        } else if took < SHORTEST && units.saturating_mul(2) > self.units {
            // It was nearly as much as it might be.
            self.units = self.units.saturating_mul(2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    #[test]
    fn a_submission_that_took_too_long_is_followed_by_shorter_ones() {
        let mut pace = Pace::new(DeviceKind::Discrete, 1_000);
        pace.note(1_000, ms(1_000));
        assert_eq!(pace.units(), 100);
        for _ in 0..8 {
            let units = pace.units();
            pace.note(units, ms(3_000));
        }
        assert_eq!(pace.units(), 1, "there is always something to do");
    }

    #[test]
    fn short_submissions_grow_until_they_are_long_enough() {
        let mut pace = Pace::new(DeviceKind::Discrete, 8);
        // A device that makes a unit in a tenth of a millisecond.
        let mut units = Vec::new();
        for _ in 0..12 {
            pace.note(pace.units(), Duration::from_micros(100 * pace.units()));
            units.push(pace.units());
        }
        assert_eq!(units[..7], [16, 32, 64, 128, 256, 512, 512], "{units:?}");
        assert_eq!(units[11], 512);
    }

    #[test]
    fn a_submission_that_had_little_to_do_says_nothing() {
        let mut pace = Pace::new(DeviceKind::Discrete, 100);
        pace.note(10, ms(1));
        assert_eq!(pace.units(), 100);
        pace.note(10, ms(400));
        assert_eq!(pace.units(), 2, "but for one that was too long");
        pace.note(0, ms(400));
        assert_eq!(pace.units(), 2, "and one that had nothing to do");
    }

    #[test]
    fn software_takes_what_it_is_given() {
        let mut software = Pace::new(DeviceKind::Cpu, 5);
        software.note(1_000, ms(9_000));
        assert_eq!(software.units(), u64::MAX);
        assert_eq!(Pace::new(DeviceKind::Integrated, 5).units(), 5);
    }
}
