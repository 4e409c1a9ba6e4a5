//! The validation canary: runs a test on software Vulkan under the validation layer and fails it if the layer
//! complains, for instance about a missing barrier or about an object that outlives its device. Through
//! `tools/shaped discrete,staging` the same tests take the paths of a discrete GPU.

use std::sync::Arc;

use smalti::vk::{
    Choice, Device, DeviceInfo, DeviceKind, DeviceOptions, DeviceRequest, Instance, InstanceOptions, Validation, choose,
};

/// Runs `test` on a fresh device, drops everything, and returns what the validation layer said.
///
/// # Panics
/// With the packages to install, if there is no software Vulkan or no validation layer.
pub fn watch<T>(options: &DeviceOptions, test: impl FnOnce(Arc<Device>) -> T) -> (T, Vec<String>) {
    watch_changed(options, |_| {}, test)
}

/// As [`watch`], on a device that is opened as if it were as `change` says.
///
/// # Panics
/// As [`watch`].
pub fn watch_changed<T>(
    options: &DeviceOptions,
    change: impl FnOnce(&mut DeviceInfo),
    test: impl FnOnce(Arc<Device>) -> T,
) -> (T, Vec<String>) {
    let instance = Instance::create(InstanceOptions { validation: Validation::On }).unwrap_or_else(|error| {
        panic!("tests need libvulkan1, mesa-vulkan-drivers and vulkan-validationlayers: {error}")
    });
    assert_eq!(instance.validation(), Validation::On, "the validation layer is not there");
    let log = Arc::clone(instance.validation_log());

    let devices = instance.physical_devices().expect("the devices can be listed");
    let choice = choose(&DeviceRequest::Name("llvmpipe".to_owned()), &devices)
        .unwrap_or_else(|error| panic!("tests run on software Vulkan; install mesa-vulkan-drivers: {error}"));
    let Choice::Vulkan(index) = choice else { panic!("a device asked for by name is a Vulkan device") };
    let mut info = devices[index].clone();
    change(&mut info);
    let device = Device::create(&instance, &info, options).expect("software Vulkan can be opened");
    let alive = Arc::downgrade(&device);

    let result = test(device);
    assert!(alive.upgrade().is_none(), "the test keeps the device alive, so leaks would go unseen");
    drop(instance);
    (result, log.take())
}

/// Runs `test` on a fresh device and fails if the validation layer says anything at all.
pub fn with_device<T>(options: &DeviceOptions, test: impl FnOnce(Arc<Device>) -> T) -> T {
    let (result, messages) = watch(options, test);
    assert!(messages.is_empty(), "the validation layer complains:\n{}", messages.join("\n"));
    result
}

/// As [`with_device`], on a device that is taken for a graphics card.
pub fn with_hardware<T>(test: impl FnOnce(Arc<Device>) -> T) -> T {
    let (result, messages) = watch_changed(&DeviceOptions::default(), |info| info.kind = DeviceKind::Discrete, test);
    assert!(messages.is_empty(), "the validation layer complains:\n{}", messages.join("\n"));
    result
}

/// Without this a driver that ignores the variable would make the second run of the suite a mere repetition.
#[test]
fn the_subgroup_size_is_the_one_that_the_environment_asks_for() {
    let Ok(vector_bits) = std::env::var("LP_NATIVE_VECTOR_WIDTH") else { return };
    let lanes = vector_bits.parse::<u32>().expect("a vector width is a number of bits") / 32;
    with_device(&DeviceOptions::default(), |device| assert_eq!(device.info().subgroup_size, lanes));
}
