//! Fixed-point numbers as the decimals that people type.

/// Most decimals that are tried; a double has no more that mean something.
const DECIMALS_MAX: usize = 17;

/// The decimal of fewest digits near `value` that is read as what `is_right` accepts.
///
/// What a parameter is rounded to has many decimals that mean the same; this is the one that somebody would type.
pub(super) fn shortest(value: f64, is_right: impl Fn(f64) -> bool) -> f64 {
    let decimals = (0..=DECIMALS_MAX).filter_map(|digits| format!("{value:.digits$}").parse().ok());
    decimals.into_iter().find(|&decimal| is_right(decimal)).unwrap_or(value)
}

/// The shortest decimal of `units` / `scale` that is rounded to `units` again.
pub(super) fn of_units(units: u32, scale: f64) -> f64 {
    shortest(f64::from(units) / scale, |decimal| (decimal * scale).round() == f64::from(units))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decimal_of_fewest_digits_that_is_read_back_is_taken() {
        for (units, scale, decimal) in [
            (0, 256.0, 0.0),
            (1, 256.0, 0.004),
            (154, 256.0, 0.6),
            (410, 256.0, 1.6),
            (409, 256.0, 1.598),
            (6_554, 65_536.0, 0.1),
        ] {
            assert_eq!(of_units(units, scale), decimal, "{units} / {scale}");
        }
        for units in 0..=65_536 {
            assert_eq!((of_units(units, 65_536.0) * 65_536.0).round() as u32, units);
        }
    }
}
