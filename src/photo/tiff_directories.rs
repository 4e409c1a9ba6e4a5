//! The directories of a TIFF file (TIFF 6.0, and BigTIFF with its offsets of 64 bits): enough to see which pages it has
//! and whether a camera's sensor lies in one of them.

/// Most directories that are looked at, and most entries of one.
const DIRECTORIES_MAX: usize = 256;
const ENTRIES_MAX: u64 = 4096;

/// Tags of entries.
pub(super) const NEW_SUBFILE_TYPE: u16 = 254;
pub(super) const BITS_PER_SAMPLE: u16 = 258;
pub(super) const COMPRESSION: u16 = 259;
pub(super) const PHOTOMETRIC: u16 = 262;
pub(super) const MAKE: u16 = 271;
pub(super) const COLOR_MAP: u16 = 320;
pub(super) const SUB_DIRECTORIES: u16 = 330;

/// The numbers of a file in its byte order.
#[derive(Clone, Copy)]
struct Numbers<'a> {
    bytes: &'a [u8],
    is_little: bool,
    /// Whether offsets and counts have 64 bits.
    is_big: bool,
}

impl Numbers<'_> {
    /// The number of `width` bytes at `place`.
    fn at(&self, place: u64, width: usize) -> Option<u64> {
        let place = usize::try_from(place).ok()?;
        let bytes = self.bytes.get(place..place.checked_add(width)?)?;
        let value = |value: u64, &byte: &u8| value << 8 | u64::from(byte);
        Some(if self.is_little { bytes.iter().rev().fold(0, value) } else { bytes.iter().fold(0, value) })
    }

    fn offset_width(&self) -> usize {
        if self.is_big { 8 } else { 4 }
    }
}

/// An entry of a directory.
#[derive(Clone, Copy)]
struct Entry {
    tag: u16,
    /// Bytes of one value.
    width: usize,
    count: u64,
    /// Where the values are.
    place: u64,
}

/// A directory: what is told about one picture of the file.
pub(super) struct Directory<'a> {
    numbers: Numbers<'a>,
    entries: Vec<Entry>,
    next: u64,
}

impl Directory<'_> {
    /// The values of a tag, at most so many.
    pub(super) fn values(&self, tag: u16, most: usize) -> Vec<u64> {
        let Some(entry) = self.entries.iter().find(|entry| entry.tag == tag) else { return Vec::new() };
        let place = |index: u64| entry.place.saturating_add(index * entry.width as u64);
        let places = (0..entry.count).take(most).map(place);
        places.map_while(|place| self.numbers.at(place, entry.width)).collect()
    }

    /// The only or first value of a tag.
    pub(super) fn value(&self, tag: u16) -> Option<u64> {
        self.values(tag, 1).first().copied()
    }

    /// Where the low byte of the first value of a tag is.
    pub(super) fn low_byte_of(&self, tag: u16) -> Option<usize> {
        let entry = self.entries.iter().find(|entry| entry.tag == tag)?;
        let place = usize::try_from(entry.place).ok()?;
        Some(if self.numbers.is_little { place } else { place.checked_add(entry.width - 1)? })
    }

    /// Whether it is a smaller version of another picture, or its mask.
    pub(super) fn is_beside(&self) -> bool {
        self.value(NEW_SUBFILE_TYPE).is_some_and(|kind| kind & 0b101 != 0)
    }

    pub(super) fn has(&self, tag: u16) -> bool {
        self.entries.iter().any(|entry| entry.tag == tag)
    }
}

fn read_directory(numbers: Numbers<'_>, place: u64) -> Option<Directory<'_>> {
    let (count_width, entry_width) = if numbers.is_big { (8, 20) } else { (2, 12) };
    let count = numbers.at(place, count_width)?;
    let first = place.checked_add(count_width as u64)?;
    let inline = numbers.offset_width() as u64;
    let entry = |index: u64| {
        let start = first.saturating_add(index * entry_width);
        let width = match numbers.at(start.saturating_add(2), 2)? {
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16 | 17 | 18 => 8,
            _ => 1,
        };
        let count = numbers.at(start.saturating_add(4), numbers.offset_width())?;
        let field = start.saturating_add(4 + inline);
        let is_inline = count.saturating_mul(width) <= inline;
        let place = if is_inline { field } else { numbers.at(field, numbers.offset_width())? };
        Some(Entry { tag: numbers.at(start, 2)? as u16, width: width as usize, count, place })
    };
    let entries = (0..count.min(ENTRIES_MAX)).map_while(entry).collect();
    let next = numbers.at(first.saturating_add(count.saturating_mul(entry_width)), numbers.offset_width());
    Some(Directory { numbers, entries, next: next.unwrap_or(0) })
}

/// The directories that follow each other from the header on. What cannot be read ends them.
pub(super) fn directories(bytes: &[u8]) -> Vec<Directory<'_>> {
    let is_little = bytes.starts_with(b"II");
    let is_big = matches!(bytes.get(2..4), Some(b"+\0" | b"\0+"));
    let numbers = Numbers { bytes, is_little, is_big };
    let first = numbers.at(if is_big { 8 } else { 4 }, numbers.offset_width());
    from(numbers, first.unwrap_or(0))
}

/// The directories below one: other versions of its picture.
pub(super) fn below<'a>(directory: &Directory<'a>) -> Vec<Directory<'a>> {
    let places = directory.values(SUB_DIRECTORIES, DIRECTORIES_MAX);
    places.into_iter().flat_map(|place| from(directory.numbers, place)).collect()
}

fn from(numbers: Numbers<'_>, mut place: u64) -> Vec<Directory<'_>> {
    let (mut found, mut seen) = (Vec::new(), Vec::new());
    // A file may lead in a circle.
    while place != 0 && found.len() < DIRECTORIES_MAX && !seen.contains(&place) {
        seen.push(place);
        let Some(directory) = read_directory(numbers, place) else { break };
        place = directory.next;
        found.push(directory);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two directories: the second one is a smaller version, with one below it.
    fn two_pages(big_endian: bool) -> Vec<u8> {
        let short = |value: u16| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
        let long = |value: u32| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
        let entry = |tag: u16, value: u32| [&short(tag)[..], &short(4), &long(1), &long(value)].concat();
        let begin = if big_endian { *b"MM\0*" } else { *b"II*\0" };
        [
            &begin[..],
            &long(8),
            &short(1),
            &entry(PHOTOMETRIC, 3),
            &long(26),
            &short(2),
            &entry(NEW_SUBFILE_TYPE, 1),
            &entry(SUB_DIRECTORIES, 56),
            &long(0),
            &short(1),
            &entry(COMPRESSION, 7),
            &long(8),
        ]
        .concat()
    }

    #[test]
    fn pages_and_what_lies_below_them_are_found_in_both_byte_orders() {
        for big_endian in [false, true] {
            let bytes = two_pages(big_endian);
            let found = directories(&bytes);
            assert_eq!(found.len(), 2);
            assert_eq!((found[0].value(PHOTOMETRIC), found[0].is_beside()), (Some(3), false));
            assert!(found[1].is_beside());
            // The one below leads back to the first one, and so in a circle.
            assert_eq!(below(&found[1])[0].value(COMPRESSION), Some(7));
        }
    }

    #[test]
    fn no_cut_or_changed_byte_leads_out_of_the_file_or_in_a_circle() {
        let whole = two_pages(false);
        for cut in 0..whole.len() {
            for value in 0..=255 {
                let mut damaged = whole.clone();
                damaged[cut] = value;
                for directory in directories(&damaged) {
                    below(&directory);
                }
            }
            directories(&whole[..cut]);
        }
    }
}
