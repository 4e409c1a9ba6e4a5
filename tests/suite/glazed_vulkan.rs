//! The cells search among translucent tiles on a Vulkan device comes to the twin's state after every round, `==`.

use std::path::Path;
use std::sync::Arc;

use smalti::cpu::cells::CpuSearch;
use smalti::gpu::{CellForm, CellShape, VulkanSearch};
use smalti::model::Target;
use smalti::model::cells::pixel::TRANSLUCENT_DEPTH;
use smalti::model::cells::rules::{Acceptance, BirthDepth, BirthKind, ColorSource};
use smalti::model::cells::{Course, Rules, Search};
use smalti::model::tile::pack;
use smalti::studio::{Recipe, work};
use smalti::vk::{Device, DeviceOptions};

use crate::canary;
use crate::cells_vulkan::{Named, check_named_rounds};
use crate::scenarios::{stream, translucent_masks};

const BACKGROUND: [u8; 3] = [90, 20, 160];

fn parrots(width_px: u32, height_px: u32) -> Target {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/parrots.png");
    let photo = image::open(&path).expect("the photo can be read").into_rgb8();
    let pixel = |place: u32| photo.get_pixel(150 + place % width_px, 100 + place / width_px).0;
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).expect("the size is right")
}

/// Two flat colours on a third one: a disc and a bar.
fn flat(width_px: u32, height_px: u32) -> Target {
    let pixel = |place: u32| {
        let (x, y) = (place % width_px, place / width_px);
        match () {
            () if (3 * x).abs_diff(width_px).pow(2) + (3 * y).abs_diff(width_px).pow(2) < width_px.pow(2) => {
                [250, 60, 0]
            }
            () if y > height_px * 3 / 4 => [20, 40, 90],
            () => [240; 3],
        }
    };
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).expect("the size is right")
}

/// A target where some pixels count more, and others should stay free.
fn uneven(target: Target) -> Target {
    let (width, height) = (target.width_px(), target.height_px());
    let places = || (0..width * height).map(|place| (place % width, place / width));
    let weights = places().map(|(x, y)| 1 + ((x / 5 + y / 7) % 16) as u8).collect();
    let transparent = places().map(|(x, y)| x > width / 2 && y > height / 2).collect();
    target
        .with_weights(weights)
        .and_then(|target| target.with_transparent(transparent))
        .expect("sizes and weights are right")
}

/// Tiles of the style `spray` in masks of noise, of a soft disc and of the faintest veil, with shades and holes.
fn course(target: Target, fly_count: usize, change: impl FnOnce(&mut Rules)) -> Course {
    let recipe = Recipe::spray().tiles(fly_count as u64).seed(7);
    let course = work(&Arc::new(target), &recipe).expect("the recipe is right").course;
    let masks = translucent_masks(&mut stream(5));
    let mask_count = masks.layers().len() as u32;
    let mut rules = Rules { background: pack(BACKGROUND), mask_first: 0, mask_count, ..course.rules };
    change(&mut rules);
    Course { rules, masks: Arc::new(masks), ..course }
}

fn narrow(device: &Device) -> CellShape {
    CellShape { lanes: device.info().subgroup_size, form: CellForm::Narrow, budget: 60_000 }
}

const WIDE: CellShape = CellShape { lanes: 32, form: CellForm::Wide, budget: 60_000 };

#[test]
fn sprayed_pictures_come_to_the_twins_state_after_every_round_in_narrow_and_wide_workgroups() {
    canary::with_device(&DeviceOptions::default(), |device| {
        for (candidates, rounds) in [(1, 4), (4, 2)] {
            let photo = course(parrots(101, 75), 150, |rules| rules.candidates = candidates);
            let graphic = course(flat(70, 93), 90, |rules| rules.candidates = candidates);
            for (name, course) in [("a photo", &photo), ("a graphic", &graphic)] {
                check_named_rounds(&device, Named { name, course }, narrow(&device), rounds);
                check_named_rounds(&device, Named { name, course }, WIDE, 2);
            }
        }
    });
}

/// Of many candidates most are invalid and cheap, and each still costs turns of loops, of which software Vulkan grants
/// 65,535 and then says nothing.
#[test]
fn steps_of_many_candidates_stay_within_the_turns_that_software_vulkan_grants() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let course = course(parrots(203, 131), 300, |rules| rules.candidates = 64);
        let chosen = CellShape::for_device(device.info(), &course).expect("it fits some shape");
        let widest = CellShape { lanes: 1_024, form: CellForm::Wide, budget: 60_000 };
        for shape in [chosen, widest] {
            check_named_rounds(&device, Named { name: "many candidates", course: &course }, shape, 1);
        }
    });
}

/// Courses for what a style may ask for.
pub fn courses() -> Vec<(&'static str, Course)> {
    let plain = |change: fn(&mut Rules)| course(parrots(80, 66), 110, change);
    vec![
        ("weights and transparent pixels", course(uneven(parrots(80, 66)), 110, |rules| rules.candidates = 3)),
        (
            "a penalty for turning, and local sizes",
            plain(|rules| {
                rules.penalties.turn = 30;
                rules.bounds.local_size = 1;
                rules.color = ColorSource::Mean;
            }),
        ),
        (
            "strict mutants of evolved colours anywhere in depth",
            plain(|rules| {
                rules.color = ColorSource::Evolved;
                rules.births.kind = BirthKind::Mutant;
                rules.births.depth = BirthDepth::Random;
                rules.acceptance = Acceptance::Strict;
                rules.candidates = 3;
            }),
        ),
        ("mutants of fitted colours", plain(|rules| rules.births.kind = BirthKind::Mutant)),
        (
            "mutants beside tiles on a leash",
            plain(|rules| {
                rules.births.kind = BirthKind::Mutant;
                rules.leash = 150;
            }),
        ),
        ("picked colours", plain(|rules| rules.color = ColorSource::Pick)),
    ]
}

#[test]
fn every_rule_for_translucent_tiles_comes_to_the_twins_state() {
    canary::with_device(&DeviceOptions::default(), |device| {
        for (name, course) in &courses() {
            check_named_rounds(&device, Named { name, course }, narrow(&device), 3);
        }
        let (name, course) = &courses()[0];
        check_named_rounds(&device, Named { name, course }, WIDE, 2);
    });
}

#[test]
fn stacks_that_are_full_refuse_the_same_children() {
    let course = course(parrots(64, 48), 400, |rules| {
        rules.bounds.side_min_q8 = 8 << 8;
        rules.births.depth = BirthDepth::Random;
    });
    let mut twin = CpuSearch::new(course.clone());
    twin.advance(3).expect("the twin works");
    let deepest = twin.read_back_stacks().expect("the twin works").pixels.iter().map(Vec::len).max();
    assert_eq!(deepest, Some(TRANSLUCENT_DEPTH));
    canary::with_device(&DeviceOptions::default(), |device| {
        check_named_rounds(&device, Named { name: "full stacks", course: &course }, narrow(&device), 3);
    });
}

#[test]
fn a_small_budget_takes_more_dispatches_of_glazed_cells_and_a_tiny_one_is_an_error() {
    let course = course(flat(64, 64), 40, |_| {});
    canary::with_device(&DeviceOptions::default(), |device| {
        for shape in [narrow(&device), WIDE] {
            check_named_rounds(
                &device,
                Named { name: "a small budget", course: &course },
                CellShape { budget: 25_000, ..shape },
                2,
            );
            let tiny = CellShape { budget: 150, ..shape };
            let mut search = VulkanSearch::with_shape(&device, course.clone(), tiny).expect("it fits");
            let error = search.advance(3).expect_err("a step cannot fit").to_string();
            assert!(error.contains("a step of cell") && error.contains("150 turns"), "{error}");
        }
    });
}

#[test]
fn translucent_cells_whose_gains_might_not_fit_32_bits_are_refused() {
    let side = 512;
    let weights: Vec<u8> = (0..side * side).map(|place| if place == 0 { 1 } else { 16 }).collect();
    let target = Target::new(side, side, vec![[9; 3]; weights.len()]).and_then(|target| target.with_weights(weights));
    let course = course(target.expect("sizes and weights are right"), 60, |_| {});
    canary::with_device(&DeviceOptions::default(), |device| {
        let told = VulkanSearch::new(&device, course.clone()).err().expect("it is refused").to_string();
        assert!(told.contains("does not fit the 32 bits"), "{told}");
    });
}
