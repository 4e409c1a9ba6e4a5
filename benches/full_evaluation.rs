//! Layers, marginal fitness of every fly and SAE of a whole population, from binning on: twin against device.

mod common;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};

fn full_evaluation(criterion: &mut Criterion) {
    let device = common::device();
    let mut group = criterion.benchmark_group("full_evaluation");
    group.sample_size(20);
    for (side_px, fly_count) in [(256, 2_500), (512, 5_000), (1024, 20_000)] {
        let (scene, flies) = common::scene(side_px, side_px, fly_count);
        for (name, mut evaluator) in common::evaluators(&device, &scene) {
            group.bench_function(BenchmarkId::new(name, format!("{side_px}px/{fly_count}")), |bencher| {
                bencher.iter(|| evaluator.load(&[(0, &flies)]).expect("the evaluator works"));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, full_evaluation);
criterion_main!(benches);
