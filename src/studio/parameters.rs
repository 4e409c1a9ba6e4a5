//! What a parameter may be, in the words of its refusal.

use std::fmt::Display;
use std::ops::RangeInclusive;

use crate::error::{Error, Result};

/// `value`, if it lies between the bounds, both included.
///
/// # Errors
/// [`Error::Parameter`].
pub(super) fn in_range(name: &str, value: u64, bounds: RangeInclusive<u64>) -> Result<u64> {
    let (least, most) = (*bounds.start(), *bounds.end());
    if bounds.contains(&value) {
        Ok(value)
    } else if most == u64::MAX {
        Err(wrong(name, value, format!("must be at least {least}")))
    } else {
        Err(wrong(name, value, format!("must be {least} to {most}")))
    }
}

/// `value`, if it lies between the bounds, both included; NaN never does.
///
/// # Errors
/// [`Error::Parameter`], which ends in `unit`.
pub(super) fn real_in_range(name: &str, value: f64, bounds: RangeInclusive<f64>, unit: &str) -> Result<f64> {
    if bounds.contains(&value) {
        Ok(value)
    } else {
        Err(wrong(name, value, format!("must be {} to {}{unit}", bounds.start(), bounds.end())))
    }
}

/// A refusal of a value.
pub(super) fn wrong(name: &str, value: impl Display, reason: impl Into<String>) -> Error {
    Error::value(name, value, reason)
}

/// A refusal of a parameter whatever its value is.
pub(super) fn contradiction(name: &str, reason: impl Into<String>) -> Error {
    Error::parameter(name, reason)
}
