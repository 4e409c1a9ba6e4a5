//! Camera raw in TIFF files: what a sensor saw, which is no picture before it is developed. The pictures that such a
//! file holds beside it are thumbnails.

use super::tiff_directories::{self as tiff, Directory};

/// The tag that tells the version of a digital negative.
const DNG_VERSION: u16 = 50706;
/// How pixels are meant: as a mosaic of colour filters, or as linear light from one.
const PHOTOMETRIC_RAW: [u64; 2] = [32803, 34892];
/// How sensors are stored by Nikon, Sony, Pentax, Samsung and Kodak.
const COMPRESSION_RAW: [u64; 6] = [34713, 32767, 65535, 32769, 32770, 65000];

/// The name of the camera raw that these bytes of a TIFF file are, if they are.
pub(super) fn name(bytes: &[u8]) -> Option<&'static str> {
    if bytes.get(8..10) == Some(b"CR") {
        return Some("camera raw (CR2)");
    }
    let pages = tiff::directories(bytes);
    if pages.iter().any(|page| page.has(DNG_VERSION)) {
        return Some("camera raw (DNG)");
    }
    let is_raw = |directory: &Directory<'_>| {
        let is_one_of = |tag, known: &[u64]| directory.value(tag).is_some_and(|value| known.contains(&value));
        is_one_of(tiff::PHOTOMETRIC, &PHOTOMETRIC_RAW) || is_one_of(tiff::COMPRESSION, &COMPRESSION_RAW)
    };
    if !pages.iter().any(|page| is_raw(page) || tiff::below(page).iter().any(is_raw)) {
        return None;
    }
    let make: Vec<u8> = pages.first()?.values(tiff::MAKE, 5).into_iter().map(|char| char as u8).collect();
    Some(match make.to_ascii_uppercase().as_slice() {
        b"NIKON" => "camera raw (NEF)",
        [b'S', b'O', b'N', b'Y', ..] => "camera raw (ARW)",
        b"PENTA" | b"RICOH" => "camera raw (PEF)",
        b"SAMSU" => "camera raw (SRW)",
        b"HASSE" => "camera raw (3FR)",
        _ => "camera raw",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file whose first directory is a thumbnail, and whose second one has this entry.
    fn with_entry(tag: u16, value: u32) -> Vec<u8> {
        let entry = |tag: u16, value: u32| {
            [&tag.to_le_bytes()[..], &[4, 0], &1_u32.to_le_bytes(), &value.to_le_bytes()].concat()
        };
        let directory = |entries: &[Vec<u8>], next: u32| {
            [&(entries.len() as u16).to_le_bytes()[..], &entries.concat(), &next.to_le_bytes()].concat()
        };
        [
            b"II*\0\x08\0\0\0".to_vec(),
            directory(&[entry(254, 1), entry(330, 38)], 0),
            directory(&[entry(tag, value)], 0),
        ]
        .concat()
    }

    #[test]
    fn a_sensor_below_a_thumbnail_is_found() {
        assert_eq!(name(&with_entry(262, 32803)), Some("camera raw"));
        assert_eq!(name(&with_entry(259, 34713)), Some("camera raw"));
        assert_eq!(name(&with_entry(262, 2)), None);
    }
}
