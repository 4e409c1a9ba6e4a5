//! The cells search of a Vulkan device comes to the twin's state after every round, `==`.

use std::path::Path;
use std::sync::Arc;

use smalti::cpu::cells::CpuSearch;
use smalti::gpu::{CellForm, CellShape, VulkanSearch};
use smalti::guide;
use smalti::model::cells::{Course, Rules, Search};
use smalti::model::{MaskSet, Target};
use smalti::vk::{Device, DeviceOptions};

use crate::canary;

/// A white star of five points on black.
fn star(width_px: u32, height_px: u32) -> Target {
    let inside = |x: u32, y: u32| {
        let (x, y) = (f64::from(2 * x) / f64::from(width_px) - 1.0, f64::from(2 * y) / f64::from(height_px) - 1.0);
        let sector = (y.atan2(x) * 5.0 / std::f64::consts::TAU).rem_euclid(1.0);
        x.hypot(y) < 0.95 - 1.1 * (sector - 0.5).abs()
    };
    let pixel = |index: u32| if inside(index % width_px, index / width_px) { [250, 240, 220] } else { [0; 3] };
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).expect("the size is right")
}

fn parrots(x0: u32, y0: u32, width_px: u32, height_px: u32) -> Target {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/parrots.png");
    let photo = image::open(&path).expect("the photo can be read").into_rgb8();
    let pixel = |index: u32| photo.get_pixel(x0 + index % width_px, y0 + index / width_px).0;
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).expect("the size is right")
}

fn course(target: Target, fly_count: usize, change: impl FnOnce(&mut Rules)) -> Course {
    let area = f64::from(target.width_px()) * f64::from(target.height_px());
    let side = (64.0 * (area / fly_count as f64).sqrt()) as u32;
    let mut rules = Rules::free(7, side, fly_count, [0; 3]);
    change(&mut rules);
    let guide = Arc::new(guide::sharp(&target));
    Course { rules, target: Arc::new(target), guide, masks: Arc::new(MaskSet::default()), fly_count }
}

fn narrow(device: &Device) -> CellShape {
    CellShape { lanes: device.info().subgroup_size, form: CellForm::Narrow, budget: 60_000 }
}

const WIDE: CellShape = CellShape { lanes: 32, form: CellForm::Wide, budget: 60_000 };

/// Goes through the rounds on both, one by one, and evens out the depths every three.
fn check_rounds(device: &Arc<Device>, course: &Course, shape: CellShape, rounds: u32) {
    let mut twin = CpuSearch::new(course.clone());
    let mut search = VulkanSearch::with_shape(device, course.clone(), shape).expect("it fits");
    for round in 1..=rounds {
        twin.advance(1).expect("the twin works");
        search.advance(1).expect("the device works");
        check_equal(&mut twin, &mut search, &format!("{shape:?} after round {round}"));
        if round % 3 == 0 {
            twin.renormalise().expect("the twin works");
            search.renormalise().expect("the device works");
            check_equal(&mut twin, &mut search, &format!("{shape:?}, even depths after round {round}"));
        }
    }
    assert!(twin.standing().accepted > 50, "hardly anything happened");
}

fn check_equal(twin: &mut CpuSearch, search: &mut VulkanSearch, when: &str) {
    let (expected, found) = (twin.read_back().expect("the twin works"), search.read_back().expect("the device works"));
    for (fly, (expected, found)) in expected.flies.iter().zip(&found.flies).enumerate() {
        assert_eq!(found, expected, "fly {fly}: {when}");
    }
    assert_eq!(found.steps, expected.steps, "step sizes: {when}");
    assert_eq!(found.fitness, expected.fitness, "marginal fitness: {when}");
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
