//! Two pictures of 512x512 px on the CPU, with 5,000 flies and 40,000 births each, one birth per generation: as lanes
//! of one engine, and in two engines side by side. One picture alone is the baseline.

mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use smalti::cpu::CpuEvaluator;
use smalti::engine::{Engine, side_by_side};
use smalti::evolve::{Evolution, PaperScheme, Undisturbed};
use smalti::model::{Fly, Scene};

/// Evolves `lane_count` pictures in one engine.
fn run(scene: &Scene, flies: &[Fly], lane_count: usize) -> u64 {
    let evaluator = Box::new(CpuEvaluator::new(vec![scene.clone(); lane_count]));
    let evolution = |lane| Evolution::new(PaperScheme::default(), lane, 512, 512, flies.to_vec());
    let mut engine = Engine::new(evaluator, (0..lane_count).map(evolution).collect());
    engine.run(&mut Undisturbed).expect("the evaluator works");
    engine.evolutions().iter().filter_map(Evolution::best_sae).sum()
}

fn lanes(criterion: &mut Criterion) {
    let (scene, flies) = common::scene(512, 512, 5_000);
    let mut group = criterion.benchmark_group("lanes");
    group.sample_size(10);
    group.bench_function("one picture", |bencher| bencher.iter(|| run(&scene, &flies, 1)));
    group.bench_function("two lanes of one engine", |bencher| bencher.iter(|| run(&scene, &flies, 2)));
    group.bench_function("two engines side by side", |bencher| {
        bencher.iter(|| side_by_side(2, |_| Ok(run(&scene, &flies, 1))).expect("threads start"));
    });
    group.finish();
}

criterion_group!(benches, lanes);
criterion_main!(benches);
