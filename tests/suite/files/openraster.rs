//! OpenRaster files: layers that together are the picture.

use std::io::{Cursor, Read};

use image::{RgbImage, RgbaImage};
use smalti::cpu::CpuPainter;
use smalti::model::{Canvas, Fly, Grout, MaskSet, Mosaic, Painter, Population};
use smalti::openraster::{self, Layers};
use smalti::photo::{self, Format, Photo};
use zip::ZipArchive;

use crate::scenarios::{holed_masks, scenarios};
use crate::workshop::Workshop;

fn member(ora: &[u8], name: &str) -> Vec<u8> {
    let mut zip = ZipArchive::new(Cursor::new(ora)).expect("it is a zip file");
    let mut bytes = Vec::new();
    zip.by_name(name).unwrap_or_else(|error| panic!("{name}: {error}")).read_to_end(&mut bytes).expect("it is whole");
    bytes
}

fn picture(ora: &[u8], name: &str) -> RgbaImage {
    image::load_from_memory(&member(ora, name)).expect("it is a picture").to_rgba8()
}

/// The files and names that `stack.xml` lists, the lowest layer first.
fn stacked(ora: &[u8]) -> Vec<(String, String)> {
    let stack = String::from_utf8(member(ora, "stack.xml")).expect("XML is UTF-8");
    let value = |line: &str, name: &str| {
        let (_, rest) = line.split_once(&format!(" {name}=\"")).expect("the attribute is there");
        rest.split_once('"').expect("it ends").0.to_owned()
    };
    let layers = stack.lines().filter(|line| line.contains("<layer "));
    let mut layers: Vec<_> = layers.map(|line| (value(line, "src"), value(line, "name"))).collect();
    layers.reverse();
    layers
}

/// The layers one over the other, as a program would show them.
fn composed(ora: &[u8]) -> RgbImage {
    let layers: Vec<RgbaImage> = stacked(ora).iter().map(|(member, _)| picture(ora, member)).collect();
    let (width_px, height_px) = layers[0].dimensions();
    RgbImage::from_fn(width_px, height_px, |i, j| {
        let over = |below: [f64; 3], layer: &RgbaImage| {
            let [r, g, b, a] = layer.get_pixel(i, j).0.map(|value| f64::from(value) / 255.0);
            let mut above = [r, g, b].into_iter();
            below.map(|below| above.next().expect("three channels") * a + below * (1.0 - a))
        };
        let color = layers.iter().fold([0.0; 3], over);
        image::Rgb(color.map(|value| (value * 255.0).round() as u8))
    })
}

fn merged(population: &Population, canvas: &Canvas, supersampling: u32) -> Vec<u8> {
    let drawn = CpuPainter.draw(population, canvas, supersampling);
    let Mosaic { width_px, height_px, pixels, alpha } = drawn.expect("the twin draws anything");
    let (photo, told) = (Photo { width_px, height_px, pixels }, vec![("smalti".to_owned(), "{}".to_owned())]);
    photo::encode_with_alpha(Format::Png, &photo, alpha.as_deref(), &told).unwrap()
}

fn encoded(population: &Population, canvas: &Canvas, supersampling: u32) -> Vec<u8> {
    let layers = Layers::draw(&mut CpuPainter, population, canvas, supersampling, 8, &mut |_| {})
        .expect("the twin draws anything");
    openraster::encode(&layers, &merged(population, canvas, supersampling)).unwrap()
}

fn populations() -> impl Iterator<Item = (&'static str, Population)> {
    let few = scenarios().into_iter().filter(|scenario| scenario.flies.len() <= 1000);
    few.filter(|scenario| scenario.scene.target.width_px() < 1000).map(|scenario| {
        let (target, masks) = (&scenario.scene.target, (*scenario.scene.masks).clone());
        let (width_px, height_px) = (target.width_px(), target.height_px());
        let background = [1, 130, 255].into();
        (scenario.name, Population { width_px, height_px, background, grout: None, masks, flies: scenario.flies })
    })
}

#[test]
fn at_evaluation_size_the_layers_are_together_exactly_the_merged_picture() {
    let mut count = 0;
    for (name, population) in populations() {
        let canvas = Canvas::evaluation(population.width_px, population.height_px);
        let ora = encoded(&population, &canvas, 1);
        let whole = image::load_from_memory(&member(&ora, "mergedimage.png")).unwrap().to_rgb8();
        assert!(composed(&ora) == whole, "{name}");
        let living = population.flies.iter().filter(|fly| fly.alive).count();
        assert_eq!(stacked(&ora).len(), 1 + living.min(8), "{name}");
        let grouted = Population { grout: Some(Grout { width: 70, color: [9, 255, 130] }), ..population };
        let grouted = encoded(&grouted, &canvas, 1);
        let merged = image::load_from_memory(&member(&grouted, "mergedimage.png")).unwrap().to_rgb8();
        assert!(composed(&grouted) == merged, "{name} with grout");
        count += u32::from(merged != whole);
    }
    assert!(count >= 8, "only {count} populations that show grout");
}

#[test]
fn supersampled_layers_are_the_merged_picture_but_for_pixels_that_they_share() {
    let (_, population) = populations().find(|(name, _)| *name == "masks with holes").expect("it is there");
    assert_eq!(population.masks, holed_masks());
    let canvas = Canvas::scaled(population.width_px, population.height_px, 201);
    let ora = encoded(&population, &canvas, 4);
    let whole = image::load_from_memory(&member(&ora, "mergedimage.png")).unwrap().to_rgb8();
    let (composed, count) = (composed(&ora), whole.len() as f64);
    let differences = whole.iter().zip(composed.iter()).map(|(&a, &b)| f64::from(a.abs_diff(b)));
    let (near, sum) = differences.fold((0.0, 0.0), |(near, sum), off| (near + f64::from(off <= 2.0), sum + off));
    assert!(near / count > 0.9 && sum / count < 1.5, "{:.3} are near, {:.3} off", near / count, sum / count);
}

#[test]
fn the_bands_have_their_place_in_depth_and_the_background_a_layer_of_its_own() {
    // Nine squares beside each other, the nearest on the left, so that each band shows which flies it holds.
    let fly =
        |k: u32| Fly { x: 64 * 4 * k as i32 + 96, y: 96, z: k, w: 256, h: 256, r: 65_535, alive: true, ..Fly::ABSENT };
    let masks = MaskSet::default();
    let population = Population {
        width_px: 40,
        height_px: 4,
        background: [0, 9, 0].into(),
        grout: None,
        masks,
        flies: (0..9).rev().map(fly).collect(),
    };
    let ora = encoded(&population, &Canvas::evaluation(40, 4), 1);
    let stacked = stacked(&ora);
    let names: Vec<&str> = stacked.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!([names[0], names[1], names[8]], ["Background", "Tiles 1 of 8, farthest", "Tiles 8 of 8, nearest"]);
    assert!(picture(&ora, &stacked[0].0).pixels().all(|pixel| pixel.0 == [0, 9, 0, 255]));
    let covered = |(member, _): &(String, String)| -> Vec<u32> {
        let picture = picture(&ora, member);
        (0..40).filter(|&i| picture.get_pixel(i, 1).0 == [255, 0, 0, 255]).map(|i| i / 4).collect()
    };
    assert_eq!(covered(&stacked[8]), [0; 4], "the nearest");
    let all: Vec<u32> = stacked[1..].iter().rev().flat_map(covered).collect();
    assert!(all.is_sorted() && all.len() == 36, "{all:?}");
}

#[test]
fn a_population_without_a_living_fly_has_a_background_only() {
    let masks = MaskSet::default();
    let population = Population {
        width_px: 5,
        height_px: 4,
        background: [7; 3].into(),
        grout: None,
        masks,
        flies: vec![Fly::ABSENT; 3],
    };
    let ora = encoded(&population, &Canvas::evaluation(5, 4), 1);
    assert_eq!(stacked(&ora).len(), 1);
    assert!(composed(&ora).pixels().all(|pixel| pixel.0 == [7; 3]));
}

#[test]
fn the_file_begins_with_its_type_and_holds_what_the_format_asks_for() {
    let (_, population) = populations().next().expect("there are scenarios");
    let canvas = Canvas::scaled(population.width_px, population.height_px, 400);
    let ora = encoded(&population, &canvas, 4);
    assert_eq!(&ora[..4], b"PK\x03\x04");
    assert_eq!(&ora[8..10], [0, 0], "stored");
    assert_eq!(&ora[26..54], b"\x08\0\0\0mimetypeimage/openraster");
    let thumbnail = picture(&ora, "Thumbnails/thumbnail.png");
    assert_eq!(thumbnail.dimensions(), (256, 192));
    assert_eq!(picture(&ora, "mergedimage.png").dimensions(), (400, 300));
    let stack = String::from_utf8(member(&ora, "stack.xml")).unwrap();
    assert!(stack.contains("w=\"400\" h=\"300\""), "{stack}");
    assert!(encoded(&population, &canvas, 4) == ora, "always the same bytes");
}

#[test]
fn what_the_merged_picture_tells_is_what_the_file_tells() {
    let workshop = Workshop::new();
    let (_, population) = populations().next().expect("there are scenarios");
    let ora = encoded(&population, &Canvas::evaluation(population.width_px, population.height_px), 1);
    workshop.write("a.ora", &ora);
    workshop.write("cut.ora", &ora[..ora.len() / 2]);
    let told = openraster::read_metadata(&workshop.path("a.ora")).unwrap();
    assert_eq!(told, vec![("smalti".to_owned(), "{}".to_owned())]);
    for other in ["photo.png", "cut.ora"] {
        assert!(openraster::read_metadata(&workshop.path(other)).unwrap().is_empty(), "{other}");
    }
    assert!(openraster::read_metadata(&workshop.path("missing.ora")).is_err());
}
