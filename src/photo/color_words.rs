//! Colours as people write them: a name of CSS, or hexadecimal digits.

use svgtypes::Color;

/// What a colour may be, for a refusal.
pub const COLOR_FORMS: &str = "a colour such as red, #f00 or ff0000";

/// A colour: a name of CSS such as `red` or `rebeccapurple` in any case, `#RGB`, or `RRGGBB` with or without `#`.
#[must_use]
pub fn color(text: &str) -> Option<[u8; 3]> {
    let text = text.trim().to_ascii_lowercase();
    let digits = text.strip_prefix('#').unwrap_or(&text);
    let is_hexadecimal = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    if is_hexadecimal && digits.len() == 6 {
        let [_, r, g, b] = u32::from_str_radix(digits, 16).ok()?.to_be_bytes();
        return Some([r, g, b]);
    }
    if text == "rebeccapurple" {
        // CSS has this name, and SVG does not.
        return Some([0x66, 0x33, 0x99]);
    }
    let is_short = is_hexadecimal && text.len() == 4 && digits.len() == 3;
    let is_name = text.bytes().all(|byte| byte.is_ascii_lowercase());
    // Nothing else that SVG knows as a colour: it may be transparent, or computed in floats.
    let color: Color = text.parse().ok().filter(|_| is_short || is_name)?;
    (color.alpha == u8::MAX).then_some([color.red, color.green, color.blue])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_names_or_hexadecimal_digits() {
        for (text, rgb) in [
            ("black", [0; 3]),
            ("white", [255; 3]),
            ("Red", [255, 0, 0]),
            (" rebeccapurple ", [0x66, 0x33, 0x99]),
            ("darkslategrey", [0x2F, 0x4F, 0x4F]),
            ("#12aBff", [0x12, 0xAB, 0xFF]),
            ("000001", [0, 0, 1]),
            ("#f0A", [255, 0, 0xAA]),
        ] {
            assert_eq!(color(text), Some(rgb), "{text:?}");
        }
        for text in [
            "",
            "#",
            "f0a",
            "12345",
            "#1234567",
            "+12345",
            "gggggg",
            "#red",
            "reddish",
            "transparent",
            "currentcolor",
            "rgb(1,2,3)",
            "#12345678",
            "#1234",
            "light blue",
            "é",
        ] {
            assert_eq!(color(text), None, "{text:?}");
        }
    }
}
