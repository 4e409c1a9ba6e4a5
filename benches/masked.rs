//! What a mask costs: a full evaluation of plain squares against one of the same flies that all wear a disc with shade.

mod common;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use smalti::model::mask::Texel;
use smalti::model::{Blend, Fly};

fn masked(criterion: &mut Criterion) {
    let device = common::device();
    let (plain, squares) = common::scene(512, 512, 5_000);
    let disc = |column: i32, row: i32| {
        let is_inside = (2 * column - 255).pow(2) + (2 * row - 255).pow(2) <= 256 * 256;
        Texel { coverage: if is_inside { 255 } else { 0 }, shade: 255 - (row / 4) as u8 }
    };
    let scene = common::with_mask(&plain, Blend::Opaque, disc);
    let discs: Vec<Fly> = squares.iter().map(|fly| Fly { mask: 1, ..*fly }).collect();
    let mut group = criterion.benchmark_group("masked");
    group.sample_size(20);
    for (name, scene, flies) in [("squares", &plain, &squares), ("discs", &scene, &discs)] {
        for (device_name, mut evaluator) in common::evaluators(&device, scene) {
            group.bench_function(BenchmarkId::new(device_name, name), |bencher| {
                bencher.iter(|| evaluator.load(&[(0, flies)]).expect("the evaluator works"));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, masked);
criterion_main!(benches);
