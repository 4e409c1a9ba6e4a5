//! Pictures as people have them: what is read of each, what is said about it, and what is refused by name.

use std::fs;

use smalti::Error;
use smalti::photo::{Background, CutShort, Loaded, Photo, ReadOptions, read};

use super::{load, load_with, photo_path};
use crate::workshop::Workshop;

const LENIENT: ReadOptions =
    ReadOptions { background: Background::Transparent, long_side_px: None, cut_short: CutShort::Take };

/// Why a picture of `tests/photos` is refused.
fn refusal(name: &str) -> String {
    match read(&photo_path(name), &ReadOptions::default()) {
        Err(Error::Input { reason, .. }) => reason,
        other => panic!("{name}: {:?} is no refusal", other.map(|loaded| loaded.warnings)),
    }
}

/// The warnings about a picture of `tests/photos`.
fn warnings(name: &str) -> Vec<String> {
    load_with(name, &ReadOptions::default()).warnings
}

#[test]
fn what_is_not_read_is_refused_by_its_name_whatever_its_ending() {
    for (name, expected) in [
        ("photo.heic", "is HEIC; convert it first, for instance with heif-convert"),
        ("photo.avif", "is AVIF; convert it first, for instance with avifdec"),
        ("small.dng", "is camera raw (DNG); develop it first, for instance with darktable or RawTherapee"),
    ] {
        assert_eq!(refusal(name), expected);
        let workshop = Workshop::new();
        workshop.write("photo.jpg", &fs::read(photo_path(name)).expect("it is there"));
        let ran = workshop.run("evolve photo.jpg -o o.png");
        assert_eq!(
            (ran.code, ran.stderr.contains(&format!("photo.jpg: {expected}"))),
            (Some(2), true),
            "{}",
            ran.stderr
        );
    }
}

#[test]
fn a_jpeg_of_a_kind_that_is_not_read_is_not_called_broken() {
    let reason = refusal("arithmetic.jpg");
    assert!(reason.starts_with("is a kind of JPEG that is not read (arithmetic coding); convert it first"), "{reason}");
}

#[test]
fn a_jpeg_that_lacks_only_its_end_marker_is_read_with_a_warning() {
    let mut whole = fs::read(photo_path("no_end_marker.jpg")).expect("it is there");
    let found = load_with("no_end_marker.jpg", &ReadOptions::default());
    assert_eq!(found.warnings, ["its end marker is missing, and all of its pixels are there"]);
    whole.extend([0xFF, 0xD9]);
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    fs::write(file.path(), whole).expect("it can be written");
    let expected = read(file.path(), &ReadOptions::default()).expect("it is whole");
    assert_eq!((found.photo, expected.warnings), (expected.photo, vec![]));
    for name in ["plain.jpg", "progressive.jpg", "cmyk.jpg"] {
        let bytes = fs::read(photo_path(name)).expect("it is there");
        for missing in [1, 2] {
            fs::write(file.path(), &bytes[..bytes.len() - missing]).expect("it can be written");
            let found = read(file.path(), &ReadOptions::default()).expect("all pixels are there");
            assert_eq!((found.photo, found.warnings.len()), (load(name), 1), "{name} without {missing} bytes");
        }
    }
}

#[test]
fn a_picture_that_is_cut_short_is_refused_unless_what_is_there_is_asked_for() {
    assert!(refusal("cut_short.jpg").contains("cut short (its end is missing)"));
    let taken = load_with("cut_short.jpg", &LENIENT);
    assert_eq!(taken.warnings, ["is cut short; what is missing is grey"]);
    let whole = load("no_end_marker.jpg");
    let first_row = taken.photo.width_px as usize;
    assert_eq!(taken.photo.pixels[..first_row], whole.pixels[..first_row]);
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    for name in ["progressive.jpg", "rgb.png", "two_frames.gif", "strip.jxl"] {
        let bytes = fs::read(photo_path(name)).expect("it is there");
        fs::write(file.path(), &bytes[..bytes.len() * 4 / 10]).expect("it can be written");
        assert!(read(file.path(), &ReadOptions::default()).is_err(), "{name}");
        let Loaded { photo, warnings, .. } =
            read(file.path(), &LENIENT).unwrap_or_else(|error| panic!("{name}: {error}"));
        let whole = load_with(name, &LENIENT).photo;
        assert_eq!((photo.width_px, photo.height_px), (whole.width_px, whole.height_px));
        assert!(warnings.iter().any(|warning| warning.starts_with("is cut short")), "{name}: {warnings:?}");
        assert!(photo.pixels.iter().any(|&pixel| pixel != [0; 3]), "{name}: something of it is there");
    }
    let bytes = fs::read(photo_path("rgb.jxl")).expect("it is there");
    fs::write(file.path(), &bytes[..24]).expect("it can be written");
    assert!(read(file.path(), &LENIENT).is_err(), "no pixel of it is there");
    assert_eq!(load_with("rgb.png", &LENIENT), load_with("rgb.png", &ReadOptions::default()));
}

#[test]
fn evolve_takes_a_picture_that_is_cut_short_if_it_is_lenient() {
    let workshop = Workshop::new();
    workshop.write("cut.jpg", &fs::read(photo_path("cut_short.jpg")).expect("it is there"));
    let ran = workshop.run("evolve cut.jpg -o o.png -n 20 --evals 200");
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    let ran = workshop.run("evolve cut.jpg -o o.png -n 20 --evals 200 --lenient");
    assert!(ran.code == Some(0) && ran.stderr.contains("cut.jpg: is cut short"), "{}", ran.stderr);
    let shown = workshop.run("show o.png");
    assert!(String::from_utf8_lossy(&shown.stdout).contains(" --lenient"), "the command makes it again");
    assert_eq!(workshop.run("score cut.jpg cut.jpg").code, Some(2));
    assert_eq!(workshop.run("score cut.jpg cut.jpg --lenient").code, Some(0));
}

#[test]
fn the_first_of_several_frames_is_said() {
    for (name, count) in [("animated.png", 3), ("animated.webp", 3), ("two_frames.gif", 2)] {
        assert_eq!(warnings(name), [format!("the first of {count} frames is read")], "{name}");
    }
}

/// The channels of sRGB light, 0 to 255 each, of linear light in [0, 1].
fn encoded(light: f64) -> f64 {
    255.0 * if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// The channels of a PNG as they are stored.
fn stored(name: &str) -> Vec<u8> {
    let file = std::io::BufReader::new(fs::File::open(photo_path(name)).expect("it is there"));
    let mut reader = png::Decoder::new(file).read_info().expect("it is a PNG");
    let mut samples = vec![0; reader.output_buffer_size().expect("it is small")];
    reader.next_frame(&mut samples).expect("it is whole");
    samples
}

#[test]
fn the_gamma_of_a_png_is_obeyed() {
    let found = load("gamma_1.png");
    for (found, stored) in found.pixels.as_flattened().iter().zip(stored("gamma_1.png")) {
        let exact = encoded(f64::from(stored) / 255.0);
        assert!((f64::from(*found) - exact).abs() < 0.51, "{stored} became {found}, not {exact}");
    }
    assert!(warnings("gamma_1.png").is_empty());
}

#[test]
fn the_code_points_of_a_png_are_obeyed() {
    let found = load("cicp_p3.png");
    // Linear Display P3 to linear sRGB (CSS Color 4).
    let matrix =
        [[1.224_940_2, -0.224_940_2, 0.0], [-0.042_057_0, 1.042_057_0, 0.0], [-0.019_637_6, -0.078_636_1, 1.098_273_5]];
    let light = |channel: u8| {
        let x = f64::from(channel) / 255.0;
        if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    };
    for (found, stored) in found.pixels.iter().zip(stored("cicp_p3.png").as_chunks::<3>().0) {
        let light = stored.map(light);
        for (channel, row) in matrix.iter().enumerate() {
            let sum: f64 = row.iter().zip(light).map(|(part, light)| part * light).sum();
            let exact = encoded(sum.clamp(0.0, 1.0));
            assert!((f64::from(found[channel]) - exact).abs() < 1.0, "{stored:?} became {found:?}, not {exact}");
        }
    }
}

/// Mean absolute difference of the channels of two pictures.
fn mean_difference(one: &Photo, other: &Photo) -> f64 {
    let (one, other) = (one.pixels.as_flattened(), other.pixels.as_flattened());
    one.iter().zip(other).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / one.len() as f64
}

#[test]
fn inks_go_through_their_profile() {
    let bytes = fs::read(photo_path("cmyk_with_profile.jpg")).expect("it is there");
    // Without its profile, the segment of marker APP2.
    let start = bytes.windows(2).position(|pair| pair == [0xFF, 0xE2]).expect("it has a profile");
    let length = usize::from(u16::from_be_bytes([bytes[start + 2], bytes[start + 3]]));
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    fs::write(file.path(), [&bytes[..start], &bytes[start + 2 + length..]].concat()).expect("it can be written");
    let naive = read(file.path(), &ReadOptions::default()).expect("it is whole").photo;
    let found = load("cmyk_with_profile.jpg");
    assert!(mean_difference(&found, &naive) > 10.0, "the profile changes colours");
    assert!(warnings("cmyk_with_profile.jpg").is_empty());
}

#[test]
fn a_tiff_with_a_palette_is_read() {
    let found = load("palette.tif");
    assert_eq!((found.width_px, found.height_px), (96, 64));
    let colors: std::collections::HashSet<[u8; 3]> = found.pixels.iter().copied().collect();
    assert!((17..=256).contains(&colors.len()), "{} colours", colors.len());
}

#[test]
fn a_gif_that_would_fill_memory_is_refused_by_its_header() {
    // A screen of 65535x4096 px, and one pixel on it.
    let gif = b"GIF89a\xFF\xFF\0\x10\x80\0\0\0\0\0\xFF\xFF\xFF,\0\0\0\0\x01\0\x01\0\0\x02\x02L\x01\0;";
    let workshop = Workshop::new();
    workshop.write("bomb.gif", gif);
    let ran = workshop.run("evolve bomb.gif -o o.png");
    assert_eq!(
        (ran.code, ran.stderr.contains("35 bytes cannot hold 65535x4096 px")),
        (Some(2), true),
        "{}",
        ran.stderr
    );
}

#[test]
fn a_batch_says_what_it_leaves_out_and_a_folder_of_only_that_is_refused() {
    let workshop = Workshop::new();
    for folder in ["mixed", "only"] {
        fs::create_dir(workshop.path(folder)).expect("the folder is ours");
        for (from, to) in [("photo.heic", "a.heic"), ("photo.heic", "b.HEIC"), ("small.dng", "c.dng")] {
            fs::copy(photo_path(from), workshop.path(folder).join(to)).expect("it can be copied");
        }
    }
    fs::copy(workshop.path("photo.png"), workshop.path("mixed/photo.png")).expect("it can be copied");
    let ran = workshop.run("batch mixed -o out -n 20 --evals 100");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(ran.stderr.contains("3 files are left out: 2 HEIC (convert"), "{}", ran.stderr);
    assert!(ran.stderr.contains("1 camera raw (DNG) (develop"), "{}", ran.stderr);
    for line in ["batch only -o out2", "video only -o out3"] {
        let ran = workshop.run(line);
        assert_eq!(ran.code, Some(2), "{}", ran.stderr);
        assert!(ran.stderr.contains("2 HEIC (convert it first, for instance with heif-convert)"), "{}", ran.stderr);
    }
}

#[test]
fn an_animation_gives_its_frames_and_their_times_without_ffmpeg() {
    let workshop = Workshop::new();
    for (name, count) in [("animated.png", 3), ("animated.webp", 3), ("two_frames.gif", 2)] {
        fs::copy(photo_path(name), workshop.path(name)).expect("it can be copied");
        let mut command = workshop.command(&format!("video {name} -o out-{name}.frames/ -n 20 --evals 100"));
        let output = command.env("PATH", "").output().expect("the program starts");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{name}: {stderr}");
        let frames: Vec<_> = fs::read_dir(workshop.path(&format!("out-{name}.frames")))
            .expect("it is there")
            .map(|entry| entry.expect("it can be read").file_name().to_string_lossy().into_owned())
            .filter(|name| name.ends_with(".png"))
            .collect();
        assert_eq!(frames.len(), count, "{name}: {frames:?}");
        let index = workshop.read(&format!("out-{name}.frames/populations/input/video.json"));
        let index: serde_json::Value = serde_json::from_slice(&index).expect("it is JSON");
        assert_eq!(index["frames_per_s"], 10, "{name}");
    }
}
