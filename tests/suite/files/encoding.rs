//! Writing pictures and their metadata.

use std::fs;
use std::path::Path;

use smalti::photo::{
    Format, Metadata, Photo, ReadOptions, encode, encode_jpeg, encode_png, encode_with_alpha, read, read_jpeg_metadata,
    read_metadata, read_png_metadata,
};

use super::{load, photo_path, short_hash};

const JPEG: Format = Format::Jpeg { quality: 90 };

fn metadata(entries: &[(&str, &str)]) -> Metadata {
    entries.iter().map(|&(keyword, text)| (keyword.to_owned(), text.to_owned())).collect()
}

/// Calls `look` with the path of a file that holds `bytes`.
fn with_file<T>(bytes: &[u8], look: impl FnOnce(&Path) -> T) -> T {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    fs::write(file.path(), bytes).expect("it can be written");
    look(file.path())
}

fn decoded(bytes: &[u8]) -> Photo {
    with_file(bytes, |path| read(path, &ReadOptions::default())).expect("we read what we write").photo
}

#[test]
fn a_png_holds_the_pixels_and_always_the_same_bytes() {
    let photo = load("parrots.png");
    let bytes = encode_png(&photo, &metadata(&[("smalti", "seed 7")])).expect("it can be encoded");
    assert!(decoded(&bytes) == photo);
    assert_eq!(short_hash(&bytes), "0669a096d9fcc673");
}

#[test]
fn a_jpeg_holds_nearly_the_pixels_and_always_the_same_bytes() {
    let photo = load("rgb.png");
    let bytes = encode_jpeg(&photo, 95, &metadata(&[("smalti", "seed 7")])).expect("it can be encoded");
    let found = decoded(&bytes);
    let pairs = found.pixels.as_flattened().iter().zip(photo.pixels.as_flattened());
    let sum: u32 = pairs.map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
    assert!(sum < 3 * photo.pixels.len() as u32 * 3, "off by {sum} in all");
    assert_eq!(short_hash(&bytes), "c8626fb1cb8015cd");
}

#[test]
fn a_jpeg_has_no_colour_subsampling() {
    let bytes = encode(JPEG, &load("rgb.png"), &vec![]).expect("it can be encoded");
    let frame = bytes.windows(2).position(|pair| pair == [0xFF, 0xC0]).expect("a baseline frame");
    let sampling = [11, 14, 17].map(|offset| bytes[frame + offset]);
    assert_eq!(sampling, [0x11; 3]);
}

#[test]
fn a_png_says_that_it_is_srgb() {
    let bytes = encode(Format::Png, &load("rgb.png"), &vec![]).expect("it can be encoded");
    assert!(bytes.windows(4).any(|chunk| chunk == b"sRGB"));
}

#[test]
fn metadata_comes_back_in_order_from_every_format() {
    let photo = load("rgb.png");
    for entries in [
        metadata(&[]),
        metadata(&[("smalti key", "a=b, c"), ("Author", ""), ("Comment", "two\nlines")]),
        metadata(&[("one", "plain"), ("two", "Grüße, 馬賽克"), ("three", "plain again")]),
    ] {
        let png = encode(Format::Png, &photo, &entries).expect("it can be encoded");
        assert_eq!(with_file(&png, read_metadata).expect("it can be read"), entries);
        assert_eq!(with_file(&png, read_png_metadata).expect("it can be read"), entries);
        assert!(with_file(&png, read_jpeg_metadata).expect("it can be read").is_empty());
        let jpeg = encode(JPEG, &photo, &entries).expect("it can be encoded");
        assert_eq!(with_file(&jpeg, read_metadata).expect("it can be read"), entries);
        assert_eq!(with_file(&jpeg, read_jpeg_metadata).expect("it can be read"), entries);
        let webp = encode(Format::WebP, &photo, &entries).expect("it can be encoded");
        assert_eq!(with_file(&webp, read_metadata).expect("it can be read"), entries);
        assert!(with_file(&jpeg, read_png_metadata).expect("it can be read").is_empty());
    }
}

#[test]
fn metadata_changes_no_pixel() {
    let photo = load("rgb.png");
    let long = metadata(&[("key", &"x".repeat(65_000))]);
    for format in [Format::Png, JPEG, Format::WebP] {
        let bare = encode(format, &photo, &vec![]).expect("it can be encoded");
        let tagged = encode(format, &photo, &long).expect("it can be encoded");
        assert_eq!(decoded(&bare), decoded(&tagged), "{format:?}");
    }
}

#[test]
fn metadata_that_would_not_come_back_is_refused() {
    let photo = load("rgb.png");
    let long = "x".repeat(65_533);
    for (keyword, text) in
        [("", "a"), ("a=b", "c"), (" a", "b"), ("é", "b"), (&long[..80], "b"), ("a", "b\0c"), ("a", &long)]
    {
        for format in [Format::Png, JPEG, Format::WebP] {
            assert!(encode(format, &photo, &metadata(&[(keyword, text)])).is_err(), "{format:?} {keyword:?}");
        }
    }
}

#[test]
fn a_foreign_file_has_no_metadata_of_ours() {
    for name in ["plain.jpg", "rgb.png", "rgb.bmp", "make.py"] {
        assert_eq!(read_metadata(&photo_path(name)).expect("it can be read"), vec![], "{name}");
    }
    assert!(read_metadata(Path::new("/no/such/file.png")).is_err());
}

#[test]
fn what_cannot_be_encoded_is_refused() {
    let empty = Photo { width_px: 0, height_px: 0, pixels: vec![] };
    let wide = Photo { width_px: 65_536, height_px: 1, pixels: vec![[0; 3]; 65_536] };
    assert!(encode(Format::Png, &empty, &vec![]).is_err());
    assert!(encode(JPEG, &empty, &vec![]).is_err());
    assert!(encode(JPEG, &wide, &vec![]).is_err());
    assert!(encode(Format::WebP, &empty, &vec![]).is_err());
    assert!(encode(Format::WebP, &wide, &vec![]).is_err());
    assert!(encode(Format::Jpeg { quality: 0 }, &load("rgb.png"), &vec![]).is_err());
    assert!(encode(Format::Jpeg { quality: 101 }, &load("rgb.png"), &vec![]).is_err());
}

#[test]
fn a_webp_loses_no_pixel_whatever_its_size() {
    let whole = load("rgb.png");
    assert_eq!(decoded(&encode(Format::WebP, &whole, &metadata(&[("a", "b")])).expect("it can be encoded")), whole);
    for (width_px, height_px) in [(1, 1), (3, 2), (16_383, 1)] {
        let pixels = super::noise((width_px * height_px * 3) as usize).as_chunks::<3>().0.to_vec();
        let photo = Photo { width_px, height_px, pixels };
        for entries in [vec![], metadata(&[("odd", "abc"), ("even", "ab")])] {
            assert_eq!(decoded(&encode(Format::WebP, &photo, &entries).expect("it can be encoded")), photo);
        }
    }
}

#[test]
fn pixels_with_alpha_come_back_as_they_were() {
    let pixels = super::noise(5 * 7 * 4).as_chunks::<4>().0.to_vec();
    let png = smalti::photo::encode_png_with_alpha(5, 7, &pixels, &vec![]).expect("it can be encoded");
    let decoded = image::load_from_memory(&png).expect("it can be decoded").to_rgba8();
    assert_eq!((decoded.dimensions(), decoded.as_raw().as_slice()), ((5, 7), pixels.as_flattened()));
    assert!(smalti::photo::encode_png_with_alpha(5, 6, &pixels, &vec![]).is_err());
}

#[test]
fn pictures_with_alpha_keep_it_and_their_metadata_and_a_jpeg_shows_them_over_black() {
    let photo = load("rgb.png");
    let alpha: Vec<u8> = (0..photo.pixels.len()).map(|index| (index * 7) as u8).collect();
    let metadata = metadata(&[("smalti", "seed 7")]);
    let pixels = photo.pixels.iter().zip(&alpha).flat_map(|(&[r, g, b], &a)| [r, g, b, a]);
    let pixels: Vec<u8> = pixels.collect();
    for format in [Format::Png, Format::WebP] {
        let bytes = encode_with_alpha(format, &photo, Some(&alpha), &metadata).expect("it can be encoded");
        let found = image::load_from_memory(&bytes).expect("it is a picture");
        assert!(found.color().has_alpha() && found.to_rgba8().as_raw() == &pixels, "{format:?}");
        assert_eq!(with_file(&bytes, read_metadata).expect("it can be read"), metadata, "{format:?}");
        let opaque = encode_with_alpha(format, &photo, None, &metadata).expect("it can be encoded");
        assert_eq!(opaque, encode(format, &photo, &metadata).expect("it can be encoded"), "{format:?}");
        assert!(encode_with_alpha(format, &photo, Some(&alpha[1..]), &metadata).is_err(), "{format:?}");
    }
    let over_black = |(color, &a): (&[u8; 3], &u8)| color.map(|c| ((u32::from(c) * u32::from(a) + 127) / 255) as u8);
    let over_black = Photo { pixels: photo.pixels.iter().zip(&alpha).map(over_black).collect(), ..photo };
    let found = encode_with_alpha(JPEG, &photo, Some(&alpha), &metadata).expect("it can be encoded");
    assert_eq!(found, encode(JPEG, &over_black, &metadata).expect("it can be encoded"));
}
