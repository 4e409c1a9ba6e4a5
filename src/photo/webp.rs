//! The chunks of a WebP file (RFC 9649): enough to append metadata to a lossless picture, and to find it again.
//!
//! The metadata is an XMP packet: a list of `keyword=text`.

use std::io::{self, Read, Seek, SeekFrom};

use super::{Metadata, xml};

/// Largest side in px that the format can hold.
pub const WEBP_SIDE_MAX_PX: u32 = 16_383;

/// Bytes of the file's header: `RIFF`, the size of the rest, `WEBP`.
const HEADER_BYTES: usize = 12;
/// Flag of the extended header: the file has an XMP packet.
const HAS_XMP: u8 = 0x04;
/// Flag of the extended header: some pixels are not opaque.
pub(super) const HAS_ALPHA: u8 = 0x10;
/// Most bytes of an XMP packet that is read.
const XMP_BYTES_MAX: u64 = 16 << 20;

/// Whether a file that begins with these bytes is a WebP.
pub(super) fn is_webp(header: &[u8]) -> bool {
    header.starts_with(b"RIFF") && header.get(8..HEADER_BYTES) == Some(b"WEBP")
}

/// The simple WebP file `bytes`, of one lossless picture of `width_px` x `height_px`, as an extended one with metadata;
/// `alpha` is 0 or [`HAS_ALPHA`].
pub(super) fn with_metadata(
    bytes: &[u8],
    (width_px, height_px): (u32, u32),
    alpha: u8,
    metadata: &Metadata,
) -> Vec<u8> {
    let mut extended = vec![HAS_XMP | alpha, 0, 0, 0];
    extended.extend(&(width_px - 1).to_le_bytes()[..3]);
    extended.extend(&(height_px - 1).to_le_bytes()[..3]);
    let mut body = b"WEBP".to_vec();
    push_chunk(&mut body, b"VP8X", &extended);
    body.extend(&bytes[HEADER_BYTES..]);
    push_chunk(&mut body, b"XMP ", packet(metadata).as_bytes());
    let mut file = Vec::with_capacity(body.len() + 8);
    push_chunk(&mut file, b"RIFF", &body);
    file
}

fn push_chunk(file: &mut Vec<u8>, name: &[u8; 4], payload: &[u8]) {
    file.extend(name);
    file.extend((payload.len() as u32).to_le_bytes());
    file.extend(payload);
    if payload.len() % 2 == 1 {
        file.push(0);
    }
}

/// The entries as XMP (ISO 16684-1).
fn packet(metadata: &Metadata) -> String {
    let items: String = metadata
        .iter()
        .map(|(keyword, text)| format!("<rdf:li>{}</rdf:li>", xml::escape(&format!("{keyword}={text}"))))
        .collect();
    format!(
        "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\
         <rdf:Description rdf:about=\"\" xmlns:smalti=\"urn:smalti:\"><smalti:metadata><rdf:Seq>{items}</rdf:Seq>\
         </smalti:metadata></rdf:Description></rdf:RDF></x:xmpmeta>"
    )
}

/// The metadata in a WebP file; empty if it has none of ours.
///
/// The packet lies behind the picture, so the chunks before it are skipped, not read.
pub(super) fn metadata(mut file: impl Read + Seek) -> io::Result<Metadata> {
    file.seek(SeekFrom::Start(HEADER_BYTES as u64))?;
    let mut header = [0; 8];
    while file.read_exact(&mut header).is_ok() {
        let [name @ .., a, b, c, d] = header;
        let payload_bytes = u64::from(u32::from_le_bytes([a, b, c, d]));
        if name == *b"XMP " {
            let mut packet = Vec::new();
            file.take(payload_bytes.min(XMP_BYTES_MAX)).read_to_end(&mut packet)?;
            let is_whole = packet.len() as u64 == payload_bytes;
            let packet = std::str::from_utf8(&packet).ok().filter(|_| is_whole);
            return Ok(packet.map(entries).unwrap_or_default());
        }
        file.seek(SeekFrom::Current((payload_bytes + payload_bytes % 2) as i64))?;
    }
    Ok(Metadata::new())
}

fn entries(packet: &str) -> Metadata {
    let Some(ours) = xml::contents(packet, "smalti:metadata").next() else { return Metadata::new() };
    xml::contents(ours, "rdf:li")
        .filter_map(|item| {
            let item = xml::unescape(item);
            let (keyword, text) = item.split_once('=')?;
            Some((keyword.to_owned(), text.to_owned()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn no_cut_or_changed_byte_leads_out_of_the_file() {
        let entries = vec![("smalti".to_owned(), "{\"a\":1}".to_owned())];
        let whole = with_metadata(b"RIFF\x10\0\0\0WEBPVP8L\x03\0\0\0abc\0", (1, 1), 0, &entries);
        assert_eq!(metadata(Cursor::new(&whole)).expect("memory can be read"), entries);
        for cut in 0..whole.len() {
            for value in 0..=255 {
                let mut damaged = whole.clone();
                damaged[cut] = value;
                metadata(Cursor::new(damaged)).expect("memory can be read");
            }
            // The last byte may be mere padding of the last chunk.
            let is_cut = cut < whole.len() - 1;
            let found = metadata(Cursor::new(&whole[..cut])).expect("memory can be read");
            assert!(!is_cut || found.is_empty(), "cut to {cut} of {} bytes", whole.len());
        }
    }
}
