//! Values as people write them, in presets and on command lines: colours and counts of colours. A refusal says what
//! would be right.

use super::choices::{Colors, GroutColor};
use crate::model::{Backdrop, Rgb};
use crate::photo::COLOR_COUNT_MAX;

/// A colour: `black`, `white`, or six hexadecimal digits with or without `#`.
pub(crate) fn color(text: &str) -> Result<Rgb, String> {
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

/// What lies behind the tiles: `none`, or a colour.
pub(crate) fn backdrop(text: &str) -> Result<Backdrop, String> {
    match text {
        "none" => Ok(Backdrop::Transparent),
        _ => {
            let expected = |_| "expected none, black, white or RRGGBB in hexadecimal".to_owned();
            color(text).map(Backdrop::Color).map_err(expected)
        }
    }
}

/// `full`, or a whole number of colours.
pub(crate) fn color_count(text: &str) -> Result<Colors, String> {
    if text == "full" {
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
    match text {
        "none" => Ok(GroutColor::None),
        "auto" => Ok(GroutColor::Auto),
        _ => {
            let expected = |_| "expected none, auto, black, white or RRGGBB in hexadecimal".to_owned();
            color(text).map(GroutColor::This).map_err(expected)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn counts_of_colours_are_full_or_up_to_256() {
        assert_eq!(color_count("full"), Ok(Colors::Full));
        assert_eq!(color_count("60"), Ok(Colors::Few(60)));
        for text in ["", "0", "257", "-1", "+1", "all", "18446744073709551616"] {
            assert!(color_count(text).is_err(), "{text:?}");
        }
    }
}
