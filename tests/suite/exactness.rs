//! The evaluators equal brute force, with `==`.

use std::sync::Arc;

use smalti::cpu::{CpuEvaluator, CpuPainter};
use smalti::gpu::{GpuEvaluator, GpuPainter, KernelShape};
use smalti::model::fly::SIDE_MAX;
use smalti::model::mask::Texel;
use smalti::model::{Blend, Canvas, Change, Evaluator, Fly, Mask, MaskSet, NO_FLY, Painter, Population, Scene, Target};

use smalti::vk::{DeviceOptions, Staging};

use crate::canary;
use crate::reference::Reference;
use crate::scenarios::{
    Scenario, any_fly, deep_stacks, dressed_scenarios, holed_masks, random_scene, scenarios, stream, translucent_masks,
    translucent_scenarios,
};

/// Flies whose marginal fitness is also checked by leaving them out of a whole picture.
const RE_RENDERS: usize = 500;

pub fn check_scenario(evaluator: &mut dyn Evaluator, painter: &mut dyn Painter, scenario: &Scenario) {
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
    let mosaic = painter.draw(&population(scene, flies), &canvas, 1).expect("the painter works");
    assert_eq!(mosaic.pixels, reference.colors(), "{name}: drawn mosaic");
}

pub fn population(scene: &Scene, flies: &[Fly]) -> Population {
    Population {
        width_px: scene.target.width_px(),
        height_px: scene.target.height_px(),
        background: scene.background.into(),
        grout: None,
        masks: (*scene.masks).clone(),
        flies: flies.to_vec(),
    }
}

#[test]
fn on_the_cpu_translucent_fitness_layers_and_mosaic_equal_brute_force() {
    for scenario in translucent_scenarios().into_iter().chain(deep_stacks()) {
        check_scenario(&mut CpuEvaluator::new(vec![scenario.scene.clone()]), &mut CpuPainter, &scenario);
    }
}

#[test]
fn on_the_cpu_fitness_layers_and_mosaic_equal_brute_force() {
    for scenario in scenarios() {
        check_scenario(&mut CpuEvaluator::new(vec![scenario.scene.clone()]), &mut CpuPainter, &scenario);
    }
}

#[test]
fn on_vulkan_fitness_layers_and_mosaic_equal_brute_force() {
    for scenario in scenarios() {
        canary::with_device(&DeviceOptions::default(), |device| {
            let mut evaluator = GpuEvaluator::create(&device, vec![scenario.scene.clone()]).expect("it fits");
            let mut painter = GpuPainter::create(&device).expect("the device works");
            check_scenario(&mut evaluator, &mut painter, &scenario);
            let drawn = painter.draw_fly_layer(&population(&scenario.scene, &scenario.flies)).expect("it draws");
            let layers = evaluator.read_back_layers(0).expect("the evaluator works");
            assert_eq!(drawn, layers.top, "{}: the graphics pass and the compute pass differ", scenario.name);
        });
    }
}

#[test]
fn on_vulkan_translucent_fitness_layers_and_mosaic_equal_brute_force() {
    for scenario in translucent_scenarios().into_iter().chain(deep_stacks()) {
        canary::with_device(&DeviceOptions::default(), |device| {
            let mut evaluator = GpuEvaluator::create(&device, vec![scenario.scene.clone()]).expect("it fits");
            let mut painter = GpuPainter::create(&device).expect("the device works");
            check_scenario(&mut evaluator, &mut painter, &scenario);
        });
    }
}

#[test]
fn every_mask_under_every_shader_equals_brute_force_on_the_cpu_and_on_vulkan() {
    for scenario in dressed_scenarios() {
        check_scenario(&mut CpuEvaluator::new(vec![scenario.scene.clone()]), &mut CpuPainter, &scenario);
        canary::with_device(&DeviceOptions::default(), |device| {
            let mut evaluator = GpuEvaluator::create(&device, vec![scenario.scene.clone()]).expect("it fits");
            let mut painter = GpuPainter::create(&device).expect("the device works");
            check_scenario(&mut evaluator, &mut painter, &scenario);
        });
    }
}

#[test]
fn every_kernel_shape_gives_the_same_numbers_directly_and_through_staging() {
    for (block_side_px, pixels_per_thread) in [(8, 1), (8, 4), (16, 4), (16, 8), (32, 4)] {
        let options = DeviceOptions { staging: Staging::Forced, ..DeviceOptions::default() };
        canary::with_device(&options, |device| {
            let shape = KernelShape { block_side_px, pixels_per_thread };
            let all = scenarios().into_iter().chain(translucent_scenarios());
            for scenario in &all.filter(|scenario| scenario.flies.len() <= 300).collect::<Vec<_>>() {
                let scenes = vec![scenario.scene.clone()];
                let mut evaluator = GpuEvaluator::create_with_shape(&device, scenes, shape).expect("it fits");
                let mut painter = GpuPainter::create(&device).expect("the device works");
                check_scenario(&mut evaluator, &mut painter, scenario);
            }
        });
    }
}

#[test]
fn translucent_tiles_are_drawn_alike_at_any_size_and_supersampling() {
    canary::with_device(&DeviceOptions::default(), |device| {
        for Scenario { name, scene, flies } in translucent_scenarios().into_iter().chain(deep_stacks()) {
            let (width_px, height_px) = (scene.target.width_px(), scene.target.height_px());
            if width_px.max(height_px) > 256 {
                continue;
            }
            let population = population(&scene, &flies);
            let mut vulkan = GpuPainter::create(&device).expect("the device works");
            // The last spans several patches of samples.
            let sizes = [(17, 1), (150, 3), (1_100, 1)];
            for (long_side_px, supersampling) in sizes.into_iter().take(if flies.len() > 1_000 { 1 } else { 3 }) {
                let canvas = Canvas::scaled(width_px, height_px, long_side_px);
                let draw = |painter: &mut dyn Painter| {
                    painter.draw(&population, &canvas, supersampling).expect("the painter works")
                };
                let same = draw(&mut CpuPainter) == draw(&mut vulkan);
                assert!(same, "{name} at {long_side_px} px with {supersampling}² samples");
            }
        }
    });
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
            let fly = if index.is_multiple_of(17) { Fly::ABSENT } else { any_fly(&scene, 0.25..15.0, &mut random) };
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

fn incremental_scene() -> Scene {
    Scene { masks: Arc::new(holed_masks()), ..random_scene(120, 90, 400, &mut stream(3)) }
}

fn incremental_translucent_scene() -> Scene {
    Scene { masks: Arc::new(translucent_masks(&mut stream(4))), ..incremental_scene() }
}

#[test]
fn on_the_cpu_the_state_after_ten_thousand_births_equals_a_fresh_evaluation() {
    check_incremental(&mut CpuEvaluator::new(vec![incremental_scene()]));
}

#[test]
fn on_the_cpu_the_translucent_state_after_ten_thousand_births_equals_a_fresh_evaluation() {
    check_incremental(&mut CpuEvaluator::new(vec![incremental_translucent_scene()]));
}

#[test]
fn on_vulkan_the_state_after_ten_thousand_births_equals_a_fresh_evaluation() {
    canary::with_device(&DeviceOptions::default(), |device| {
        check_incremental(&mut GpuEvaluator::create(&device, vec![incremental_scene()]).expect("it fits"));
    });
}

#[test]
fn on_vulkan_the_translucent_state_after_ten_thousand_births_equals_a_fresh_evaluation() {
    canary::with_device(&DeviceOptions::default(), |device| {
        check_incremental(&mut GpuEvaluator::create(&device, vec![incremental_translucent_scene()]).expect("it fits"));
    });
}

/// Loads and changes four lanes together, and each alone; all fitness must agree.
fn check_lanes(mut create: impl FnMut(Vec<Scene>) -> Box<dyn Evaluator>) {
    let mut random = stream(11);
    let masked = Scene { masks: Arc::new(holed_masks()), ..random_scene(70, 20, 90, &mut random) };
    let foggy = Scene { masks: Arc::new(translucent_masks(&mut random)), ..random_scene(40, 41, 100, &mut random) };
    let scenes = vec![random_scene(33, 65, 120, &mut random), foggy, masked, random_scene(8, 8, 7, &mut random)];
    let populations: Vec<Vec<Fly>> = scenes
        .iter()
        .map(|scene| (0..scene.fly_count).map(|_| any_fly(scene, 1.0..20.0, &mut random)).collect())
        .collect();
    let change = |lane: usize, random: &mut _| {
        let index = scenes[lane].fly_count as u32 / 2;
        Change { lane, index, fly: any_fly(&scenes[lane], 1.0..20.0, random) }
    };
    let changes: Vec<Change> = (0..scenes.len()).map(|lane| change(lane, &mut random)).collect();

    let mut together = create(scenes.clone());
    let loads: Vec<(usize, &[Fly])> = populations.iter().map(Vec::as_slice).enumerate().collect();
    together.load(&loads).expect("the evaluator works");
    together.replace(&changes).expect("the evaluator works");
    for (lane, scene) in scenes.iter().enumerate() {
        let mut alone = create(vec![scene.clone()]);
        alone.load(&[(0, &populations[lane])]).expect("the evaluator works");
        alone.replace(&[Change { lane: 0, ..changes[lane] }]).expect("the evaluator works");
        assert_eq!(together.evaluation(lane), alone.evaluation(0), "lane {lane}");
        let layers = together.read_back_layers(lane).expect("the evaluator works");
        assert_eq!(layers, alone.read_back_layers(0).expect("the evaluator works"), "lane {lane}");
    }
}

#[test]
fn on_the_cpu_lanes_of_different_sizes_and_blends_equal_single_ones() {
    check_lanes(|scenes| Box::new(CpuEvaluator::new(scenes)));
}

#[test]
fn on_vulkan_lanes_of_different_sizes_and_blends_equal_single_ones() {
    canary::with_device(&DeviceOptions::default(), |device| {
        check_lanes(|scenes| Box::new(GpuEvaluator::create(&device, scenes).expect("it fits")));
    });
}

/// With coverage of nothing or all, translucent tiles are opaque ones.
fn check_opaque_equivalence(mut create: impl FnMut(Scene) -> Box<dyn Evaluator>, painter: &mut dyn Painter) {
    let mut random = stream(12);
    let texel = |texel: &Texel| Texel { coverage: if texel.coverage < 128 { 0 } else { 255 }, ..*texel };
    let holed = holed_masks();
    let layers = holed.layers()[1..].iter().map(|mask| Mask::new(mask.texels().iter().map(texel).collect()));
    let masks = MaskSet::with_layers(layers.collect::<Result<_, _>>().expect("full layers")).expect("few layers");
    let scene = Scene { background: [1, 99, 200], ..random_scene(75, 50, 220, &mut random) };
    let flies: Vec<Fly> = (0..scene.fly_count)
        .map(|index| Fly { mask: index as u16 % 3, ..any_fly(&scene, 1.0..20.0, &mut random) })
        .collect();
    let mut evaluate = |blend: Blend| {
        let scene = Scene { masks: Arc::new(masks.clone().with_blend(blend)), ..scene.clone() };
        let mut evaluator = create(scene.clone());
        evaluator.load(&[(0, &flies)]).expect("the evaluator works");
        let evaluation = (evaluator.evaluation(0).sae, evaluator.evaluation(0).marginal.to_vec());
        let layers = evaluator.read_back_layers(0).expect("the evaluator works");
        let canvas = Canvas::scaled(75, 50, 120);
        (evaluation, layers, painter.draw(&population(&scene, &flies), &canvas, 2).expect("the painter works"))
    };
    assert_eq!(evaluate(Blend::Opaque), evaluate(Blend::Translucent));
}

#[test]
fn on_the_cpu_translucent_tiles_of_all_or_nothing_equal_opaque_ones() {
    check_opaque_equivalence(|scene| Box::new(CpuEvaluator::new(vec![scene])), &mut CpuPainter);
}

#[test]
fn on_vulkan_translucent_tiles_of_all_or_nothing_equal_opaque_ones() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let painter = &mut GpuPainter::create(&device).expect("the device works");
        check_opaque_equivalence(
            |scene| Box::new(GpuEvaluator::create(&device, vec![scene]).expect("it fits")),
            painter,
        );
    });
}

#[test]
fn re_rendering_without_each_fly_gives_the_marginal_fitness_of_the_one_dispatch() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let scene = incremental_scene();
        let mut random = stream(5);
        let flies: Vec<Fly> = (0..scene.fly_count).map(|_| any_fly(&scene, 1.0..15.0, &mut random)).collect();
        let mut evaluator = GpuEvaluator::create(&device, vec![scene]).expect("it fits");
        evaluator.load(&[(0, &flies)]).expect("the evaluator works");
        let slow = evaluator.marginal_by_re_rendering().expect("it fits a dispatch");
        assert_eq!(slow, evaluator.evaluation(0).marginal);
    });
}

/// White over black on 2400x2400 px: marginal fitness and SAE need more than 32 bits, going up and coming down.
fn check_wide_sums(mut create: impl FnMut(Scene) -> Box<dyn Evaluator>) {
    const SIDE_PX: u32 = 2_400;
    let pixels = i64::from(SIDE_PX * SIDE_PX);
    let black = Target::new(SIDE_PX, SIDE_PX, vec![[0; 3]; pixels as usize]).expect("a valid size");
    let scene = Scene { target: Arc::new(black), masks: Arc::default(), background: [0; 3], fly_count: 2 };
    let whole = Fly { x: 76_800, y: 76_800, w: SIDE_MAX, h: SIDE_MAX, alive: true, ..Fly::ABSENT };
    let white = Fly { r: 65_535, g: 65_535, b: 65_535, z: 1, ..whole };
    let grey = Fly { r: 32_896, g: 32_896, b: 32_896, z: 2, ..whole };
    let mut evaluator = create(scene);
    evaluator.load(&[(0, &[white, grey])]).expect("the evaluator works");
    let per_pixel = |expected: (i64, i64, i64), evaluator: &dyn Evaluator| {
        let (sae, first, second) = expected;
        let evaluation = evaluator.evaluation(0);
        assert_eq!(evaluation.sae as i64, sae * pixels);
        assert_eq!(evaluation.marginal, [first * pixels, second * pixels]);
    };
    // 128 of 255 in each of three channels is 384; white is 765.
    per_pixel((765, 384 - 765, 0), &*evaluator);
    let mut replace = |index, fly| evaluator.replace(&[Change { lane: 0, index, fly }]).expect("the evaluator works");
    replace(0, Fly::ABSENT);
    replace(1, white);
    per_pixel((765, 0, -765), &*evaluator);
    evaluator.replace(&[Change { lane: 0, index: 1, fly: Fly::ABSENT }]).expect("the evaluator works");
    per_pixel((0, 0, 0), &*evaluator);
    evaluator.replace(&[Change { lane: 0, index: 0, fly: white }]).expect("the evaluator works");
    per_pixel((765, -765, 0), &*evaluator);
}

#[test]
fn on_the_cpu_sums_past_32_bits_survive_replacements() {
    check_wide_sums(|scene| Box::new(CpuEvaluator::new(vec![scene])));
}

#[test]
fn on_vulkan_sums_past_32_bits_survive_replacements() {
    canary::with_device(&DeviceOptions::default(), |device| {
        check_wide_sums(|scene| Box::new(GpuEvaluator::create(&device, vec![scene]).expect("it fits")));
    });
}
