//! Every parameter of the paper's scheme: the same bytes on both evaluators, and what it promises.

use std::sync::Arc;

use smalti::cpu::{CpuEvaluator, CpuPainter};
use smalti::engine::{Engine, side_by_side};
use smalti::evolve::{
    ColorMode, ColorRule, Evolution, Observer, Palette, PaperScheme, Seen, StopReason, Undisturbed, begin_from,
    first_population,
};
use smalti::gpu::{GpuEvaluator, GpuPainter};
use smalti::model::operators::Rotation;
use smalti::model::{Canvas, Evaluator, Fly, Painter, Population, Scene};
use smalti::vk::DeviceOptions;

use crate::canary;
use crate::scenarios::{holed_masks, random_scene, stream};

fn scene() -> Scene {
    Scene { masks: Arc::new(holed_masks()), ..random_scene(96, 80, 240, &mut stream(31)) }
}

/// Enough births for what all parameters do, and two restarts.
fn usual() -> PaperScheme {
    PaperScheme { seed: 9, births: 400, restarts: 2, ..PaperScheme::default() }
}

fn palette() -> Palette {
    Palette::new([[0, 0, 0], [250, 240, 230], [200, 30, 20], [20, 180, 60], [30, 40, 210]]).expect("five colours")
}

fn color(mode: ColorMode, palette: Option<Palette>) -> ColorRule {
    ColorRule { mode, palette }
}

/// A scheme for each parameter, and some together.
fn schemes() -> Vec<(&'static str, PaperScheme)> {
    let half = 1 << 15;
    vec![
        ("mutation", PaperScheme { mutation_q16: half, ..usual() }),
        ("crossover", PaperScheme { crossover_q16: half, ..usual() }),
        ("crossover only", PaperScheme { crossover_q16: 1 << 16, mutation_q16: 0, ..usual() }),
        ("new blood", PaperScheme { new_blood_q16: half, ..usual() }),
        ("mitosis", PaperScheme { mitosis: 2, cool_q16: 40_000, ..usual() }),
        ("no rotation", PaperScheme { rotation: Rotation::None, ..usual() }),
        ("large tiles", PaperScheme { tile_scale_q16: 4 << 16, ..usual() }),
        ("masks", PaperScheme { masks: vec![vec![0], vec![1, 0], vec![1, 2]], ..usual() }),
        ("picked", PaperScheme { color: color(ColorMode::Pick, None), ..usual() }),
        ("mean", PaperScheme { color: color(ColorMode::Mean, None), masks: vec![vec![1]], ..usual() }),
        ("median", PaperScheme { color: color(ColorMode::Median, None), batch_births: 7, ..usual() }),
        ("palette", PaperScheme { color: color(ColorMode::Evolved, Some(palette())), ..usual() }),
        (
            "all together",
            PaperScheme {
                color: color(ColorMode::Median, Some(palette())),
                mutation_q16: 60_000,
                crossover_q16: half,
                new_blood_q16: 6_000,
                mitosis: 1,
                masks: vec![vec![0, 1], vec![1]],
                tile_scale_q16: 90_000,
                batch_births: 3,
                ..usual()
            },
        ),
    ]
}

/// The best population, its SAE, and its spread's index.
type Result = (Vec<Fly>, u64, Option<f64>);

fn evolve(evaluator: Box<dyn Evaluator>, painter: &mut dyn Painter, scheme: &PaperScheme) -> Result {
    let scene = evaluator.scene(0).clone();
    let (width_px, height_px) = (scene.target.width_px(), scene.target.height_px());
    let flies = first_population(scheme, &scene.target, scene.fly_count);
    let mut engine = Engine::new(evaluator, vec![Evolution::new(scheme.clone(), 0, width_px, height_px, flies)]);
    engine.run(&mut Undisturbed).expect("the evaluator works");
    let evolution = &engine.evolutions()[0];
    let (flies, sae) = (evolution.best_flies().to_vec(), evolution.best_sae().expect("it was evaluated"));
    let spread = evolution.spread().clark_evans;
    let (background, masks) = (scene.background.into(), (*scene.masks).clone());
    let population = Population { width_px, height_px, background, grout: None, masks, flies: flies.clone() };
    let mosaic = painter.draw(&population, &Canvas::evaluation(width_px, height_px), 1).expect("it draws");
    let pairs = mosaic.pixels.as_flattened().iter().zip(scene.target.pixels().as_flattened());
    let drawn: u64 = pairs.map(|(&one, &other)| u64::from(one.abs_diff(other))).sum();
    assert_eq!((engine.evaluator().evaluation(0).sae, drawn), (sae, sae), "the result is what was scored");
    (flies, sae, spread)
}

fn on_cpu(scheme: &PaperScheme) -> Result {
    evolve(Box::new(CpuEvaluator::new(vec![scene()])), &mut CpuPainter, scheme)
}

#[test]
fn every_parameter_leads_to_the_same_population_on_both_evaluators() {
    let usual = on_cpu(&usual());
    canary::with_device(&DeviceOptions::default(), |device| {
        for (name, scheme) in schemes() {
            let vulkan = GpuEvaluator::create(&device, vec![scene()]).expect("it fits");
            let result = on_cpu(&scheme);
            let mut painter = GpuPainter::create(&device).expect("the device works");
            assert_eq!(result, evolve(Box::new(vulkan), &mut painter, &scheme), "{name}");
            assert_ne!(result.0, usual.0, "{name} changes nothing");
        }
    });
}

#[test]
fn pictures_evolved_side_by_side_are_those_evolved_alone() {
    let schemes = schemes();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("a small pool");
    let together = pool.install(|| side_by_side(schemes.len(), |number| Ok(on_cpu(&schemes[number].1))));
    let alone: Vec<Result> = schemes.iter().map(|(_, scheme)| on_cpu(scheme)).collect();
    assert_eq!(together.expect("the threads start"), alone);
}

#[test]
fn lanes_with_schemes_of_their_own_evolve_as_each_would_alone() {
    let chosen: Vec<PaperScheme> =
        schemes().into_iter().filter(|(name, _)| ["median", "masks", "mitosis"].contains(name)).map(|s| s.1).collect();
    let alone: Vec<Result> = chosen.iter().map(on_cpu).collect();
    let scenes = vec![scene(); chosen.len()];
    let evolution = |(lane, scheme): (usize, &PaperScheme)| {
        Evolution::new(scheme.clone(), lane, 96, 80, first_population(scheme, &scenes[lane].target, 240))
    };
    let evolutions = chosen.iter().enumerate().map(evolution).collect();
    let mut engine = Engine::new(Box::new(CpuEvaluator::new(scenes.clone())), evolutions);
    engine.run(&mut Undisturbed).expect("the evaluator works");
    for (evolution, (flies, sae, _)) in engine.evolutions().iter().zip(alone) {
        assert_eq!((evolution.best_flies(), evolution.best_sae()), (&flies[..], Some(sae)));
    }
}

#[test]
fn all_colours_of_a_result_lie_in_the_palette() {
    for mode in [ColorMode::Evolved, ColorMode::Pick, ColorMode::Mean, ColorMode::Median] {
        let scheme = PaperScheme { color: color(mode, Some(palette())), mitosis: 1, crossover_q16: 20_000, ..usual() };
        let (flies, ..) = on_cpu(&PaperScheme { new_blood_q16: 9_000, ..scheme });
        let strange = flies.iter().find(|fly| !palette().colors().contains(&fly.color()));
        assert_eq!(strange, None, "{mode:?}");
        let used = palette().colors().iter().filter(|&&c| flies.iter().any(|fly| fly.color() == c)).count();
        assert!(used >= 3, "{mode:?}: {used} colours for a picture that has all");
    }
}

#[test]
fn the_result_wears_the_masks_of_the_last_run() {
    let scheme = PaperScheme { masks: vec![vec![0], vec![1, 2]], ..usual() };
    let first = first_population(&scheme, &scene().target, 240);
    assert!(first.iter().all(|fly| fly.mask == 0));
    let (flies, ..) = on_cpu(&scheme);
    assert!(flies.iter().all(|fly| [1, 2].contains(&fly.mask)));
    // A run without a birth is enough.
    let (flies, ..) = on_cpu(&PaperScheme { births: 0, restarts: 1, ..scheme });
    let count = |layer| flies.iter().filter(|fly| fly.mask == layer).count();
    assert!(count(1) > 80 && count(2) > 80 && count(1) + count(2) == 240, "both about equally often");
}

#[test]
fn without_rotation_the_result_lies_straight() {
    let scheme = PaperScheme { rotation: Rotation::None, crossover_q16: 1 << 15, new_blood_q16: 999, ..usual() };
    assert!(on_cpu(&scheme).0.iter().all(|fly| fly.angle == 0));
}

/// Remembers how many flies live, and the area of all tiles, when each run begins.
#[derive(Default)]
struct Runs(Vec<(usize, f64)>);

impl Runs {
    fn look(&mut self, evolution: &Evolution) {
        if evolution.births_in_run() == 0 {
            let living = evolution.flies().iter().filter(|fly| fly.alive);
            let area = living.clone().map(|fly| f64::from(fly.w) * f64::from(fly.h)).sum();
            self.0.push((living.count(), area));
        }
    }
}

impl Observer for Runs {
    fn at_start(&mut self, seen: &mut Seen<'_>) -> smalti::Result<()> {
        self.after_epoch(seen).map(|_| ())
    }

    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> smalti::Result<Option<StopReason>> {
        let Seen::Evolutions(evolutions) = seen else { panic!("it is the paper's scheme") };
        self.look(&evolutions[0]);
        Ok(None)
    }
}

#[test]
fn mitosis_doubles_the_living_flies_at_the_first_restarts() {
    let scheme = PaperScheme { mitosis: 2, restarts: 3, births: 50, ..usual() };
    let scene = Scene { fly_count: 242, ..scene() };
    let flies = first_population(&scheme, &scene.target, 242);
    let evaluator = Box::new(CpuEvaluator::new(vec![scene]));
    let mut engine = Engine::new(evaluator, vec![Evolution::new(scheme, 0, 96, 80, flies)]);
    let mut runs = Runs::default();
    engine.run(&mut runs).expect("the evaluator works");
    assert_eq!(runs.0.iter().map(|run| run.0).collect::<Vec<_>>(), [61, 122, 242, 242]);
    assert_eq!(engine.evolutions()[0].best_flies().iter().filter(|fly| fly.alive).count(), 242);
}

#[test]
fn mitosis_keeps_the_area_but_for_the_mutations_of_every_other_fly() {
    // Without a birth a run ends with the population that it began with.
    let scheme = PaperScheme { mitosis: 2, births: 0, cool_q16: 1, ..usual() };
    let scene = scene();
    let flies = first_population(&scheme, &scene.target, 240);
    let mut engine =
        Engine::new(Box::new(CpuEvaluator::new(vec![scene])), vec![Evolution::new(scheme, 0, 96, 80, flies.clone())]);
    let mut runs = Runs::default();
    engine.run(&mut runs).expect("the evaluator works");
    let areas: Vec<f64> = runs.0.iter().map(|run| run.1).collect();
    assert!(areas.iter().all(|area| (area / areas[0] - 1.0).abs() < 0.01), "{areas:?}");
    // With steps cooled to nothing both halves lie where the whole was.
    let after = engine.evolutions()[0].flies();
    assert!((0..60).all(|k| (after[k].x - flies[k].x).abs() <= 1 && (after[k + 60].x - flies[k].x).abs() <= 1));
}

#[test]
fn a_population_from_elsewhere_keeps_its_masks_unless_the_scheme_names_some() {
    let wearing = |mask| move |fly: Fly| Fly { mask, r: 40_000, g: 40_000, b: 40_000, ..fly };
    let scene = scene();
    let given: Vec<Fly> = first_population(&usual(), &scene.target, 240).into_iter().map(wearing(1)).collect();
    assert_eq!(begin_from(&usual(), given.clone()), given);
    let naming = PaperScheme { masks: vec![vec![2]], ..usual() };
    assert!(begin_from(&naming, given.clone()).iter().all(|fly| fly.mask == 2));
    let later = PaperScheme { masks: vec![vec![], vec![0]], new_blood_q16: 1 << 14, ..usual() };
    assert_eq!(begin_from(&later, given.clone()), given);

    // New flies wear what the others do.
    let blood = PaperScheme { new_blood_q16: 1 << 15, restarts: 0, ..usual() };
    let evolution = Evolution::new(blood, 0, 96, 80, given.clone());
    let mut engine = Engine::new(Box::new(CpuEvaluator::new(vec![scene])), vec![evolution]);
    engine.run(&mut Undisturbed).expect("the evaluator works");
    assert!(engine.evolutions()[0].flies().iter().all(|fly| fly.mask == 1));

    let straight =
        PaperScheme { rotation: Rotation::None, color: color(ColorMode::Evolved, Some(palette())), ..usual() };
    let begun = begin_from(&straight, given);
    assert!(begun.iter().all(|fly| fly.angle == 0 && palette().colors().contains(&fly.color())));
}

#[test]
fn colours_of_what_shows_fit_better_than_picked_ones() {
    let sae = |mode| on_cpu(&PaperScheme { color: color(mode, None), births: 3_000, restarts: 0, ..usual() }).1;
    let (picked, mean, median) = (sae(ColorMode::Pick), sae(ColorMode::Mean), sae(ColorMode::Median));
    assert!(mean < picked && median < picked, "picked {picked}, mean {mean}, median {median}");
}
