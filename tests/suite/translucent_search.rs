//! The search among translucent tiles, against pictures drawn from its flies.

use std::path::Path;
use std::sync::Arc;

use smalti::cpu::CpuPainter;
use smalti::cpu::cells::CpuSearch;
use smalti::model::cells::rules::BirthDepth;
use smalti::model::cells::{Course, Rules, Search, SearchState};
use smalti::model::tile::pack;
use smalti::model::{Backdrop, Canvas, Fly, Painter, Population, Target};
use smalti::photo::{ReadOptions, read};
use smalti::studio::{Recipe, work};

use crate::scenarios::{stream, translucent_masks};

const BACKGROUND: [u8; 3] = [90, 20, 160];
/// What any tile costs at a pixel where none is wanted.
const UNWANTED: i64 = 765;

fn parrots(x0: u32, y0: u32, width_px: u32, height_px: u32) -> Target {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/parrots.png");
    let photo = read(&path, &ReadOptions::default()).unwrap().photo;
    let pixel = |place| photo.pixels[((y0 + place / width_px) * photo.width_px + x0 + place % width_px) as usize];
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).unwrap()
}

/// The photograph where some pixels count more, and others should stay free.
pub fn uneven(width_px: u32, height_px: u32) -> Target {
    let places = || (0..width_px * height_px).map(|place| (place % width_px, place / width_px));
    let weights = places().map(|(x, y)| 1 + ((x / 5 + y / 7) % 16) as u8).collect();
    let transparent = places().map(|(x, y)| x > width_px / 2 && y > height_px / 2).collect();
    parrots(60, 80, width_px, height_px).with_weights(weights).and_then(|t| t.with_transparent(transparent)).unwrap()
}

/// Tiles of the style `spray` in random masks, which have shades and holes, too.
pub fn course(target: Target, fly_count: usize) -> Course {
    let recipe = Recipe::spray().tiles(fly_count as u64).seed(7);
    let course = work(&Arc::new(target), &recipe).expect("the recipe is right").course;
    let masks = translucent_masks(&mut stream(5));
    let mask_count = masks.layers().len() as u32;
    let background = pack(BACKGROUND);
    let rules = Rules { background, mask_first: 0, mask_count, steps_per_fly: 3, ..course.rules };
    Course { rules, masks: Arc::new(masks), ..course }
}

/// The objective of a picture drawn from some flies.
fn drawn_objective(course: &Course, flies: &[Fly]) -> i64 {
    let target = &course.target;
    let (width_px, height_px) = (target.width_px(), target.height_px());
    let population = Population {
        width_px,
        height_px,
        background: Backdrop::Transparent,
        grout: None,
        masks: (*course.masks).clone(),
        flies: flies.to_vec(),
    };
    let canvas = Canvas::evaluation(width_px, height_px);
    let alone = CpuPainter.draw(&population, &canvas, 1).unwrap().alpha.unwrap();
    let over = Population { background: BACKGROUND.into(), ..population };
    let shown = CpuPainter.draw(&over, &canvas, 1).unwrap().pixels;
    (0..shown.len())
        .map(|place| {
            let weight = target.weights().map_or(1, |weights| i64::from(weights[place]));
            let is_unwanted = target.transparent().is_some_and(|transparent| transparent[place]);
            let lacks = shown[place].iter().zip(target.pixels()[place]).map(|(a, b)| i64::from(a.abs_diff(b)));
            // Opacities of the masks are high enough that a covered pixel has some alpha.
            let error = if !is_unwanted { lacks.sum() } else { UNWANTED * i64::from(alone[place] > 0) };
            weight * error
        })
        .sum()
}

fn check_against_fresh(search: &mut CpuSearch) -> SearchState {
    let state = search.read_back().unwrap();
    let mut fresh = CpuSearch::new(search.course().clone());
    fresh.load(&state.flies).unwrap();
    let round = search.standing().rounds;
    assert_eq!(fresh.standing().objective, search.standing().objective, "after round {round}");
    assert_eq!(fresh.read_back().unwrap().fitness, state.fitness, "after round {round}");
    assert_eq!(fresh.read_back_stacks().unwrap(), search.read_back_stacks().unwrap(), "after round {round}");
    state
}

#[test]
fn after_every_round_the_state_is_that_of_its_flies_and_the_objective_has_not_risen() {
    for target in [parrots(20, 30, 101, 75), uneven(93, 70)] {
        let course = course(target, 150);
        let mut search = CpuSearch::new(course.clone());
        let mut objective = search.standing().objective;
        assert_eq!(objective, drawn_objective(&course, &[]));
        for round in 0..8 {
            search.advance(1).unwrap();
            if round % 3 == 2 {
                search.renormalise().unwrap();
            }
            let state = check_against_fresh(&mut search);
            assert!(search.standing().objective <= objective, "round {round}");
            objective = search.standing().objective;
            assert_eq!(objective, drawn_objective(&course, &state.flies), "round {round}");
        }
        let bare = drawn_objective(&course, &[]);
        assert!(objective < bare / 3, "{objective} of {bare}");
    }
}

#[test]
fn marginal_fitness_is_what_the_picture_loses_without_the_fly() {
    for target in [parrots(200, 60, 40, 31), uneven(33, 40)] {
        let course = course(target, 40);
        let mut search = CpuSearch::new(course.clone());
        search.advance(5).unwrap();
        let state = search.read_back().unwrap();
        let objective = search.standing().objective;
        let mut alive = 0;
        for (index, fly) in state.flies.iter().enumerate() {
            let mut others = state.flies.clone();
            others[index] = Fly::ABSENT;
            assert_eq!(state.fitness[index], drawn_objective(&course, &others) - objective, "fly {index}");
            alive += usize::from(fly.alive);
        }
        assert!(alive > 25, "{alive} flies");
    }
}

#[test]
fn one_thread_and_two_find_the_same_flies() {
    let states = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut search = CpuSearch::new(course(parrots(0, 0, 220, 150), 300));
        pool.install(|| search.advance(4)).unwrap();
        (search.read_back().unwrap(), search.standing())
    });
    assert!(states[0] == states[1]);
}

#[test]
fn a_pixel_never_holds_more_tiles_than_the_search_keeps_track_of() {
    let mut course = course(parrots(150, 90, 64, 48), 400);
    course.rules.bounds.side_min_q8 = 8 << 8;
    course.rules.births.depth = BirthDepth::Random;
    let mut search = CpuSearch::new(course.clone());
    search.advance(3).unwrap();
    let state = check_against_fresh(&mut search);
    let deepest = search.read_back_stacks().unwrap().pixels.iter().map(Vec::len).max();
    assert_eq!(deepest, Some(smalti::model::cells::pixel::TRANSLUCENT_DEPTH));
    assert_eq!(search.standing().objective, drawn_objective(&course, &state.flies));
}
