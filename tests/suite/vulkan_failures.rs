//! How raw Vulkan fails: mistakes in a recording, requests that do not fit, machines without Vulkan. Also checks that
//! the canary fails on the messages that it watches for.

use std::process::Command;
use std::sync::Arc;

use smalti::vk::{
    Binding, BindingGroup, BindingKind, ComputePipeline, ComputeShader, Device, DeviceOptions, Image, ImageFormat,
    ImageShape, Instance, InstanceOptions, Recorder, Timing, Validation,
};
use smalti::{Error, Result};

use crate::canary;
use crate::vulkan::{NEIGHBOURS, neighbours, on_both_paths, read_all, storage, words};
use crate::workshop::Workshop;

#[test]
fn a_mistake_in_a_pass_is_returned_by_the_submission_and_the_recorder_goes_on() {
    on_both_paths(|device| {
        let buffer = storage(device, "bytes", 16)?;
        let pipeline = neighbours(device, 0)?;
        let bindings = [Binding::Buffer(&buffer), Binding::Buffer(&buffer)];
        let group = BindingGroup::create("bytes", pipeline.layout(), &bindings)?;
        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        let workgroups = device.info().limits.workgroups[1] + 1;

        recorder.compute_pass("unbound")?.dispatch(1, 1, 1);
        let unbound = recorder.submit_and_wait();
        {
            let mut pass = recorder.compute_pass("too-many")?;
            pass.bind(&pipeline, &group);
            pass.push_constants(&[0; 8]);
            pass.dispatch(1, workgroups, 1);
        }
        let too_many = recorder.submit_and_wait();
        {
            let mut pass = recorder.compute_pass("too-short")?;
            pass.bind(&pipeline, &group);
            pass.push_constants(&[0; 4]);
        }
        let too_short = recorder.submit_and_wait();
        recorder.transfer_pass("outside")?.fill(&buffer, 12, 8, 0);
        let outside = recorder.submit_and_wait();
        for (result, part) in [
            (unbound, "pass unbound failed: dispatch without a pipeline"),
            (too_many, "pass too-many failed: 1x"),
            (too_short, "4 bytes of push constants instead of 8"),
            (outside, "fill of buffer bytes failed: 8 bytes at 12 reach past its 16 bytes"),
        ] {
            let message = result.expect_err(part).to_string();
            assert!(message.contains(part), "{message}");
        }

        std::mem::forget(recorder.compute_pass("forgotten")?);
        let message = recorder.submit_and_wait().expect_err("the pass never ends").to_string();
        assert!(message.contains("pass forgotten failed: it was never ended"), "{message}");

        recorder.write_buffer(&buffer, 0, &[7; 16])?;
        assert_eq!(read_all(&mut recorder, &buffer)?, [7; 16]);
        Ok(())
    });
}

#[test]
fn a_ticket_is_good_for_its_own_submission_only() {
    on_both_paths(|device| {
        let buffer = storage(device, "bytes", 16)?;
        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        let mut other = Recorder::create(device, "other", Timing::Off)?;
        recorder.write_buffer(&buffer, 0, &[1; 16])?;
        let ticket = recorder.read_buffer(&buffer, 0, 16)?;
        let mut bytes = [0; 16];
        assert!(recorder.read_into(&ticket, &mut bytes).is_err(), "before the submission");
        recorder.submit_and_wait()?;
        assert!(recorder.read_into(&ticket, &mut bytes[..8]).is_err(), "with another size");
        assert!(other.read_into(&ticket, &mut bytes).is_err(), "by another recorder");
        recorder.read_into(&ticket, &mut bytes)?;
        assert_eq!(bytes, [1; 16]);
        recorder.write_buffer(&buffer, 0, &[2; 16])?;
        assert!(recorder.read_into(&ticket, &mut bytes).is_err(), "during the next recording");
        recorder.submit_and_wait()?;
        assert!(recorder.read_into(&ticket, &mut bytes).is_err(), "after the next submission");
        other.submit_and_wait()
    });
}

#[test]
fn what_does_not_fit_the_device_is_refused_with_its_name_and_the_limit() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let limits = &device.info().limits;
        let bytes = limits.storage_buffer_bytes + 4;
        let buffer = storage(&device, "tiles", bytes);
        let shape = ImageShape { width_px: limits.image_side_px + 1, height_px: 1, layers: 1 };
        let image = Image::create(&device, "mosaic", ImageFormat::Rgba8Unorm, shape);
        for (error, parts) in [
            (buffer.err(), ["tiles".to_owned(), bytes.to_string()]),
            (image.err(), ["mosaic".to_owned(), limits.image_side_px.to_string()]),
        ] {
            match error {
                Some(Error::TooLarge { what, .. }) => assert!(parts.iter().all(|part| what.contains(part)), "{what}"),
                other => panic!("{parts:?} gave {other:?}"),
            }
        }
    });
}

#[test]
fn a_pipeline_refuses_what_is_no_spirv_and_a_group_what_the_pipeline_does_not_expect() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let shader = ComputeShader {
            name: "broken",
            spirv: &[1, 2, 3],
            specialization: &[],
            bindings: &[],
            push_constant_bytes: 0,
        };
        let error = ComputePipeline::create(&device, &shader).err().expect("three words are no module");
        assert!(error.to_string().contains("shader broken failed: it is not a SPIR-V module"), "{error}");

        let pipeline = neighbours(&device, 0).expect("the shader compiles");
        let buffer = storage(&device, "lonely", 16).expect("16 bytes fit");
        let group = BindingGroup::create("lonely", pipeline.layout(), &[Binding::Buffer(&buffer)]);
        let error = group.err().expect("one buffer is not two");
        assert!(error.to_string().contains("pipeline neighbours expects [StorageBuffer, StorageBuffer]"), "{error}");
    });
}

/// Two dispatches of which the second reads what the first wrote; correct only with a barrier between them.
fn dispatch_twice(device: &Arc<Device>, barriers: usize) -> Result<()> {
    let (a, b) = (storage(device, "a", 256)?, storage(device, "b", 256)?);
    let pipeline = neighbours(device, 0)?;
    let forth = BindingGroup::create("forth", pipeline.layout(), &[Binding::Buffer(&a), Binding::Buffer(&b)])?;
    let back = BindingGroup::create("back", pipeline.layout(), &[Binding::Buffer(&b), Binding::Buffer(&a)])?;
    let mut recorder = Recorder::create(device, "test", Timing::Off)?;
    recorder.write_buffer(&a, 0, &[1; 256])?;
    {
        let mut pass = recorder.compute_pass("twice")?;
        pass.bind(&pipeline, &forth);
        pass.push_constants(bytemuck::cast_slice(&[64_u32, 1]));
        pass.dispatch(1, 1, 1);
        for _ in 0..barriers {
            pass.barrier();
        }
        pass.bind(&pipeline, &back);
        pass.dispatch(1, 1, 1);
    }
    recorder.submit_and_wait()
}

#[test]
fn the_canary_dies_of_a_missing_barrier() {
    for (barriers, is_hazard) in [(1, false), (0, true)] {
        let (result, messages) = canary::watch(&DeviceOptions::default(), |device| dispatch_twice(&device, barriers));
        result.expect("the dispatches run either way");
        assert_eq!(messages.iter().any(|message| message.contains("SYNC-HAZARD")), is_hazard, "{messages:?}");
    }
}

#[test]
fn the_canary_dies_of_a_shader_that_does_not_fit_its_pipeline() {
    let (_, messages) = canary::watch(&DeviceOptions::default(), |device| {
        let shader = ComputeShader {
            name: "neighbours",
            spirv: &words(NEIGHBOURS),
            specialization: &[],
            bindings: &[BindingKind::StorageBuffer],
            push_constant_bytes: 8,
        };
        ComputePipeline::create(&device, &shader).map(drop)
    });
    assert!(!messages.is_empty(), "a binding is missing and the validation layer is silent");
}

/// Creates an instance in this process and prints how that went; the test below reads it.
#[test]
#[ignore = "run by `a_machine_without_vulkan_is_told_what_to_install` in an environment that lacks something"]
fn child_that_opens_vulkan() {
    let opened = Instance::create(InstanceOptions { validation: Validation::On })
        .and_then(|instance| instance.physical_devices());
    match opened {
        Ok(devices) => eprintln!("opened {} devices", devices.len()),
        Err(error) => eprintln!("refused: {error}"),
    }
}

fn output_of_child(variable: &str, value: &std::path::Path) -> String {
    let output = Command::new(std::env::current_exe().expect("the test binary has a path"))
        .args(["--exact", "vulkan_failures::child_that_opens_vulkan", "--ignored", "--nocapture"])
        .env(variable, value)
        .output()
        .expect("the test binary runs");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn without_vulkan_auto_takes_the_cpu_and_the_list_of_devices_says_so() {
    let workshop = Workshop::new();
    let nowhere = workshop.path("missing");
    let run = |line: &str| workshop.command(line).env("VK_DRIVER_FILES", &nowhere).output().expect("it starts");
    let evolved = run("evolve photo.png --scheme paper -o out.png -n 60 --births 10 --device auto");
    let note = String::from_utf8_lossy(&evolved.stderr);
    assert!(evolved.status.success() && note.contains("since no Vulkan driver is installed"), "{note}");
    assert_eq!(run("evolve photo.png --scheme paper -o new.png --device vulkan").status.code(), Some(4));

    let listed = run("devices --json");
    let list: serde_json::Value = serde_json::from_slice(&listed.stdout).expect("it is JSON");
    assert_eq!([listed.status.code(), list["devices"].as_array().map(|list| list.len() as i32)], [Some(0); 2]);
    assert_eq!(list["auto"]["device"], "cpu");
    assert!(list["auto"]["reason"].as_str().is_some_and(|reason| reason.contains("; install ")), "{list}");
    let table = run("devices");
    assert!(table.status.success());
    assert!(String::from_utf8_lossy(&table.stdout).starts_with("--device auto takes the CPU, since no Vulkan"));
}

#[test]
fn a_machine_without_vulkan_is_told_what_to_install() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // The dynamic linker takes the first file of that name, and this one is no library.
    std::fs::write(folder.path().join("libvulkan.so.1"), b"").expect("the folder can be written");
    let nowhere = folder.path().join("missing");
    for (variable, value, sentence) in [
        ("LD_LIBRARY_PATH", folder.path(), "the Vulkan loader cannot be opened ("),
        ("VK_DRIVER_FILES", nowhere.as_path(), "no Vulkan driver is installed; install "),
        ("VK_LAYER_PATH", nowhere.as_path(), "VK_LAYER_KHRONOS_validation is not installed; install "),
    ] {
        let output = output_of_child(variable, value);
        assert!(output.contains("refused: no suitable device: ") && output.contains(sentence), "{variable}: {output}");
        // What that is depends on the system: `src/error/install.rs`.
        assert!(output.contains("; install "), "{variable}: {output}");
    }
    assert!(output_of_child("SMALTI_TEST", &nowhere).contains("opened"), "the child fails even with Vulkan");
}
