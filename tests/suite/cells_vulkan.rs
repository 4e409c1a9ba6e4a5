//! The cells search of a Vulkan device comes to the twin's state after every round, `==`.

use std::path::Path;
use std::sync::Arc;

use smalti::cpu::cells::CpuSearch;
use smalti::gpu::{CellForm, CellShape, VulkanSearch};
use smalti::model::cells::rules::{Acceptance, BirthDepth, BirthKind, Bounds, Class, ColorSource};
use smalti::model::cells::{Course, Penalties, Rules, Search};
use smalti::model::{Fly, Target};
use smalti::studio::{Recipe, work};
use smalti::vk::{Device, DeviceOptions};

use crate::canary;
use crate::scenarios::holed_masks;

/// A white star of five points on black.
pub fn star(width_px: u32, height_px: u32) -> Target {
    let inside = |x: u32, y: u32| {
        let (x, y) = (f64::from(2 * x) / f64::from(width_px) - 1.0, f64::from(2 * y) / f64::from(height_px) - 1.0);
        let sector = (y.atan2(x) * 5.0 / std::f64::consts::TAU).rem_euclid(1.0);
        x.hypot(y) < 0.95 - 1.1 * (sector - 0.5).abs()
    };
    let pixel = |index: u32| if inside(index % width_px, index / width_px) { [250, 240, 220] } else { [0; 3] };
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).expect("the size is right")
}

pub fn parrots(x0: u32, y0: u32, width_px: u32, height_px: u32) -> Target {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/parrots.png");
    let photo = image::open(&path).expect("the photo can be read").into_rgb8();
    let pixel = |index: u32| photo.get_pixel(x0 + index % width_px, y0 + index / width_px).0;
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).expect("the size is right")
}

/// A course of the style `free`, changed.
pub fn course(target: Target, fly_count: usize, change: impl FnOnce(&mut Rules)) -> Course {
    let recipe = Recipe::new().tiles(fly_count as u64).seed(7);
    let mut course = work(&Arc::new(target), &recipe).expect("the recipe is right").course;
    course.rules.background = 0;
    change(&mut course.rules);
    course
}

pub fn narrow(device: &Device) -> CellShape {
    CellShape { lanes: device.info().subgroup_size, form: CellForm::Narrow, budget: 60_000 }
}

const WIDE: CellShape = CellShape { lanes: 32, form: CellForm::Wide, budget: 60_000 };

/// Goes through the rounds on both, one by one, and evens out the depths every two.
fn check_rounds(device: &Arc<Device>, course: &Course, shape: CellShape, rounds: u32) {
    check_named_rounds(device, Named { name: "plain", course }, shape, rounds);
}

/// A course and what it is called where it fails.
#[derive(Clone, Copy)]
pub struct Named<'a> {
    pub name: &'a str,
    pub course: &'a Course,
}

/// As [`check_rounds`], of a course with a name.
pub fn check_named_rounds(device: &Arc<Device>, named: Named<'_>, shape: CellShape, rounds: u32) {
    let Named { name, course } = named;
    let mut twin = CpuSearch::new(course.clone());
    let mut search = VulkanSearch::with_shape(device, course.clone(), shape).expect("it fits");
    if course.rules.births.kind == BirthKind::Mutant {
        let flies = first_flies(course);
        twin.load(&flies).expect("the twin works");
        search.load(&flies).expect("the device works");
        check_equal(&mut twin, &mut search, "loaded");
    }
    for round in 1..=rounds {
        twin.advance(1).expect("the twin works");
        search.advance(1).expect("the device works");
        check_equal(&mut twin, &mut search, &format!("{name}, {shape:?} after round {round}"));
        if round % 2 == 0 {
            twin.renormalise().expect("the twin works");
            search.renormalise().expect("the device works");
            check_equal(&mut twin, &mut search, &format!("{name}, {shape:?}, even depths after round {round}"));
        }
    }
    assert!(twin.standing().accepted > 50, "{name}: hardly anything happened");
}

/// Flies that mutants can come from.
pub fn first_flies(course: &Course) -> Vec<Fly> {
    let mut births = course.rules.births;
    births.kind = BirthKind::Fresh;
    let mut search = CpuSearch::new(Course { rules: Rules { births, ..course.rules }, ..course.clone() });
    search.advance(1).expect("the twin works");
    search.read_back().expect("the twin works").flies
}

/// Compares all that can be read back of two searches.
pub fn check_equal(twin: &mut dyn Search, search: &mut dyn Search, when: &str) {
    let (expected, found) = (twin.read_back().expect("the twin works"), search.read_back().expect("the device works"));
    for (fly, (expected, found)) in expected.flies.iter().zip(&found.flies).enumerate() {
        assert_eq!(found, expected, "fly {fly}: {when}");
    }
    assert_eq!(found.steps, expected.steps, "step sizes: {when}");
    for (fly, (expected, found)) in expected.fitness.iter().zip(&found.fitness).enumerate() {
        assert_eq!(found, expected, "marginal fitness of fly {fly}: {when}");
    }
    assert_eq!(search.standing(), twin.standing(), "standing: {when}");
    let (expected, found) =
        (twin.read_back_stacks().expect("the twin works"), search.read_back_stacks().expect("the device works"));
    for (pixel, (expected, found)) in expected.pixels.iter().zip(&found.pixels).enumerate() {
        assert_eq!(found, expected, "pixel {pixel}: {when}");
    }
}

#[test]
fn a_star_comes_to_the_twins_state_after_every_round_in_narrow_and_wide_workgroups() {
    for candidates in [1, 8] {
        let course = course(star(96, 80), 120, |rules| rules.candidates = candidates);
        canary::with_device(&DeviceOptions::default(), |device| {
            check_rounds(&device, &course, narrow(&device), 7);
            check_rounds(&device, &course, WIDE, 4);
        });
    }
}

#[test]
fn a_photo_comes_to_the_twins_state_after_every_round_in_narrow_and_wide_workgroups() {
    for candidates in [1, 8] {
        let course = course(parrots(150, 100, 149, 131), 500, |rules| rules.candidates = candidates);
        canary::with_device(&DeviceOptions::default(), |device| {
            check_rounds(&device, &course, narrow(&device), 4);
            check_rounds(&device, &course, WIDE, 4);
        });
    }
}

/// A target whose right side counts more, and with a hole where no tile is wanted.
fn weighed(target: Target) -> Target {
    let (width, height) = (target.width_px(), target.height_px());
    let places = || (0..width * height).map(|index| (index % width, index / width));
    let weights = places().map(|(x, _)| 1 + (15 * x / width) as u8).collect();
    let transparent = places().map(|(x, y)| x.abs_diff(width / 2) + y.abs_diff(height / 2) < 20).collect();
    target
        .with_weights(weights)
        .and_then(|target| target.with_transparent(transparent))
        .expect("sizes and weights are right")
}

/// Everything that a style may ask for: a course for each, and some together.
pub fn courses() -> Vec<(&'static str, Course)> {
    let photo = || parrots(200, 200, 100, 90);
    let plain = |change: fn(&mut Rules)| course(photo(), 200, change);
    let masks = Arc::new(holed_masks());
    let every_mask = |rules: &mut Rules| {
        rules.mask_count = 3;
        rules.births.is_stroke = 1;
    };
    vec![
        (
            "means, penalties and own sides",
            plain(|rules| {
                rules.color = ColorSource::Mean;
                rules.penalties = Penalties { overlap: 20, hole: 120, turn: 30 };
                rules.bounds = Bounds { side_min_q8: 150, side_max_q8: 410, aspect_max_q8: 410, local_size: 1 };
                rules.class_count = 2;
                rules.classes[0] = Class { end: 30, scale_q12: 3 << 11, first_round: 0 };
                rules.classes[1] = Class { end: 200, scale_q12: 3 << 10, first_round: 2 };
            }),
        ),
        (
            "mutants of evolved colours anywhere in depth",
            plain(|rules| {
                rules.color = ColorSource::Evolved;
                rules.births.kind = BirthKind::Mutant;
                rules.births.depth = BirthDepth::Random;
                rules.acceptance = Acceptance::Strict;
                rules.candidates = 3;
            }),
        ),
        ("picked", plain(|rules| rules.color = ColorSource::Pick)),
        (
            "mutants beside tiles on a leash",
            plain(|rules| {
                rules.births.kind = BirthKind::Mutant;
                rules.leash = 150;
            }),
        ),
        ("masks", Course { masks: Arc::clone(&masks), ..plain(every_mask) }),
        (
            "masks with grout, weights and transparent pixels",
            Course {
                masks,
                ..course(weighed(photo()), 200, |rules| {
                    rules.mask_count = 3;
                    rules.grout = 40;
                    rules.grout_color = 0x80_90A0;
                    rules.penalties = Penalties { overlap: 20, hole: 120, turn: 0 };
                    rules.candidates = 8;
                })
            },
        ),
        (
            "means of weighted pixels",
            course(weighed(photo()), 200, |rules| {
                rules.color = ColorSource::Mean;
                rules.grout = 20;
            }),
        ),
    ]
}

#[test]
fn every_rule_of_every_style_comes_to_the_twins_state() {
    canary::with_device(&DeviceOptions::default(), |device| {
        for (name, course) in courses() {
            check_named_rounds(&device, Named { name, course: &course }, narrow(&device), 3);
        }
        let (_, course) = &courses()[4];
        check_rounds(&device, course, WIDE, 3);
    });
}

#[test]
fn tiles_on_a_leash_come_to_the_twins_state_towards_another_picture() {
    let first = course(parrots(200, 200, 100, 90), 200, |_| {});
    let flies = evolved(&first, 6);
    // Bounds that some of the tiles are beyond.
    let second = course(parrots(203, 198, 100, 90), 200, |rules| {
        (rules.leash, rules.candidates, rules.seed) = (100, 4, 8);
        rules.bounds.side_max_q8 = 500;
    });
    canary::with_device(&DeviceOptions::default(), |device| {
        for shape in [narrow(&device), WIDE] {
            let mut twin = CpuSearch::new(second.clone());
            let mut search = VulkanSearch::with_shape(&device, second.clone(), shape).expect("it fits");
            twin.load(&flies).expect("the twin works");
            search.load(&flies).expect("the device works");
            check_equal(&mut twin, &mut search, "loaded on a leash");
            for round in 1..=5 {
                twin.advance(1).expect("the twin works");
                search.advance(1).expect("the device works");
                check_equal(&mut twin, &mut search, &format!("on a leash, {shape:?} after round {round}"));
            }
            assert!(twin.standing().accepted > 50, "hardly anything happened");
        }
    });
}

/// What a search comes to in so many rounds.
fn evolved(course: &Course, rounds: u32) -> Vec<Fly> {
    let mut search = CpuSearch::new(course.clone());
    search.advance(rounds).expect("the twin works");
    search.read_back().expect("the twin works").flies
}

#[test]
fn a_small_budget_takes_more_dispatches_and_a_tiny_one_is_an_error() {
    let course = course(star(64, 64), 40, |_| {});
    canary::with_device(&DeviceOptions::default(), |device| {
        for shape in [narrow(&device), WIDE] {
            check_rounds(&device, &course, CellShape { budget: 15_000, ..shape }, 3);
            let tiny = CellShape { budget: 150, ..shape };
            let mut search = VulkanSearch::with_shape(&device, course.clone(), tiny).expect("it fits");
            let error = search.advance(3).expect_err("a step cannot fit").to_string();
            assert!(error.contains("a step of cell") && error.contains("150 turns"), "{error}");
        }
    });
}

#[test]
fn tiles_that_are_too_large_for_32_bits_or_for_a_dispatch_are_refused() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let weights =
            vec![16; 1_500 * 1_000].into_iter().enumerate().map(|(place, weight)| if place == 0 { 1 } else { weight });
        let target = Target::new(1_500, 1_000, vec![[9; 3]; 1_500 * 1_000]).expect("the size is right");
        let heavy = target.clone().with_weights(weights.collect()).expect("weights in range");
        let refusal = |course: Course| VulkanSearch::new(&device, course).err().expect("it is refused").to_string();
        let told = refusal(course(heavy, 9, |_| {}));
        assert!(told.contains("does not fit the 32 bits"), "{told}");
        let told = refusal(course(target, 9, |rules| rules.candidates = 64));
        assert!(told.contains("too long for a dispatch"), "{told}");
        let told = refusal(course(star(64, 64), 480_001, |_| {}));
        assert!(told.contains("too many for one dispatch"), "{told}");
    });
}
