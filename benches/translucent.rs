//! What translucency costs: full evaluations of the same flies as plain squares, under an opaque mask, and under the
//! same mask read as translucent, with half the opacity on average. Mean depths are 4, 8 and 16.

mod common;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use smalti::model::mask::Texel;
use smalti::model::{Blend, Fly};

fn translucent(criterion: &mut Criterion) {
    let device = common::device();
    let (plain, flies) = common::scene(512, 512, 5_000);
    let veil = |column: i32, row: i32| Texel { coverage: 64 + (column / 2) as u8, shade: 255 - (row / 4) as u8 };
    let [opaque, translucent] = [Blend::Opaque, Blend::Translucent].map(|blend| common::with_mask(&plain, blend, veil));
    let mut group = criterion.benchmark_group("translucent");
    group.sample_size(20);
    for depth in [4, 8, 16] {
        let squares = common::at_depth(&flies, &plain, f64::from(depth));
        let veils: Vec<Fly> = squares.iter().map(|fly| Fly { mask: 1, ..*fly }).collect();
        let scenes =
            [("squares", &plain, &squares), ("opaque", &opaque, &veils), ("translucent", &translucent, &veils)];
        for (name, scene, flies) in scenes {
            for (device_name, mut evaluator) in common::evaluators(&device, scene) {
                group.bench_function(BenchmarkId::new(device_name, format!("{name} at depth {depth}")), |bencher| {
                    bencher.iter(|| evaluator.load(&[(0, flies)]).expect("the evaluator works"));
                });
            }
        }
    }
    group.finish();
}

criterion_group!(benches, translucent);
criterion_main!(benches);
