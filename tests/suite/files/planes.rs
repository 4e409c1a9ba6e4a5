//! What pictures tell besides colours: where they are transparent, and maps of where they matter.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageFormat, RgbaImage};
use smalti::Error;
use smalti::photo::{Background, CutShort, Loaded, ReadOptions, read, read_weights};

use super::{load, load_with, noise, photo_path, short_hash};

const CUT: ReadOptions =
    ReadOptions { background: Background::Transparent, long_side_px: None, cut_short: CutShort::Refuse };

fn with_file<T>(bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    fs::write(file.path(), bytes).expect("it can be written");
    read(file.path())
}

fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Vec::new();
    image.write_to(&mut Cursor::new(&mut bytes), format).expect("the picture can be encoded");
    bytes
}

fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
    encoded(&image.into(), ImageFormat::Png)
}

fn cut_from(bytes: &[u8], long_side_px: Option<u32>) -> Loaded {
    with_file(bytes, |path| read(path, &ReadOptions { long_side_px, ..CUT })).expect("the picture can be read")
}

/// Noise with every alpha.
fn noisy(width_px: u32, height_px: u32) -> RgbaImage {
    RgbaImage::from_raw(width_px, height_px, noise((width_px * height_px * 4) as usize)).expect("the size fits")
}

/// The colours and the transparency that a picture of 8-bit channels must have at its own size.
fn expected(image: &RgbaImage) -> (Vec<[u8; 3]>, Vec<bool>) {
    let pixel = |&image::Rgba([r, g, b, alpha]): &image::Rgba<u8>| {
        let color = if alpha < 128 { [0; 3] } else { [r, g, b] };
        (color, alpha < 128)
    };
    image.pixels().map(pixel).unzip()
}

#[test]
fn pixels_of_less_than_half_alpha_are_transparent_and_the_others_keep_their_colour_in_every_format() {
    let rgba = DynamicImage::from(noisy(31, 17));
    let grey = DynamicImage::from(rgba.to_luma_alpha8());
    let same = |image: &DynamicImage, formats: &[ImageFormat]| {
        let (pixels, transparent) = expected(&image.to_rgba8());
        for &format in formats {
            let found = cut_from(&encoded(image, format), None);
            assert_eq!((found.photo.width_px, found.photo.height_px), (31, 17));
            assert_eq!(found.photo.pixels, pixels, "{format:?} of {:?}", image.color());
            assert_eq!(found.transparent.as_ref(), Some(&transparent), "{format:?} of {:?}", image.color());
        }
    };
    same(&rgba, &[ImageFormat::Png, ImageFormat::WebP, ImageFormat::Tiff]);
    same(&DynamicImage::from(rgba.to_rgba16()), &[ImageFormat::Png, ImageFormat::Tiff]);
    same(&grey, &[ImageFormat::Png]);
    same(&DynamicImage::from(grey.to_luma_alpha16()), &[ImageFormat::Png]);
}

#[test]
fn the_alpha_of_16_bits_is_rounded_to_the_nearest_of_8() {
    let alphas = [0, 32_767, 32_768, 65_535];
    let samples: Vec<u16> = alphas.into_iter().flat_map(|alpha| [65_535, 65_535, 65_535, alpha]).collect();
    let image = image::ImageBuffer::<image::Rgba<u16>, _>::from_raw(4, 1, samples).expect("four pixels");
    let found = cut_from(&png(image), None);
    assert_eq!(found.transparent, Some(vec![true, true, false, false]));
    assert_eq!(found.photo.pixels, [[0; 3], [0; 3], [255; 3], [255; 3]]);
}

/// A PNG of 3x1 px: of a palette of three colours whose alphas are 0, 200 and 255, or of one grey that is transparent.
fn png_with_trns(color: png::ColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 3, 1);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    if color == png::ColorType::Indexed {
        encoder.set_palette(&[255, 0, 0, 0, 255, 0, 0, 0, 255][..]);
        encoder.set_trns(&[0, 200][..]);
    } else {
        encoder.set_trns(&[0, 0][..]);
    }
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&[0, 1, 2]).expect("three pixels");
    writer.finish().expect("the end");
    bytes
}

#[test]
fn the_transparency_of_a_palette_and_of_one_colour_is_kept() {
    let palette = cut_from(&png_with_trns(png::ColorType::Indexed), None);
    assert_eq!(palette.transparent, Some(vec![true, false, false]));
    assert_eq!(palette.photo.pixels, [[0, 0, 0], [0, 255, 0], [0, 0, 255]]);
    let grey = cut_from(&png_with_trns(png::ColorType::Grayscale), None);
    assert_eq!(grey.transparent, Some(vec![true, false, false]));
    assert_eq!(grey.photo.pixels, [[0; 3], [1; 3], [2; 3]]);
}

#[test]
fn exif_orientation_turns_the_transparency_with_the_picture() {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 3, 1);
    encoder.set_color(png::ColorType::Rgba);
    let mut writer = encoder.write_header().expect("a header");
    // One entry, of orientation 3: the upright picture is this one turned by half.
    let exif = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0";
    writer.write_chunk(png::chunk::eXIf, exif).expect("a chunk");
    writer.write_image_data(&[9, 9, 9, 0, 8, 8, 8, 255, 7, 7, 7, 255]).expect("three pixels");
    writer.finish().expect("the end");
    let found = cut_from(&bytes, None);
    assert_eq!(found.photo.pixels, [[7; 3], [8; 3], [0; 3]]);
    assert_eq!(found.transparent, Some(vec![false, false, true]));
}

#[test]
fn what_is_transparent_gives_its_neighbours_no_colour_when_the_picture_is_reduced() {
    let disc = |x: u32, y: u32| (f64::from(x) - 60.0).hypot(f64::from(y) - 40.0) < 33.3;
    for hidden in [[0, 255, 0], [0, 0, 0], [255, 255, 255]] {
        let [r, g, b] = hidden;
        let pixel = |x, y| image::Rgba(if disc(x, y) { [240, 30, 20, 255] } else { [r, g, b, 0] });
        let bytes = png(RgbaImage::from_fn(120, 90, pixel));
        for long_side_px in [101, 60, 37, 8] {
            let Loaded { photo, transparent, .. } = cut_from(&bytes, Some(long_side_px));
            let transparent = transparent.expect("the corners are");
            assert!(transparent.contains(&false));
            for (index, (&color, &is_transparent)) in photo.pixels.iter().zip(&transparent).enumerate() {
                let wanted = if is_transparent { [0; 3] } else { [240, 30, 20] };
                assert_eq!(color, wanted, "pixel {index} at {long_side_px} px, {hidden:?} hidden");
            }
        }
    }
}

#[test]
fn a_soft_edge_has_the_colour_of_what_it_is_the_edge_of_at_every_size() {
    let color = [240, 30, 20];
    let pixel = |x: u32, y: u32| {
        let from_center = (f64::from(x) - 60.0).hypot(f64::from(y) - 40.0);
        let [r, g, b] = color;
        image::Rgba([r, g, b, ((36.0 - from_center) * 40.0).clamp(0.0, 255.0) as u8])
    };
    let logo = RgbaImage::from_fn(120, 90, pixel);
    assert!(logo.pixels().filter(|pixel| (128..255).contains(&pixel.0[3])).count() > 300);
    let bytes = png(logo.clone());
    for long_side_px in [None, Some(101), Some(60), Some(37), Some(8)] {
        let found = cut_from(&bytes, long_side_px);
        let transparent = found.transparent.as_ref().expect("the corners are");
        for (index, (&found, &is_transparent)) in found.photo.pixels.iter().zip(transparent).enumerate() {
            let wanted = if is_transparent { [0; 3] } else { color };
            assert_eq!(found, wanted, "pixel {index} at {long_side_px:?} px");
        }
    }
    // A background that was asked for still shows through.
    let over = ReadOptions { background: Background::Color([0, 0, 255]), ..ReadOptions::default() };
    let flat = with_file(&bytes, |path| read(path, &over)).expect("the picture can be read");
    let mixed = flat.photo.pixels.iter().zip(logo.pixels()).filter(|(_, stored)| (1..255).contains(&stored.0[3]));
    for ([r, _, b], stored) in mixed {
        let alpha = u32::from(stored.0[3]);
        assert_eq!(u32::from(*r), (240 * alpha + 127) / 255);
        assert_eq!(u32::from(*b), (20 * alpha + 255 * (255 - alpha) + 127) / 255);
    }
}

#[test]
fn pixels_in_memory_and_the_same_pixels_in_a_file_are_read_alike() {
    let image = noisy(40, 30);
    let bytes = png(image.clone());
    for long_side_px in [None, Some(17)] {
        let of_file = cut_from(&bytes, long_side_px);
        let decoded = smalti::photo::Decoded::from_pixels(40, 30, 4, image.as_raw()).expect("so many pixels");
        let of_memory = decoded.fitted(&ReadOptions { long_side_px, ..CUT });
        assert_eq!((of_memory.photo, of_memory.transparent), (of_file.photo, of_file.transparent));
    }
}

#[test]
fn an_opaque_picture_is_read_alike_with_and_without_transparency() {
    let mut with_channel = noisy(61, 40);
    with_channel.pixels_mut().for_each(|pixel| pixel.0[3] = 255);
    let bytes = png(with_channel);
    for long_side_px in [None, Some(61), Some(23)] {
        let over_black = ReadOptions { long_side_px, ..ReadOptions::default() };
        let expected = with_file(&bytes, |path| read(path, &over_black)).expect("the picture can be read");
        assert_eq!(expected.transparent, None);
        assert_eq!(cut_from(&bytes, long_side_px), expected);
        for name in ["rgb.png", "plain.jpg", "linear_grey.png", "float.tif"] {
            assert_eq!(load_with(name, &ReadOptions { long_side_px, ..CUT }), load_with(name, &over_black), "{name}");
        }
    }
}

#[test]
fn over_a_colour_nothing_is_transparent() {
    let background = Background::Color([0, 255, 0]);
    let green = ReadOptions { background, long_side_px: Some(20), ..ReadOptions::default() };
    assert_eq!(load_with("alpha.png", &green).transparent, None);
}

#[test]
fn a_cut_picture_has_the_pixels_it_always_had() {
    let found = [None, Some(37)].map(|long_side_px| {
        let Loaded { photo, transparent, .. } = load_with("alpha.png", &ReadOptions { long_side_px, ..CUT });
        let transparent: Vec<u8> = transparent.expect("half of it is").into_iter().map(u8::from).collect();
        (short_hash(photo.pixels.as_flattened()), short_hash(&transparent))
    });
    let expected = [("ea99a6ddf47c928f", "30957b4edafa0350"), ("a15d361a11e748d0", "57e1a67ad204153e")];
    assert_eq!(found, expected.map(|(pixels, transparent)| (pixels.to_owned(), transparent.to_owned())));
}

/// A plane at another size before rounding, straight from the definition of the filter.
fn lanczos_in_double_precision(plane: &[f64], from: (u32, u32), to: (u32, u32)) -> Vec<f64> {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (x * std::f64::consts::PI).sin() / (x * std::f64::consts::PI) };
    let kernel = |x: f64| if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 };
    let weights = |from: u32, to: u32, place: u32| -> Vec<f64> {
        let scale = f64::from(from) / f64::from(to);
        let centre = (f64::from(place) + 0.5) * scale;
        let raw: Vec<f64> = (0..from).map(|i| kernel((f64::from(i) + 0.5 - centre) / scale.max(1.0))).collect();
        let sum: f64 = raw.iter().sum();
        raw.iter().map(|weight| weight / sum).collect()
    };
    let sum = |weights: &[f64], values: &mut dyn Iterator<Item = f64>| -> f64 {
        weights.iter().zip(values).map(|(weight, value)| weight * value).sum()
    };
    let columns: Vec<Vec<f64>> = (0..to.0).map(|column| weights(from.0, to.0, column)).collect();
    let rows: Vec<Vec<f64>> = plane
        .chunks_exact(from.0 as usize)
        .map(|row| columns.iter().map(|weights| sum(weights, &mut row.iter().copied())).collect())
        .collect();
    let column_of = |column: usize| rows.iter().map(move |row| row[column]);
    (0..to.1)
        .flat_map(|row| {
            let weights = weights(from.1, to.1, row);
            (0..to.0 as usize).map(|column| sum(&weights, &mut column_of(column))).collect::<Vec<f64>>()
        })
        .collect()
}

#[test]
fn a_reduced_cut_picture_is_within_rounding_of_means_weighed_by_alpha_in_double_precision() {
    let (from, to) = ((93, 71), (40, 31));
    let mut image = noisy(from.0, from.1);
    // Noise alone averages to alphas around the threshold.
    image.enumerate_pixels_mut().filter(|(x, ..)| *x < 50).for_each(|(.., pixel)| pixel.0[3] |= 128);
    let found = cut_from(&png(image.clone()), Some(40));
    assert_eq!((found.photo.width_px, found.photo.height_px), to);
    let alphas: Vec<f64> = image.pixels().map(|pixel| f64::from(pixel.0[3])).collect();
    let fitted_alphas = lanczos_in_double_precision(&alphas, from, to);
    let transparent = found.transparent.expect("the right half is, here and there");
    let mut compared = 0;
    for channel in 0..3 {
        let weighed = image.pixels().map(|pixel| f64::from(pixel.0[channel]) * f64::from(pixel.0[3]));
        let sums = lanczos_in_double_precision(&weighed.collect::<Vec<f64>>(), from, to);
        for (index, (sum, alpha)) in sums.iter().zip(&fitted_alphas).enumerate() {
            if (alpha - 127.5).abs() < 0.01 {
                continue;
            }
            assert_eq!(transparent[index], *alpha < 127.5, "pixel {index} of alpha {alpha}");
            if *alpha > 127.5 {
                let exact = (sum / alpha).clamp(0.0, 255.0);
                let off = (f64::from(found.photo.pixels[index][channel]) - exact).abs();
                assert!(off < 0.51, "pixel {index} is off by {off}");
                compared += 1;
            }
        }
    }
    assert!(compared > 1000 && transparent.iter().filter(|&&is_transparent| is_transparent).count() > 100);
}

fn weights_of(bytes: &[u8], width_px: u32, height_px: u32) -> Vec<u8> {
    with_file(bytes, |path| read_weights(path, (width_px, height_px), CutShort::Refuse)).expect("the map fits")
}

#[test]
fn a_grey_map_is_taken_as_it_is_stored_whatever_its_profile() {
    let stored: Vec<u8> = load("grey.png").pixels.iter().map(|pixel| pixel[0]).collect();
    for name in ["grey.png", "linear_grey.png"] {
        assert_eq!(
            read_weights(&photo_path(name), (63, 48), CutShort::Refuse).expect("the size is the same"),
            stored,
            "{name}"
        );
    }
}

#[test]
fn a_map_in_colour_is_taken_by_its_luma_over_black() {
    let image = noisy(19, 23);
    let found = weights_of(&png(image.clone()), 19, 23);
    for (pixel, luma) in image.pixels().zip(found) {
        let [r, g, b, alpha] = pixel.0.map(f64::from);
        let exact = (0.2126 * r + 0.7152 * g + 0.0722 * b) * alpha / 255.0;
        assert!((f64::from(luma) - exact).abs() < 0.500_1, "{pixel:?} became {luma}");
    }
    let primaries = image::RgbImage::from_raw(4, 1, vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255]);
    assert_eq!(weights_of(&png(primaries.expect("four pixels")), 4, 1), [54, 182, 18, 255]);
}

#[test]
fn exif_orientation_turns_a_map_upright() {
    let stored = read_weights(&photo_path("plain.jpg"), (63, 48), CutShort::Refuse).expect("the size is the same");
    let upright = read_weights(&photo_path("turned.jpg"), (48, 63), CutShort::Refuse)
        .expect("the size is that of the upright map");
    for (index, &luma) in upright.iter().enumerate() {
        let (x, y) = (index % 48, index / 48);
        assert_eq!(luma, stored[(47 - x) * 63 + y], "({x}, {y})");
    }
}

#[test]
fn a_map_is_fitted_to_the_size_of_the_picture_whether_it_is_larger_or_smaller() {
    let map = image::GrayImage::from_raw(60, 40, noise(60 * 40)).expect("the size fits");
    let plane: Vec<f64> = map.as_raw().iter().map(|&luma| f64::from(luma)).collect();
    let bytes = png(map.clone());
    assert_eq!(&weights_of(&bytes, 60, 40), map.as_raw());
    for (width_px, height_px) in [(30, 20), (41, 27), (90, 60), (301, 200)] {
        let found = weights_of(&bytes, width_px, height_px);
        let exact = lanczos_in_double_precision(&plane, (60, 40), (width_px, height_px));
        assert_eq!(found.len(), exact.len());
        let off = found.iter().zip(exact).map(|(&luma, exact)| (f64::from(luma) - exact.clamp(0.0, 255.0)).abs());
        let worst = off.fold(0.0, f64::max);
        assert!(worst < 0.51, "at {width_px}x{height_px} px: off by {worst}");
    }
}

/// The reason for which a map of these bytes is refused for a picture of this size.
fn refusal(bytes: &[u8], width_px: u32, height_px: u32) -> String {
    with_file(bytes, |map| match read_weights(map, (width_px, height_px), CutShort::Refuse) {
        Err(Error::Input { path, reason }) if path == map => reason,
        other => panic!("{:?} is no refusal of the map", other.map(|lumas| lumas.len())),
    })
}

#[test]
fn a_map_of_other_proportions_is_refused_with_both_sizes() {
    let map = png(image::GrayImage::new(60, 40));
    for (width_px, height_px) in [(40, 60), (60, 60), (512, 320), (512, 360), (1, 1000)] {
        let reason = refusal(&map, width_px, height_px);
        assert!(reason.contains("60x40 px") && reason.contains(&format!("{width_px}x{height_px} px")), "{reason}");
    }
    for (width_px, height_px) in [(512, 341), (512, 342), (61, 40)] {
        weights_of(&map, width_px, height_px);
    }
}

#[test]
fn a_map_that_is_no_picture_is_refused_with_the_reason() {
    assert!(refusal(b"white where it matters", 5, 5).starts_with("not a picture"));
    let whole = png(image::GrayImage::new(60, 40));
    assert!(refusal(&whole[..whole.len() / 2], 60, 40).contains("broken or cut short"));
}
