//! How many pictures a file holds, and how large they say they are.

use image::ImageFormat;

use super::tiff_directories;

/// How many pictures a file of this format holds that follow each other, and what they are called.
pub(super) fn count(bytes: &[u8], format: ImageFormat) -> (usize, &'static str) {
    match format {
        ImageFormat::Gif => (in_gif(bytes).len(), "frames"),
        ImageFormat::Png => (in_png(bytes), "frames"),
        ImageFormat::WebP => (in_webp(bytes), "frames"),
        ImageFormat::Tiff => (in_tiff(bytes), "pages"),
        _ => (1, "frames"),
    }
}

/// Width and height in px of the largest frame, which in a GIF may be larger than the screen that it is shown on.
/// `None` in other formats, whose decoders refuse that.
pub(super) fn largest_px(bytes: &[u8], format: ImageFormat) -> Option<(u32, u32)> {
    let number = |place: usize| bytes.get(place..place + 2).map_or(0, |two| u32::from(two[0]) | u32::from(two[1]) << 8);
    let size_px = |place: usize| (number(place + 5), number(place + 7));
    let places = if format == ImageFormat::Gif { in_gif(bytes) } else { Vec::new() };
    places.into_iter().map(size_px).max_by_key(|&(width_px, height_px)| u64::from(width_px) * u64::from(height_px))
}

/// Where the frames of a GIF begin (GIF89a): every image descriptor is one.
fn in_gif(bytes: &[u8]) -> Vec<usize> {
    const TABLE: u8 = 0x80;
    let table_bytes = |flags: u8| if flags & TABLE == 0 { 0 } else { 6 << (flags & 7) };
    let byte = |place: usize| bytes.get(place).copied();
    // Blocks of data, each after its length, up to an empty one.
    let after_blocks = |mut place: usize| loop {
        match byte(place)? {
            0 => return Some(place + 1),
            length => place += 1 + usize::from(length),
        }
    };
    let mut frames = Vec::new();
    let mut place = 13 + byte(10).map_or(0, table_bytes);
    loop {
        let next = match byte(place) {
            Some(0x21) => after_blocks(place + 2),
            Some(0x2C) => {
                frames.push(place);
                byte(place + 9).and_then(|flags| after_blocks(place + 11 + table_bytes(flags)))
            }
            _ => None,
        };
        let Some(next) = next else { return frames };
        place = next;
    }
}

/// Frames of a PNG: what its chunk `acTL` says, 1 if it has none.
fn in_png(bytes: &[u8]) -> usize {
    let mut place = 8;
    while let Some(&[length @ .., a, b, c, d]) = bytes.get(place..).and_then(|rest| rest.first_chunk::<8>()) {
        let length = u32::from_be_bytes(length) as usize;
        match &[a, b, c, d] {
            b"acTL" => {
                let count = bytes.get(place + 8..).and_then(|rest| rest.first_chunk());
                return count.map_or(1, |&count| u32::from_be_bytes(count) as usize);
            }
            b"IDAT" | b"IEND" => return 1,
            _ => place = place.saturating_add(12).saturating_add(length),
        }
    }
    1
}

/// Frames of a WebP (RFC 9649): its chunks `ANMF`, 1 if it has none.
fn in_webp(bytes: &[u8]) -> usize {
    let (mut place, mut count) = (12, 0_usize);
    while let Some(&[a, b, c, d, length @ ..]) = bytes.get(place..).and_then(|rest| rest.first_chunk::<8>()) {
        count += usize::from([a, b, c, d] == *b"ANMF");
        let length = u32::from_le_bytes(length) as usize;
        place = place.saturating_add(8).saturating_add(length).saturating_add(length % 2);
    }
    count.max(1)
}

/// Pages of a TIFF: its directories, without smaller versions and masks.
fn in_tiff(bytes: &[u8]) -> usize {
    tiff_directories::directories(bytes).iter().filter(|directory| !directory.is_beside()).count()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn photo(name: &str) -> Vec<u8> {
        std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos").join(name)).expect("it is there")
    }

    #[test]
    fn frames_and_pages_are_counted_in_every_format_that_has_them() {
        for (name, format, expected) in [
            ("two_frames.gif", ImageFormat::Gif, (2, "frames")),
            ("animated.png", ImageFormat::Png, (3, "frames")),
            ("animated.webp", ImageFormat::WebP, (3, "frames")),
            ("rgb.tif", ImageFormat::Tiff, (1, "pages")),
            ("rgb.png", ImageFormat::Png, (1, "frames")),
            ("lossy.webp", ImageFormat::WebP, (1, "frames")),
            ("plain.jpg", ImageFormat::Jpeg, (1, "frames")),
        ] {
            assert_eq!(count(&photo(name), format), expected, "{name}");
        }
    }

    #[test]
    fn the_largest_frame_of_a_gif_is_found_wherever_it_is() {
        let mut gif = photo("two_frames.gif");
        assert_eq!(largest_px(&gif, ImageFormat::Gif), Some((63, 48)));
        let last = *in_gif(&gif).last().expect("it has two");
        gif[last + 5..last + 9].copy_from_slice(&[0xAE, 0x42, 0x60, 0x82]);
        assert_eq!(largest_px(&gif, ImageFormat::Gif), Some((17_070, 33_376)));
        assert_eq!(largest_px(&photo("animated.png"), ImageFormat::Png), None);
    }

    #[test]
    fn no_cut_or_changed_byte_leads_out_of_the_file() {
        for (name, format) in [
            ("two_frames.gif", ImageFormat::Gif),
            ("animated.png", ImageFormat::Png),
            ("animated.webp", ImageFormat::WebP),
        ] {
            let whole = photo(name);
            for cut in 0..whole.len().min(400) {
                count(&whole[..cut], format);
                largest_px(&whole[..cut], format);
                for value in [0, 1, 0x21, 0x2C, 0x80, 0xFF] {
                    let mut damaged = whole.clone();
                    damaged[cut] = value;
                    count(&damaged, format);
                }
            }
        }
    }
}
