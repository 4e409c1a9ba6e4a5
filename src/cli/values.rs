//! The values that people type: counts with suffixes, durations, and the bounds of flags. Each error says what would be
//! right.

use std::borrow::Cow;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::{PathBufValueParser, TypedValueParser};

use crate::error::{Error, Result};
use crate::model::target::TARGET_SIDE_MAX_PX;

/// `value`, if it lies within the bounds, which both belong to the range.
///
/// # Errors
/// [`Error::Usage`] that names the flag and its range.
pub(crate) fn in_range(flag: &str, value: u64, bounds: RangeInclusive<u64>) -> Result<u64> {
    let (least, most) = (*bounds.start(), *bounds.end());
    if bounds.contains(&value) {
        Ok(value)
    } else if most == u64::MAX {
        Err(Error::Usage(format!("{flag} {value}: must be at least {least}")))
    } else {
        Err(Error::Usage(format!("{flag} {value}: must be {least} to {most}")))
    }
}

/// A flag's value that is the side of a picture, in px.
///
/// # Errors
/// [`Error::Usage`] that names the flag and what it may be.
pub(crate) fn side_px(flag: &str, px: u64) -> Result<u32> {
    in_range(flag, px, 1..=u64::from(TARGET_SIDE_MAX_PX)).map(|px| px as u32)
}

/// A whole number, as `40000`, `40_000`, `40,000`, `40k`, `2.5k` or `2M`.
pub(crate) fn count(text: &str) -> Result<u64, String> {
    let (digits, zeros) = match text.strip_suffix(['k', 'K']) {
        Some(digits) => (digits, 3),
        None => text.strip_suffix('M').map_or((text, 0), |digits| (digits, 6)),
    };
    decimal(digits, zeros).or_else(|| in_thousands(text)).ok_or_else(|| {
        // A small m is a thousandth elsewhere, or minutes.
        let is_small_m = text.strip_suffix('m').is_some_and(|digits| decimal(digits, 6).is_some());
        if is_small_m {
            let million = text.to_uppercase();
            return format!("expected a whole number such as 500, 40k or 2M; for millions write {million}");
        }
        "expected a whole number such as 500, 40k or 2M".to_owned()
    })
}

/// The number whose digits commas part in groups of three.
fn in_thousands(text: &str) -> Option<u64> {
    let (first, groups) = text.split_once(',')?;
    let is_well_parted = (1..=3).contains(&first.len()) && groups.split(',').all(|group| group.len() == 3);
    if is_well_parted { whole(&text.replace(',', "")) } else { None }
}

/// The number that is written with or without decimals, times ten to the power of `zeros`, if that is whole. Single `_`
/// may part digits.
fn decimal(text: &str, zeros: u32) -> Option<u64> {
    let (before, after) = text.split_once('.').map_or((text, ""), |(before, after)| (before, after));
    let has_point = text.contains('.');
    let is_parted_well = before.split('_').all(|part| !part.is_empty());
    if !is_parted_well || (has_point && after.is_empty()) || after.len() > zeros as usize {
        return None;
    }
    let digits = format!("{}{after}", before.replace('_', ""));
    whole(&digits)?.checked_mul(10_u64.pow(zeros - after.len() as u32))
}

/// A text as a cell of a CSV table. Spreadsheets take a cell for a formula that begins like one, and run it; with an
/// apostrophe in front it is text. Numbers stay numbers.
pub(crate) fn table_cell(text: &str) -> Cow<'_, str> {
    let is_plain_number = text.parse::<f64>().is_ok() && !text.contains(|c: char| c.is_ascii_alphabetic() && c != 'e');
    let may_be_formula = text.len() > 1 && text.starts_with(['=', '+', '-', '@', '\t', '\r', '\n']);
    if may_be_formula && !is_plain_number { Cow::Owned(format!("'{text}")) } else { Cow::Borrowed(text) }
}

/// An input: a path, or `-` for stdin.
pub(crate) fn input() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|path| if path.as_os_str() == "-" { PathBuf::from(STDIN) } else { path })
}

/// What the system calls stdin. It is opened as any other file.
const STDIN: &str = "/dev/stdin";

/// A number with or without decimals, such as `1` or `0.5`. The flag itself checks whether it is finite and in range.
pub(crate) fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "expected a number such as 0.5".to_owned())
}

/// A seed: any whole number of 64 bits.
pub(crate) fn seed(text: &str) -> Result<u64, String> {
    whole(text).ok_or_else(|| format!("expected a whole number from 0 to {}", u64::MAX))
}

fn positive(time: Duration) -> Result<Duration, String> {
    if time.is_zero() { Err("expected a time longer than 0".to_owned()) } else { Ok(time) }
}

/// A duration: seconds, or numbers with units, as `90`, `30s`, `1.5m`, `1min` or `1h30m`.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || "expected a time such as 90, 30s, 2m or 1h30m".to_owned();
    let compact: String = text.to_lowercase().split_whitespace().collect();
    if let Some(seconds) = whole(text) {
        return positive(Duration::from_secs(seconds));
    }
    let mut rest = compact.as_str();
    let mut total = Duration::ZERO;
    while !rest.is_empty() {
        let is_of_number = |c: char| c.is_ascii_digit() || c == '.';
        let digits = rest.find(|c| !is_of_number(c)).ok_or_else(wrong)?;
        let (number, tail) = rest.split_at(digits);
        let unit_end = tail.find(is_of_number).unwrap_or(tail.len());
        let (unit, tail) = tail.split_at(unit_end);
        let unit_ms = match unit {
            "ms" => 1,
            "s" | "sec" | "secs" | "second" | "seconds" => 1_000,
            "m" | "min" | "mins" | "minute" | "minutes" => 60_000,
            "h" | "hr" | "hrs" | "hour" | "hours" => 3_600_000,
            _ => return Err(wrong()),
        };
        let part_ms = thousandths(number).and_then(|number| number.checked_mul(unit_ms)).ok_or_else(wrong)? / 1_000;
        total = total.checked_add(Duration::from_millis(part_ms)).ok_or_else(wrong)?;
        rest = tail;
    }
    if compact.is_empty() { Err(wrong()) } else { positive(total) }
}

/// A number with at most three decimals, in thousandths.
fn thousandths(number: &str) -> Option<u64> {
    decimal(number, 3).filter(|_| !number.contains('_'))
}

/// A path in a list with commas, after each of which people may leave a blank.
pub(crate) fn path_in_list() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|path| match path.to_str().map(str::trim) {
        Some(trimmed) if !trimmed.is_empty() && !path.exists() => PathBuf::from(trimmed),
        _ => path,
    })
}

/// An ending of files in a list with commas, as `png`, `.png` or `PNG`.
pub(crate) fn ending(text: &str) -> Result<String, String> {
    let trimmed = text.trim();
    Ok(trimmed.strip_prefix('.').unwrap_or(trimmed).to_lowercase())
}

/// A number that consists of digits only: `parse` would accept `+5`, which is a typing mistake here.
fn whole(digits: &str) -> Option<u64> {
    if digits.bytes().all(|byte| byte.is_ascii_digit()) { digits.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_take_the_suffixes_k_and_m_and_decimals_that_leave_a_whole_number() {
        assert_eq!(count("0"), Ok(0));
        assert_eq!(count("40k"), Ok(40_000));
        assert_eq!(count("2M"), Ok(2_000_000));
        assert_eq!(count("2.5k"), Ok(2_500));
        assert_eq!(count("0.25M"), Ok(250_000));
        assert_eq!(count("1_000_000"), Ok(1_000_000));
        assert_eq!(count("2,500"), Ok(2_500));
        assert_eq!(count("12,345,678"), Ok(12_345_678));
        assert_eq!(count("18446744073709551615"), Ok(u64::MAX));
        for text in [
            "",
            "k",
            "-1",
            "+1",
            "1.5",
            "1.",
            ".5k",
            "1.0005k",
            "1kk",
            "1 k",
            "1__0",
            "_1",
            "1_",
            "1.2.3k",
            "18446744073709551616",
            "18446744073709551615k",
        ] {
            assert!(count(text).is_err(), "{text:?}");
        }
        assert!(count("2m").is_err_and(|told| told.ends_with("for millions write 2M")));
    }

    #[test]
    fn durations_take_plain_seconds_and_units() {
        for (text, ms) in [
            ("90", 90_000),
            ("30s", 30_000),
            ("250ms", 250),
            ("2m", 120_000),
            ("1min", 60_000),
            ("1 Min", 60_000),
            ("1.5m", 90_000),
            ("0.25s", 250),
            ("90 seconds", 90_000),
            ("1h30m", 5_400_000),
        ] {
            assert_eq!(duration(text), Ok(Duration::from_millis(ms)), "{text}");
        }
        for text in [
            "",
            "s",
            "-1s",
            "1d",
            "1s5",
            "1.5",
            "1..5s",
            "1.s",
            "1_0s",
            "0",
            "0ms",
            "99999999999999999999s",
            "9999999999999999999h",
        ] {
            assert!(duration(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn a_cell_that_a_spreadsheet_would_run_becomes_text_and_numbers_stay() {
        for text in ["=1+2", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "-inf", "+1e5x"] {
            assert_eq!(table_cell(text), format!("'{text}"));
        }
        for text in ["", "-", "-5", "+5", "-0.25", "-1e-7", "a=b", "in/-x.png", "'=1"] {
            assert_eq!(table_cell(text), text);
        }
    }
}
