//! Grout, drawn: the ring of each tile, exactly, on the CPU and on Vulkan.

use smalti::cpu::CpuPainter;
use smalti::gpu::GpuPainter;
use smalti::model::tables::cos_sin;
use smalti::model::{Canvas, Fly, Grout, NO_FLY, Painter, Population};
use smalti::vk::DeviceOptions;

use crate::canary;
use crate::exactness::population;
use crate::reference::Reference;
use crate::scenarios::{Scenario, dressed_scenarios, scenarios, translucent_scenarios};

const COLOR: [u8; 3] = [3, 250, 77];

/// Opaque scenarios of a size that is drawn quickly, squares and masks.
fn opaque() -> impl Iterator<Item = Scenario> {
    let [dressed, _] = dressed_scenarios();
    let all = scenarios().into_iter().chain([dressed]);
    all.filter(|scenario| scenario.scene.target.width_px().max(scenario.scene.target.height_px()) <= 256)
}

fn grouted(Scenario { scene, flies, .. }: &Scenario, width: u32) -> Population {
    Population { grout: Some(Grout { width, color: COLOR }), ..population(scene, flies) }
}

fn draw(painter: &mut dyn Painter, population: &Population, canvas: &Canvas, supersampling: u32) -> Vec<[u8; 3]> {
    painter.draw(population, canvas, supersampling).expect("the painter works").pixels
}

/// Whether a pixel that `fly` covers lies within `width` of one of its edges, from the genes alone.
fn is_in_ring(fly: &Fly, width: u32, i: i64, j: i64) -> bool {
    let (cos, sin) = cos_sin(fly.angle);
    let (dx, dy) = (i * 64 - i64::from(fly.x), j * 64 - i64::from(fly.y));
    let u = dx * i64::from(cos) + dy * i64::from(sin) + i64::from(fly.w) * 2048;
    let v = dy * i64::from(cos) - dx * i64::from(sin) + i64::from(fly.h) * 2048;
    let ring = i64::from(width) * 4096;
    let is_near = |place: i64, side: u32| place < ring || place >= i64::from(side) * 4096 - ring;
    is_near(u, fly.w) || is_near(v, fly.h)
}

#[test]
fn at_evaluation_size_the_ring_of_the_top_tile_is_grout_and_all_else_is_as_without() {
    let mut sums = [0, 0];
    for scenario in opaque() {
        let Scenario { name, scene, flies } = &scenario;
        let reference = Reference::new(scene, flies);
        let (plain, top) = (reference.colors(), reference.layer(0));
        let (width_px, height_px) = (scene.target.width_px(), scene.target.height_px());
        for width in [1, 40, 300] {
            let places = (0..i64::from(height_px)).flat_map(|j| (0..i64::from(width_px)).map(move |i| (i, j)));
            let is_grout =
                |(fly, (i, j)): (&u32, (i64, i64))| *fly != NO_FLY && is_in_ring(&flies[*fly as usize], width, i, j);
            let ring: Vec<bool> = top.iter().zip(places).map(is_grout).collect();
            let expected: Vec<_> =
                ring.iter().zip(&plain).map(|(&ring, &plain)| if ring { COLOR } else { plain }).collect();
            ring.iter().for_each(|&ring| sums[usize::from(ring)] += 1);
            let canvas = Canvas::evaluation(width_px, height_px);
            let drawn = draw(&mut CpuPainter, &grouted(&scenario, width), &canvas, 1);
            assert!(drawn == expected, "{name}: grout of {width}");
        }
    }
    assert!(sums.iter().all(|&count| count > 50_000), "{sums:?} pixels without and with grout");
}

#[test]
fn grout_is_drawn_alike_on_the_cpu_and_on_vulkan_at_any_size_and_supersampling() {
    canary::with_device(&DeviceOptions::default(), |device| {
        for scenario in opaque().filter(|scenario| scenario.flies.len() <= 300) {
            let (width_px, height_px) = (scenario.scene.target.width_px(), scenario.scene.target.height_px());
            let mut vulkan = GpuPainter::create(&device).expect("the device works");
            // The last spans several patches of samples.
            let sizes = [(17, 1, 64), (150, 3, 7), (90, 2, 100_000), (2_200, 1, 33)];
            let count = if scenario.name == "masks with holes" { 4 } else { 2 };
            for (long_side_px, supersampling, width) in sizes.into_iter().take(count) {
                let population = grouted(&scenario, width);
                let canvas = Canvas::scaled(width_px, height_px, long_side_px);
                let [twin, vulkan] = [&mut CpuPainter as &mut dyn Painter, &mut vulkan]
                    .map(|painter| draw(painter, &population, &canvas, supersampling));
                assert!(twin == vulkan, "{} at {long_side_px} px with {supersampling}² samples", scenario.name);
            }
        }
    });
}

#[test]
fn a_ring_wider_than_half_a_tile_leaves_nothing_of_it_and_translucent_tiles_have_none() {
    let square = |w: u32, h: u32| Fly { x: 64 * 16, y: 64 * 16, w, h, r: 65_535, alive: true, ..Fly::ABSENT };
    let draw = |fly: Fly, width: u32, canvas: &Canvas| {
        let scenario = scenarios().swap_remove(0);
        let grout = Some(Grout { width, color: COLOR });
        let population =
            Population { width_px: 32, height_px: 32, grout, flies: vec![fly], ..population(&scenario.scene, &[]) };
        draw(&mut CpuPainter, &population, canvas, 1)
    };
    for (long_side_px, scale) in [(32, 1), (96, 9)] {
        let canvas = Canvas::scaled(32, 32, long_side_px);
        let count = |pixels: &[[u8; 3]], color| pixels.iter().filter(|&&pixel| pixel == color).count();
        let narrow = draw(square(1024, 512), 128, &canvas);
        assert_eq!([count(&narrow, [255, 0, 0]), count(&narrow, COLOR)], [12 * 4 * scale, (16 * 8 - 12 * 4) * scale]);
        let wide = draw(square(1024, 512), 256, &canvas);
        assert_eq!([count(&wide, [255, 0, 0]), count(&wide, COLOR)], [0, 16 * 8 * scale]);
    }
    let foggy = translucent_scenarios().swap_remove(0);
    let canvas = Canvas::evaluation(foggy.scene.target.width_px(), foggy.scene.target.height_px());
    let plain = population(&foggy.scene, &foggy.flies);
    for population in [&plain, &grouted(&foggy, 60)] {
        let drawn = draw_on_vulkan_and_cpu(population, &canvas);
        assert!(drawn == Reference::new(&foggy.scene, &foggy.flies).colors());
    }
}

/// The picture that both draw.
fn draw_on_vulkan_and_cpu(population: &Population, canvas: &Canvas) -> Vec<[u8; 3]> {
    let twin = draw(&mut CpuPainter, population, canvas, 1);
    canary::with_device(&DeviceOptions::default(), |device| {
        let mut painter = GpuPainter::create(&device).expect("the device works");
        assert!(draw(&mut painter, population, canvas, 1) == twin);
    });
    twin
}
