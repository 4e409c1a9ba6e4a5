//! The cells search on the CPU: its state is always that of a fresh evaluation, whatever it went through.

use std::sync::Arc;

use smalti::cpu::CpuEvaluator;
use smalti::cpu::cells::CpuSearch;
use smalti::model::cells::pixel::STACK_DEPTH;
use smalti::model::cells::{Course, Rules, Search};
use smalti::model::mask::Texel;
use smalti::model::tile::pack;
use smalti::model::{Evaluator, Fly, Mask, MaskSet, Scene, Target};
use smalti::studio::{Recipe, work};

/// A red star-like shape on white: flat areas in which like tiles pile up.
pub fn graphic(width_px: u32, height_px: u32) -> Target {
    let pixels = (0..height_px).flat_map(|y| (0..width_px).map(move |x| (x as i32, y as i32)));
    let (middle_x, middle_y) = (width_px as i32 / 2, height_px as i32 / 2);
    let is_red = |x: i32, y: i32| (x - middle_x).abs() * (y - middle_y).abs() < (middle_x * middle_y) / 16;
    let color = |(x, y)| if is_red(x, y) { [220, 20, 30] } else { [255, 255, 255] };
    Target::new(width_px, height_px, pixels.map(color).collect()).expect("a small picture")
}

/// A part of a photograph.
pub fn photograph(width_px: u32, height_px: u32) -> Target {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/photos/parrots.png");
    let photo = image::open(path).expect("a photo of the tests").into_rgb8();
    let part = image::imageops::crop_imm(&photo, 60, 90, width_px, height_px).to_image();
    Target::new(width_px, height_px, part.pixels().map(|pixel| pixel.0).collect()).expect("a small picture")
}

/// A course of the style over `target`, with masks that have holes and shades if the style wears any.
pub fn course(style: &str, target: Target, fly_count: usize) -> Course {
    let recipe = Recipe::named(style).expect("it is a style").tiles(fly_count as u64).seed(7);
    let mut course = work(&Arc::new(target), &recipe).expect("the recipe is right").course;
    course.rules.background = pack([90, 80, 70]);
    if course.masks.layers().len() == 1 {
        return course;
    }
    let masks = Arc::new(holed_masks());
    let (mask_first, mask_count) = (1, masks.layers().len() as u32 - 1);
    Course { rules: Rules { mask_first, mask_count, ..course.rules }, masks, ..course }
}

fn holed_masks() -> MaskSet {
    let texel = |place: u32, hole: u32| Texel {
        coverage: if (place / 256 + place % 256) % 90 < hole { 90 } else { 200 },
        shade: 255 - (place % 256 / 3) as u8,
    };
    let mask = |hole| Mask::new((0..256 * 256).map(|place| texel(place, hole)).collect()).expect("256x256 texels");
    MaskSet::with_layers(vec![mask(30), mask(55)]).expect("two masks")
}

/// The courses that differ in how their pixels are computed.
fn courses() -> Vec<(&'static str, Course)> {
    let weighed = |target: Target| {
        let weights = (0..target.pixels().len()).map(|place| 1 + (place / 40 % 16) as u8).collect();
        let transparent = (0..target.pixels().len()).map(|place| place % 96 < 9).collect();
        target
            .with_weights(weights)
            .and_then(|target| target.with_transparent(transparent))
            .expect("planes of its size")
    };
    let mut several = course("free", photograph(97, 83), 150);
    several.rules.candidates = 8;
    vec![
        ("free on a photo", course("free", photograph(96, 90), 160)),
        ("free on a graphic", course("free", graphic(96, 90), 160)),
        ("free with eight candidates", several),
        ("mosaic", course("mosaic", photograph(110, 75), 140)),
        ("paint", course("paint", photograph(90, 96), 120)),
        ("weights and transparency", course("free", weighed(photograph(96, 70)), 130)),
        ("many weighed tiles with grout", course("mosaic", weighed(graphic(130, 61)), 220)),
    ]
}

/// The state equals that of the same flies, loaded afresh.
fn check_state(name: &str, search: &mut CpuSearch) {
    let state = search.read_back().expect("the twin works");
    let mut fresh = CpuSearch::new(search.course().clone());
    fresh.load(&state.flies).expect("the twin works");
    let loaded = fresh.read_back().expect("the twin works");
    let round = search.standing().rounds;
    assert!(loaded.flies == state.flies, "{name}: flies after round {round}");
    assert!(loaded.fitness == state.fitness, "{name}: marginal fitness after round {round}");
    assert_eq!(fresh.standing().objective, search.standing().objective, "{name}: objective after round {round}");
    assert!(fresh.read_back_stacks().ok() == search.read_back_stacks().ok(), "{name}: stacks after round {round}");
}

#[test]
fn after_every_round_the_state_is_that_of_a_fresh_evaluation_and_the_objective_never_rises() {
    for (name, course) in courses() {
        let mut search = CpuSearch::new(course);
        let mut objective = search.standing().objective;
        for round in 0..14 {
            search.advance(1).expect("the twin works");
            check_state(name, &mut search);
            assert!(search.standing().objective <= objective, "{name}: the objective rose in round {round}");
            objective = search.standing().objective;
            if round % 4 == 3 {
                search.renormalise().expect("the twin works");
                check_state(name, &mut search);
                assert_eq!(search.standing().objective, objective, "{name}: another picture after renormalising");
            }
        }
        assert!(search.standing().accepted > 200, "{name}: hardly anything was accepted");
    }
}

#[test]
fn in_free_the_objective_is_the_sae_and_the_marginal_fitness_that_of_the_evaluator() {
    for target in [photograph(120, 100), graphic(100, 120)] {
        let course = course("free", target, 200);
        let scene = Scene {
            target: Arc::clone(&course.target),
            masks: Arc::clone(&course.masks),
            background: [90, 80, 70],
            fly_count: 200,
        };
        let mut search = CpuSearch::new(course);
        search.advance(12).expect("the twin works");
        let state = search.read_back().expect("the twin works");
        let mut evaluator = CpuEvaluator::new(vec![scene]);
        evaluator.load(&[(0, &state.flies)]).expect("the twin works");
        let evaluation = evaluator.evaluation(0);
        assert_eq!(i64::try_from(evaluation.sae), Ok(search.standing().objective));
        assert_eq!(evaluation.marginal, state.fitness);
    }
}

#[test]
fn leaving_out_any_fly_costs_its_marginal_fitness_in_every_style() {
    for (name, course) in courses() {
        let mut search = CpuSearch::new(course);
        search.advance(9).expect("the twin works");
        let state = search.read_back().expect("the twin works");
        let mut without = CpuSearch::new(search.course().clone());
        for fly in (0..state.flies.len()).step_by(7) {
            let mut flies = state.flies.clone();
            flies[fly] = Fly::ABSENT;
            without.load(&flies).expect("the twin works");
            let gain = without.standing().objective - search.standing().objective;
            assert_eq!(gain, state.fitness[fly], "{name}: without fly {fly}");
        }
    }
}

#[test]
fn like_tiles_on_a_flat_picture_open_no_holes_and_end_in_a_perfect_likeness() {
    let mut search = CpuSearch::new(course("free", graphic(128, 128), 400));
    let mut last = i64::MAX;
    for _ in 0..30 {
        search.advance(4).expect("the twin works");
        search.renormalise().expect("the twin works");
        assert!(search.standing().objective <= last);
        last = search.standing().objective;
    }
    // The first tiles leave millions; a hole of 5x5 px on white would alone leave 14,000.
    assert!(last < 8_000, "an error of {last} is left");
}

#[test]
fn flies_that_would_stack_too_deep_become_absent_and_the_others_are_as_they_were() {
    let course = course("free", photograph(64, 64), 60);
    let fly = |index: u32| Fly {
        x: 30 * 64,
        y: 30 * 64,
        z: 1_000 * index,
        w: 400,
        h: 300,
        angle: 999 * index as u16,
        alive: true,
        ..Fly::ABSENT
    };
    let flies: Vec<Fly> = (0..60).map(fly).collect();
    let mut search = CpuSearch::new(course);
    search.load(&flies).expect("the twin works");
    let state = search.read_back().expect("the twin works");
    assert_eq!(state.flies[..STACK_DEPTH], flies[..STACK_DEPTH]);
    assert!(state.flies[STACK_DEPTH..].iter().all(|fly| !fly.alive));
    check_state("a full stack", &mut search);
    search.advance(6).expect("the twin works");
    check_state("what came of a full stack", &mut search);
    let deepest = search.read_back_stacks().expect("the twin works").pixels.iter().map(Vec::len).max();
    assert!(deepest <= Some(STACK_DEPTH));
}

#[test]
fn a_fly_between_the_pixels_becomes_absent_and_is_born_again() {
    let course = course("free", photograph(64, 64), 12);
    let between = Fly { x: 30 * 64 + 32, y: 30 * 64 + 32, w: 16, h: 16, alive: true, ..Fly::ABSENT };
    let seen = Fly { x: 20 * 64, y: 9 * 64, z: 9, w: 4_000, h: 3_000, ..between };
    let mut flies = vec![between; 12];
    flies[3] = seen;
    let mut search = CpuSearch::new(course);
    search.load(&flies).expect("the twin works");
    let state = search.read_back().expect("the twin works");
    assert!((0..).zip(&state.flies).all(|(index, fly)| fly.alive == (index == 3)), "only one covers a pixel");
    check_state("flies between pixels", &mut search);
    search.advance(6).expect("the twin works");
    let alive = search.read_back().expect("the twin works").flies.iter().filter(|fly| fly.alive).count();
    assert!(alive > 8, "{alive} flies");
}

#[test]
fn the_state_does_not_depend_on_the_number_of_threads() {
    for (name, course) in courses() {
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a small pool");
            pool.install(|| {
                let mut search = CpuSearch::new(course.clone());
                search.advance(6).expect("the twin works");
                (search.read_back().expect("the twin works"), search.standing())
            })
        });
        assert!(one == three, "{name}");
    }
}

#[test]
fn flies_obey_the_bounds_of_their_style() {
    for style in ["mosaic", "paint"] {
        let course = course(style, photograph(120, 120), 200);
        let mut search = CpuSearch::new(course.clone());
        search.advance(12).expect("the twin works");
        let flies = search.read_back().expect("the twin works").flies;
        for (index, fly) in (0_u32..).zip(&flies).filter(|(_, fly)| fly.alive) {
            let own_side = course.rules.own_side(index, course.guide.at(fly.x >> 6, fly.y >> 6));
            let bounded = smalti::model::cells::operators::bounded(fly, &course.rules.bounds, own_side);
            assert_eq!(bounded, *fly, "fly {index}");
            let (long, short) = (fly.w.max(fly.h), fly.w.min(fly.h));
            assert!(long * 256 <= short * course.rules.bounds.aspect_max_q8 + 256, "fly {index} is {long} by {short}");
        }
    }
}
