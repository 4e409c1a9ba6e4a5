//! The marker segments of a JPEG file (ITU-T T.81, annex B): enough to see its end and its comments.

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

/// The comments before the first scan.
pub(super) fn comments(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    segments(bytes)
        .take_while(|segment| segment.marker != START_OF_SCAN)
        .filter(|segment| segment.marker == COMMENT)
        .map(|segment| segment.payload)
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
    use super::{comment, comments, header_end, is_complete};

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
            }
        }
    }
}
