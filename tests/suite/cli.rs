//! The command line at work: real runs of the program on small pictures.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use smalti::photo;

use crate::workshop::Workshop;

/// The metadata in a picture.
fn metadata(workshop: &Workshop, name: &str) -> Value {
    let entries = photo::read_metadata(&workshop.path(name)).unwrap();
    let (_, text) = entries.iter().find(|(keyword, _)| keyword == "smalti").expect("the picture tells how it was made");
    serde_json::from_str(text).unwrap()
}

#[test]
fn a_picture_becomes_a_mosaic_as_png_jpeg_and_population() {
    let workshop = Workshop::new();
    let ran = workshop.evolve("-o a.png -o b.jpg -o c.npz --save-target t.png");
    assert!(ran.stdout.is_empty(), "nothing was asked for on stdout");
    assert!(ran.stderr.contains("wrote a.png, b.jpg, c.npz, t.png: 60 tiles, "), "{}", ran.stderr);
    assert_eq!(workshop.pixels("a.png").dimensions(), (40, 30));
    assert_eq!(workshop.pixels("b.jpg").dimensions(), (40, 30));
    assert_eq!(workshop.pixels("t.png"), workshop.pixels("photo.png"));
    let archive = smalti::archive::read(&workshop.path("c.npz")).unwrap();
    assert_eq!(archive.population.flies.len(), 60);
    assert_eq!(archive.meta["status"], "complete");
    assert_eq!(workshop.files().len(), 5, "{:?}", workshop.files());
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let workshop = Workshop::new();
    for ending in ["png", "jpg", "webp", "svg", "ora", "npz", "csv", "json"] {
        workshop.evolve(&format!("-o a.{ending} --seed 7"));
        workshop.evolve(&format!("-o b.{ending} --seed 7"));
        workshop.evolve(&format!("-o c.{ending} --seed 8"));
        assert_eq!(workshop.read(&format!("a.{ending}")), workshop.read(&format!("b.{ending}")));
        assert_ne!(workshop.read(&format!("a.{ending}")), workshop.read(&format!("c.{ending}")));
    }
}

#[test]
fn neither_threads_nor_device_change_a_byte() {
    let workshop = Workshop::new();
    let options = "--batch-births 20 --restarts 1 --cool 0.5";
    workshop.evolve(&format!("-o one.png {options} --threads 1"));
    workshop.evolve(&format!("-o two.png {options} --threads 2"));
    workshop.evolve(&format!("-o gpu.png {options} --device name:llvmpipe --validate"));
    assert_eq!(workshop.read("one.png"), workshop.read("two.png"));
    assert_eq!(workshop.read("one.png"), workshop.read("gpu.png"));
}

#[test]
fn the_row_of_json_tells_the_result_and_agrees_with_the_files() {
    let workshop = Workshop::new();
    let row = workshop.evolve_to_row("-o a.png -o b.npz --seed 3 --restarts 2");
    for (field, value) in [
        ("id", json!("photo")),
        ("status", json!("complete")),
        ("stop", json!("births")),
        ("output", json!(["a.png", "b.npz"])),
        ("seed", json!(3)),
        ("scheme", json!("paper")),
        ("tiles", json!(60)),
        ("births", json!(900)),
        ("births_in_last_run", json!(300)),
        ("evals", json!(900)),
        ("restarts", json!(2)),
        ("device", json!("CPU")),
        ("shard", json!(null)),
        ("version", json!(env!("CARGO_PKG_VERSION"))),
        ("error", json!(null)),
    ] {
        assert_eq!(row[field], value, "{field}");
    }
    for field in ["psnr", "load_ms", "evolve_ms", "save_ms"] {
        assert!(row[field].is_f64(), "{field}: {}", row[field]);
    }
    assert!(row["fallback_kills"].is_u64() && row["host"].is_string());
    assert_eq!(row["sae"], row["objective"]);
    let told = metadata(&workshop, "a.png");
    assert_eq!([&told["key"], &told["sae"], &told["births"]], [&row["key"], &row["sae"], &row["births"]]);
}

#[test]
fn the_saved_picture_is_exactly_what_was_scored() {
    let workshop = Workshop::new();
    let row = workshop.evolve_to_row("-o a.png --save-target t.png --size 20 --background 336699");
    let (mosaic, target) = (workshop.pixels("a.png"), workshop.pixels("t.png"));
    assert_eq!(mosaic.dimensions(), (20, 15));
    let sae: u64 = mosaic.iter().zip(target.iter()).map(|(&a, &b)| u64::from(a.abs_diff(b))).sum();
    assert_eq!(row["sae"], sae);
}

#[test]
fn metadata_tells_what_decides_the_picture_and_nothing_about_the_machine() {
    let workshop = Workshop::new();
    workshop.evolve("-o a.png -o b.jpg --seed 5 --threads 1");
    let told = metadata(&workshop, "a.png");
    assert_eq!(told, metadata(&workshop, "b.jpg"));
    assert_eq!([&told["seed"], &told["tiles"], &told["births_per_run"]], [&json!(5), &json!(60), &json!(300)]);
    assert_eq!([&told["software"], &told["status"]], [&json!("smalti"), &json!("complete")]);
    assert!(told["input_sha256"].as_str().is_some_and(|hash| hash.len() == 64));
    let text = told.to_string();
    for private in ["CPU", "photo.png", "threads", "a.png"] {
        assert!(!text.contains(private), "{private} in {text}");
    }
}

#[test]
fn the_key_changes_with_what_decides_the_picture_and_with_nothing_else() {
    let workshop = Workshop::new();
    let key = |rest: &str| workshop.evolve_to_row(&format!("-o a.png --dry-run {rest}"))["key"].clone();
    let plain = key("");
    for rest in [
        "--threads 1",
        "--progress none",
        "-o b.npz",
        "--save-target t.png",
        "--size 40",
        "--output-size 40",
        "--force",
    ] {
        assert_eq!(key(rest), plain, "{rest}");
    }
    for rest in [
        "--seed 1",
        "--size 20",
        "--batch-births 2",
        "--restarts 1",
        "--restarts 1 --cool 0.5",
        "--on-dry stop",
        "--patience 9",
        "--target-sae 9",
        "--time 9",
        "--background white",
        "--output-size 50",
    ] {
        assert_ne!(key(rest), plain, "{rest}");
    }
    // In milliseconds this exceeds 64 bits by 384.
    assert_ne!(key("--time 18446744073709552"), key("--time 384ms"));
}

#[test]
fn the_size_of_the_picture_is_no_matter_of_the_population() {
    let workshop = Workshop::new();
    let plain = workshop.evolve_to_row("-o a.npz")["key"].clone();
    let row = workshop.evolve_to_row("-o a.npz -o a.png --output-size 50");
    assert_ne!(row["key"], plain, "the picture's");
    assert_eq!(metadata(&workshop, "a.png")["key"], row["key"]);
    let told = smalti::archive::read(&workshop.path("a.npz")).unwrap().meta;
    assert_eq!([&told["key"], &told["output_size_px"]], [&plain, &json!(null)]);
    workshop.evolve("-o b.png --output-size 40");
    assert_eq!(metadata(&workshop, "b.png")["output_size_px"], json!(null), "it is as evolved");
}

#[test]
fn the_pixels_that_are_evolved_towards_decide_too() {
    let workshop = Workshop::new();
    let row = workshop.evolve_to_row("-o a.png --save-target t.png");
    let told = metadata(&workshop, "a.png");
    assert_eq!(told["target_sha256"], metadata(&workshop, "t.png")["target_sha256"]);
    let hash: String = Sha256::digest(workshop.pixels("t.png").as_raw()).iter().map(|b| format!("{b:02x}")).collect();
    assert_eq!([&told["target_sha256"], &told["key"]], [&json!(hash), &row["key"]]);
}

#[test]
fn a_population_is_taken_up_where_it_was_left() {
    let workshop = Workshop::new();
    let first = workshop.evolve_to_row("-o a.png -o flies.npz --background white");
    let again = workshop.run("evolve photo.png --scheme paper --init flies.npz --births 0 -o b.png --json").row();
    assert_eq!([&again["sae"], &again["tiles"]], [&first["sae"], &first["tiles"]]);
    assert_eq!(workshop.pixels("a.png"), workshop.pixels("b.png"), "the background comes from the population");
    let further =
        workshop.run("evolve photo.png --scheme paper --init flies.npz --births 500 --seed 1 -o c.png --json").row();
    assert!(further["sae"].as_u64() <= first["sae"].as_u64(), "the best is kept");
    assert_ne!(further["key"], again["key"]);
}

#[test]
fn the_written_picture_may_have_another_size() {
    let workshop = Workshop::new();
    workshop.evolve("-o large.png -o large.jpg --output-size 120");
    workshop.evolve("-o small.png --output-size 8");
    assert_eq!(workshop.pixels("large.png").dimensions(), (120, 90));
    assert_eq!(workshop.pixels("large.jpg").dimensions(), (120, 90));
    assert_eq!(workshop.pixels("small.png").dimensions(), (8, 6));
}

#[test]
fn budgets_end_an_evolution_and_are_named_as_the_reason() {
    let workshop = Workshop::new();
    for (rest, stop) in [
        ("--births 10M --time 200ms", "time"),
        ("--births 10M --target-sae 10M", "target-sae"),
        ("--births 10M --patience 50", "patience"),
        ("--births 10M --on-dry stop", "dry"),
        ("--births 0", "births"),
    ] {
        let ran = workshop.run(&format!("evolve photo.png --scheme paper -n 60 -o a.png --force --json {rest}"));
        assert_eq!(ran.code, Some(0), "{rest}: {}", ran.stderr);
        assert_eq!([&ran.row()["stop"], &ran.row()["status"]], [stop, "complete"], "{rest}");
    }
}

#[test]
fn a_run_that_the_clock_cut_can_be_repeated_from_what_was_told() {
    let workshop = Workshop::new();
    let row = workshop
        .run("evolve photo.png --scheme paper -n 60 -o a.png --json --births 1000 --restarts 1000000 --time 300ms")
        .row();
    assert_eq!(row["stop"], "time");
    let [births, restarts, last] =
        ["births", "restarts", "births_in_last_run"].map(|field| row[field].as_u64().unwrap());
    assert_eq!(births, restarts * 1000 + last);
    assert_eq!(metadata(&workshop, "a.png")["births_in_last_run"], last);
}

#[test]
fn a_dry_run_tells_the_plan_and_writes_nothing() {
    let workshop = Workshop::new();
    let before = workshop.files();
    let ran = workshop.evolve("-o a.png -o b.npz --save-target t.png --output-size 400 --dry-run");
    for part in ["40x30 px", "60, at random at first", "300", "seed 0", "CPU", "a.png, b.npz, t.png", "memory", "key"] {
        assert!(ran.stderr.contains(part), "{part} in {}", ran.stderr);
    }
    let row = workshop.evolve_to_row("-o a.png --dry-run");
    assert_eq!([&row["status"], &row["sae"]], [&json!("planned"), &json!(null)]);
    assert_eq!(workshop.files(), before);
}

#[test]
fn a_dash_sends_the_picture_to_stdout() {
    let workshop = Workshop::new();
    workshop.evolve("-o a.png");
    let before = workshop.files();
    let ran = workshop.evolve("-o -");
    assert_eq!(ran.stdout, workshop.read("a.png"));
    assert_eq!(workshop.files(), before);
}

#[test]
fn stdout_gets_the_format_that_is_asked_for() {
    let workshop = Workshop::new();
    for ending in ["png", "jpg", "webp", "svg", "ora", "npz", "csv", "json"] {
        workshop.evolve(&format!("-o a.{ending} -o tiles.npz --force"));
        let ran = workshop.evolve(&format!("-o - --format {ending}"));
        assert!(ran.stdout == workshop.read(&format!("a.{ending}")), "{ending}");
    }
    let drawn = workshop.run("render tiles.npz -o - --format .SVG -q");
    assert!(drawn.stdout.starts_with(b"<"), "{}", drawn.stderr);
    for (flags, sentence) in [
        ("-o - --format bmp", "--format bmp: there are png, jpg"),
        ("-o - --format image/png", "--format image/png: there are png, jpg"),
        ("-o - --format x.png", "--format x.png: there are png, jpg"),
        ("-o b.png --format svg", "--format svg: is for -o -"),
    ] {
        let ran = workshop.run(&format!("evolve photo.png {flags}"));
        assert_eq!((ran.code, ran.stderr.lines().count()), (Some(2), 1), "{}", ran.stderr);
        assert!(ran.stderr.contains(sentence), "{}", ran.stderr);
    }
}

#[test]
fn a_reader_that_goes_away_needs_no_row_but_misses_a_picture() {
    let workshop = Workshop::new();
    for (output, code, message) in
        [("-o a.png --json", 0, ""), ("-o -", 1, "smalti: stdout: its reader went away before it had the picture")]
    {
        let line = format!("evolve photo.png --scheme paper -n 60 --births 300 -q {output}");
        let mut child = workshop.command(&line).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        assert!(stderr.starts_with(message) && stderr.lines().count() == usize::from(code == 1), "{stderr:?}");
    }
}

#[test]
fn messages_off_a_terminal_have_no_escape_codes_and_quiet_has_no_messages() {
    let workshop = Workshop::new();
    for progress in ["auto", "bar", "plain", "json", "none"] {
        let ran = workshop.evolve(&format!("-o {progress}.png --progress {progress} -v"));
        assert!(!ran.stderr.contains('\u{1b}') && !ran.stderr.contains('\r'), "{progress}: {:?}", ran.stderr);
    }
    assert_eq!(workshop.evolve("-o quiet.png -q").stderr, "");
}

#[test]
fn progress_in_json_has_one_object_a_line() {
    let workshop = Workshop::new();
    let ran =
        workshop.run("evolve photo.png --scheme paper -o a.png -n 60 --births 1000M --time 2500ms --progress json -q");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let lines: Vec<Value> = ran.stderr.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert!(!lines.is_empty());
    assert!(lines.iter().all(|line| line["births"].as_u64() > Some(0) && line["sae"].is_u64()), "{}", ran.stderr);
}

#[test]
fn an_evolution_ends_when_the_reader_of_its_progress_goes_away() {
    let workshop = Workshop::new();
    for (output, code) in [("a.png", 75), ("-", 1)] {
        // The time only ends a test that fails.
        let line =
            format!("evolve photo.png --scheme paper -o {output} -n 60 --births 1000M --time 5m --progress json");
        let mut child = workshop.command(&line).spawn().unwrap();
        drop((child.stderr.take(), child.stdout.take()));
        assert_eq!(child.wait().unwrap().code(), Some(code), "{output}");
    }
    assert_eq!(metadata(&workshop, "a.png")["status"], "partial");
}

#[test]
fn devices_are_listed_for_people_and_for_programs() {
    let workshop = Workshop::new();
    let table = String::from_utf8(workshop.run("devices").stdout).unwrap();
    assert!(table.contains("llvmpipe") && table.contains("--device auto takes"), "{table}");
    let list = workshop.run("devices --json").row();
    let devices = list["devices"].as_array().unwrap();
    assert!(devices.iter().any(|device| device["name"].as_str().is_some_and(|name| name.contains("llvmpipe"))));
    assert!(devices.iter().all(|device| device["missing"].is_array() && device["limits"].is_object()));
    assert!(!list["auto"]["device"].is_null());
}

#[cfg(unix)]
#[test]
fn a_dash_as_the_input_is_what_comes_through_a_pipe() {
    use std::io::Write;
    use std::process::Stdio;

    let workshop = Workshop::new();
    assert_eq!(workshop.run("evolve photo.png -o named.png -o named.npz -n 20 --evals 500").code, Some(0));
    for (line, name) in [
        ("evolve - -o piped.png -o piped.npz -n 20 --evals 500", "photo.png"),
        ("render - -o drawn.png", "named.npz"),
        ("score - named.png --json", "photo.png"),
    ] {
        let mut child = workshop.command(line).stdin(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(&workshop.read(name)).unwrap();
        let ran = child.wait_with_output().unwrap();
        assert_eq!(ran.status.code(), Some(0), "{line}: {}", String::from_utf8_lossy(&ran.stderr));
    }
    assert!(workshop.read("named.png") == workshop.read("piped.png"));
    assert!(workshop.read("named.npz") == workshop.read("piped.npz"));
    assert_eq!(workshop.pixels("named.png"), workshop.pixels("drawn.png"));
    let empty = workshop.run("evolve - -o empty.png");
    assert!(empty.code == Some(2) && empty.stderr.contains("/dev/stdin: the file is empty"), "{}", empty.stderr);
}
