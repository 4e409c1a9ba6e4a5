//! The picture of a mosaic at work is that of the painters, rectangle by rectangle, and only changes are uploaded.

use std::sync::Arc;

use rand::RngExt;
use smalti::cpu::CpuPainter;
use smalti::gpu::layout::Instance;
use smalti::gpu::{GpuPainter, LiveMosaic, LiveView, Upload};
use smalti::model::blocks::{depth_order, index_of};
use smalti::model::tile::pack;
use smalti::model::{Backdrop, Canvas, Fly, Grout, MaskSet, Painter, Population, Tile};
use smalti::vk::{Device, DeviceOptions, Image, Recorder, Staging, Timing};

use crate::canary;
use crate::scenarios::{any_fly, holed_masks, random_scene, stream, translucent_masks};

const SOLID: u32 = 255 << 24;

/// A population of 48 x 40 px in which many flies are equally deep.
fn population(masks: MaskSet, background: Backdrop, grout: Option<Grout>) -> Population {
    let mut random = stream(72);
    let mut scene = random_scene(48, 40, 0, &mut random);
    scene.masks = Arc::new(masks.clone());
    let mut flies: Vec<Fly> = (0..60).map(|_| any_fly(&scene, 1.0..14.0, &mut random)).collect();
    flies.iter_mut().step_by(3).for_each(|fly| fly.z = 5);
    flies[7].alive = false;
    Population { width_px: 48, height_px: 40, background, grout, masks, flies }
}

/// One of each kind.
fn populations() -> [Population; 5] {
    let grout = Some(Grout { width: 50, color: [255, 0, 255] });
    let translucent = || translucent_masks(&mut stream(5));
    [
        population(MaskSet::default(), Backdrop::Color([9, 99, 199]), None),
        population(holed_masks(), Backdrop::Color([9, 99, 199]), grout),
        population(holed_masks(), Backdrop::Transparent, None),
        population(translucent(), Backdrop::Color([9, 99, 199]), None),
        population(translucent(), Backdrop::Transparent, None),
    ]
}

/// A rectangle: left, top, width, height.
fn view(canvas: Canvas, [x, y, width_px, height_px]: [u32; 4]) -> LiveView {
    LiveView { canvas, x, y, width_px, height_px }
}

fn whole(canvas: Canvas) -> LiveView {
    view(canvas, [0, 0, canvas.width_px, canvas.height_px])
}

/// What an image holds in its upper left corner, pixel by pixel.
fn corner(device: &Arc<Device>, image: &Arc<Image>, width_px: u32, height_px: u32) -> Vec<u32> {
    let mut recorder = Recorder::create(device, "test", Timing::Off).expect("the device works");
    let ticket = recorder.read_image(image).expect("it is a colour attachment");
    recorder.submit_and_wait().expect("the device works");
    let shape = image.shape();
    let mut pixels = vec![0_u32; (shape.width_px * shape.height_px) as usize];
    recorder.read_into(&ticket, bytemuck::cast_slice_mut(&mut pixels)).expect("it was read");
    let rows = pixels.chunks_exact(shape.width_px as usize).take(height_px as usize);
    rows.flat_map(|row| &row[..width_px as usize]).copied().collect()
}

/// What a painter draws there, in the image's terms.
fn painted(painter: &mut dyn Painter, population: &Population, view: &LiveView) -> Vec<u32> {
    let mosaic = painter.draw(population, &view.canvas, 1).expect("it can be drawn");
    let pixels = mosaic.over_black();
    let places = (view.y..view.y + view.height_px)
        .flat_map(|y| (view.x..view.x + view.width_px).map(move |x| (y * view.canvas.width_px + x) as usize));
    let alpha = |place: usize| mosaic.alpha.as_ref().map_or(255, |alpha| u32::from(alpha[place]));
    places.map(|place| pack(pixels[place]) | alpha(place) << 24).collect()
}

fn assert_as_painted(live: &mut LiveMosaic, device: &Arc<Device>, population: &Population, view: &LiveView) {
    let image = live.draw(population, view).expect("it can be drawn");
    let found = corner(device, &image, view.width_px, view.height_px);
    let mut vulkan = GpuPainter::create(device).expect("the device works");
    for painter in [&mut vulkan as &mut dyn Painter, &mut CpuPainter] {
        let expected = painted(painter, population, view);
        let differing = found.iter().zip(&expected).position(|(one, other)| one != other);
        assert_eq!(differing, None, "{view:?} of {:?}, blend {:?}", population.grout, population.masks.blend());
    }
}

#[test]
fn every_rectangle_at_every_size_has_the_bytes_of_the_painters() {
    for staging in [Staging::Auto, Staging::Forced] {
        canary::with_device(&DeviceOptions { staging, ..DeviceOptions::default() }, |device| {
            let mut live = LiveMosaic::create(&device).expect("the device works");
            for population in populations() {
                for canvas in [48, 72, 384].map(|long_side_px| Canvas::scaled(48, 40, long_side_px)) {
                    let (right, lower) = (canvas.width_px - 1, canvas.height_px - 1);
                    for view in [
                        whole(canvas),
                        view(canvas, [5, 7, 31, 19]),
                        view(canvas, [right, lower, 1, 1]),
                        view(canvas, [0, lower - 9, right, 10]),
                    ] {
                        assert_as_painted(&mut live, &device, &population, &view);
                    }
                }
            }
        });
    }
}

#[test]
fn after_a_change_only_the_flies_that_changed_are_baked_and_uploaded() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let (tile, quad) = (size_of::<Tile>() as u64, size_of::<Instance>() as u64);
        for mut population in populations() {
            let is_opaque = population.masks.blend() == smalti::Blend::Opaque;
            let quads = |count: u64| if is_opaque { count * quad } else { 0 };
            let mut live = LiveMosaic::create(&device).expect("the device works");
            let view = whole(Canvas::scaled(48, 40, 96));
            assert_as_painted(&mut live, &device, &population, &view);
            assert_eq!(live.last_upload().tiles, 60);
            let first = live.draw(&population, &view).expect("it can be drawn");
            assert_eq!(live.last_upload(), Upload::default(), "nothing changed");

            for (fly, color) in [(0, 1), (30, 2), (59, 3)] {
                population.flies[fly].r = color << 8;
            }
            assert_as_painted(&mut live, &device, &population, &view);
            assert_eq!(live.last_upload(), Upload { tiles: 3, bytes: 3 * tile }, "colours");

            population.flies[12].z = 0;
            assert_as_painted(&mut live, &device, &population, &view);
            assert_eq!(live.last_upload(), Upload { tiles: 1, bytes: quads(1) }, "a depth");

            population.flies[12].x = 64 * 20;
            population.flies[12].w = 64 * 9;
            assert_as_painted(&mut live, &device, &population, &view);
            assert_eq!(live.last_upload(), Upload { tiles: 1, bytes: tile + quads(1) }, "a place");

            population.flies[7].alive = true;
            population.flies.truncate(50);
            population.flies.swap(3, 4);
            assert_as_painted(&mut live, &device, &population, &view);
            assert_eq!(live.last_upload().tiles, 3);
            population.flies.truncate(40);
            assert_as_painted(&mut live, &device, &population, &view);
            assert_eq!(live.last_upload(), Upload::default(), "some are gone");

            population.background = Backdrop::Color([1, 2, 3]);
            assert_as_painted(&mut live, &device, &population, &view);
            assert_eq!(live.last_upload(), Upload::default(), "another background");
            let image = live.draw(&population, &view).expect("it can be drawn");
            assert!(Arc::ptr_eq(&first, &image), "the image serves as long as it is large enough");
        }
    });
}

#[test]
fn a_list_of_tiles_may_grow_and_wear_other_masks_and_grout() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let mut live = LiveMosaic::create(&device).expect("the device works");
        let view = whole(Canvas::evaluation(48, 40));
        let [plain, grouted, .., glazed] = populations();
        let scene = random_scene(48, 40, 0, &mut stream(1));
        let mut random = stream(2);
        for few in [plain, grouted.clone(), glazed] {
            let more = (0..2_500).map(|_| any_fly(&scene, 1.0..3.0, &mut random));
            let many = Population { flies: few.flies.iter().copied().chain(more).collect(), ..few.clone() };
            for population in [&few, &many, &few] {
                assert_as_painted(&mut live, &device, population, &view);
            }
        }
        assert_as_painted(&mut live, &device, &Population { grout: None, ..grouted.clone() }, &view);
        assert_as_painted(&mut live, &device, &Population { flies: Vec::new(), ..grouted }, &view);
    });
}

/// The rule of the tiles, pixel by pixel, without masks.
fn by_rule(population: &Population, view: &LiveView) -> Vec<u32> {
    let tiles: Vec<Tile> = population.flies.iter().map(|fly| Tile::bake(fly, &view.canvas)).collect();
    let order: Vec<&Tile> = depth_order(&population.flies).iter().map(|&key| &tiles[index_of(key) as usize]).collect();
    let covers = |tile: &Tile, i: i32, j: i32| {
        let (u, v) = tile.coordinates(i, j);
        let is_in_box = (tile.x0..=tile.x1).contains(&i) && (tile.y0..=tile.y1).contains(&j);
        is_in_box && u < tile.u_end() && v < tile.v_end()
    };
    let places =
        (0..view.height_px).flat_map(|j| (0..view.width_px).map(move |i| ((view.x + i) as i32, (view.y + j) as i32)));
    let color = |(i, j)| order.iter().find(|tile| covers(tile, i, j)).map(|tile| tile.color);
    places.map(|place| color(place).unwrap_or(pack(population.background.color())) | SOLID).collect()
}

#[test]
fn a_canvas_may_be_65535_px_wide_and_any_rectangle_of_it_is_exact() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let mut live = LiveMosaic::create(&device).expect("the device works");
        let mut population = population(MaskSet::default(), Backdrop::Color([1, 2, 3]), None);
        population.flies.iter_mut().skip(20).for_each(|fly| (fly.w, fly.h) = (20, 17));
        let canvas = Canvas::scaled(48, 40, 65_535);
        let mut random = stream(9);
        let (right, lower) = (canvas.width_px - 160, canvas.height_px - 120);
        let mut places: Vec<[u32; 2]> =
            (0..6).map(|_| [random.random_range(0..=right), random.random_range(0..=lower)]).collect();
        // Around corners of tiles, where the rule decides between neighbours.
        let boxes = population.flies.iter().map(|fly| Tile::bake(fly, &canvas)).filter(|tile| !tile.is_empty());
        places.extend(
            boxes.take(12).map(|tile| {
                [(tile.x0 as u32).saturating_sub(80).min(right), ((tile.y0 + tile.y1) as u32 / 2).min(lower)]
            }),
        );
        for [x, y] in places.into_iter().chain([[0, 0], [right, lower]]) {
            let view = view(canvas, [x, y, 160, 120]);
            let image = live.draw(&population, &view).expect("it can be drawn");
            assert!(corner(&device, &image, 160, 120) == by_rule(&population, &view), "at {x}, {y}");
        }
    });
}

#[test]
fn a_rectangle_that_leaves_its_canvas_or_is_larger_than_any_image_is_refused() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let mut live = LiveMosaic::create(&device).expect("the device works");
        let [population, ..] = populations();
        let canvas = Canvas::scaled(48, 40, 65_535);
        let outside = live.draw(&population, &view(canvas, [65_000, 0, 536, 1])).err().expect("it leaves the canvas");
        assert!(outside.to_string().contains("536x1 px at 65000, 0"), "{outside}");
        let side = device.info().limits.image_side_px + 1;
        let large = live.draw(&population, &view(canvas, [0, 0, side, 1])).err().expect("no image is as large");
        assert!(matches!(large, smalti::Error::TooLarge { .. }), "{large}");
        assert_as_painted(&mut live, &device, &population, &whole(Canvas::evaluation(48, 40)));
    });
}
