//! Foreign text, such as the name of a file, as a terminal may show it.
//!
//! A terminal obeys control characters: one in a name could colour, delete or forge what stands around it. So they are
//! spelt out, as `\n` or `\u{1b}`, and so are the characters that turn the direction of a text.

use std::borrow::Cow;

/// `text` on one line.
pub(crate) fn shown(text: &str) -> Cow<'_, str> {
    spelt_out(text, is_unsafe)
}

/// `text` with the lines and tabs that it has.
pub(super) fn lines_shown(text: &str) -> Cow<'_, str> {
    spelt_out(text, |char| is_unsafe(char) && !matches!(char, '\n' | '\t'))
}

fn spelt_out(text: &str, is_to_spell: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_to_spell) {
        return Cow::Borrowed(text);
    }
    let mut spelt = String::with_capacity(text.len() + 8);
    for char in text.chars() {
        if is_to_spell(char) {
            spelt.extend(char.escape_default());
        } else {
            spelt.push(char);
        }
    }
    Cow::Owned(spelt)
}

/// Whether a terminal would do something else with this character than show it.
fn is_unsafe(char: char) -> bool {
    let turns_direction =
        matches!(char, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let ends_line = matches!(char, '\u{2028}' | '\u{2029}');
    char.is_control() || turns_direction || ends_line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_spelt_out_and_all_others_stay() {
        assert_eq!(shown("Grüße, 馬賽克 — \u{1f600} C:\\a.png"), "Grüße, 馬賽克 — \u{1f600} C:\\a.png");
        assert_eq!(shown("a\u{1b}[2Jb\r\n\t\0"), r"a\u{1b}[2Jb\r\n\t\u{0}");
        assert_eq!(shown("\u{7f}\u{85}\u{9b}31m\u{202e}gnp.\u{2028}"), r"\u{7f}\u{85}\u{9b}31m\u{202e}gnp.\u{2028}");
        assert_eq!(lines_shown("a\tb\nc\rd\n"), "a\tb\nc\\rd\n");
    }
}
