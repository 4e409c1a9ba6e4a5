//! Damage to zip files, such as `.npz`: members, and what is compressed in them, with checksums that are right all the
//! same. What a member holds is looked at only if its checksum is.

use flate2::Crc;

use super::{bytes, packed, text};
use crate::dice::Dice;

const LOCAL: &[u8] = b"PK\x03\x04";
const CENTRAL: &[u8] = b"PK\x01\x02";
const END: &[u8] = b"PK\x05\x06";
const STORED: u16 = 0;
const DEFLATED: u16 = 8;
/// Columns and text begin with what describes them.
const DESCRIPTION_BYTES: usize = 128;

struct Member {
    name: Vec<u8>,
    content: Vec<u8>,
    is_packed: bool,
}

/// Whether the bytes begin like a zip file.
#[must_use]
pub fn is_zip(bytes: &[u8]) -> bool {
    bytes.starts_with(LOCAL)
}

/// Changes a member, or which members there are.
pub fn change(zip: &mut Vec<u8>, other: &[u8], words: &[Vec<u8>], dice: &mut Dice) {
    let mut members = members(zip);
    if members.is_empty() {
        return;
    }
    let place = dice.below(members.len());
    match dice.below(12) {
        0 => drop(members.remove(place)),
        1 => {
            let with = dice.below(members.len());
            let content = members[with].content.clone();
            members[place].content = content;
        }
        2 => bytes::change(&mut members[place].name, b"mask_1.npy", dice),
        3 => {
            let mut others = self::members(other);
            if !others.is_empty() {
                members.push(others.swap_remove(dice.below(others.len())));
            }
        }
        4 => members[place].is_packed = !members[place].is_packed,
        5 | 6 => {
            // The whole of a mask is large, and its description says more.
            let content = &mut members[place].content;
            let rest = content.split_off(content.len().min(DESCRIPTION_BYTES));
            text::change(content, other, words, dice);
            content.extend(rest);
        }
        7 | 8 => {
            if let Some(header) = members.iter_mut().find(|member| member.name.ends_with(b".json")) {
                text::change(&mut header.content, other, words, dice);
            }
        }
        _ => bytes::change(&mut members[place].content, &[], dice),
    }
    *zip = joined(&members);
}

fn number(bytes: &[u8], place: usize, length: usize) -> Option<usize> {
    let digits = bytes.get(place..place + length)?;
    Some(digits.iter().rev().fold(0, |number, &byte| number << 8 | usize::from(byte)))
}

/// An entry in the list of members at the end of the file.
struct Entry {
    central: usize,
    local: usize,
    packed: std::ops::Range<usize>,
    method: u16,
    name: Vec<u8>,
}

/// The entries that can be followed to their members.
fn entries(zip: &[u8]) -> Vec<Entry> {
    let mut entries = Vec::new();
    let Some(end) = zip.windows(4).rposition(|bytes| bytes == END) else { return entries };
    let Some(mut central) = number(zip, end + 16, 4) else { return entries };
    while zip.get(central..).is_some_and(|rest| rest.starts_with(CENTRAL)) {
        let entry = || {
            let (method, length, local) =
                (number(zip, central + 10, 2)?, number(zip, central + 20, 4)?, number(zip, central + 42, 4)?);
            let name = zip.get(central + 46..central + 46 + number(zip, central + 28, 2)?)?.to_vec();
            zip.get(local..)?.starts_with(LOCAL).then_some(())?;
            let start = local + 30 + number(zip, local + 26, 2)? + number(zip, local + 28, 2)?;
            let packed = start..start.checked_add(length).filter(|&end| end <= zip.len())?;
            Some(Entry { central, local, packed, method: method as u16, name })
        };
        entries.extend(entry());
        let lengths = [28, 30, 32].map(|place| number(zip, central + place, 2).unwrap_or_default());
        central += 46 + lengths.iter().sum::<usize>();
    }
    entries
}

fn content(zip: &[u8], entry: &Entry) -> Option<Vec<u8>> {
    let packed = zip.get(entry.packed.clone())?;
    if entry.method == STORED { Some(packed.to_vec()) } else { packed::inflated(packed) }
}

fn members(zip: &[u8]) -> Vec<Member> {
    let member = |entry: &Entry| {
        let content = content(zip, entry).unwrap_or_default();
        Member { name: entry.name.clone(), content, is_packed: entry.method == DEFLATED }
    };
    entries(zip).iter().map(member).collect()
}

fn joined(members: &[Member]) -> Vec<u8> {
    let (mut zip, mut list) = (Vec::new(), Vec::new());
    for Member { name, content, is_packed } in members {
        let wrapped;
        let (method, packed) = if *is_packed {
            let stream = packed::zlib(content);
            // Without the two bytes and the checksum that make it zlib.
            wrapped = stream[2..stream.len() - 4].to_vec();
            (DEFLATED, &wrapped)
        } else {
            (STORED, content)
        };
        let local = zip.len() as u32;
        let mut common = Vec::new();
        common.extend([20, 0, 0, 0]);
        common.extend(method.to_le_bytes());
        // Midnight of the first day that the format knows.
        common.extend([0, 0, 0x21, 0]);
        common.extend(sum(content).to_le_bytes());
        common.extend((packed.len() as u32).to_le_bytes());
        common.extend((content.len() as u32).to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        zip.extend([LOCAL, &common, name, packed].concat());
        list.extend([CENTRAL, &[20, 0], &common, &[0; 10], &local.to_le_bytes(), name].concat());
    }
    let (count, start, length) = ((members.len() as u16).to_le_bytes(), zip.len() as u32, list.len() as u32);
    zip.extend(list);
    zip.extend([END, &[0; 4], &count, &count, &length.to_le_bytes(), &start.to_le_bytes(), &[0, 0]].concat());
    zip
}

fn sum(content: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(content);
    crc.sum()
}

/// Makes right the checksum of each member that can be read.
pub fn mend(zip: &mut [u8]) {
    for entry in entries(zip) {
        let Some(content) = content(zip, &entry) else { continue };
        let sum = sum(&content).to_le_bytes();
        for place in [entry.central + 16, entry.local + 14] {
            if let Some(old) = zip.get_mut(place..place + 4) {
                old.copy_from_slice(&sum);
            }
        }
    }
}
