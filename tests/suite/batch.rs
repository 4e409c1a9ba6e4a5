//! `smalti batch` at work: which pictures it takes, what it writes, and what it says about them.

use std::collections::{BTreeMap, HashSet};
use std::io::Write;
use std::path::Path;
use std::process::Stdio;

use serde_json::{Value, json};

use crate::workshop::{Ran, Workshop};

/// Enough work that results differ, done in an instant.
pub const QUICK: &str = "-n 20 --evals 400 --progress none";
/// Every ending that an output may have.
pub const ALL_FORMATS: &str = "png,jpg,webp,svg,ora,npz,json,csv";

/// Paints pictures, no two alike.
pub fn paint(workshop: &Workshop, names: &[&str]) {
    for (number, name) in names.iter().enumerate() {
        std::fs::create_dir_all(workshop.path(name).parent().unwrap()).unwrap();
        workshop.paint(name, 16 + number as u32, 18);
    }
}

/// Runs a batch with few evals.
pub fn batch(workshop: &Workshop, rest: &str) -> Ran {
    workshop.run(&format!("batch {QUICK} {rest}"))
}

/// As [`batch`], and fails unless it succeeds.
pub fn done(workshop: &Workshop, rest: &str) -> Ran {
    let ran = batch(workshop, rest);
    assert_eq!(ran.code, Some(0), "{rest}: {}", ran.stderr);
    ran
}

/// The rows in a file, in order.
pub fn rows(workshop: &Workshop, name: &str) -> Vec<Value> {
    let text = String::from_utf8(workshop.read(name)).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Of the rows of a run, each `(id, status)`.
pub fn statuses(rows: &[Value]) -> BTreeMap<&str, &str> {
    rows.iter().map(|row| (row["id"].as_str().unwrap(), row["status"].as_str().unwrap())).collect()
}

/// All files below a folder but those of the results, by their names from there.
pub fn tree(workshop: &Workshop, folder: &str) -> BTreeMap<String, Vec<u8>> {
    fn list(folder: &Path, name: &str, found: &mut BTreeMap<String, Vec<u8>>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{name}{}", path.file_name().unwrap().to_string_lossy());
            if path.is_dir() {
                list(&path, &format!("{name}/"), found);
            } else if !name.ends_with(".jsonl") {
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    let mut found = BTreeMap::new();
    list(&workshop.path(folder), "", &mut found);
    found
}

fn names(workshop: &Workshop, folder: &str) -> Vec<String> {
    tree(workshop, folder).into_keys().collect()
}

#[test]
fn folders_patterns_and_files_become_mosaics_under_their_names() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/p10.png", "in/p2.png", "in/sub/deep/c.jpg", "more/d.bmp", "e.tiff"]);
    workshop.write("in/notes.txt", b"no picture");
    done(&workshop, "in -o flat");
    assert_eq!(names(&workshop, "flat"), ["p10.png", "p2.png"]);
    done(&workshop, "in --recursive more/*.bmp e.tiff -o all --format png,svg");
    let all = ["d.png", "d.svg", "e.png", "e.svg", "p10.png", "p10.svg", "p2.png", "p2.svg"];
    let all: Vec<&str> = all.into_iter().chain(["sub/deep/c.png", "sub/deep/c.svg"]).collect();
    assert_eq!(names(&workshop, "all"), all);
    done(&workshop, "in/p*.png -o named --name {index}-{stem}-{suffix}-{seed}.{ext} --seed 5 --threads 1");
    assert_eq!(names(&workshop, "named"), ["1-p2-png-5.png", "2-p10-png-5.png"], "in natural order");
    let ids: Vec<Value> = rows(&workshop, "named/results.jsonl").iter().map(|row| row["id"].clone()).collect();
    assert_eq!(ids, ["p2", "p10"]);
}

#[test]
fn a_batch_writes_the_bytes_of_evolve_whatever_runs_beside_it() {
    let workshop = Workshop::new();
    let pictures = ["in/a.png", "in/b.png", "in/c.png", "in/d.png", "in/e.png"];
    paint(&workshop, &pictures);
    for (number, how) in
        ["--threads 1", "--threads 3 --in-flight 2", "--in-flight 5 --io-threads 3:2", "--device vulkan"]
            .into_iter()
            .enumerate()
    {
        done(&workshop, &format!("in -o out{number} --format {ALL_FORMATS} {how}"));
        assert_eq!(tree(&workshop, "out0"), tree(&workshop, &format!("out{number}")), "{how}");
    }
    for ending in ALL_FORMATS.split(',') {
        let ran = workshop.run(&format!("evolve in/c.png {QUICK} -o single.{ending}"));
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        assert_eq!(workshop.read(&format!("single.{ending}")), workshop.read(&format!("out0/c.{ending}")), "{ending}");
    }
}

#[test]
fn a_batch_by_the_papers_scheme_writes_the_bytes_of_evolve() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png"]);
    let scheme = "--scheme paper -n 20 --births 400 --progress none";
    for line in [format!("batch in -o out {scheme}"), format!("evolve in/b.png -o b.png {scheme}")] {
        assert_eq!(workshop.run(&line).code, Some(0));
    }
    assert_eq!(workshop.read("out/b.png"), workshop.read("b.png"));
}

#[test]
fn every_row_has_the_fields_of_evolve_also_on_stdout_and_for_what_is_up_to_date() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png"]);
    workshop.write("in/bad.png", b"no picture");
    let single = workshop.run(&format!("evolve in/a.png {QUICK} -o a.png --json")).row();
    let fields = |row: &Value| row.as_object().unwrap().keys().cloned().collect::<HashSet<_>>();
    for (wanted, run) in [("complete", 1), ("unchanged", 2)] {
        let ran = batch(&workshop, "in -o out --json");
        assert_eq!(ran.code, Some(3), "{}", ran.stderr);
        let rows = rows(&workshop, "out/results.jsonl");
        assert_eq!(rows.len(), 3 * run, "a row for every picture");
        let printed = String::from_utf8(ran.stdout).unwrap();
        let printed: Vec<Value> = printed.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(printed, rows[rows.len() - 3..]);
        assert_eq!(statuses(&printed), BTreeMap::from([("a", wanted), ("b", wanted), ("bad", "failed")]));
        for row in &printed {
            assert_eq!(fields(row), fields(&single));
            assert_eq!(row["error"].is_null(), row["id"] != "bad");
        }
        let a = printed.iter().find(|row| row["id"] == "a").unwrap();
        for field in ["key", "sae", "objective", "evals", "births", "stop", "seed", "scheme", "version"] {
            assert_eq!(a[field], single[field], "{field} of {wanted}");
        }
        assert_eq!(a["output"], json!(["out/a.png"]));
    }
}

#[test]
fn a_manifest_says_what_is_special_about_each_picture() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png", "in/c.png"]);
    let manifest = [
        json!({"input": "in/a.png"}),
        json!({"input": "in/a.png", "id": "other", "seed": 7, "output": ["x/other.svg", "other.npz"]}),
        json!({"input": "in/b.png", "id": "mosaic", "preset": "mosaic", "params": {"tiles": 15, "grout": "auto"}}),
        json!({"input": "in/c.png", "id": "paper", "output": "paper.png", "group": "g",
               "params": {"scheme": "paper", "births": "400", "evals": null, "no-rotation": true}}),
        json!({"input": "in/c.png", "id": "shapes", "output": "shapes.csv", "params": {"mask": ["disc", "flower"]}}),
    ];
    let manifest: Vec<String> = manifest.iter().map(ToString::to_string).collect();
    let manifest = format!("{}\n\n", manifest.join("\n"));
    workshop.write("m.jsonl", manifest.as_bytes());
    // What is said for all pictures must not contradict what is said for one.
    let line = "batch --progress none -n 20 --mask border -o out --format png,csv --name {dir}/{id}.{ext} --manifest";
    let ran = workshop.run(&format!("{line} m.jsonl"));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let in_folder = [
        "in/in/a.csv",
        "in/in/a.png",
        "in/mosaic.csv",
        "in/mosaic.png",
        "other.npz",
        "paper.png",
        "shapes.csv",
        "x/other.svg",
    ];
    assert_eq!(names(&workshop, "out"), in_folder);
    for (flags, output) in [
        ("in/a.png --seed 7 -n 20 --mask border", "other.npz"),
        ("in/b.png --preset mosaic -n 15 --grout auto --mask border", "in/mosaic.png"),
        ("in/c.png --scheme paper -n 20 --births 400 --no-rotation --mask border", "paper.png"),
        ("in/c.png -n 20 --mask disc,flower", "shapes.csv"),
    ] {
        let single = format!("single-{}", output.replace('/', "-"));
        let ran = workshop.run(&format!("evolve {flags} --progress none -o {single}"));
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        assert_eq!(workshop.read(&single), workshop.read(&format!("out/{output}")), "{output}");
    }
    // The same from stdin.
    let before = tree(&workshop, "out");
    let mut command = workshop.command(&line.replace("-o out", "-o piped"));
    let mut child = command.arg("-").stdin(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(manifest.as_bytes()).unwrap();
    assert!(child.wait_with_output().unwrap().status.success());
    assert_eq!(tree(&workshop, "piped"), before);
}

#[test]
fn what_comes_after_a_picture_waits_for_it_and_fails_with_it() {
    let workshop = Workshop::new();
    paint(&workshop, &["a.png", "b.png", "c.png", "d.png"]);
    workshop.write("bad.png", b"no picture");
    let row =
        |id: &str, input: &str, after: Option<&str>| json!({"input": input, "id": id, "group": "g", "after": after});
    let write = |rows: &[Value]| {
        let text: Vec<String> = rows.iter().map(ToString::to_string).collect();
        workshop.write("m.jsonl", text.join("\n").as_bytes());
    };
    write(&[
        row("third", "c.png", Some("second")),
        row("second", "b.png", Some("first")),
        row("first", "a.png", None),
        row("broken", "bad.png", None),
        row("never", "d.png", Some("broken")),
        row("nor this", "d.png", Some("never")),
    ]);
    let line = "--manifest m.jsonl -o out --name {id}.{ext}";
    for run in 1..=2 {
        assert_eq!(batch(&workshop, &format!("{line} --threads 2")).code, Some(3));
        let rows = rows(&workshop, "out/results.jsonl");
        assert_eq!(rows.len(), run * 6, "also one for each that was never begun");
        let rows = &rows[rows.len() - 6..];
        let at = |id: &str| rows.iter().position(|row| row["id"] == id).unwrap();
        assert!(at("first") < at("second") && at("second") < at("third"));
        assert!(rows[at("never")]["error"].as_str().unwrap().contains("broken, which failed"));
        assert!(rows[at("nor this")]["error"].as_str().unwrap().contains("never, which failed"));
        assert_eq!(names(&workshop, "out"), ["first.png", "second.png", "third.png"]);
    }
    write(&[
        row("one", "a.png", Some("three")),
        row("two", "b.png", Some("one")),
        row("three", "c.png", Some("two")),
        row("four", "d.png", Some("two")),
    ]);
    let ran = batch(&workshop, line);
    assert!(ran.code == Some(2) && ran.stderr.contains("break the circle"), "{}", ran.stderr);
    write(&[row("one", "a.png", Some("nobody"))]);
    let ran = batch(&workshop, line);
    assert!(ran.code == Some(2) && ran.stderr.contains("not in the batch"), "{}", ran.stderr);
}

#[test]
fn what_cannot_be_meant_is_refused_before_anything_is_written() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/a.jpg", "one/a.png", "two/a.png"]);
    let manifest = |name: &str, row: Value| workshop.write(name, row.to_string().as_bytes());
    manifest("weird.jsonl", json!({"input": "in/a.png", "params": {"threads": 3}}));
    manifest("minus.jsonl", json!({"input": "in/a.png", "output": "-"}));
    manifest("over.jsonl", json!({"input": "in/a.png", "output": "../one/a.png"}));
    manifest("same.jsonl", json!({"input": "in/a.png", "output": ["new/a.png", "new/x/../a.png"]}));
    for (line, told) in [
        ("-o out", "name pictures"),
        ("none/*.png -o out", "matches no file"),
        ("in -o out", "would both be written to out/a.png"),
        ("one two -o out", "would both be written to"),
        ("one -o one --format png", "is an input"),
        ("one -o one --name b.{ext}", "would be taken for a picture of one"),
        (". --recursive -o one/.. --name {index}.{ext}", "would be taken for a picture of ."),
        ("one --manifest over.jsonl -o out", "lies outside of the folder out"),
        ("one --manifest over.jsonl --allow-outside -o out", "is an input"),
        ("--manifest same.jsonl -o out", "would both be written to"),
        ("--manifest minus.jsonl -o out", "writes files"),
        ("--manifest weird.jsonl -o out", "threads is no flag that decides a picture"),
        ("--manifest none.jsonl -o out", "no such file"),
        ("one -o out --format gif", "a mosaic is a still picture"),
        ("one -o out --format png,.PNG", "named twice"),
        ("one -o out --name {stem}.png", "ends in .{ext}"),
        ("one -o out --shard 3/2", "expected k/n"),
        ("one -o out --shard auto", "no scheduler names a shard"),
        ("one -o out --in-flight 0", "--in-flight"),
        ("one -o out --io-threads 0:1", "LOAD:SAVE"),
        ("one -o out --results -", "--json"),
        ("one -o out --results one/a.png", "is read or written by the batch"),
        ("--manifest over.jsonl --allow-outside -o out --results over.jsonl", "is read or written by the batch"),
        ("one -o out --devices cpu --device cpu", "drop --device"),
    ] {
        let before = tree(&workshop, ".");
        let ran = batch(&workshop, line);
        assert_eq!(ran.code, Some(2), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(told), "{line}: {}", ran.stderr);
        // What a folder holds besides pictures is told first.
        let refusals = ran.stderr.lines().filter(|line| !line.contains("left out"));
        assert_eq!(refusals.count(), 1, "{line}: {}", ran.stderr);
        assert_eq!(tree(&workshop, "."), before, "{line}");
    }
}

#[test]
fn outputs_below_a_folder_are_not_taken_for_its_pictures_the_next_time() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.jpg", "in/sub/b.jpg"]);
    for line in ["in --recursive -o in/mosaics", "in/**/*.* -o in/globbed", "in -o in --format svg,npz"] {
        done(&workshop, line);
        let before = tree(&workshop, "in");
        let ran = done(&workshop, &format!("{line} --json"));
        assert!(String::from_utf8(ran.stdout).unwrap().lines().all(|row| row.contains("\"unchanged\"")), "{line}");
        assert_eq!(tree(&workshop, "in"), before, "{line}");
        for made in ["in/mosaics", "in/globbed"] {
            let _ = std::fs::remove_dir_all(workshop.path(made));
        }
    }
}

#[test]
fn a_dry_run_lists_the_work_and_writes_nothing() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png"]);
    let before = tree(&workshop, ".");
    let ran = done(&workshop, "in -o out --dry-run --json --shard 1/1");
    assert!(ran.stderr.contains("in/a.png -> out/a.png"), "{}", ran.stderr);
    let printed = String::from_utf8(ran.stdout).unwrap();
    let planned = printed.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    assert!(planned.into_iter().all(|row| row["status"] == "planned"));
    assert_eq!(printed.lines().count(), 2);
    assert_eq!(tree(&workshop, "."), before);
    assert!(!workshop.path("out").exists());
}

#[test]
fn shards_together_make_the_whole_and_another_count_of_them_redoes_nothing() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/1.png", "in/2.png", "in/3.png", "in/4.png", "in/5.png", "in/6.png", "in/7.png"]);
    done(&workshop, "in -o whole");
    let mut taken = 0;
    for shard in ["1/3", "2/3", "3/3"] {
        done(&workshop, &format!("in -o parts --shard {shard}"));
        let rows = rows(&workshop, &format!("parts/results.{}.jsonl", shard.replace('/', "-of-")));
        assert!(rows.iter().all(|row| row["shard"] == shard && row["status"] == "complete"));
        taken += rows.len();
    }
    assert_eq!(taken, 7);
    assert_eq!(tree(&workshop, "parts"), tree(&workshop, "whole"));
    for shard in ["1/2", "2/2"] {
        done(&workshop, &format!("in -o parts --shard {shard}"));
        let rows = rows(&workshop, &format!("parts/results.{}.jsonl", shard.replace('/', "-of-")));
        assert!(rows.iter().all(|row| row["status"] == "unchanged"), "{shard}");
    }
    let ran = workshop
        .command(&format!("batch {QUICK} in -o auto --shard auto"))
        .envs([("SHARD_INDEX", "2"), ("SHARD_COUNT", "2")])
        .output()
        .unwrap();
    assert!(ran.status.success());
    assert!(workshop.path("auto/results.2-of-2.jsonl").exists());
}

#[test]
fn a_device_from_the_environment_does_not_contradict_devices() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png"]);
    // The environment says cpu, and two devices share the work.
    done(&workshop, "in -o out --devices cpu,vulkan --in-flight 1");
    let devices: HashSet<String> =
        rows(&workshop, "out/results.jsonl").iter().map(|row| row["device"].to_string()).collect();
    assert!(!devices.is_empty());
    done(&workshop, "in -o single --devices cpu");
    assert_eq!(tree(&workshop, "out"), tree(&workshop, "single"));
}

#[test]
fn bad_pictures_of_many_kinds_fail_with_a_sentence_each_and_stop_no_other() {
    use std::os::unix::fs::symlink;
    let workshop = Workshop::new();
    paint(&workshop, &["in/good.png", "in/zz.png"]);
    let photo =
        |name: &str| std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos").join(name)).unwrap();
    let half = |name: &str| photo(name)[..photo(name).len() / 2].to_vec();
    let png = workshop.read("in/good.png");
    let mut wrong_sum = png.clone();
    let length = wrong_sum.len();
    wrong_sum[length - 13] ^= 0x55;
    // The width and height of a PNG follow its first 16 bytes; their checksum is not what a decoder looks at first.
    let sized = |side: u32| {
        let mut bytes = png.clone();
        bytes[16..24].copy_from_slice(&[side.to_be_bytes(), side.to_be_bytes()].concat());
        bytes
    };
    let files: [(&str, Vec<u8>); 13] = [
        ("empty.png", Vec::new()),
        ("text.png", b"no picture".to_vec()),
        ("archive.jpg", b"PK\x03\x04".to_vec()),
        ("cut.png", png[..png.len() / 2].to_vec()),
        ("cut-jpg.jpg", half("plain.jpg")),
        ("cut-webp.webp", half("lossy.webp")),
        ("cut-tif.tif", half("rgb.tif")),
        ("cut-gif.gif", photo("two_frames.gif")[..30].to_vec()),
        ("cut-bmp.bmp", half("rgb.bmp")),
        ("wrong-sum.png", wrong_sum),
        ("bomb.png", sized(65_535)),
        ("none.png", sized(0)),
        ("signature.png", png[..8].to_vec()),
    ];
    for (name, bytes) in &files {
        workshop.write(&format!("in/{name}"), bytes);
    }
    // All its pixels are there.
    workshop.write("in/no-end.jpg", &photo("plain.jpg")[..photo("plain.jpg").len() - 2]);
    image::RgbaImage::new(20, 20).save(workshop.path("in/clear.png")).unwrap();
    std::fs::create_dir(workshop.path("in/folder.png")).unwrap();
    for (link, to) in [
        ("dangling.png", "nowhere"),
        ("circle.png", "circle.png"),
        ("zero.png", "/dev/zero"),
        ("below.png", "text.png/x"),
    ] {
        symlink(to, workshop.path("in").join(link)).unwrap();
    }
    let _socket = std::os::unix::net::UnixListener::bind(workshop.path("in/socket.png")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(workshop.path("in/pipe.png")).status().unwrap().success());
    let bad = files.len() + 8;
    let ran = batch(&workshop, "in missing.png -o out");
    assert_eq!(ran.code, Some(3), "{}", ran.stderr);
    assert_eq!(names(&workshop, "out"), ["good.png", "no-end.png", "zz.png"]);
    let rows = rows(&workshop, "out/results.jsonl");
    assert_eq!(rows.len(), bad + 4);
    for row in rows.iter().filter(|row| row["status"] == "failed") {
        let (input, error) = (row["input"].as_str().unwrap(), row["error"].as_str().unwrap());
        assert!(error.starts_with(&format!("{input}: ")) && !error.contains("panic"), "{error}");
        assert_eq!(row["output"], json!([]));
    }
    assert!(ran.stderr.contains(&format!("failed            {}", bad + 1)), "{}", ran.stderr);
}
