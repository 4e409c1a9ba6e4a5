//! The evaluators equal brute force, with `==`.

use smalti::cpu::CpuEvaluator;
use smalti::model::{Canvas, Change, Evaluator, Fly, NO_FLY, Population, Scene};

use crate::reference::Reference;
use crate::scenarios::{Scenario, any_fly, random_scene, scenarios, stream};

/// Flies whose marginal fitness is also checked by leaving them out of a whole picture.
const RE_RENDERS: usize = 500;

fn check_scenario(evaluator: &mut dyn Evaluator, scenario: &Scenario) {
    let Scenario { name, scene, flies } = scenario;
    evaluator.load(&[(0, flies)]).expect("the evaluator works");
    let reference = Reference::new(scene, flies);
    let evaluation = evaluator.evaluation(0);
    assert_eq!(evaluation.sae, reference.sae_without(None), "{name}: SAE");
    assert_eq!(evaluation.marginal, reference.marginal(flies.len()), "{name}: marginal fitness");
    let stride = flies.len().div_ceil(RE_RENDERS).max(scene.target.pixels().len() / 1_000_000);
    for fly in (0..flies.len()).step_by(stride) {
        let gain = reference.sae_without(Some(fly as u32)) as i64 - evaluation.sae as i64;
        assert_eq!(evaluation.marginal[fly], gain, "{name}: leaving out fly {fly}");
    }
    let layers = evaluator.read_back_layers(0).expect("the evaluator works");
    assert_eq!(layers.top, reference.layer(0), "{name}: top layer");
    assert_eq!(layers.under, reference.layer(1), "{name}: under layer");

    let canvas = Canvas::evaluation(scene.target.width_px(), scene.target.height_px());
    let mosaic = evaluator.draw(&population(scene, flies), &canvas, 1).expect("the evaluator works");
    assert_eq!(mosaic.pixels, reference.colors(), "{name}: drawn mosaic");
}

fn population(scene: &Scene, flies: &[Fly]) -> Population {
    Population {
        width_px: scene.target.width_px(),
        height_px: scene.target.height_px(),
        background: scene.background,
        masks: (*scene.masks).clone(),
        flies: flies.to_vec(),
    }
}

#[test]
fn on_the_cpu_fitness_layers_and_mosaic_equal_brute_force() {
    for scenario in scenarios() {
        check_scenario(&mut CpuEvaluator::new(vec![scenario.scene.clone()]), &scenario);
    }
}

/// 10,000 births, in batches of 1 to 100, then the same population loaded afresh.
fn check_incremental(evaluator: &mut dyn Evaluator) {
    let mut random = stream(7);
    let scene = evaluator.scene(0).clone();
    let mut flies: Vec<Fly> = (0..scene.fly_count).map(|_| any_fly(&scene, 0.25..15.0, &mut random)).collect();
    evaluator.load(&[(0, &flies)]).expect("the evaluator works");
    let mut births = 0;
    while births < 10_000 {
        let count = 1 + random.below(100).min(9_999 - births);
        let change = |_| {
            let index = random.below(scene.fly_count as u32);
            let fly = if index % 17 == 0 { Fly::ABSENT } else { any_fly(&scene, 0.25..15.0, &mut random) };
            flies[index as usize] = fly;
            Change { lane: 0, index, fly }
        };
        let changes: Vec<Change> = (0..count).map(change).collect();
        evaluator.replace(&changes).expect("the evaluator works");
        births += count;
    }
    let (sae, marginal) = (evaluator.evaluation(0).sae, evaluator.evaluation(0).marginal.to_vec());
    let layers = evaluator.read_back_layers(0).expect("the evaluator works");
    evaluator.load(&[(0, &flies)]).expect("the evaluator works");
    let fresh = evaluator.evaluation(0);
    assert_eq!((sae, marginal.as_slice()), (fresh.sae, fresh.marginal));
    assert_eq!(layers, evaluator.read_back_layers(0).expect("the evaluator works"));
    assert_eq!(sae, Reference::new(&scene, &flies).sae_without(None));
    assert!(layers.top.iter().any(|&fly| fly != NO_FLY));
}

#[test]
fn on_the_cpu_the_state_after_ten_thousand_births_equals_a_fresh_evaluation() {
    check_incremental(&mut CpuEvaluator::new(vec![random_scene(120, 90, 400, &mut stream(3))]));
}
