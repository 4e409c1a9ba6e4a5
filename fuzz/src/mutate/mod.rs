//! Damage to files that were right, so that what is left of them is read as far as possible.
//!
//! A change of bytes alone ends at the first checksum. So what is compressed is changed before it is compressed, and
//! checksums are made right again after each change.

mod bytes;
mod packed;
mod png;
mod text;
mod zip;

use crate::dice::Dice;

/// `file` after some changes; `other` is another file of the same kind, and `words` are what such files say.
#[must_use]
pub fn mutated(file: &[u8], other: &[u8], words: &[Vec<u8>], dice: &mut Dice) -> Vec<u8> {
    let mut damaged = file.to_vec();
    let is_text = !file.is_empty() && !file.contains(&0) && std::str::from_utf8(file).is_ok();
    // One change as a rule: what comes after a second mistake is seldom read.
    for _ in 0..=(dice.number().trailing_zeros()) {
        if is_text {
            text::change(&mut damaged, other, words, dice);
        } else if png::is_png(&damaged) && !dice.one_in(4) {
            png::change(&mut damaged, other, dice);
        } else if zip::is_zip(&damaged) && !dice.one_in(4) {
            zip::change(&mut damaged, other, words, dice);
        } else {
            bytes::change(&mut damaged, other, dice);
        }
    }
    // A wrong checksum must be met with a refusal, too.
    if !dice.one_in(16) {
        mend(&mut damaged);
    }
    damaged
}

/// Makes right the checksums and the length of the whole file.
fn mend(file: &mut [u8]) {
    if png::is_png(file) {
        png::mend(file);
    } else if zip::is_zip(file) {
        zip::mend(file);
    } else if file.starts_with(b"RIFF") && file.len() > 12 {
        let length = file.len() as u32 - 8;
        file[4..8].copy_from_slice(&length.to_le_bytes());
    }
}

/// The words of a dictionary in libFuzzer's form: each in quotes on a line of its own, with `\xNN` for other bytes.
#[must_use]
pub fn words(dictionary: &str) -> Vec<Vec<u8>> {
    let quoted = |line: &str| Some(line.trim().strip_prefix('"')?.strip_suffix('"')?.to_owned());
    dictionary.lines().filter_map(quoted).map(|word| unescaped(&word)).collect()
}

fn unescaped(word: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = word.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        rest = tail;
        match (first, tail) {
            (b'\\', [b'x', high, low, others @ ..]) => {
                let digit = |byte: &u8| char::from(*byte).to_digit(16).unwrap_or_default() as u8;
                bytes.push(digit(high) << 4 | digit(low));
                rest = others;
            }
            (b'\\', [plain, others @ ..]) => {
                bytes.push(*plain);
                rest = others;
            }
            _ => bytes.push(first),
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dictionary_is_read_as_libfuzzer_reads_it() {
        assert_eq!(words("# no word\n\"ab\"\n\"a\\\"\\\\\\x0A\"\n"), [b"ab".to_vec(), b"a\"\\\n".to_vec()]);
    }

    #[test]
    fn damaged_files_keep_right_checksums() {
        let picture = std::fs::read("../tests/photos/rgb.png").expect("a test photo");
        let read = (0..200).filter(|&index| {
            let damaged = mutated(&picture, &picture, &[], &mut Dice::new(0, "test", index));
            // Where no chunk is lost, a decoder reads the pixels or refuses something else than a checksum.
            smalti::Picture::from_encoded(&damaged).map_or_else(|error| !error.to_string().contains("CRC"), |_| true)
        });
        assert!(read.count() > 170);
    }
}
