//! All marginal fitnesses by one dispatch against the paper's way, one re-render per fly: same device, same run.

mod common;

use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use smalti::gpu::GpuEvaluator;
use smalti::model::Evaluator;

fn leave_one_out(criterion: &mut Criterion) {
    let device = common::device();
    let (scene, flies) = common::scene(256, 256, 2_500);
    let mut evaluator = GpuEvaluator::create(&device, vec![scene]).expect("it fits");
    evaluator.load(&[(0, &flies)]).expect("the evaluator works");
    let mut group = criterion.benchmark_group("leave_one_out");
    group.sample_size(10);
    group.bench_function("one dispatch", |bencher| {
        bencher.iter(|| evaluator.evaluate_again().expect("the evaluator works"));
    });
    group.bench_function("2500 re-renders", |bencher| {
        bencher.iter_custom(|rounds| {
            let start = Instant::now();
            for _ in 0..rounds {
                let slow = evaluator.marginal_by_re_rendering().expect("it fits a dispatch");
                assert_eq!(slow, evaluator.evaluation(0).marginal);
            }
            start.elapsed()
        });
    });
    group.finish();
}

criterion_group!(benches, leave_one_out);
criterion_main!(benches);
