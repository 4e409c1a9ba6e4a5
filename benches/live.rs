//! What a frame of a mosaic at work costs: 50 flies change, and 800 x 800 px are drawn, whole and at eight times the
//! size.

mod common;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use smalti::gpu::{LiveMosaic, LiveView};
use smalti::model::fly::position_max;
use smalti::model::mask::Texel;
use smalti::model::{Backdrop, Blend, Canvas, Fly, Population};

const SIDE_PX: u32 = 800;

/// Flies of a mosaic, of which so many cover a pixel on average.
fn population(fly_count: usize, depth: f64, blend: Blend) -> Population {
    let (plain, flies) = common::scene(SIDE_PX, SIDE_PX, fly_count);
    let mut flies = common::at_depth(&flies, &plain, depth);
    let scene = match blend {
        Blend::Opaque => plain,
        Blend::Translucent => {
            flies.iter_mut().for_each(|fly| fly.mask = 1);
            let soft = |column: i32, row: i32| {
                let distance = (column - 128).pow(2) + (row - 128).pow(2);
                Texel { coverage: (120 - distance / 128).max(0) as u8, shade: 255 }
            };
            common::with_mask(&plain, blend, soft)
        }
    };
    let (width_px, height_px, background) = (SIDE_PX, SIDE_PX, Backdrop::Color(scene.background));
    Population { width_px, height_px, background, grout: None, masks: (*scene.masks).clone(), flies }
}

fn live(criterion: &mut Criterion) {
    let device = common::device();
    let mut group = criterion.benchmark_group("live");
    group.sample_size(20);
    for (name, mut population) in [
        ("5,000 opaque", population(5_000, 2.0, Blend::Opaque)),
        ("100,000 opaque", population(100_000, 2.0, Blend::Opaque)),
        ("5,000 translucent", population(5_000, 8.0, Blend::Translucent)),
    ] {
        for scale in [1, 8] {
            let mut live = LiveMosaic::create(&device).expect("the device works");
            let canvas = Canvas::scaled(SIDE_PX, SIDE_PX, scale * SIDE_PX);
            let corner = (scale - 1) * SIDE_PX / 2;
            let view = LiveView { canvas, x: corner, y: corner, width_px: SIDE_PX, height_px: SIDE_PX };
            let mut step = 0;
            group.bench_function(BenchmarkId::new(name, format!("x{scale}")), |bencher| {
                bencher.iter(|| {
                    for _ in 0..50 {
                        step += 97;
                        let place = step % population.flies.len();
                        let fly = population.flies[place];
                        let x = (fly.x + 640) % position_max(SIDE_PX);
                        population.flies[place] = Fly { x, ..fly };
                    }
                    live.draw(&population, &view).expect("the device works")
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, live);
criterion_main!(benches);
