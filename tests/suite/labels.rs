//! What a device is given is named: each pass by the stem of its shader, or as what it copies.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex};

use smalti::evolve::evolution::random_population;
use smalti::gpu::{GpuEvaluator, GpuPainter, VulkanSearch};
use smalti::model::cells::{Course, Rules, Search};
use smalti::model::{Blend, Canvas, Evaluator, MaskSet, Painter, Population, Scene, Target};
use smalti::studio::{Recipe, work};
use smalti::vk::{ClockMethod, Device, DeviceOptions, PassTime, Staging, Submission, SubmissionObserver, Timing};

use crate::canary;
use crate::scenarios::{holed_masks, stream, translucent_masks};

/// Labels of passes without a shader.
const TRANSFERS: [&str; 4] = ["uploads", "read-backs", "zero sums", "zero parts"];

/// Collects what it is told.
#[derive(Debug, Default)]
struct Listener {
    labels: Mutex<BTreeSet<&'static str>>,
    /// Numbers of the submissions, once before and once after each.
    numbers: Mutex<Vec<u64>>,
}

impl SubmissionObserver for Listener {
    fn timing(&self) -> Timing {
        Timing::On
    }

    fn before(&self, _device: &Arc<Device>, submission: &Submission<'_>) {
        self.numbers.lock().unwrap().push(submission.number);
    }

    fn after(&self, _device: &Arc<Device>, submission: &Submission<'_>, passes: &[PassTime]) {
        self.numbers.lock().unwrap().push(submission.number);
        self.labels.lock().unwrap().extend(passes.iter().map(|pass| pass.name));
    }
}

/// Stems of all shaders that can run.
fn stems() -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let shaders = files.filter(|path| path.extension().is_some_and(|kind| kind != "glsl"));
    shaders
        .filter_map(|path| path.is_file().then(|| path.file_stem().unwrap().to_string_lossy().into_owned()))
        .collect()
}

fn target() -> Arc<Target> {
    let pixels = (0..48 * 40).map(|place: u32| [place as u8, (place / 7) as u8, (place / 48) as u8]).collect();
    Arc::new(Target::new(48, 40, pixels).expect("a valid size"))
}

fn evaluate_and_draw(device: &Arc<Device>, masks: MaskSet) {
    let scene = Scene { target: target(), masks: Arc::new(masks.clone()), background: [0; 3], fly_count: 40 };
    let flies = random_population(48, 40, 40, 0);
    let mut evaluator = GpuEvaluator::create(device, vec![scene]).expect("it fits");
    evaluator.load(&[(0, &flies)]).expect("the device works");
    let (width_px, height_px) = (48, 40);
    let population = Population { width_px, height_px, background: [0; 3].into(), grout: None, masks, flies };
    let mut painter = GpuPainter::create(device).expect("the device works");
    painter.draw(&population, &Canvas::evaluation(48, 40), 1).expect("the device works");
    if population.masks.blend() == Blend::Opaque {
        evaluator.marginal_by_re_rendering().expect("the device works");
    }
}

fn search(device: &Arc<Device>, masks: MaskSet) {
    let recipe = if masks.blend() == Blend::Opaque { Recipe::new() } else { Recipe::spray() }.tiles(40);
    let course = work(&target(), &recipe).expect("the recipe is right").course;
    let rules = Rules { mask_first: 0, mask_count: masks.layers().len() as u32, ..course.rules };
    let course = Course { rules, masks: Arc::new(masks), ..course };
    let mut search = VulkanSearch::new(device, course).expect("it fits");
    search.advance(3).expect("the device works");
    search.renormalise().expect("the device works");
    // Depths are set in the submission after.
    search.advance(1).expect("the device works");
}

#[test]
fn every_pass_is_labelled_by_the_stem_of_its_shader_and_every_shader_has_a_pass() {
    let options = DeviceOptions { staging: Staging::Forced, ..DeviceOptions::default() };
    let listener = Arc::new(Listener::default());
    canary::with_device(&options, |device| {
        device.observe(Arc::<Listener>::clone(&listener));
        for masks in [holed_masks(), translucent_masks(&mut stream(5))] {
            evaluate_and_draw(&device, masks.clone());
            search(&device, masks);
        }
    });
    // Only hardware spreads depths itself.
    let on_hardware = Arc::new(Listener::default());
    canary::with_hardware(|device| {
        device.observe(Arc::<Listener>::clone(&on_hardware));
        search(&device, holed_masks());
    });
    let labels = [&listener, &on_hardware].map(|listener| listener.labels.lock().unwrap().clone());
    let labels: BTreeSet<String> = labels.into_iter().flatten().map(str::to_owned).collect();
    let expected: BTreeSet<String> = stems().into_iter().chain(TRANSFERS.map(str::to_owned)).collect();
    assert_eq!(labels, expected);
    let numbers = listener.numbers.lock().unwrap();
    assert!(numbers.len() > 20);
    for (place, pair) in (1..).zip(numbers.chunks(2)) {
        assert_eq!(pair, [place, place], "submissions are counted from 1, and told before and after");
    }
}

#[test]
fn both_ways_to_read_the_clock_of_a_device_agree_and_go_forward() {
    canary::with_device(&DeviceOptions::default(), |device| {
        assert_eq!(device.clock_method(), Some(ClockMethod::Calibrated));
        let methods = [ClockMethod::Calibrated, ClockMethod::Submission, ClockMethod::Calibrated];
        for _ in 0..20 {
            let ticks = methods.map(|method| device.read_clock(method).expect("the device has a clock"));
            assert!(ticks[0] <= ticks[1] && ticks[1] <= ticks[2], "{ticks:?}");
            assert!(device.info().limits.ns_between(ticks[0], ticks[2]) < 1e10, "{ticks:?}");
        }
    });
}
