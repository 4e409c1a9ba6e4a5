//! Masks of the user's own: pictures, SVG, and what is refused.

use std::fs;
use std::path::{Path, PathBuf};

use image::{GrayImage, Luma, LumaA, Rgb, RgbImage, Rgba, RgbaImage};
use smalti::Error;
use smalti::model::Blend;
use smalti::model::mask::MASK_SIDE;
use smalti::shapes::{BuiltIn, Ink, MASK_FILE_BYTES_MAX, Shader, Source, Template, read};

use super::wardrobe;

/// A folder for masks.
struct Drawer {
    folder: tempfile::TempDir,
}

impl Drawer {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.path(name), content).unwrap();
        self.path(name)
    }

    /// The template of an SVG with this body, in a view box of 100x50.
    fn svg(&self, body: &str) -> smalti::Result<Template> {
        let text = format!(r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 50">{body}</svg>"#);
        read(&self.write("drawing.svg", text))
    }
}

fn ink(template: &Template, column: usize, row: usize) -> Ink {
    template.ink()[row * MASK_SIDE + column]
}

fn drawn(alpha: u8, intensity: u8) -> Ink {
    Ink { alpha, intensity }
}

/// The refusal's sentence without the path, after checking that it names the path.
fn refusal<T: std::fmt::Debug>(path: &Path, result: smalti::Result<T>) -> String {
    let error = result.unwrap_err();
    assert!(matches!(error, Error::Input { .. }), "{error:?}");
    let sentence = error.to_string();
    let reason = sentence.strip_prefix(&format!("{}: ", path.display())).expect("the path comes first");
    assert!(!reason.contains('\n') && reason.contains([';', ',']), "one sentence that says what to do: {reason}");
    reason.to_owned()
}

#[test]
fn a_picture_with_transparency_draws_with_its_alpha_and_shades_with_its_luma() {
    let drawer = Drawer::new();
    let path = drawer.path("mask.png");
    let pixel = |x, y| match (x < 128, y < 128) {
        (true, true) => Rgba([255, 255, 255, 255]),
        (false, true) => Rgba([128, 128, 128, 255]),
        (true, false) => Rgba([255, 255, 255, 77]),
        (false, false) => Rgba([9, 200, 3, 0]),
    };
    RgbaImage::from_fn(256, 256, pixel).save(&path).unwrap();
    let template = read(&path).unwrap();
    assert_eq!(ink(&template, 10, 10), drawn(255, 255));
    assert_eq!(ink(&template, 200, 10), drawn(255, 128));
    assert_eq!(ink(&template, 10, 200), drawn(77, 255));
    assert_eq!(ink(&template, 200, 200).alpha, 0);
    assert_eq!(template.source(), &Source::File(path));
}

#[test]
fn an_opaque_picture_is_a_stencil_whether_or_not_it_has_an_alpha_channel() {
    let drawer = Drawer::new();
    let (grey, with_alpha, color) = (drawer.path("grey.png"), drawer.path("alpha.png"), drawer.path("color.png"));
    let level = |x: u32| [0, 100, 200, 255][(x / 64) as usize];
    GrayImage::from_fn(256, 256, |x, _| Luma([level(x)])).save(&grey).unwrap();
    image::ImageBuffer::<LumaA<u8>, _>::from_fn(256, 256, |x, _| LumaA([level(x), 255])).save(&with_alpha).unwrap();
    RgbImage::from_fn(256, 256, |x, _| Rgb([level(x); 3])).save(&color).unwrap();
    let template = read(&grey).unwrap();
    assert_eq!(ink(&template, 10, 99).alpha, 0);
    assert_eq!(ink(&template, 80, 99), drawn(100, 100));
    assert_eq!(ink(&template, 140, 99), drawn(200, 200));
    assert_eq!(ink(&template, 250, 99), drawn(255, 255));
    assert_eq!(read(&with_alpha).unwrap().ink(), template.ink());
    assert_eq!(read(&color).unwrap().ink(), template.ink());
}

#[test]
fn other_sizes_are_stretched_to_the_square() {
    let drawer = Drawer::new();
    let path = drawer.path("wide.png");
    GrayImage::from_fn(1000, 10, |x, _| Luma([if x < 500 { 255 } else { 0 }])).save(&path).unwrap();
    let template = read(&path).unwrap();
    for row in [0, 100, 255] {
        assert_eq!((ink(&template, 120, row).alpha, ink(&template, 136, row).alpha), (255, 0), "row {row}");
    }
}

#[test]
fn an_upside_down_photo_is_turned_upright() {
    let photos = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos");
    let upright = read(&photos.join("turned.jpg")).unwrap();
    let stored = read(&photos.join("plain.jpg")).unwrap();
    let turned = |column, row| ink(&stored, row, MASK_SIDE - 1 - column);
    let differences = (0..MASK_SIDE * MASK_SIDE).step_by(97).map(|index| {
        let (column, row) = (index % MASK_SIDE, index / MASK_SIDE);
        ink(&upright, column, row).alpha.abs_diff(turned(column, row).alpha)
    });
    assert!(differences.max().unwrap() <= 2);
}

#[test]
fn the_brightest_intensity_becomes_full_and_black_is_not_black() {
    let drawer = Drawer::new();
    let path = drawer.path("dark.png");
    let pixel = |x, y| Rgba([(x / 64 * 40) as u8, 0, 0, if y < 128 { 255 } else { 0 }]);
    RgbaImage::from_fn(256, 256, pixel).save(&path).unwrap();
    let template = read(&path).unwrap();
    let intensities = [10, 70, 130, 200].map(|column| ink(&template, column, 9).intensity);
    assert!(intensities.is_sorted() && intensities[0] == 0 && intensities[3] == 255, "{intensities:?}");

    RgbaImage::from_fn(256, 256, |x, _| Rgba([0, 0, 0, if x < 128 { 255 } else { 0 }])).save(&path).unwrap();
    assert_eq!(ink(&read(&path).unwrap(), 9, 9), drawn(255, 255), "a black silhouette is evenly bright");
}

#[test]
fn an_svg_is_drawn_whole_in_the_middle_with_its_aspect() {
    let drawer = Drawer::new();
    let template = drawer.svg(r##"<rect width="100" height="50"/>"##).unwrap();
    for (row, alpha) in [(0, 0), (63, 0), (64, 255), (191, 255), (192, 0)] {
        for column in [0, 128, 255] {
            assert_eq!(ink(&template, column, row).alpha, alpha, "at {column}, {row}");
        }
    }
}

#[test]
fn an_svg_shades_with_the_luma_of_its_colour_without_its_opacity() {
    let drawer = Drawer::new();
    let body = r##"<rect width="50" height="50" fill="#fff"/><rect x="50" width="50" height="50" fill="#808080"
        fill-opacity=".5"/>"##;
    let template = drawer.svg(body).unwrap();
    assert_eq!(ink(&template, 20, 128), drawn(255, 255));
    let Ink { alpha, intensity } = ink(&template, 200, 128);
    assert!((127..=128).contains(&alpha) && (127..=129).contains(&intensity), "{alpha}, {intensity}");
}

#[test]
fn an_svg_is_known_by_its_content_or_else_by_its_name() {
    let drawer = Drawer::new();
    let text = r#"<?xml version="1.0"?><!-- x --><svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><rect width="9" height="9"/></svg>"#;
    let nameless = read(&drawer.write("shape", text)).unwrap();
    assert!(nameless.ink().iter().all(|ink| *ink == drawn(255, 255)));
    let late = text.replace("<!-- x -->", &format!("<!-- {} -->", "long ".repeat(2000)));
    assert_eq!(read(&drawer.write("late.SVG", &late)).unwrap().ink(), nameless.ink());
    let path = drawer.write("late", &late);
    assert!(refusal(&path, read(&path)).starts_with("not a mask that can be read"));
}

#[test]
fn an_svg_with_what_cannot_be_drawn_is_refused() {
    let drawer = Drawer::new();
    let path = drawer.path("drawing.svg");
    let rect = r#"<rect width="100" height="50"/>"#;
    for (body, reason) in [
        ("<g><text>a</text></g>", "the SVG has text, which is not drawn"),
        (r#"<image href="/etc/passwd" width="9" height="9"/>"#, "the SVG has an element `image`"),
        ("<foreignObject/>", "the SVG has an element `foreignObject`"),
    ] {
        let found = refusal(&path, drawer.svg(&format!("{rect}{body}")));
        assert!(found.starts_with(reason), "{found}");
    }
}

#[test]
fn an_svg_whose_cost_has_no_limit_is_refused() {
    let drawer = Drawer::new();
    let path = drawer.path("drawing.svg");
    let filter = r#"<filter id="f"><feGaussianBlur stdDeviation="1e9"/></filter>"#;
    let pattern =
        r#"<pattern id="p" width="9e5" height="9e5" patternUnits="userSpaceOnUse"><path d="M0 0h9v9"/></pattern>"#;
    let rect = |attribute: &str| format!(r#"<rect width="100" height="50" {attribute}/>"#);
    for (body, reason) in [
        (format!("{filter}{}", rect(r#"filter="url(#f)""#)), "the SVG uses a filter"),
        (rect(r#"style="filter: blur(3px)""#), "the SVG uses a filter"),
        (
            format!(r#"{filter}<mask id="m">{}</mask>{}"#, rect(r#"filter="url(#f)""#), rect(r#"mask="url(#m)""#)),
            "the SVG uses a filter",
        ),
        (format!("{pattern}{}", rect(r#"fill="url(#p)""#)), "the SVG uses a pattern"),
    ] {
        let found = refusal(&path, drawer.svg(&body));
        assert!(found.starts_with(reason), "{found}");
    }
    assert!(drawer.svg(&format!("{filter}{pattern}{}", rect(""))).is_ok(), "what is not used costs nothing");
    let laughs: String =
        (1..30).map(|n| format!(r##"<g id="l{n}"><use href="#l{0}"/><use href="#l{0}"/></g>"##, n - 1)).collect();
    let laughs = format!(r##"<defs><path id="l0" d="M0 0h9v9"/>{laughs}</defs><use href="#l29"/>"##);
    assert!(refusal(&path, drawer.svg(&laughs)).starts_with("the SVG has too many elements"));
}

#[test]
fn a_picture_is_shaded_by_the_luma_of_what_a_viewer_shows() {
    let photos = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos");
    for name in ["rgb.png", "wide_rgb.png", "linear_grey.png", "grey_16_bit.png", "float.tif", "turned.jpg"] {
        let path = photos.join(name);
        let photo = smalti::photo::read(&path, &smalti::photo::ReadOptions::default()).unwrap().photo;
        let stencil = smalti::photo::decode_stencil(&fs::read(&path).unwrap()).unwrap();
        assert_eq!((stencil.width_px, stencil.height_px), (photo.width_px, photo.height_px), "{name}");
        for ([r, g, b], [luma, alpha]) in photo.pixels.iter().zip(&stencil.pixels) {
            let [r, g, b] = [r, g, b].map(|channel| f64::from(*channel));
            let expected = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            assert!((expected - f64::from(*luma)).abs() <= 1.01 && *alpha == 255, "{name}: {luma}, not {expected}");
        }
    }
}

#[test]
fn an_svg_that_does_not_parse_is_refused() {
    let drawer = Drawer::new();
    let opened = r#"<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><rect>"#;
    let negative = r#"<svg xmlns="http://www.w3.org/2000/svg" width="-9" height="9"/>"#;
    for content in [opened.as_bytes(), negative.as_bytes(), b"plain text", b"<svg \xFF\xFE/>"] {
        let path = drawer.write("broken.svg", content);
        let found = refusal(&path, read(&path));
        assert!(found.starts_with("the SVG does not parse ("), "{found}");
    }
    let path = drawer.write("shape.svgz", b"\x1f\x8b\x08\x00");
    assert_eq!(refusal(&path, read(&path)), "is compressed; unpack it with gunzip and name the SVG");
}

#[test]
fn what_cannot_be_read_or_is_no_mask_is_refused() {
    let drawer = Drawer::new();
    let missing = drawer.path("none.png");
    assert_eq!(refusal(&missing, read(&missing)), "there is no such file; check its name");
    let folder = drawer.path("");
    assert_eq!(refusal(&folder, read(&folder)), "is a folder; name a file in it");
    let path = drawer.write("empty.png", "");
    assert_eq!(refusal(&path, read(&path)), "the file is empty (0 bytes); get it again");
    let path = drawer.write("notes.txt", "a square, please");
    let reason = "not a mask that can be read; PNG, JPEG, JPEG XL, WebP, TIFF, BMP, GIF and SVG can";
    assert_eq!(refusal(&path, read(&path)), reason);
    let whole = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/alpha.png")).unwrap();
    let path = drawer.write("cut.png", &whole[..whole.len() / 2]);
    assert!(refusal(&path, read(&path)).starts_with("the Png data is broken or cut short"));
}

#[test]
fn endless_and_absurd_files_are_refused() {
    let endless = Path::new("/dev/zero");
    assert!(refusal(endless, read(endless)).starts_with("the file has more than 64 MiB"));
    let drawer = Drawer::new();
    let path = drawer.write("sparse.png", "");
    fs::File::options().write(true).open(&path).unwrap().set_len(MASK_FILE_BYTES_MAX + 1).unwrap();
    assert!(refusal(&path, read(&path)).starts_with("the file has more than 64 MiB"));

    // A bitmap's header alone.
    let mut bomb = b"BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0".to_vec();
    bomb.extend(60_000_u32.to_le_bytes());
    bomb.extend(60_000_u32.to_le_bytes());
    bomb.extend(b"\x01\0\x18\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0");
    let path = drawer.write("bomb.bmp", bomb);
    let found = refusal(&path, read(&path));
    assert!(found.starts_with("the picture has 60000x60000 px, more than"), "{found}");
}

#[test]
fn a_mask_that_covers_nothing_is_refused() {
    let drawer = Drawer::new();
    let (clear, black) = (drawer.path("clear.png"), drawer.path("black.png"));
    RgbaImage::from_pixel(20, 20, Rgba([255, 255, 255, 0])).save(&clear).unwrap();
    GrayImage::new(20, 20).save(&black).unwrap();
    for path in [clear, black] {
        assert!(refusal(&path, read(&path)).starts_with("the mask is empty"));
    }
    assert!(refusal(&drawer.path("drawing.svg"), drawer.svg("<g/>")).starts_with("the mask is empty"));
}

#[test]
fn a_faint_mask_can_be_worn_translucent_but_not_opaque() {
    let drawer = Drawer::new();
    let path = drawer.path("faint.png");
    RgbaImage::from_pixel(20, 20, Rgba([255, 255, 255, 127])).save(&path).unwrap();
    let template = read(&path).unwrap();
    for shader in Shader::ALL {
        let found = wardrobe(&[(&template, shader)], Blend::Translucent, 128).unwrap();
        let most = found.masks.layers()[1].texels().iter().map(|texel| texel.coverage).max();
        assert!(most >= Some(40), "{shader}: {most:?}");
        // (127 * 1 + 127) / 255 is 0.
        refusal(&path, wardrobe(&[(&template, shader)], Blend::Translucent, 1));
        let found = refusal(&path, wardrobe(&[(&template, shader)], Blend::Opaque, 255));
        assert!(found.starts_with(&format!("under the shader `{shader}` its tiles would cover nothing")), "{found}");
    }
}

#[test]
fn a_mask_is_found_by_its_built_in_name_or_by_its_path() {
    assert_eq!(Template::find(Path::new("flower")).unwrap(), BuiltIn::Flower.template());
    let drawer = Drawer::new();
    let path = drawer.path("flower");
    GrayImage::from_pixel(9, 9, Luma([255])).save_with_format(&path, image::ImageFormat::Png).unwrap();
    assert_eq!(Template::find(&path).unwrap().source(), &Source::File(path.clone()));
    let wrong = Path::new("flowers");
    assert_eq!(
        refusal(wrong, Template::find(wrong)),
        "there is no such mask; name one of square, border, lines, flower, disc, triangle, hexagon, brush, or a picture \
         or SVG file"
    );
}
