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

/// A whole number, as `40000`, `40k` or `2M`.
pub(crate) fn count(text: &str) -> Result<u64, String> {
    let (digits, factor) = match text.strip_suffix(['k', 'K']) {
        Some(digits) => (digits, 1_000),
        None => text.strip_suffix('M').map_or((text, 1), |digits| (digits, 1_000_000)),
    };
    whole(digits)
        .and_then(|number| number.checked_mul(factor))
        .ok_or_else(|| "expected a whole number such as 500, 40k or 2M".to_owned())
}

/// A word, quoted for a shell.
pub(crate) fn quoted(text: &str) -> String {
    let is_plain = |char: char| char.is_ascii_alphanumeric() || "-_./=:,+@%".contains(char);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
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

/// A duration: seconds, or numbers with the units h, m, s and ms, as `90`, `30s`, `1h30m`.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
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

/// A number that consists of digits only: `parse` would accept `+5`, which is a typing mistake here.
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
    fn a_word_is_quoted_for_a_shell_where_it_must_be() {
        assert_eq!(quoted("--style=mosaic"), "--style=mosaic");
        assert_eq!(quoted("/a/b_c-1.png"), "/a/b_c-1.png");
        for (text, expected) in [("", "''"), ("a b", "'a b'"), ("$x", "'$x'"), ("it's", r"'it'\''s'"), ("*", "'*'")] {
            assert_eq!(quoted(text), expected);
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
