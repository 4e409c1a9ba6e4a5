//! Damage to bytes of which nothing is known.

use crate::dice::Dice;

/// Numbers at which formats, types and loops have their limits.
pub const TELLING: [u32; 20] = [
    0,
    1,
    2,
    3,
    7,
    8,
    16,
    127,
    128,
    255,
    256,
    1_000,
    32_767,
    32_768,
    65_535,
    65_536,
    0x7FFF_FFFF,
    0x8000_0000,
    0xFFFF_FFFE,
    0xFFFF_FFFF,
];
/// No file grows beyond this: a small file finds a fault sooner than a large one.
pub const BYTES_MAX: usize = 1 << 18;

/// Changes something; `other` is another file of the same kind.
pub fn change(bytes: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    if bytes.is_empty() {
        bytes.extend_from_slice(other);
        return;
    }
    let place = dice.below(bytes.len());
    match dice.below(12) {
        0 | 1 => bytes[place] ^= 1 << dice.below(8),
        2 => bytes[place] = dice.number() as u8,
        3 => bytes[place] = *dice.pick(&[0, 1, 0x7F, 0x80, 0xFE, 0xFF]),
        4 => overwrite(bytes, place, *dice.pick(&TELLING), dice),
        5 => nudge(bytes, place, dice),
        6 => {
            let range = dice.range(bytes.len());
            bytes.drain(range);
        }
        7 => {
            let again = bytes[dice.range(bytes.len())].to_vec();
            insert(bytes, place, &again);
        }
        8 if dice.one_in(3) => bytes.truncate(place),
        8 | 9 if !other.is_empty() => {
            let piece = &other[dice.range(other.len())];
            if dice.one_in(2) {
                insert(bytes, place, piece);
            } else {
                let end = bytes.len().min(place + piece.len());
                bytes[place..end].copy_from_slice(&piece[..end - place]);
            }
        }
        10 => {
            let run = vec![*dice.pick(&[0, b' ', 0xFF]); 1 + dice.below(300)];
            insert(bytes, place, &run);
        }
        _ => {
            let end = bytes.len().min(place + 1 + dice.below(8));
            bytes[place..end].iter_mut().for_each(|byte| *byte = dice.number() as u8);
        }
    }
}

fn insert(bytes: &mut Vec<u8>, place: usize, piece: &[u8]) {
    if bytes.len() + piece.len() <= BYTES_MAX {
        bytes.splice(place..place, piece.iter().copied());
    }
}

/// Puts a number of 2 or 4 bytes there, in either order.
fn overwrite(bytes: &mut [u8], place: usize, number: u32, dice: &mut Dice) {
    let (little, big, short) = (number.to_le_bytes(), number.to_be_bytes(), number as u16);
    let piece: &[u8] = match dice.below(4) {
        0 => &little,
        1 => &big,
        2 => &short.to_le_bytes(),
        _ => &short.to_be_bytes(),
    };
    let end = bytes.len().min(place + piece.len());
    bytes[place..end].copy_from_slice(&piece[..end - place]);
}

/// Makes what may be a length a little larger or smaller.
fn nudge(bytes: &mut [u8], place: usize, dice: &mut Dice) {
    let by = 1 + dice.below(16) as u8;
    bytes[place] = if dice.one_in(2) { bytes[place].wrapping_add(by) } else { bytes[place].wrapping_sub(by) };
}
