//! Damage to text: words for words, lines for lines, numbers for numbers.

use super::bytes::{self, BYTES_MAX};
use crate::dice::Dice;

const NUMBERS: [&str; 22] = [
    "0",
    "1",
    "-1",
    "2",
    "255",
    "256",
    "65535",
    "65536",
    "1000001",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551616",
    "0.5",
    "-0.0",
    "1e9",
    "1e38",
    "1e-38",
    "1e400",
    "nan",
    "inf",
    "0x7fffffff",
];

/// Changes something; `other` is another file of the same kind, and `words` are what such files say.
pub fn change(text: &mut Vec<u8>, other: &[u8], words: &[Vec<u8>], dice: &mut Dice) {
    match dice.below(8) {
        0 | 1 if !words.is_empty() => {
            let word = dice.pick(words);
            replace_word(text, word, dice);
        }
        2 | 3 => replace_number(text, dice),
        4 => move_line(text, other, dice),
        5 if !words.is_empty() => {
            let (place, word) = (dice.below(text.len() + 1), dice.pick(words).clone());
            text.splice(place..place, word);
        }
        6 => nest(text, dice),
        _ => bytes::change(text, other, dice),
    }
}

/// The runs of bytes that are all `kind`.
fn runs(text: &[u8], kind: impl Fn(u8) -> bool) -> Vec<std::ops::Range<usize>> {
    let mut runs = Vec::new();
    let mut start = None;
    for (place, &byte) in text.iter().chain([&0]).enumerate() {
        match (kind(byte) && place < text.len(), start) {
            (true, None) => start = Some(place),
            (false, Some(from)) => {
                runs.push(from..place);
                start = None;
            }
            _ => {}
        }
    }
    runs
}

fn replace_word(text: &mut Vec<u8>, word: &[u8], dice: &mut Dice) {
    let words = runs(text, |byte| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_');
    if !words.is_empty() {
        let range = dice.pick(&words).clone();
        text.splice(range, word.iter().copied());
    }
}

fn replace_number(text: &mut Vec<u8>, dice: &mut Dice) {
    let numbers = runs(text, |byte| byte.is_ascii_digit() || byte == b'.');
    if !numbers.is_empty() {
        let (range, number) = (dice.pick(&numbers).clone(), *dice.pick(&NUMBERS));
        text.splice(range, number.bytes());
    }
}

/// Removes a line, says it twice, or takes one of `other`.
fn move_line(text: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    let mut lines: Vec<Vec<u8>> = text.split_inclusive(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    let others: Vec<&[u8]> = other.split_inclusive(|&byte| byte == b'\n').collect();
    let place = dice.below(lines.len());
    match dice.below(3) {
        0 if !lines.is_empty() => drop(lines.remove(place)),
        1 if !lines.is_empty() => lines.insert(place, lines[dice.below(lines.len())].clone()),
        _ if !others.is_empty() => lines.insert(place, dice.pick(&others).to_vec()),
        _ => {}
    }
    *text = lines.concat();
}

/// Puts a range of the text within itself, again and again.
fn nest(text: &mut Vec<u8>, dice: &mut Dice) {
    let range = dice.range(text.len());
    let times = 1 << dice.below(10);
    if text.len() + range.len() * times <= BYTES_MAX {
        let piece = text[range.clone()].repeat(times);
        text.splice(range.start..range.start, piece);
    }
}
