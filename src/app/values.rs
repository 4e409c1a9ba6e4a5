//! The values that people type: counts with suffixes, durations, colours. A refusal says what would be right.

use std::time::Duration;

use crate::model::Rgb;
use crate::photo::COLOR_COUNT_MAX;

/// A whole number, as `40000`, `40k` or `2M`.
pub(super) fn count(text: &str) -> Result<u64, String> {
    let (digits, factor) = match text.strip_suffix(['k', 'K']) {
        Some(digits) => (digits, 1_000),
        None => text.strip_suffix('M').map_or((text, 1), |digits| (digits, 1_000_000)),
    };
    whole(digits)
        .and_then(|number| number.checked_mul(factor))
        .ok_or_else(|| "expected a whole number such as 500, 40k or 2M".to_owned())
}

/// A number with or without decimals, such as `1` or `0.5`; whether it is in range, or a number at all, the flag says.
pub(super) fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "expected a number such as 0.5".to_owned())
}

/// A seed: any whole number of 64 bits.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    whole(text).ok_or_else(|| format!("expected a whole number from 0 to {}", u64::MAX))
}

/// How many colours a picture keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorCount {
    /// All of them.
    Full,
    /// At most so many.
    Few(usize),
}

/// `full`, or a whole number of colours.
pub(super) fn color_count(text: &str) -> Result<ColorCount, String> {
    if text == "full" {
        return Ok(ColorCount::Full);
    }
    match whole(text) {
        Some(number) if (1..=COLOR_COUNT_MAX as u64).contains(&number) => Ok(ColorCount::Few(number as usize)),
        _ => Err(format!("expected full or a number of colours from 1 to {COLOR_COUNT_MAX}")),
    }
}

/// A duration: seconds, or numbers with the units h, m, s and ms, as `90`, `30s`, `1h30m`.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || "expected a time such as 90, 30s, 2m or 1h30m".to_owned();
    if let Some(seconds) = whole(text) {
        return Ok(Duration::from_secs(seconds));
    }
    let mut rest = text;
    let mut total = Duration::ZERO;
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit()).ok_or_else(wrong)?;
        let (number, tail) = rest.split_at(digits);
        let unit_end = tail.find(|c: char| c.is_ascii_digit()).unwrap_or(tail.len());
        let (unit, tail) = tail.split_at(unit_end);
        let unit_ms = match unit {
            "ms" => 1,
            "s" => 1_000,
            "m" => 60_000,
            "h" => 3_600_000,
            _ => return Err(wrong()),
        };
        let part_ms = whole(number).and_then(|number| number.checked_mul(unit_ms)).ok_or_else(wrong)?;
        total = total.checked_add(Duration::from_millis(part_ms)).ok_or_else(wrong)?;
        rest = tail;
    }
    if text.is_empty() { Err(wrong()) } else { Ok(total) }
}

/// A colour: `black`, `white`, or six hexadecimal digits with or without `#`.
pub(super) fn color(text: &str) -> Result<Rgb, String> {
    match text {
        "black" => return Ok([0; 3]),
        "white" => return Ok([255; 3]),
        _ => {}
    }
    let digits = text.strip_prefix('#').unwrap_or(text);
    let is_hexadecimal = digits.len() == 6 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    let packed = u32::from_str_radix(digits, 16).ok().filter(|_| is_hexadecimal);
    let [_, r, g, b] = packed.ok_or("expected black, white or RRGGBB in hexadecimal")?.to_be_bytes();
    Ok([r, g, b])
}

/// A number of digits only: `+5`, which `parse` would take, is a typing mistake here.
fn whole(digits: &str) -> Option<u64> {
    if digits.bytes().all(|byte| byte.is_ascii_digit()) { digits.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_take_the_suffixes_k_and_m() {
        assert_eq!(count("0"), Ok(0));
        assert_eq!(count("40k"), Ok(40_000));
        assert_eq!(count("2M"), Ok(2_000_000));
        assert_eq!(count("18446744073709551615"), Ok(u64::MAX));
        for text in ["", "k", "-1", "+1", "1.5k", "1kk", "1 k", "18446744073709551616", "18446744073709551615k", "2m"] {
            assert!(count(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn colours_are_full_or_up_to_256() {
        assert_eq!(color_count("full"), Ok(ColorCount::Full));
        assert_eq!(color_count("60"), Ok(ColorCount::Few(60)));
        for text in ["", "0", "257", "-1", "all", "18446744073709551616"] {
            assert!(color_count(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn durations_take_plain_seconds_and_units() {
        assert_eq!(duration("90"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("30s"), Ok(Duration::from_secs(30)));
        assert_eq!(duration("250ms"), Ok(Duration::from_millis(250)));
        assert_eq!(duration("2m"), Ok(Duration::from_secs(120)));
        assert_eq!(duration("1h30m"), Ok(Duration::from_secs(5_400)));
        for text in ["", "s", "30 s", "-1s", "1d", "1s5", "99999999999999999999s", "9999999999999999999h"] {
            assert!(duration(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn colours_are_named_or_six_hexadecimal_digits() {
        assert_eq!(color("black"), Ok([0, 0, 0]));
        assert_eq!(color("white"), Ok([255, 255, 255]));
        assert_eq!(color("#12aBff"), Ok([0x12, 0xAB, 0xFF]));
        assert_eq!(color("000001"), Ok([0, 0, 1]));
        for text in ["", "#", "red", "12345", "#1234567", "+12345", "gggggg"] {
            assert!(color(text).is_err(), "{text:?}");
        }
    }
}
