//! What all benches share: pictures that look like photos to the engine, and a Vulkan device.

#![allow(dead_code, reason = "each bench uses its part")]

pub mod cells;

use std::sync::Arc;

use smalti::cpu::CpuEvaluator;
use smalti::evolve::evolution::random_population;
use smalti::gpu::GpuEvaluator;
use smalti::model::mask::{MASK_SIDE, Mask, Texel};
use smalti::model::{Blend, Evaluator, Fly, MaskSet, Scene, Target};
use smalti::vk::{Choice, Device, DeviceOptions, DeviceRequest, Instance, InstanceOptions, choose};

/// A smooth picture with edges: bands of colour, a disc, and fine texture, all by integers.
pub fn target(width_px: u32, height_px: u32) -> Arc<Target> {
    let pixel = |i: u32, j: u32| {
        let (x, y) = (i * 256 / width_px, j * 256 / height_px);
        let in_disc = (x as i32 - 150).pow(2) + (y as i32 - 110).pow(2) < 60 * 60;
        let texture = (i * 7 + j * 13 + i * j % 11) % 24;
        let base = if in_disc { [220, 60 + y / 2, 40] } else { [x, 255 - y, (x + y) / 2] };
        base.map(|channel| (channel + texture).min(255) as u8)
    };
    let pixels = (0..height_px).flat_map(|j| (0..width_px).map(move |i| pixel(i, j))).collect();
    Arc::new(Target::new(width_px, height_px, pixels).expect("a valid size"))
}

/// A scene of `fly_count` flies, and its first population by seed 0.
pub fn scene(width_px: u32, height_px: u32, fly_count: usize) -> (Scene, Vec<Fly>) {
    let scene = Scene { target: target(width_px, height_px), masks: Arc::default(), background: [0; 3], fly_count };
    (scene, random_population(width_px, height_px, fly_count, 0))
}

/// The same flies with their sides scaled so that so many of them cover a pixel on average.
pub fn at_depth(flies: &[Fly], scene: &Scene, depth: f64) -> Vec<Fly> {
    let area: f64 = flies.iter().map(|fly| f64::from(fly.w) * f64::from(fly.h) / 4096.0).sum();
    let factor = (depth * scene.target.pixels().len() as f64 / area).sqrt();
    let side = |side: u32| (f64::from(side) * factor) as u32;
    flies.iter().map(|fly| Fly { w: side(fly.w), h: side(fly.h), ..*fly }).collect()
}

/// The scene with the square and one more mask.
pub fn with_mask(scene: &Scene, blend: Blend, texel: impl Fn(i32, i32) -> Texel) -> Scene {
    let side = MASK_SIDE as i32;
    let texels = (0..side).flat_map(|row| (0..side).map(move |column| (column, row)));
    let mask = Mask::new(texels.map(|(column, row)| texel(column, row)).collect()).expect("a full layer");
    let masks = MaskSet::with_layers(vec![mask]).expect("few layers").with_blend(blend);
    Scene { masks: Arc::new(masks), ..scene.clone() }
}

/// Both evaluators of a scene, by name.
pub fn evaluators(device: &Arc<Device>, scene: &Scene) -> [(&'static str, Box<dyn Evaluator>); 2] {
    [
        ("cpu", Box::new(CpuEvaluator::new(vec![scene.clone()]))),
        ("vulkan", Box::new(GpuEvaluator::create(device, vec![scene.clone()]).expect("it fits"))),
    ]
}

/// The Vulkan device that `SMALTI_DEVICE` asks for; software Vulkan unless it is set.
pub fn device() -> Arc<Device> {
    let request = std::env::var("SMALTI_DEVICE").unwrap_or_else(|_| "name:llvmpipe".to_owned());
    let request: DeviceRequest = request.parse().expect("SMALTI_DEVICE names a device");
    let instance = Instance::create(InstanceOptions::default()).expect("benches need Vulkan; see tools/test");
    let devices = instance.physical_devices().expect("the devices can be listed");
    match choose(&request, &devices).expect("the device is there") {
        Choice::Vulkan(index) => {
            Device::create(&instance, &devices[index], &DeviceOptions::default()).expect("the device can be opened")
        }
        Choice::Cpu { reason } => panic!("benches of Vulkan need a Vulkan device: {reason}"),
    }
}
