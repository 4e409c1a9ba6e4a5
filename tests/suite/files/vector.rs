//! SVG files: drawn by another program they are our mosaic, except on antialiased edges.

use std::ops::Range;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};
use serde_json::{Map, json};
use smalti::cpu::CpuPainter;
use smalti::model::mask::{MASK_SIDE, Texel};
use smalti::model::{Blend, Canvas, Fly, Grout, Mask, MaskSet, Mosaic, Painter, Population, Rgb, Scene};
use smalti::{archive, vector};

use super::photo_path;
use crate::scenarios::{any_fly, holed_masks, random_scene, stream};
use crate::workshop::Workshop;

/// Samples along each side of a pixel, to find out what lies in it: the thinnest tile, 1/4 px, covers four.
const SAMPLES: u32 = 16;

/// The document as resvg draws it.
fn drawn_by_resvg(svg: &[u8]) -> Mosaic {
    let tree = Tree::from_data(svg, &Options::default()).expect("it is SVG");
    let size = tree.size().to_int_size();
    let mut pixmap = Pixmap::new(size.width(), size.height()).expect("it has a size");
    resvg::render(&tree, Transform::identity(), &mut pixmap.as_mut());
    let pixels = pixmap.data().as_chunks::<4>().0.iter().map(|&[r, g, b, a]| {
        assert_eq!(a, 255, "the background is everywhere");
        [r, g, b]
    });
    Mosaic { width_px: size.width(), height_px: size.height(), pixels: pixels.collect(), alpha: None }
}

fn drawn(population: &Population, canvas: &Canvas) -> Mosaic {
    CpuPainter.draw(population, canvas, 1).expect("the twin draws anything")
}

/// The population with the number of each fly as its colour.
fn numbered(population: &Population) -> Population {
    let color = |index: usize, fly: &Fly| {
        let [r, g, b] = [16, 8, 0].map(|shift| (index >> shift & 255) as u16 * 257);
        Fly { r, g, b, ..*fly }
    };
    let flies = population.flies.iter().enumerate().map(|(index, fly)| color(index, fly)).collect();
    let unshaded = |mask: &Mask| Mask::new(mask.texels().iter().map(|&texel| Texel { shade: 255, ..texel }).collect());
    let masks = population.masks.layers()[1..].iter().map(|mask| unshaded(mask).unwrap()).collect();
    let masks = MaskSet::with_layers(masks).unwrap();
    Population { background: [255; 3].into(), grout: None, flies, masks, ..*population }
}

/// Compares every pixel whose samples, and the row of samples around them, all see one fly: resvg must give each
/// channel a value between those of these samples, give or take `tolerance`. This detects a tile that lies an eighth of
/// a pixel off.
///
/// Returns the share of all pixels that were compared; the others have an edge in them.
fn compare(population: &Population, long_side_px: u32, tolerance: u8) -> f64 {
    let canvas = Canvas::scaled(population.width_px, population.height_px, long_side_px);
    let theirs = drawn_by_resvg(&vector::encode(population, &canvas, &Map::new()).unwrap());
    assert_eq!((theirs.width_px, theirs.height_px), (canvas.width_px, canvas.height_px));
    let samples = canvas.supersampled(SAMPLES);
    let (colors, flies) = (drawn(population, &samples), drawn(&numbered(population), &samples));
    let around = |place: u32, end: u32| (place * SAMPLES).saturating_sub(1)..((place + 1) * SAMPLES + 1).min(end);
    let mut compared = 0;
    for (index, found) in (0..).zip(&theirs.pixels) {
        let (i, j) = (index % canvas.width_px, index / canvas.width_px);
        let (columns, rows) = (around(i, samples.width_px), around(j, samples.height_px));
        let seen = |mosaic: &Mosaic| seen_in(mosaic, columns.clone(), rows.clone());
        let (first, last) = seen(&flies);
        if first != last {
            continue;
        }
        compared += 1;
        let (least, most) = seen(&colors);
        for channel in 0..3 {
            let allowed = least[channel].saturating_sub(tolerance)..=most[channel].saturating_add(tolerance);
            assert!(allowed.contains(&found[channel]), "{found:?} at {i}, {j} and not {least:?} to {most:?}");
        }
    }
    f64::from(compared) / theirs.pixels.len() as f64
}

/// The least and the largest value of each channel in a rectangle of samples.
fn seen_in(mosaic: &Mosaic, columns: Range<u32>, rows: Range<u32>) -> (Rgb, Rgb) {
    let (mut least, mut most) = ([255; 3], [0; 3]);
    for row in rows {
        let first = (row * mosaic.width_px) as usize;
        for color in &mosaic.pixels[first + columns.start as usize..first + columns.end as usize] {
            for channel in 0..3 {
                least[channel] = least[channel].min(color[channel]);
                most[channel] = most[channel].max(color[channel]);
            }
        }
    }
    (least, most)
}

fn population_of(scene: &Scene, flies: Vec<Fly>) -> Population {
    Population {
        width_px: scene.target.width_px(),
        height_px: scene.target.height_px(),
        background: scene.background.into(),
        grout: None,
        masks: (*scene.masks).clone(),
        flies,
    }
}

fn random_population(masks: MaskSet, side_px: Range<f32>, seed: u64) -> Population {
    let mut random = stream(seed);
    let scene = Scene { masks: masks.into(), background: [30, 90, 200], ..random_scene(96, 71, 160, &mut random) };
    let absent = |fly: Fly| if fly.z.is_multiple_of(8) { Fly { alive: false, ..fly } } else { fly };
    let flies = (0..scene.fly_count).map(|_| absent(any_fly(&scene, side_px.clone(), &mut random))).collect();
    population_of(&scene, flies)
}

fn assert_compared(share: f64, least: f64) {
    assert!(share >= least, "only {:.1} % of the pixels lie inside a tile", share * 100.0);
}

#[test]
fn random_squares_come_out_of_resvg_as_ours_at_once_and_twice_the_size() {
    for (seed, side_px) in [(1, 3.0..25.0), (2, 0.25..12.0), (3, 20.0..300.0)] {
        let population = random_population(MaskSet::default(), side_px, seed);
        assert_compared(compare(&population, 96, 1), 0.1);
        assert_compared(compare(&population, 192, 1), 0.3);
    }
    // 66.5 rows are rounded to 67.
    assert_compared(compare(&random_population(MaskSet::default(), 3.0..25.0, 1), 90, 1), 0.1);
}

#[test]
fn upright_tiles_and_tiles_of_one_depth_come_out_of_resvg_as_ours() {
    let mut population = random_population(MaskSet::default(), 3.0..25.0, 4);
    population.flies.iter_mut().for_each(|fly| (fly.angle, fly.z) = (fly.angle & 0xC000, fly.z & 1));
    assert_compared(compare(&population, 96, 1), 0.3);
    assert_compared(compare(&population, 192, 1), 0.5);
}

#[test]
fn an_evolved_mosaic_comes_out_of_resvg_as_ours() {
    let workshop = Workshop::new();
    let photo = photo_path("parrots.png");
    let line = format!("evolve {} --scheme paper --size 128 -n 400 --births 5k -o a.npz", photo.display());
    assert_eq!(workshop.run(&line).code, Some(0));
    let population = archive::read(&workshop.path("a.npz")).unwrap().population;
    assert_compared(compare(&population, 128, 1), 0.15);
    assert_compared(compare(&population, 256, 1), 0.4);
}

/// A blob without a straight edge, of one shade.
fn blob(shade: u8) -> Mask {
    let texel = |index: usize| {
        let (column, row) = ((index % MASK_SIDE) as i32 - 100, (index / MASK_SIDE) as i32 - 140);
        let coverage = if 2 * column * column + row * row - column * row < 9_000 { 255 } else { 0 };
        Texel { coverage, shade }
    };
    Mask::new((0..MASK_SIDE * MASK_SIDE).map(texel).collect()).unwrap()
}

#[test]
fn masks_with_holes_and_shades_come_out_of_resvg_as_ours() {
    let plain = MaskSet::with_layers(vec![blob(255)]).unwrap();
    let shaded = MaskSet::with_layers(vec![blob(100), blob(255)]).unwrap();
    for (seed, masks, tolerance) in [(5, plain, 1), (6, shaded, 2), (7, holed_masks(), 2)] {
        let population = random_population(masks, 5.0..40.0, seed);
        assert_compared(compare(&population, 96, tolerance), 0.2);
        assert_compared(compare(&population, 192, tolerance), 0.4);
    }
}

#[test]
fn tiles_and_masks_with_grout_come_out_of_resvg_as_ours() {
    let plain = MaskSet::with_layers(vec![blob(255)]).unwrap();
    let shaded = MaskSet::with_layers(vec![blob(100), blob(255)]).unwrap();
    for (seed, masks, width) in
        [(11, MaskSet::default(), 90), (12, plain, 150), (13, shaded, 150), (14, holed_masks(), 80)]
    {
        let grout = Some(Grout { width, color: [250, 240, 5] });
        let population = Population { grout, ..random_population(masks, 5.0..40.0, seed) };
        assert_compared(compare(&population, 96, 2), 0.2);
        assert_compared(compare(&population, 192, 2), 0.4);
    }
}

#[test]
fn a_translucent_tile_shows_what_lies_behind_as_far_as_its_coverage_lets_it() {
    let texel = |index: usize| if index % MASK_SIDE < 128 { (51, 255) } else { (204, 128) };
    let texel = |index| Texel { coverage: texel(index).0, shade: texel(index).1 };
    let mask = Mask::new((0..MASK_SIDE * MASK_SIDE).map(texel).collect()).unwrap();
    let masks = MaskSet::with_layers(vec![mask]).unwrap().with_blend(Blend::Translucent);
    let (centre, side) = (32 * 7, 64 * 40);
    let [x, y, w, h] = [centre, centre, side, side];
    let fly = Fly { x, y, w: w as u32, h: h as u32, r: 65_535, g: 0, b: 32_896, mask: 1, alive: true, ..Fly::ABSENT };
    let population = Population {
        width_px: 8,
        height_px: 8,
        background: [0, 200, 100].into(),
        grout: None,
        masks,
        flies: vec![fly],
    };
    let svg = vector::encode(&population, &Canvas::evaluation(8, 8), &Map::new()).unwrap();
    let found = drawn_by_resvg(&svg);
    // A fifth of (255, 0, 128) on the left, four fifths of its half on the right.
    for (place, expected) in [(8 * 4 + 1, [51, 160, 106]), (8 * 4 + 6, [102, 40, 71])] {
        let off = found.pixels[place].iter().zip(expected).map(|(&a, b): (&u8, u8)| a.abs_diff(b)).max();
        assert!(off <= Some(2), "{:?} and not {expected:?}", found.pixels[place]);
    }
}

#[test]
fn there_is_one_element_for_each_living_fly_and_the_farthest_comes_first() {
    let population = random_population(holed_masks(), 1.0..9.0, 8);
    let svg =
        String::from_utf8(vector::encode(&population, &Canvas::evaluation(96, 71), &Map::new()).unwrap()).unwrap();
    let (_, drawing) = svg.split_once("</defs>").unwrap();
    let colors: Vec<&str> =
        drawing.lines().filter_map(|line| Some(line.split_once("fill=\"")?.1.split_once('"')?.0)).collect();
    let mut living: Vec<(u32, usize)> =
        (0..).zip(&population.flies).filter(|(_, fly)| fly.alive).map(|(index, fly)| (fly.z, index)).collect();
    living.sort_unstable();
    let hexadecimal = |[r, g, b]: Rgb| format!("#{r:02x}{g:02x}{b:02x}");
    let expected = living.iter().rev().map(|&(_, index)| hexadecimal(population.flies[index].color()));
    let expected: Vec<String> = std::iter::once("#1e5ac8".to_owned()).chain(expected).collect();
    assert_eq!(colors, expected);
}

#[test]
fn five_thousand_tiles_take_less_than_half_a_megabyte() {
    let mut random = stream(9);
    let scene = random_scene(512, 512, 5_000, &mut random);
    let flies = (0..5_000).map(|_| any_fly(&scene, 2.0..25.0, &mut random)).collect();
    let svg = vector::encode(&population_of(&scene, flies), &Canvas::evaluation(512, 512), &Map::new()).unwrap();
    assert!(svg.len() < 500_000, "{} bytes", svg.len());
}

#[test]
fn what_an_svg_tells_about_itself_comes_back() {
    let workshop = Workshop::new();
    let population = random_population(MaskSet::default(), 1.0..9.0, 10);
    let told = json!({"key": "a<b>&amp;\"c\"\n", "sae": u64::MAX}).as_object().unwrap().clone();
    workshop.write("a.svg", &vector::encode(&population, &Canvas::evaluation(96, 71), &told).unwrap());
    assert_eq!(vector::read_meta(&workshop.path("a.svg")).unwrap(), Some(told));
    workshop.write("b.svg", b"<svg xmlns=\"http://www.w3.org/2000/svg\"/>");
    assert_eq!(vector::read_meta(&workshop.path("b.svg")).unwrap(), None);
    assert!(vector::read_meta(&workshop.path("c.svg")).is_err());
}
