//! Reading pictures: the same pixels always, and one sentence for whatever cannot be read.

use std::fs;
use std::path::Path;

use smalti::Error;
use smalti::photo::{Background, CutShort, Photo, ReadOptions, encode_png, read};

use super::{load, load_with, noise, photo_path, short_hash};

const GREEN: ReadOptions =
    ReadOptions { background: Background::Color(GREEN_COLOR), long_side_px: None, cut_short: CutShort::Refuse };
const GREEN_COLOR: [u8; 3] = [10, 200, 30];

/// Name, width, height, and hash of the pixels over [`GREEN`].
const DECODED: [(&str, u32, u32, &str); 20] = [
    ("parrots.png", 512, 512, "393efda4d4d92129"),
    ("rgb.png", 63, 48, "24fbfb3e338868e1"),
    ("grey.png", 63, 48, "69099796d1f11faa"),
    ("grey_16_bit.png", 63, 48, "82bd97703d8cbb2a"),
    ("palette.png", 63, 48, "f49a1f368291202e"),
    ("alpha.png", 63, 48, "ffb179133cf64038"),
    ("wide_rgb.png", 63, 48, "d74a08f73146de6a"),
    ("broken_profile.png", 63, 48, "24fbfb3e338868e1"),
    ("linear_grey.png", 63, 48, "5077669e731d040d"),
    ("plain.jpg", 63, 48, "caf85f224980b27b"),
    ("progressive.jpg", 63, 48, "caf85f224980b27b"),
    ("turned.jpg", 48, 63, "f984d94cf54dca23"),
    ("wide_rgb.jpg", 63, 48, "e8812f9efe6a8b51"),
    ("cmyk.jpg", 63, 48, "72028082001e0e7e"),
    ("lossy.webp", 63, 48, "7af844b53d95e4a0"),
    ("lossless.webp", 63, 48, "24fbfb3e338868e1"),
    ("rgb.tif", 63, 48, "24fbfb3e338868e1"),
    ("float.tif", 63, 48, "24fbfb3e338868e1"),
    ("rgb.bmp", 63, 48, "24fbfb3e338868e1"),
    ("two_frames.gif", 63, 48, "327a68566f6374c1"),
];

#[test]
fn every_picture_decodes_to_the_pixels_it_always_had() {
    let found = DECODED.map(|(name, ..)| {
        let photo = load_with(name, &GREEN).photo;
        (name, photo.width_px, photo.height_px, short_hash(photo.pixels.as_flattened()))
    });
    let expected = DECODED.map(|(name, width_px, height_px, hash)| (name, width_px, height_px, hash.to_owned()));
    assert_eq!(found, expected);
}

#[test]
fn reduced_pictures_have_the_pixels_they_always_had() {
    let cases = [
        ("parrots.png", 256, "98458b1bbc0a55fc"),
        ("parrots.png", 101, "cc6884b3f1484078"),
        ("turned.jpg", 37, "989fb7d43feb6bbc"),
    ];
    for (name, long_side_px, hash) in cases {
        let photo = load_with(name, &ReadOptions { long_side_px: Some(long_side_px), ..GREEN }).photo;
        assert_eq!(photo.width_px.max(photo.height_px), long_side_px);
        assert_eq!(short_hash(photo.pixels.as_flattened()), hash, "{name} at {long_side_px} px");
    }
}

#[test]
fn lossless_formats_hold_the_same_pixels() {
    let expected = load("rgb.png");
    for name in ["rgb.bmp", "rgb.tif", "lossless.webp", "float.tif", "rgb.jxl"] {
        assert_eq!(load(name), expected, "{name}");
    }
}

#[test]
fn jpeg_xl_holds_the_pixels_of_what_it_was_made_of() {
    for name in ["alpha", "grey_16_bit", "animated"] {
        let [of_png, of_jxl] = [".png", ".jxl"].map(|ending| load_with(&format!("{name}{ending}"), &GREEN).photo);
        assert_eq!(of_jxl, of_png, "{name}");
    }
    let transparent = ReadOptions { background: Background::Transparent, ..GREEN };
    let [of_png, of_jxl] = ["alpha.png", "alpha.jxl"].map(|name| load_with(name, &transparent));
    assert_eq!((of_jxl.photo, of_jxl.transparent), (of_png.photo, of_png.transparent));
    // A profile of its own, and a JPEG that is packed anew and turned on its side.
    for name in ["wide_rgb.png", "turned.jpg"] {
        let packed = format!("{}.jxl", name.split('.').next().unwrap_or_default());
        let difference = mean_difference(&load(&packed), &load(name));
        assert!(difference < 1.0, "{name} is off by {difference}");
    }
    assert_eq!(load_with("animated.jxl", &GREEN).warnings, ["the first frame of an animation is read"]);
}

/// Mean absolute difference of the channels.
fn mean_difference(a: &Photo, b: &Photo) -> f64 {
    assert_eq!((a.width_px, a.height_px), (b.width_px, b.height_px));
    let (a, b) = (a.pixels.as_flattened(), b.pixels.as_flattened());
    let sum: u64 = a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.len() as f64
}

#[test]
fn lossy_formats_hold_nearly_the_same_pixels() {
    let expected = load("rgb.png");
    for (name, most) in [
        ("plain.jpg", 7.0),
        ("progressive.jpg", 7.0),
        ("cmyk.jpg", 4.0),
        ("lossy.webp", 7.0),
        ("lossy.jxl", 7.0),
        ("palette.png", 12.0),
    ] {
        let difference = mean_difference(&load(name), &expected);
        assert!(difference < most, "{name} is off by {difference}");
    }
}

#[test]
fn the_first_frame_of_an_animation_is_read() {
    let expected = load("rgb.png");
    let turned = Photo { pixels: expected.pixels.iter().rev().copied().collect(), ..expected.clone() };
    let found = load("two_frames.gif");
    assert!(mean_difference(&found, &expected) < 12.0);
    assert!(mean_difference(&found, &turned) > 100.0);
}

#[test]
fn exif_orientation_turns_the_picture_upright() {
    let stored = load("plain.jpg");
    let upright = load("turned.jpg");
    for y in 0..upright.height_px {
        for x in 0..upright.width_px {
            let from = (stored.height_px - 1 - x) * stored.width_px + y;
            assert_eq!(upright.pixels[(y * upright.width_px + x) as usize], stored.pixels[from as usize], "({x}, {y})");
        }
    }
}

#[test]
fn the_original_size_is_that_of_the_upright_picture_and_the_hash_that_of_the_file() {
    let loaded = load_with("turned.jpg", &ReadOptions { long_side_px: Some(21), ..GREEN });
    assert_eq!((loaded.photo.width_px, loaded.photo.height_px), (16, 21));
    assert_eq!((loaded.original_width_px, loaded.original_height_px), (48, 63));
    assert_eq!(loaded.sha256.len(), 64);
    assert!(loaded.sha256.starts_with(&short_hash(&fs::read(photo_path("turned.jpg")).expect("it is there"))));
}

#[test]
fn transparency_shows_the_background() {
    let opaque = load("rgb.png");
    let found = load_with("alpha.png", &GREEN).photo;
    for (index, (&over, &front)) in found.pixels.iter().zip(&opaque.pixels).enumerate() {
        let (x, y) = (index as u32 % opaque.width_px, index as u32 / opaque.width_px);
        let alpha = (x * 7 + y * 3) % 256;
        let expected: [u8; 3] = std::array::from_fn(|i| {
            ((u32::from(front[i]) * alpha + u32::from(GREEN_COLOR[i]) * (255 - alpha) + 127) / 255) as u8
        });
        assert_eq!(over, expected, "({x}, {y})");
    }
}

#[test]
fn sixteen_bits_are_rounded_to_eight() {
    let sixteen = load("grey_16_bit.png");
    let eight = load("rgb.png");
    for (index, (found, expected)) in sixteen.pixels.iter().zip(&eight.pixels).enumerate() {
        assert_eq!(*found, [expected[0]; 3], "pixel {index} is the red channel");
    }
}

#[test]
fn profiles_are_applied() {
    let tagged = load("wide_rgb.png");
    let untagged = load("rgb.png");
    // Yellow of a wide profile lies outside sRGB: red is clipped and blue falls.
    let disc = (18 * untagged.width_px + 22) as usize;
    assert!(tagged.pixels[disc][2] < untagged.pixels[disc][2], "{:?}", tagged.pixels[disc]);
    assert!(mean_difference(&tagged, &untagged) > 3.0);
    // Linear middle grey is brighter in sRGB.
    let (linear, grey) = (load("linear_grey.png"), load("grey.png"));
    let middle = grey.pixels.iter().position(|pixel| pixel[0] == 128).expect("the ramp passes the middle");
    assert_eq!(linear.pixels[middle], [188; 3]);
}

#[test]
fn a_broken_profile_is_ignored_with_a_warning() {
    let loaded = load_with("broken_profile.png", &ReadOptions::default());
    assert_eq!(loaded.photo, load("rgb.png"));
    assert!(
        matches!(&loaded.warnings[..], [warning] if warning.contains("ICC profile is ignored")),
        "{:?}",
        loaded.warnings
    );
    assert!(load_with("wide_rgb.png", &ReadOptions::default()).warnings.is_empty());
}

#[test]
fn a_reduced_picture_is_within_rounding_of_lanczos_in_double_precision() {
    let sizes = [(403, 301, 150), (301, 403, 37), (512, 512, 256), (1000, 3, 333), (7, 9, 5)];
    for (width_px, height_px, long_side_px) in sizes {
        let source = Photo {
            width_px,
            height_px,
            pixels: noise((width_px * height_px * 3) as usize).as_chunks::<3>().0.to_vec(),
        };
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        fs::write(file.path(), encode_png(&source, &vec![]).expect("noise can be encoded")).expect("it can be written");
        let found = read(file.path(), &ReadOptions { long_side_px: Some(long_side_px), ..GREEN }).expect("ours").photo;
        let expected = lanczos_in_double_precision(&source, found.width_px, found.height_px);
        let differences = found.pixels.as_flattened().iter().zip(expected).map(|(&a, b)| (f64::from(a) - b).abs());
        let worst = differences.fold(0.0, f64::max);
        assert!(worst < 0.51, "{width_px}x{height_px} at {long_side_px} px: off by {worst}");
    }
}

/// Channels of the reduced picture before rounding, straight from the definition of the filter.
fn lanczos_in_double_precision(photo: &Photo, width_px: u32, height_px: u32) -> Vec<f64> {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (x * std::f64::consts::PI).sin() / (x * std::f64::consts::PI) };
    let kernel = |x: f64| if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 };
    let weights = |from: u32, to: u32, place: u32| -> Vec<f64> {
        let scale = f64::from(from) / f64::from(to);
        let centre = (f64::from(place) + 0.5) * scale;
        let raw: Vec<f64> = (0..from).map(|i| kernel((f64::from(i) + 0.5 - centre) / scale)).collect();
        let sum: f64 = raw.iter().sum();
        raw.iter().map(|weight| weight / sum).collect()
    };
    let width = photo.width_px as usize;
    let mut rows = Vec::new();
    for row in photo.pixels.chunks_exact(width) {
        for column in 0..width_px {
            let weights = weights(photo.width_px, width_px, column);
            let sum =
                |channel| row.iter().zip(&weights).map(|(pixel, w): (&[u8; 3], _)| f64::from(pixel[channel]) * w).sum();
            rows.push([0, 1, 2].map(|channel: usize| -> f64 { sum(channel) }));
        }
    }
    let mut channels = Vec::new();
    for row in 0..height_px {
        let weights = weights(photo.height_px, height_px, row);
        for column in 0..width_px as usize {
            let pixels = rows.iter().skip(column).step_by(width_px as usize);
            let sum = |channel: usize| pixels.clone().zip(&weights).map(|(pixel, w)| pixel[channel] * w).sum::<f64>();
            channels.extend([0, 1, 2].map(|channel| sum(channel).clamp(0.0, 255.0)));
        }
    }
    channels
}

/// The message of the refusal to read `bytes`.
fn refusal(bytes: &[u8]) -> String {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    fs::write(file.path(), bytes).expect("it can be written");
    refusal_at(file.path())
}

fn refusal_at(path: &Path) -> String {
    match read(path, &ReadOptions::default()) {
        Err(Error::Input { path: named, reason }) => {
            assert_eq!(named, path);
            reason
        }
        Err(other) => panic!("{other} is no input error"),
        Ok(_) => panic!("{} should have been refused", path.display()),
    }
}

#[test]
fn a_picture_cut_short_is_refused_in_every_format() {
    for (name, ..) in DECODED {
        let whole = fs::read(photo_path(name)).expect("it is there");
        // The second half of the GIF is its second frame, which is not read.
        let cuts = if name.ends_with(".gif") { vec![3, 4] } else { vec![3, 5, 9] };
        for cut in cuts.into_iter().map(|tenths| whole.len() * tenths / 10) {
            let message = refusal(&whole[..cut]);
            assert!(message.contains("broken or cut short"), "{name} cut at {cut}: {message}");
        }
    }
}

#[test]
fn a_jpeg_is_refused_wherever_it_is_cut() {
    for name in ["plain.jpg", "progressive.jpg"] {
        let whole = fs::read(photo_path(name)).expect("it is there");
        // Without the last two bytes, its end marker, it has all of its pixels.
        for cut in 64..whole.len() - 2 {
            refusal(&whole[..cut]);
        }
    }
}

#[test]
fn damaged_bytes_never_bring_the_reader_down() {
    for (name, ..) in &DECODED[1..] {
        let whole = fs::read(photo_path(name)).expect("it is there");
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        for (index, place) in noise(60).as_chunks::<3>().0.iter().enumerate() {
            let mut damaged = whole.clone();
            let offset = usize::from(u16::from_be_bytes([place[0], place[1]])) % whole.len().min(300 << (index % 8));
            damaged[offset] ^= place[2] | 1;
            fs::write(file.path(), damaged).expect("it can be written");
            // Either answer is right: some bytes do not matter.
            let _ = read(file.path(), &ReadOptions::default());
        }
    }
}

#[test]
fn what_is_no_picture_is_refused_with_the_formats_that_are_read() {
    for bytes in [&b"hello"[..], b"#!/bin/sh"] {
        assert_eq!(refusal(bytes), "not a picture that can be read; PNG, JPEG, JPEG XL, WebP, TIFF, BMP and GIF can");
    }
    assert_eq!(refusal(b""), "the file is empty (0 bytes); get it again");
}

#[test]
fn what_cannot_be_opened_is_refused_with_the_reason() {
    assert_eq!(refusal_at(Path::new("/no/such/picture.png")), "there is no such file; check its name");
    assert_eq!(refusal_at(&photo_path("")), "is a folder; name a file in it");
}

#[cfg(unix)]
#[test]
fn a_file_without_end_is_not_read_to_its_end() {
    assert!(refusal_at(Path::new("/dev/zero")).starts_with("not a picture"));
}

/// A PNG that claims to be this large.
fn png_of_size(width_px: u32, height_px: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = png::Encoder::new(&mut bytes, width_px, height_px).write_header().expect("a header");
    writer.write_chunk(png::chunk::IDAT, b"nothing").expect("a chunk");
    drop(writer);
    bytes
}

#[test]
fn pictures_beyond_the_limits_are_refused_by_their_header() {
    for (width_px, height_px) in [(65_536, 1), (1, 65_536), (20_000, 20_000), (u32::MAX >> 1, u32::MAX >> 1)] {
        let message = refusal(&png_of_size(width_px, height_px));
        let size =
            format!("the picture has {width_px}x{height_px} px, more than the 65535 px a side or 268435456 px in all");
        assert!(message.starts_with(&size), "{message}");
    }
}

#[test]
fn a_picture_without_pixels_is_refused() {
    let gif = b"GIF89a\0\0\0\0\0\0\0\x2C\0\0\0\0\0\0\0\0\0\x02\0\x3B";
    assert!(refusal(gif).contains("no pixels (0x0)"), "{}", refusal(gif));
}
