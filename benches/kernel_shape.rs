//! Which cut of the evaluation kernel is fastest on this device: block side and pixels per invocation.

mod common;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use smalti::gpu::{GpuEvaluator, KernelShape};
use smalti::model::Evaluator;

fn kernel_shape(criterion: &mut Criterion) {
    let device = common::device();
    let (scene, flies) = common::scene(512, 512, 5_000);
    let mut group = criterion.benchmark_group("kernel_shape");
    group.sample_size(20);
    for (block_side_px, pixels_per_thread) in
        [(8, 1), (8, 2), (8, 4), (8, 8), (16, 2), (16, 4), (16, 8), (16, 16), (32, 8)]
    {
        let shape = KernelShape { block_side_px, pixels_per_thread };
        let mut evaluator = GpuEvaluator::create_with_shape(&device, vec![scene.clone()], shape).expect("it fits");
        evaluator.load(&[(0, &flies)]).expect("the evaluator works");
        group.bench_function(BenchmarkId::from_parameter(format!("{block_side_px}/{pixels_per_thread}")), |bencher| {
            bencher.iter(|| evaluator.evaluate_again().expect("the evaluator works"));
        });
    }
    group.finish();
}

criterion_group!(benches, kernel_shape);
criterion_main!(benches);
