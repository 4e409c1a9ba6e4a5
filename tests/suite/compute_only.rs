//! Devices without graphics: they score and search, the twin draws opaque tiles for them, and nothing that only drawing
//! needs reaches them. Software Vulkan is opened here as if it were such a device, so that the validation layer tells
//! what it was not given.

use std::sync::Arc;

use smalti::Error;
use smalti::cpu::cells::CpuSearch;
use smalti::gpu::{GpuEvaluator, GpuPainter, VulkanSearch};
use smalti::model::cells::Search;
use smalti::vk::{Device, DeviceInfo, DeviceOptions, Image, ImageFormat, ImageShape, Recorder, RenderTargets, Timing};

use crate::canary;
use crate::cells_vulkan::{check_equal, course, star};
use crate::exactness::{check_scenario, population};
use crate::scenarios::{scenarios, translucent_scenarios};
use crate::vulkan::squares;

const LACKING: &str = "a queue for graphics";

/// Runs `test` on a device that cannot draw, and fails if the validation layer says anything at all.
fn with_device<T>(test: impl FnOnce(Arc<Device>) -> T) -> T {
    let change = |info: &mut DeviceInfo| info.missing_for_drawing.push(LACKING.to_owned());
    let (result, messages) = canary::watch_changed(&DeviceOptions::default(), change, test);
    assert!(messages.is_empty(), "the validation layer complains:\n{}", messages.join("\n"));
    result
}

#[test]
fn a_device_that_cannot_draw_scores_as_brute_force_and_its_painter_draws_so() {
    let some = scenarios().into_iter().take(3).chain(translucent_scenarios().into_iter().take(3));
    for scenario in some {
        with_device(|device| {
            let mut evaluator = GpuEvaluator::create(&device, vec![scenario.scene.clone()]).expect("it fits");
            let mut painter = GpuPainter::create(&device).expect("the device works");
            check_scenario(&mut evaluator, &mut painter, &scenario);
        });
    }
}

#[test]
fn a_device_that_cannot_draw_searches_as_the_twin() {
    let course = course(star(48, 40), 60, |rules| rules.candidates = 8);
    let mut twin = CpuSearch::new(course.clone());
    twin.advance(3).expect("the twin works");
    with_device(|device| {
        let mut search = VulkanSearch::new(&device, course).expect("it fits");
        search.advance(3).expect("the device works");
        check_equal(&mut twin, &mut search, "after three rounds");
    });
}

#[test]
fn what_only_drawing_needs_is_refused_with_what_the_device_lacks() {
    let scenario = scenarios().swap_remove(0);
    with_device(|device| {
        assert!(!device.info().can_draw());
        let shape = ImageShape { width_px: 1, height_px: 1, layers: 1 };
        let mut recorder = Recorder::create(&device, "test", Timing::Off).expect("the device works");
        let targets = RenderTargets { colors: &[], depth: None, width_px: 1, height_px: 1 };
        let mut painter = GpuPainter::create(&device).expect("the device works");
        for refused in [
            Image::create(&device, "colour", ImageFormat::Rgba8Unorm, shape).err(),
            Image::create(&device, "masks", ImageFormat::Rg8Uint, shape).err(),
            squares(&device).err(),
            recorder.render_pass("draw", &targets).err(),
            painter.draw_fly_layer(&population(&scenario.scene, &scenario.flies)).err(),
        ] {
            match refused {
                Some(Error::Vulkan { reason, .. }) => {
                    assert!(reason.ends_with(&format!("lacks {LACKING}")), "{reason}");
                }
                other => panic!("it gave {other:?}"),
            }
        }
    });
}
