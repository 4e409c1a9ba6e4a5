//! Same picture, options and seed: the same population and the same pixels, whatever evaluates and however.

use sha2::{Digest, Sha256};
use smalti::cpu::{CpuEvaluator, CpuPainter};
use smalti::engine::Engine;
use smalti::evolve::evolution::random_population;
use smalti::evolve::{ALGORITHM_VERSION, Evolution, Outcome, PaperScheme, Undisturbed};
use smalti::gpu::{GpuEvaluator, GpuPainter};
use smalti::model::{Canvas, Evaluator, Fly, Mosaic, Painter, Population, Scene};
use smalti::vk::DeviceOptions;

use crate::canary;
use crate::scenarios::{random_scene, stream};

/// All that an evolution leads to.
type Result = (Vec<Fly>, u64, Vec<i64>, Outcome, Mosaic);

fn evolve(evaluator: Box<dyn Evaluator>, painter: &mut dyn Painter, scheme: PaperScheme) -> Result {
    let scene = evaluator.scene(0).clone();
    let (width_px, height_px) = (scene.target.width_px(), scene.target.height_px());
    let flies = random_population(width_px, height_px, scene.fly_count, scheme.seed);
    let mut engine = Engine::new(evaluator, vec![Evolution::new(scheme, 0, width_px, height_px, flies)]);
    engine.run(&mut Undisturbed).expect("the evaluator works");
    let evolution = &engine.evolutions()[0];
    let (best, sae) = (evolution.best_flies().to_vec(), evolution.best_sae().expect("it was evaluated"));
    let outcome = evolution.outcome();
    let population = Population {
        width_px,
        height_px,
        background: scene.background.into(),
        grout: None,
        masks: (*scene.masks).clone(),
        flies: best.clone(),
    };
    let evaluation = engine.evaluator().evaluation(0);
    assert_eq!(evaluation.sae, sae, "the best population is loaded when the evolution has ended");
    let marginal = evaluation.marginal.to_vec();
    let canvas = Canvas::scaled(width_px, height_px, 450);
    let mosaic = painter.draw(&population, &canvas, 2).expect("the painter works");
    (best, sae, marginal, outcome, mosaic)
}

/// Large enough that the twin shares both a whole evaluation and a batch of births among its threads.
fn scene() -> Scene {
    random_scene(320, 240, 900, &mut stream(8))
}

fn on_threads(threads: usize, scheme: &PaperScheme) -> Result {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a small pool");
    pool.install(|| evolve(Box::new(CpuEvaluator::new(vec![scene()])), &mut CpuPainter, scheme.clone()))
}

fn check_everywhere(scheme: &PaperScheme) {
    let one = on_threads(1, scheme);
    assert_eq!(one, on_threads(2, scheme), "two threads");
    let vulkan = canary::with_device(&DeviceOptions::default(), |device| {
        let evaluator = GpuEvaluator::create(&device, vec![scene()]).expect("it fits");
        let mut painter = GpuPainter::create(&device).expect("the device works");
        evolve(Box::new(evaluator), &mut painter, scheme.clone())
    });
    assert_eq!(one, vulkan, "software Vulkan");
    let other_seed = on_threads(1, &PaperScheme { seed: scheme.seed + 1, ..scheme.clone() });
    assert_ne!(one.0, other_seed.0, "the seed matters");
}

#[test]
fn births_one_by_one_lead_to_the_same_mosaic_everywhere() {
    check_everywhere(&PaperScheme { seed: 3, births: 1_500, ..PaperScheme::default() });
}

#[test]
fn batches_of_births_with_cooling_restarts_lead_to_the_same_mosaic_everywhere() {
    let scheme = PaperScheme {
        seed: 4,
        births: 2_000,
        restarts: 2,
        cool_q16: 1 << 15,
        batch_births: 90,
        ..PaperScheme::default()
    };
    check_everywhere(&scheme);
}

#[test]
fn evolution_lowers_the_error_and_restarts_never_lose_the_best() {
    let run = |restarts| on_threads(1, &PaperScheme { births: 1_000, restarts, ..PaperScheme::default() }).1;
    let first = on_threads(1, &PaperScheme { births: 0, ..PaperScheme::default() }).1;
    let saes = [first, run(0), run(1), run(2)];
    assert!(saes[1] < first, "{saes:?}");
    assert!(saes.is_sorted_by(|a, b| a >= b), "{saes:?}");
}

/// The first 16 digits of the SHA-256 of the best population, gene by gene.
fn population_hash((flies, ..): &Result) -> String {
    let mut hash = Sha256::new();
    for fly in flies {
        let genes = [fly.x as u32, fly.y as u32, fly.z, fly.w, fly.h, fly.angle.into()];
        let colors = [fly.r, fly.g, fly.b].map(u32::from);
        genes.iter().chain(&colors).for_each(|gene| hash.update(gene.to_le_bytes()));
    }
    hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn this_version_of_the_algorithm_leads_to_the_populations_it_always_did() {
    let one_by_one = PaperScheme { seed: 5, births: 3_000, ..PaperScheme::default() };
    let batches = PaperScheme { restarts: 1, cool_q16: 40_000, batch_births: 11, ..one_by_one.clone() };
    let found = [&one_by_one, &batches].map(|scheme| population_hash(&on_threads(2, scheme)));
    assert_eq!(
        (ALGORITHM_VERSION, found.each_ref().map(String::as_str)),
        (2, ["20dfb2177a56e5a2", "f9995ec40bbcf711"]),
        "the same options give another population: raise evolve::ALGORITHM_VERSION with the hashes"
    );
}
