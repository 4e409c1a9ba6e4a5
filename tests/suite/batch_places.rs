//! Where the outputs of `smalti batch` may not go: over its inputs, over one another, and where a second run would take
//! them for inputs.

use std::fs::File;
use std::time::{Duration, SystemTime};

use crate::batch::{batch, done, paint, tree};
use crate::workshop::Workshop;

#[test]
fn nothing_is_written_over_what_is_read_or_written_already() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "mask.png", "weight.png", "colors.png"]);
    for made in ["in -o made --format npz", "in -o made"] {
        done(&workshop, made);
    }
    workshop.write("colors.gpl", b"GIMP Palette\n0 0 0\n255 255 255\n");
    workshop.write("diary.txt", b"Dear diary\n");
    workshop.write(
        "rows.jsonl",
        b"{\"input\": \"in/a.png\", \"output\": \"b.png\", \"params\": {\"mask\": \"mask.png\"}}\n",
    );
    for (line, told) in [
        ("in -o out --trace out/a.png", "read or written by the batch"),
        ("in -o out --trace in/a.png", "read or written by the batch"),
        ("in -o out --init made/a.npz --trace made/a.npz", "read or written by the batch"),
        ("in -o out --weight weight.png --trace weight.png", "read or written by the batch"),
        ("in -o out --trace out/results.jsonl", "an input or another output"),
        ("in -o out --palette colors.gpl --results colors.gpl", "read or written by the batch"),
        ("--manifest rows.jsonl -o out --results mask.png", "read or written by the batch"),
        ("--manifest rows.jsonl -o out --trace rows.jsonl", "read or written by the batch"),
        ("in -o out --results diary.txt", "holds no rows of results"),
        ("in -o . --name mask.{ext} --mask mask.png", "mask.png is an input"),
        ("in -o . --name weight.{ext} --weight weight.png", "weight.png is an input"),
        ("in -o made --format npz --init made/a.npz", "made/a.npz is an input"),
        ("--manifest rows.jsonl -o . in --name mask.{ext}", "mask.png is an input"),
    ] {
        let before = tree(&workshop, ".");
        let count = if line.contains("--init") { "" } else { "-n 20" };
        let ran = workshop.run(&format!("batch --evals 400 --progress none --on-exists overwrite {count} {line}"));
        assert_eq!(ran.code, Some(2), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(told), "{line}: {}", ran.stderr);
        // The output folder may have been made, and nothing in it but an empty file of results.
        assert_eq!(tree(&workshop, "."), before, "{line}");
    }
    assert_eq!(workshop.read("diary.txt"), b"Dear diary\n");
    workshop.write("torn.jsonl", b"{\"id\":\"a");
    done(&workshop, "in -o out --results torn.jsonl");
    done(&workshop, "in -o out --results torn.jsonl");
}

#[test]
fn outputs_that_a_pattern_would_take_for_pictures_are_refused_the_first_time() {
    let workshop = Workshop::new();
    paint(&workshop, &["g/star.png"]);
    for (line, told) in [
        ("g/*.png -o g --name {stem}-m.{ext}", "g/star-m.png would be taken for a picture of g/*.png"),
        ("g/* -o g --format svg", "g/star.svg would be taken"),
        ("g/* -o elsewhere --results g/rows.jsonl", "g/rows.jsonl would be taken"),
    ] {
        let ran = batch(&workshop, line);
        assert_eq!(ran.code, Some(2), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(told), "{line}: {}", ran.stderr);
    }
    for _ in 0..2 {
        done(&workshop, "g/*.png -o g --format svg");
    }
}

#[test]
fn a_device_from_the_configuration_does_not_contradict_devices() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png"]);
    workshop.write("own.toml", b"device = \"cpu\"\nthreads = 1\n");
    let run = |line: &str| {
        let output = workshop.command(line).env_remove("SMALTI_DEVICE").env("SMALTI_THREADS", "").output().unwrap();
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    };
    run("batch in -o out -n 20 --evals 400 --config own.toml --devices cpu");
    run("plan in -o out -n 20 --evals 400 --config own.toml --devices cpu --shards 1 --picture-time 1s");
    let script = String::from_utf8(workshop.read("plan/submit.slurm")).unwrap();
    assert!(script.contains("--devices=cpu") && !script.contains("--device=cpu"), "{script}");
    assert_eq!(script.matches("--threads").count(), 1, "{script}");
}

#[test]
fn what_a_killed_process_left_beside_trace_and_results_is_taken_away() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png"]);
    std::fs::create_dir(workshop.path("rows")).unwrap();
    for name in [".smalti-left.partial", "rows/.smalti-left.partial"] {
        workshop.write(name, b"half");
        let long_ago = SystemTime::now() - Duration::from_secs(2 * 24 * 3600);
        File::options().write(true).open(workshop.path(name)).unwrap().set_modified(long_ago).unwrap();
    }
    done(&workshop, "in -o out --trace t.json --results rows/all.jsonl");
    for name in [".smalti-left.partial", "rows/.smalti-left.partial"] {
        assert!(!workshop.path(name).exists(), "{name}");
    }
}
