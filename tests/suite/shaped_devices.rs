//! Devices that look and behave otherwise than software Vulkan does: as hardware, with less than it offers, lost in the
//! middle of the work, or silent for ever. A layer of our own between the program and the driver makes them
//! (`tools/shaped`).

use std::path::Path;
use std::process::Stdio;

use serde_json::Value;

use crate::workshop::{Ran, Workshop};

/// Runs the program on a device of this shape.
fn shaped(workshop: &Workshop, shape: &str, line: &str) -> Ran {
    let plain = workshop.command(line);
    let mut command = std::process::Command::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/shaped"));
    command.arg(shape).arg(plain.get_program()).args(plain.get_args());
    command.current_dir(workshop.path("")).env("SMALTI_DEVICE", "vulkan");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let output = command.output().expect("tools/shaped starts");
    let stderr = String::from_utf8(output.stderr).expect("messages are UTF-8");
    Ran { code: output.status.code(), stdout: output.stdout, stderr }
}

/// Work of all kinds: opaque and translucent searches, and the paper's scheme.
const WORK: [&str; 3] = [
    "-n 60 --evals 3k",
    "-n 40 --evals 8k --style spray",
    "-n 40 --scheme paper --births 200 --batch-births 20 --output-size 90",
];

#[test]
fn the_cpu_makes_the_rest_for_a_device_that_is_lost_wherever_it_is_and_comes_to_the_same_bytes() {
    let workshop = Workshop::new();
    for work in WORK {
        let cpu = workshop.run(&format!("evolve photo.png -o cpu.png --force {work}"));
        assert_eq!(cpu.code, Some(0), "{}", cpu.stderr);
        for shape in ["lose=1", "lose=2", "lose=3", "lose=5", "hang=1", "hang=4"] {
            let patience = if shape.contains("hang") { "--device-timeout 300ms" } else { "" };
            let flags = format!("--on-device-lost cpu {patience}");
            let ran = shaped(
                &workshop,
                &format!("discrete,{shape}"),
                &format!("evolve photo.png -o lost.png --force {work} {flags}"),
            );
            assert_eq!(ran.code, Some(0), "{shape}, {work}: {}", ran.stderr);
            assert_eq!(ran.stderr.matches("; the CPU makes the rest").count(), 1, "{shape}, {work}: {}", ran.stderr);
            assert_eq!(workshop.read("lost.png"), workshop.read("cpu.png"), "{shape}, {work}");
        }
    }
}

#[test]
fn a_device_that_is_lost_or_silent_ends_the_work_with_its_exit_code_and_nothing_is_written() {
    let workshop = Workshop::new();
    for (shape, told) in
        [("lose=4", "was lost during `"), ("hang=4", "did not finish `"), ("hang=4,staging", "within 0.3 seconds")]
    {
        for work in WORK {
            let ran = shaped(
                &workshop,
                &format!("discrete,{shape}"),
                &format!(
                    "evolve photo.png -o lost.png {work} {}",
                    if shape.contains("hang") { "--device-timeout 300ms" } else { "" }
                ),
            );
            assert_eq!(ran.code, Some(75), "{shape}, {work}: {}", ran.stderr);
            assert!(ran.stderr.contains(told), "{shape}, {work}: {}", ran.stderr);
            assert!(ran.stderr.contains("--on-device-lost cpu"), "{}", ran.stderr);
            assert!(!workshop.files().contains("lost.png"), "{shape}, {work}");
        }
    }
}

/// Rows of a batch by their identifiers.
fn rows(ran: &Ran) -> Vec<Value> {
    let text = std::str::from_utf8(&ran.stdout).expect("JSON is UTF-8");
    text.lines().map(|line| serde_json::from_str(line).expect("it is JSON")).collect()
}

#[test]
fn a_batch_loses_no_picture_with_a_device() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("photos")).expect("a folder can be made");
    for number in 0..5 {
        workshop.paint(&format!("photos/{number}.png"), 40 + number, 30);
    }
    let line = |rest: &str| format!("batch photos -n 50 --evals 2k --json -q {rest}");
    let cpu = workshop.run(&line("-o cpu"));
    assert_eq!((cpu.code, rows(&cpu).len()), (Some(0), 5), "{}", cpu.stderr);
    let check = |folder: &str| {
        for number in 0..5 {
            let name = format!("{number}.png");
            assert_eq!(workshop.read(&format!("{folder}/{name}")), workshop.read(&format!("cpu/{name}")), "{folder}");
        }
    };
    for (folder, shape, rest) in [
        ("cpu_goes_on", "lose=6", "--on-device-lost cpu"),
        ("silent", "hang=6", "--on-device-lost cpu --device-timeout 300ms"),
        ("other_device", "lose=6", "--devices 0,cpu"),
        ("both_lost", "lose=6", "--devices 0,0 --on-device-lost cpu"),
    ] {
        let ran = shaped(&workshop, &format!("discrete,{shape}"), &line(&format!("-o {folder} {rest}")));
        assert_eq!(ran.code, Some(0), "{folder}: {}", ran.stderr);
        assert!(rows(&ran).iter().all(|row| row["status"] == "complete"), "{folder}");
        check(folder);
    }
    let stopped = shaped(&workshop, "discrete,lose=6", &line("-o stopped"));
    assert_eq!(stopped.code, Some(75), "{}", stopped.stderr);
    let again = workshop.run(&line("-o stopped"));
    assert_eq!(again.code, Some(0), "the same command goes on: {}", again.stderr);
    check("stopped");
}

#[test]
fn hardware_without_subgroups_graphics_or_cached_memory_makes_the_same_mosaics() {
    let workshop = Workshop::new();
    for shape in ["discrete,staging,no-subgroups", "integrated,compute-only,no-arithmetic", "discrete,slow=30"] {
        for work in WORK.iter().chain(&["-n 60 --evals 3k --candidates 8 --style mosaic"]) {
            let cpu = workshop.run(&format!("evolve photo.png -o cpu.png --force {work}"));
            assert_eq!(cpu.code, Some(0), "{}", cpu.stderr);
            let ran = shaped(&workshop, shape, &format!("evolve photo.png -o device.png --force {work}"));
            assert_eq!(ran.code, Some(0), "{shape}, {work}: {}", ran.stderr);
            assert_eq!(workshop.read("device.png"), workshop.read("cpu.png"), "{shape}, {work}");
        }
    }
}

#[test]
fn a_limit_that_is_too_low_is_named_before_anything_is_made() {
    let workshop = Workshop::new();
    for (shape, told) in [
        ("storage-buffers=13", "14 storage buffers per shader stage (it has 13)"),
        ("invocations=255", "256 invocations in a workgroup (it has 255)"),
        ("no-feature=synchronization2", "the feature synchronization2"),
        ("no-feature=maintenance4", "the feature maintenance4"),
    ] {
        let ran = shaped(&workshop, shape, "evolve photo.png -o a.png -n 40 --evals 1k");
        assert_eq!(ran.code, Some(4), "{shape}: {}", ran.stderr);
        assert!(ran.stderr.contains(told), "{shape}: {}", ran.stderr);
    }
    let ran = shaped(&workshop, "buffer=100000", "evolve photo.png -o a.png -n 4000 --evals 1k");
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    assert!(ran.stderr.contains("buffers end at 100000"), "{}", ran.stderr);
    assert!(!workshop.files().contains("a.png"));
}

#[test]
fn lanes_that_no_buffer_could_hold_together_share_several() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("photos")).expect("a folder can be made");
    for number in 0..6 {
        workshop.paint(&format!("photos/{number}.png"), 64, 64 + number);
    }
    let line = |rest: &str| format!("batch photos -n 50 --evals 2k --json -q {rest}");
    let cpu = workshop.run(&line("-o cpu"));
    assert_eq!(cpu.code, Some(0), "{}", cpu.stderr);
    // The stacks of a picture have half a megabyte and more.
    let ran = shaped(&workshop, "discrete,storage-range=1500000", &line("-o device --in-flight 6"));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    for number in 0..6 {
        let name = format!("{number}.png");
        assert_eq!(workshop.read(&format!("device/{name}")), workshop.read(&format!("cpu/{name}")));
    }
}

#[test]
fn a_batch_does_not_begin_on_a_device_that_does_not_give_what_the_cpu_gives() {
    let workshop = Workshop::new();
    let ran = shaped(&workshop, "discrete,lose=5", "batch photo.png -o out -n 40 --evals 1k --check -q");
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    for told in ["--check of llvmpipe", "was lost during `", "smalti check"] {
        assert!(ran.stderr.contains(told), "{told}: {}", ran.stderr);
    }
    assert!(!workshop.path("out/photo.png").exists());
}
