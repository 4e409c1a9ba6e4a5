//! The marker segments of a JPEG file (ITU-T T.81, annex B): enough to see its kind, its scans, its end and its
//! comments.

/// Marker of the start of the image.
const START_OF_IMAGE: u8 = 0xD8;
/// Marker of the end of the image.
const END_OF_IMAGE: u8 = 0xD9;
/// Marker of a scan, whose header is followed by entropy-coded bytes.
const START_OF_SCAN: u8 = 0xDA;
/// Marker of the segment that a JFIF file begins with.
const APP0: u8 = 0xE0;
/// Marker of a comment.
const COMMENT: u8 = 0xFE;
/// Most bytes that a segment can carry: its 16-bit length counts itself.
pub(super) const PAYLOAD_BYTES_MAX: usize = 65_533;

/// A marker, the bytes of its segment, and where the next one may begin.
struct Segment<'a> {
    marker: u8,
    payload: &'a [u8],
    end: usize,
}

/// The first segment at or after `from`, or `None` where the bytes end before it does.
///
/// One rule skips entropy-coded bytes and fill bytes: a marker is 0xFF followed by a byte that is neither 0 nor 0xFF.
fn next_segment(bytes: &[u8], from: usize) -> Option<Segment<'_>> {
    let offset = bytes.get(from..)?.windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xFF))?;
    let body = from + offset + 2;
    let marker = bytes[body - 1];
    // TEM, RST0 to RST7, SOI and EOI have no payload.
    if matches!(marker, 0x01 | 0xD0..=END_OF_IMAGE) {
        return Some(Segment { marker, payload: &[], end: body });
    }
    let length = usize::from(u16::from_be_bytes(*bytes.get(body..)?.first_chunk()?));
    let payload = bytes.get(body + 2..body + length)?;
    Some(Segment { marker, payload, end: body + length })
}

fn segments(bytes: &[u8]) -> impl Iterator<Item = Segment<'_>> {
    let mut from = 0;
    std::iter::from_fn(move || {
        let segment = next_segment(bytes, from)?;
        from = segment.end;
        Some(segment)
    })
}

/// Whether the file holds the end of its image.
pub(super) fn is_complete(bytes: &[u8]) -> bool {
    segments(bytes).any(|segment| segment.marker == END_OF_IMAGE)
}

/// Where the last segment ends that is there as a whole, together with the entropy-coded bytes after it.
pub(super) fn end_of_last_segment(bytes: &[u8]) -> usize {
    let end = segments(bytes).last().map_or(0, |segment| segment.end);
    let marker = bytes[end..].windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xFF));
    let end = marker.map_or(bytes.len(), |place| end + place);
    // Half of a marker is none.
    end - bytes[..end].iter().rev().take_while(|&&byte| byte == 0xFF).count()
}

/// The segments before the first scan.
fn header(bytes: &[u8]) -> impl Iterator<Item = Segment<'_>> {
    segments(bytes).take_while(|segment| segment.marker != START_OF_SCAN)
}

/// What the file is, if it is of a kind that is not read (ITU-T T.81, table B.1).
pub(super) fn refused_kind(bytes: &[u8]) -> Option<&'static str> {
    header(bytes).find_map(|segment| match segment.marker {
        0xC3 => Some("lossless"),
        0xC5..=0xC7 | 0xDE => Some("hierarchical"),
        0xC9 | 0xCA | 0xCC => Some("arithmetic coding"),
        0xCB => Some("lossless, arithmetic coding"),
        0xCD..=0xCF => Some("hierarchical, arithmetic coding"),
        0xF7 => Some("JPEG-LS"),
        0xC0..=0xC2 if segment.payload.first() == Some(&12) => Some("12 bits a channel"),
        _ => None,
    })
}

/// The frame header and whether the picture comes in passes, each finer than the last.
fn frame(bytes: &[u8]) -> Option<(&[u8], bool)> {
    let frame = header(bytes).find(|segment| matches!(segment.marker, 0xC0..=0xC2))?;
    Some((frame.payload, frame.marker == 0xC2))
}

/// The number of components of a picture that comes in passes.
pub(super) fn progressive_components(bytes: &[u8]) -> Option<u64> {
    let (payload, is_progressive) = frame(bytes)?;
    payload.get(5).filter(|_| is_progressive).map(|&count| u64::from(count))
}

/// Whether the scans that began give every coefficient of every component all of its bits.
pub(super) fn has_every_scan(bytes: &[u8]) -> bool {
    let Some((payload, is_progressive)) = frame(bytes) else { return false };
    let components: Vec<u8> = payload.get(6..).unwrap_or_default().chunks_exact(3).map(|of_one| of_one[0]).collect();
    // Coefficients that lack bits, of each component.
    let mut lacking = vec![u64::MAX; components.len()];
    for scan in segments(bytes).filter(|segment| segment.marker == START_OF_SCAN).map(|segment| segment.payload) {
        let Some((&count, rest)) = scan.split_first() else { return false };
        let count = usize::from(count);
        let (Some(named), Some(&[first, last, bits])) =
            (rest.get(..2 * count), rest.get(2 * count..2 * count + 3).and_then(|rest| rest.first_chunk::<3>()))
        else {
            return false;
        };
        let is_full = !is_progressive || bits & 0x0F == 0;
        let (first, last) = if is_progressive { (first.min(63), last.min(63)) } else { (0, 63) };
        for name in named.chunks_exact(2).map(|pair| pair[0]) {
            let Some(place) = components.iter().position(|&component| component == name) else { continue };
            for coefficient in first..=last {
                let bit = 1_u64 << coefficient;
                if is_full { lacking[place] &= !bit } else { lacking[place] |= bit }
            }
        }
    }
    !lacking.is_empty() && lacking.iter().all(|&lacking| lacking == 0)
}

/// Whether one of Adobe's programs wrote the file, or one that does as they do.
pub(super) fn is_of_adobe(bytes: &[u8]) -> bool {
    header(bytes).any(|segment| segment.marker == 0xEE && segment.payload.starts_with(b"Adobe"))
}

/// The comments before the first scan.
pub(super) fn comments(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    header(bytes).filter(|segment| segment.marker == COMMENT).map(|segment| segment.payload)
}

/// A comment segment `keyword=text`, of at most [`PAYLOAD_BYTES_MAX`] bytes.
pub(super) fn comment(keyword: &str, text: &str) -> Vec<u8> {
    let payload = format!("{keyword}={text}");
    debug_assert!(payload.len() <= PAYLOAD_BYTES_MAX, "metadata is checked before it is written");
    let mut segment = vec![0xFF, COMMENT];
    segment.extend_from_slice(&((payload.len() + 2) as u16).to_be_bytes());
    segment.extend_from_slice(payload.as_bytes());
    segment
}

/// Where comments go: after the start of the image and the JFIF header, if there is one.
pub(super) fn header_end(bytes: &[u8]) -> usize {
    segments(bytes)
        .take_while(|segment| matches!(segment.marker, START_OF_IMAGE | APP0))
        .last()
        .map_or(0, |segment| segment.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Start, JFIF header (empty), comment, scan whose bytes hold a stuffed 0xFF and a restart marker.
    const UNFINISHED: &[u8] = b"\xFF\xD8\xFF\xE0\0\x02\xFF\xFE\0\x05a=b\xFF\xDA\0\x04xy\x12\xFF\0\xFF\xD3\x34";

    #[test]
    fn a_file_is_complete_once_the_end_of_its_image_is_there() {
        assert!(!is_complete(UNFINISHED));
        assert!(is_complete(&[UNFINISHED, b"\xFF\xD9"].concat()));
    }

    #[test]
    fn the_end_of_an_embedded_thumbnail_is_not_the_end_of_the_image() {
        let thumbnail = b"\xFF\xD8\xFF\xE1\0\x06\xFF\xD8\xFF\xD9\xFF\xDA\0\x02";
        assert!(!is_complete(thumbnail));
    }

    #[test]
    fn a_kind_that_is_not_read_is_named() {
        let kind = |marker: u8, bits: u8| refused_kind(&[0xFF, 0xD8, 0xFF, marker, 0, 3, bits, 0xFF, 0xDA, 0, 2]);
        assert_eq!([0xC0, 0xC1, 0xC2].map(|marker| kind(marker, 8)), [None; 3]);
        assert_eq!(kind(0xC1, 12), Some("12 bits a channel"));
        assert_eq!(
            [0xC3, 0xC7, 0xC9, 0xCA].map(|marker| kind(marker, 8)),
            [Some("lossless"), Some("hierarchical"), Some("arithmetic coding"), Some("arithmetic coding")]
        );
    }

    #[test]
    fn a_picture_in_passes_has_every_scan_once_all_bits_of_all_coefficients_came() {
        let frame = b"\xFF\xD8\xFF\xC2\0\x0B\x08\0\x08\0\x08\x01\x01\x11\0";
        let scan = |first: u8, last: u8, bits: u8| [0xFF, 0xDA, 0, 8, 1, 1, 0, first, last, bits, 0x12];
        let passes = [&scan(0, 0, 0x01)[..], &scan(1, 63, 0x00), &scan(0, 0, 0x10)];
        let file = |count: usize| [&frame[..], &passes[..count].concat()].concat();
        assert_eq!([0, 1, 2, 3].map(|count| has_every_scan(&file(count))), [false, false, false, true]);
    }

    #[test]
    fn a_segment_that_is_cut_and_half_a_marker_are_left_out() {
        let scan = b"\xFF\xD8\xFF\xDA\0\x02\x12\x34";
        for rest in [&b""[..], b"\xFF", b"\xFF\xC4\0\x09\x01", b"\xFF\xDA\0"] {
            assert_eq!(end_of_last_segment(&[&scan[..], rest].concat()), scan.len(), "{rest:?}");
        }
    }

    #[test]
    fn comments_are_found_where_they_are_put() {
        assert_eq!(comments(UNFINISHED).collect::<Vec<_>>(), [b"a=b"]);
        assert_eq!(header_end(UNFINISHED), 6);
        assert_eq!(comment("a", "b"), UNFINISHED[6..13]);
    }

    #[test]
    fn no_cut_or_changed_byte_leads_out_of_the_file() {
        for cut in 0..UNFINISHED.len() {
            assert!(!is_complete(&UNFINISHED[..cut]));
            for value in 0..=255 {
                let mut damaged = UNFINISHED.to_vec();
                damaged[cut] = value;
                is_complete(&damaged);
                comments(&damaged).for_each(drop);
                header_end(&damaged);
                has_every_scan(&damaged);
                refused_kind(&damaged);
                end_of_last_segment(&damaged);
            }
        }
    }
}
