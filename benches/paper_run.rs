//! The paper's run, 256x256 with 2,500 flies and 40,000 births: one by one on the twin; in batches of 25 on the device,
//! refreshing only touched blocks, and refreshing everything.

mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use smalti::Result;
use smalti::cpu::CpuEvaluator;
use smalti::engine::Engine;
use smalti::evolve::{Evolution, PaperScheme, Undisturbed};
use smalti::gpu::GpuEvaluator;
use smalti::model::{Change, Evaluation, Evaluator, Fly, Lane, Layers, Scene};

/// An evaluator that evaluates the whole picture after every generation: what incremental refresh is compared with.
struct FullRefresh {
    inner: GpuEvaluator,
    flies: Vec<Fly>,
}

impl Evaluator for FullRefresh {
    fn lane(&self, lane: usize) -> &Lane {
        self.inner.lane(lane)
    }
    fn lane_count(&self) -> usize {
        self.inner.lane_count()
    }
    fn admit(&mut self, scene: Scene) -> Result<Option<usize>> {
        self.inner.admit(scene)
    }
    fn release(&mut self, lane: usize) {
        self.inner.release(lane);
    }
    fn load(&mut self, populations: &[(usize, &[Fly])]) -> Result<()> {
        self.flies = populations[0].1.to_vec();
        self.inner.load(populations)
    }
    fn replace(&mut self, changes: &[Change]) -> Result<()> {
        for change in changes {
            self.flies[change.index as usize] = change.fly;
        }
        self.inner.load(&[(0, &self.flies)])
    }
    fn evaluation(&self, lane: usize) -> Evaluation<'_> {
        self.inner.evaluation(lane)
    }
    fn read_back_layers(&mut self, lane: usize) -> Result<Layers> {
        self.inner.read_back_layers(lane)
    }
}

/// Runs `births` births and returns the best SAE, which all evaluators must agree on.
fn run(evaluator: Box<dyn Evaluator>, flies: &[Fly], births: u64, batch_births: u32) -> u64 {
    let scheme = PaperScheme { births, batch_births, ..PaperScheme::default() };
    let mut engine = Engine::new(evaluator, vec![Evolution::new(scheme, 0, 256, 256, flies.to_vec())]);
    engine.run(&mut Undisturbed).expect("the evaluator works");
    engine.evolutions()[0].best_sae().expect("it was evaluated")
}

fn paper_run(criterion: &mut Criterion) {
    let device = common::device();
    let (scene, flies) = common::scene(256, 256, 2_500);
    let cpu = || Box::new(CpuEvaluator::new(vec![scene.clone()]));
    let vulkan = || GpuEvaluator::create(&device, vec![scene.clone()]).expect("it fits");
    let mut group = criterion.benchmark_group("paper_run");
    group.sample_size(10);
    group.bench_function("cpu/40000 births one by one", |bencher| {
        bencher.iter(|| run(cpu(), &flies, 40_000, 1));
    });
    group.bench_function("cpu/40000 births by 25", |bencher| bencher.iter(|| run(cpu(), &flies, 40_000, 25)));
    group.bench_function("vulkan/40000 births by 25", |bencher| {
        bencher.iter(|| run(Box::new(vulkan()), &flies, 40_000, 25));
    });
    group.bench_function("vulkan/40000 births by 25, full refresh", |bencher| {
        bencher.iter(|| run(Box::new(FullRefresh { inner: vulkan(), flies: Vec::new() }), &flies, 40_000, 25));
    });
    group.bench_function("vulkan/2000 births one by one", |bencher| {
        bencher.iter(|| run(Box::new(vulkan()), &flies, 2_000, 1));
    });
    group.finish();
}

criterion_group!(benches, paper_run);
criterion_main!(benches);
