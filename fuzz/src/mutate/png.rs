//! Damage to PNG: chunks, and what is compressed in them, with checksums that are right all the same. A decoder looks at
//! nothing in a chunk whose checksum is wrong.

use flate2::Crc;

use super::bytes::{self, TELLING};
use super::packed;
use crate::dice::Dice;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
/// Chunks that decoders or smalti itself read.
const KINDS: [&[u8; 4]; 20] = [
    b"IHDR", b"PLTE", b"IDAT", b"IEND", b"tRNS", b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"cICP", b"eXIf", b"tEXt",
    b"zTXt", b"iTXt", b"acTL", b"fcTL", b"fdAT", b"sBIT", b"bKGD", b"mDCV",
];

struct Chunk {
    kind: [u8; 4],
    body: Vec<u8>,
}

/// Whether the bytes begin like a PNG.
#[must_use]
pub fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(SIGNATURE)
}

/// Changes a chunk, or the order of chunks.
pub fn change(png: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    let mut chunks = chunks(png);
    if chunks.is_empty() {
        return;
    }
    let place = dice.below(chunks.len());
    match dice.below(12) {
        0 => drop(chunks.remove(place)),
        1 => {
            let Chunk { kind, body } = &chunks[dice.below(chunks.len())];
            let again = Chunk { kind: *kind, body: body.clone() };
            chunks.insert(place, again);
        }
        2 => {
            let with = dice.below(chunks.len());
            chunks.swap(place, with);
        }
        3 => chunks[place].kind = **dice.pick(&KINDS),
        4 => {
            let mut others = self::chunks(other);
            if !others.is_empty() {
                chunks.insert(place, others.swap_remove(dice.below(others.len())));
            }
        }
        5 => {
            let mut body = Vec::new();
            (0..dice.below(40)).for_each(|_| body.push(dice.number() as u8));
            chunks.insert(place, Chunk { kind: **dice.pick(&KINDS), body });
        }
        6 | 7 => change_header(&mut chunks, dice),
        8 | 9 => change_packed(&mut chunks, dice),
        _ => bytes::change(&mut chunks[place].body, other, dice),
    }
    *png = joined(&chunks);
}

/// Size, depth, colour type and the rest in the header.
fn change_header(chunks: &mut [Chunk], dice: &mut Dice) {
    let Some(header) = chunks.iter_mut().find(|chunk| &chunk.kind == b"IHDR" && chunk.body.len() >= 13) else { return };
    match dice.below(5) {
        0 => header.body[8] = *dice.pick(&[1, 2, 4, 8, 16]),
        1 => header.body[9] = *dice.pick(&[0, 2, 3, 4, 6]),
        2 => header.body[12] ^= 1,
        3 => {
            let (side, telling) = (4 * dice.below(2), dice.pick(&TELLING).to_be_bytes());
            header.body[side..side + 4].copy_from_slice(&telling);
        }
        _ => {
            let place = dice.below(13);
            header.body[place] = header.body[place].wrapping_add(1 + dice.below(4) as u8);
        }
    }
}

/// What is compressed in a chunk: pixels, a profile, or text.
fn change_packed(chunks: &mut [Chunk], dice: &mut Dice) {
    let mut packed: Vec<&mut Chunk> = chunks.iter_mut().filter(|chunk| begin_of_packed(chunk).is_some()).collect();
    if packed.is_empty() {
        return;
    }
    let index = dice.below(packed.len());
    let chunk = &mut packed[index];
    let start = begin_of_packed(chunk).unwrap_or_default();
    if let Some(mut content) = packed::unzlib(&chunk.body[start..]) {
        for _ in 0..=dice.below(3) {
            bytes::change(&mut content, &[], dice);
        }
        chunk.body.truncate(start);
        chunk.body.extend(packed::zlib(&content));
    }
}

/// Where a stream of zlib begins in the body of a chunk, if there is one.
fn begin_of_packed(chunk: &Chunk) -> Option<usize> {
    let start = match &chunk.kind {
        b"IDAT" => 0,
        b"fdAT" => 4,
        b"iCCP" | b"zTXt" => chunk.body.iter().position(|&byte| byte == 0)? + 2,
        _ => return None,
    };
    (start < chunk.body.len()).then_some(start)
}

/// The chunks, the last of which may be cut short.
fn chunks(png: &[u8]) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    let mut rest = png.get(SIGNATURE.len()..).unwrap_or_default();
    while let Some((head, tail)) = rest.split_first_chunk::<8>() {
        let [a, b, c, d, kind @ ..] = *head;
        let length = (u32::from_be_bytes([a, b, c, d]) as usize).min(tail.len());
        chunks.push(Chunk { kind, body: tail[..length].to_vec() });
        rest = tail.get(length + 4..).unwrap_or_default();
    }
    chunks
}

fn joined(chunks: &[Chunk]) -> Vec<u8> {
    let mut png = SIGNATURE.to_vec();
    for Chunk { kind, body } in chunks {
        png.extend((body.len() as u32).to_be_bytes());
        png.extend(kind);
        png.extend(body);
        png.extend(crc(kind, body).to_be_bytes());
    }
    png
}

fn crc(kind: &[u8], body: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(kind);
    crc.update(body);
    crc.sum()
}

/// Makes right the checksum of each chunk that is whole, and of what is compressed in it.
pub fn mend(png: &mut [u8]) {
    let mut start = SIGNATURE.len();
    while let Some(&[a, b, c, d, ..]) = png.get(start..start + 8) {
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        let (body, end) = (start + 8, start.saturating_add(length).saturating_add(8));
        let Some(whole) = png.get_mut(start + 4..end.saturating_add(4)) else { return };
        let kind: [u8; 4] = whole[..4].try_into().unwrap_or_default();
        let chunk = Chunk { kind, body: png[body..end].to_vec() };
        if let Some(packed) = begin_of_packed(&chunk) {
            packed::mend_zlib(&mut png[body + packed..end]);
        }
        let sum = crc(&kind, &png[body..end]);
        png[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        start = end + 4;
    }
}
