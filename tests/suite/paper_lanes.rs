//! Lanes that come and go: every picture of a crew is, byte for byte, what an engine of its own makes of it.

use std::collections::BTreeMap;
use std::sync::Arc;

use smalti::cpu::CpuEvaluator;
use smalti::engine::{Crew, Engine, Finished, PaperTask, Task};
use smalti::evolve::{Ended, Evolution, PaperScheme, Undisturbed, first_population};
use smalti::gpu::GpuEvaluator;
use smalti::model::mask::{MASK_LAYERS_MAX, TEXELS, Texel};
use smalti::model::{Change, Evaluator, Fly, Mask, MaskSet, Scene};
use smalti::vk::DeviceOptions;

use crate::canary;
use crate::scenarios::{any_fly, holed_masks, random_scene, stream, translucent_masks};

/// Width and height in px, flies, masks if not the square, and the scheme.
type Kind<'a> = (u32, u32, usize, Option<&'a Arc<MaskSet>>, PaperScheme);

/// Pictures of all kinds and sizes, and how each evolves; they end at different times.
fn pictures() -> Vec<PaperTask> {
    let mut random = stream(77);
    let holed = Arc::new(holed_masks());
    let foggy = Arc::new(translucent_masks(&mut random));
    // The same texels once more.
    let holed_again = Arc::new(holed_masks());
    let usual = PaperScheme { births: 60, ..PaperScheme::default() };
    let kinds: [Kind<'_>; 10] = [
        (40, 33, 90, None, PaperScheme { births: 200, restarts: 1, ..usual.clone() }),
        (64, 64, 120, Some(&foggy), PaperScheme { batch_births: 3, masks: vec![vec![1, 2]], ..usual.clone() }),
        (8, 8, 4, None, PaperScheme { births: 700, ..usual.clone() }),
        (61, 20, 70, Some(&holed), PaperScheme { masks: vec![vec![1], vec![0, 2]], restarts: 1, ..usual.clone() }),
        (130, 40, 300, None, PaperScheme { batch_births: 20, births: 400, ..usual.clone() }),
        (61, 20, 70, Some(&holed_again), PaperScheme { masks: vec![vec![0, 1]], batch_births: 2, ..usual.clone() }),
        (16, 70, 50, Some(&foggy), PaperScheme { masks: vec![vec![3]], restarts: 2, births: 20, ..usual.clone() }),
        (1, 1, 3, None, PaperScheme { births: 0, ..usual.clone() }),
        (96, 96, 200, None, PaperScheme { mitosis: 1, births: 90, restarts: 1, ..usual.clone() }),
        (33, 65, 120, None, PaperScheme { target_sae: Some(u64::MAX), ..usual }),
    ];
    let picture = |(seed, (width_px, height_px, fly_count, masks, scheme)): (u64, Kind<'_>)| {
        let masks = masks.map_or_else(Arc::default, Arc::clone);
        let background = [seed as u8, 0, 9];
        let scene = Scene { masks, background, ..random_scene(width_px, height_px, fly_count, &mut random) };
        let scheme = PaperScheme { seed, ..scheme };
        let first_flies = first_population(&scheme, &scene.target, fly_count);
        PaperTask { scene, scheme, first_flies }
    };
    (0..).zip(kinds).map(picture).collect()
}

fn alone(evaluator: Box<dyn Evaluator>, task: &PaperTask) -> Ended {
    let target = Arc::clone(&evaluator.scene(0).target);
    let evolution =
        Evolution::new(task.scheme.clone(), 0, target.width_px(), target.height_px(), task.first_flies.clone());
    let mut engine = Engine::new(evaluator, vec![evolution]);
    engine.run(&mut Undisturbed).expect("the evaluator works");
    engine.ended(0).expect("the result is what was scored")
}

/// Runs all pictures, at most `lanes_max` at a time, the next as soon as one has ended.
fn by_crew(mut crew: Crew, pictures: &[PaperTask], lanes_max: usize) -> BTreeMap<u64, Ended> {
    let mut done = BTreeMap::new();
    let mut waiting = (0..).zip(pictures).peekable();
    while done.len() < pictures.len() {
        while crew.len() < lanes_max
            && let Some((ticket, task)) = waiting.peek()
        {
            if !crew.admit(*ticket, Task::Paper((*task).clone())).expect("the evaluator works") {
                break;
            }
            waiting.next();
        }
        for Finished { ticket, outcome } in crew.step().expect("the evaluator works") {
            let ended = outcome.expect("the result is what was scored");
            assert!(done.insert(ticket, ended).is_none(), "{ticket} ended twice");
        }
    }
    assert!(crew.is_empty());
    done
}

fn check_crew(mut create: impl FnMut(Vec<Scene>) -> Box<dyn Evaluator>) {
    let pictures = pictures();
    let expected: BTreeMap<u64, Ended> =
        (0..).zip(&pictures).map(|(ticket, task)| (ticket, alone(create(vec![task.scene.clone()]), task))).collect();
    for lanes_max in [1, 3, pictures.len()] {
        let together = by_crew(Crew::default().with_evolutions(create(Vec::new())), &pictures, lanes_max);
        assert_eq!(together, expected, "{lanes_max} lanes");
    }
}

#[test]
fn on_the_cpu_pictures_of_a_crew_are_those_evolved_alone() {
    check_crew(|scenes| Box::new(CpuEvaluator::new(scenes)));
}

#[test]
fn on_vulkan_pictures_of_a_crew_are_those_evolved_alone() {
    canary::with_device(&DeviceOptions::default(), |device| {
        check_crew(|scenes| Box::new(GpuEvaluator::create(&device, scenes).expect("it fits")));
    });
}

#[test]
fn a_cancelled_crew_begins_anew_as_if_nothing_had_been() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let pictures = pictures();
        let create = |scenes| Box::new(GpuEvaluator::create(&device, scenes).expect("it fits"));
        let mut crew = Crew::default().with_evolutions(create(Vec::new()));
        for (ticket, task) in (100..).zip(&pictures[..4]) {
            assert!(crew.admit(ticket, Task::Paper(task.clone())).expect("the evaluator works"));
        }
        crew.step().expect("the evaluator works");
        assert!(!crew.is_empty(), "something is left to cancel");
        crew.cancel_all();
        assert!(crew.step().expect("the evaluator works").is_empty());
        let together = by_crew(crew, &pictures[..4], 2);
        for (ticket, task) in (0..).zip(&pictures[..4]) {
            assert_eq!(together[&ticket], alone(create(vec![task.scene.clone()]), task));
        }
    });
}

#[test]
fn lanes_with_the_same_masks_share_them_and_one_with_others_waits_for_room() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let layers_max = device.info().limits.storage_buffer_bytes as usize / size_of::<[Texel; TEXELS]>();
        let sets_max = layers_max / MASK_LAYERS_MAX;
        assert!((1..9).contains(&sets_max), "software Vulkan has small buffers");
        let set = |shade| {
            let mask = Mask::new(vec![Texel { coverage: 255, shade }; TEXELS]).expect("a full layer");
            Arc::new(MaskSet::with_layers(vec![mask; MASK_LAYERS_MAX - 1]).expect("few layers"))
        };
        let scene = |masks: &Arc<MaskSet>| Scene { masks: Arc::clone(masks), ..random_scene(9, 9, 5, &mut stream(1)) };
        let (one, copy, last) = (set(7), set(7), set(100));
        let mut evaluator = GpuEvaluator::create(&device, Vec::new()).expect("nothing fits");
        let mut admit = |masks: &Arc<MaskSet>| evaluator.admit(scene(masks)).expect("the device works");
        for lane in 0..=sets_max {
            assert_eq!(admit(if lane % 2 == 0 { &one } else { &copy }), Some(lane));
        }
        for other in 1..sets_max {
            assert_eq!(admit(&set(7 + other as u8)), Some(sets_max + other));
        }
        assert_eq!(admit(&last), None);
        // The masks stay while anybody wears them.
        (1..=sets_max).for_each(|lane| evaluator.release(lane));
        assert_eq!(evaluator.admit(scene(&last)).expect("the device works"), None);
        evaluator.release(0);
        assert_eq!(evaluator.admit(scene(&last)).expect("the device works"), Some(0));
    });
}

#[test]
fn a_lane_without_room_waits_until_another_ends() {
    canary::with_device(&DeviceOptions::default(), |device| {
        // A lane of more than half of what a buffer can hold.
        let side_px = ((device.info().limits.storage_buffer_bytes / 4 * 2 / 3) as f64).sqrt() as u32;
        let side_px = side_px.min(5_000);
        let mut evaluator = GpuEvaluator::create(&device, Vec::new()).expect("nothing fits");
        let large = random_scene(side_px, side_px, 3, &mut stream(2));
        let small = random_scene(30, 20, 12, &mut stream(3));
        assert_eq!(evaluator.admit(small.clone()).expect("it fits"), Some(0));
        assert_eq!(evaluator.admit(large.clone()).expect("it fits"), Some(1));
        assert_eq!(evaluator.admit(large.clone()).expect("the other may end"), None);
        assert_eq!(evaluator.admit(small).expect("it fits"), Some(2));
        evaluator.release(1);
        assert_eq!((evaluator.lane_count(), evaluator.admit(large).expect("it fits")), (2, Some(1)));
    });
}

#[test]
fn lanes_that_make_buffers_grow_disturb_nobody() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let mut random = stream(5);
        let scene = Scene { masks: Arc::new(holed_masks()), ..random_scene(45, 50, 80, &mut random) };
        let flies: Vec<Fly> = (0..80).map(|_| any_fly(&scene, 1.0..20.0, &mut random)).collect();
        let mut evaluator = GpuEvaluator::create(&device, vec![scene.clone()]).expect("it fits");
        let mut twin = CpuEvaluator::new(vec![scene.clone()]);
        evaluator.load(&[(0, &flies)]).expect("the evaluator works");
        twin.load(&[(0, &flies)]).expect("the twin works");
        for round in 0..6 {
            let other = random_scene(30 << round, 40, 50 << round, &mut random);
            let number = evaluator.admit(other.clone()).expect("it fits").expect("there is room");
            let others: Vec<Fly> = (0..other.fly_count).map(|_| any_fly(&other, 1.0..9.0, &mut random)).collect();
            if round % 2 == 0 {
                evaluator.load(&[(number, &others)]).expect("the evaluator works");
            }
            let change = Change { lane: 0, index: round, fly: any_fly(&scene, 1.0..20.0, &mut random) };
            evaluator.replace(&[change]).expect("the evaluator works");
            twin.replace(&[change]).expect("the twin works");
            assert_eq!(evaluator.evaluation(0), twin.evaluation(0), "round {round}");
            assert_eq!(evaluator.read_back_layers(0).unwrap(), twin.read_back_layers(0).unwrap(), "round {round}");
            if round == 3 {
                evaluator.release(number);
            }
        }
    });
}
