//! Values as people write them, in presets and on command lines: colours and counts of colours. A refusal says what
//! would be right.

use super::choices::{Colors, GroutColor};
use crate::model::{Backdrop, Rgb};
use crate::photo::{self, COLOR_COUNT_MAX, COLOR_FORMS};

/// A colour: a name of CSS such as `teal`, or hexadecimal digits.
pub(crate) fn color(text: &str) -> Result<Rgb, String> {
    photo::color(text).ok_or_else(|| format!("expected {COLOR_FORMS}"))
}

/// What lies behind the tiles: `none` or `transparent`, or a colour.
pub(crate) fn backdrop(text: &str) -> Result<Backdrop, String> {
    match text.trim().to_ascii_lowercase().as_str() {
        "none" | "transparent" => Ok(Backdrop::Transparent),
        _ => photo::color(text).map(Backdrop::Color).ok_or_else(|| format!("expected none, or {COLOR_FORMS}")),
    }
}

/// `full`, or a whole number of colours.
pub(crate) fn color_count(text: &str) -> Result<Colors, String> {
    if text.eq_ignore_ascii_case("full") {
        return Ok(Colors::Full);
    }
    let is_whole = text.bytes().all(|byte| byte.is_ascii_digit());
    match text.parse::<usize>().ok().filter(|_| is_whole) {
        Some(count) if (1..=COLOR_COUNT_MAX).contains(&count) => Ok(Colors::Few(count)),
        _ => Err(format!("expected full or a number of colours from 1 to {COLOR_COUNT_MAX}")),
    }
}

/// A colour of grout: `none`, `auto`, or a colour.
pub(crate) fn grout_color(text: &str) -> Result<GroutColor, String> {
    match text.trim().to_ascii_lowercase().as_str() {
        "none" => Ok(GroutColor::None),
        "auto" => Ok(GroutColor::Auto),
        _ => photo::color(text).map(GroutColor::This).ok_or_else(|| format!("expected none, auto, or {COLOR_FORMS}")),
    }
}

/// A word, quoted for a shell.
pub(crate) fn quoted(text: &str) -> String {
    let is_plain = |char: char| char.is_ascii_alphanumeric() || "-_./=:,+@%".contains(char);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_beside_colours_are_known_in_any_case() {
        assert_eq!(backdrop("None"), Ok(Backdrop::Transparent));
        assert_eq!(backdrop("Navy"), Ok(Backdrop::Color([0, 0, 128])));
        assert_eq!(grout_color("AUTO"), Ok(GroutColor::Auto));
        assert_eq!(color("reddish"), Err("expected a colour such as red, #f00 or ff0000".to_owned()));
    }

    #[test]
    fn counts_of_colours_are_full_or_up_to_256() {
        assert_eq!(color_count("full"), Ok(Colors::Full));
        assert_eq!(color_count("60"), Ok(Colors::Few(60)));
        for text in ["", "0", "257", "-1", "+1", "all", "18446744073709551616"] {
            assert!(color_count(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn a_word_is_quoted_for_a_shell_where_it_must_be() {
        assert_eq!(quoted("style=mosaic"), "style=mosaic");
        assert_eq!(quoted("/a/b_c-1.png"), "/a/b_c-1.png");
        for (text, expected) in [("", "''"), ("a b", "'a b'"), ("$x", "'$x'"), ("it's", r"'it'\''s'"), ("*", "'*'")] {
            assert_eq!(quoted(text), expected);
        }
    }
}
