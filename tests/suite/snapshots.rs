//! The course of an evolution, kept by `--save-run`.

use std::collections::BTreeMap;

use smalti::archive::{self, Archive};

use crate::cli_interrupts::interrupted;
use crate::cli_refusals::refused;
use crate::workshop::Workshop;

/// The files of a folder by name.
fn files_in(workshop: &Workshop, folder: &str) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(workshop.path(folder)).expect("the folder is there").map(|entry| entry.unwrap());
    entries.map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap())).collect()
}

/// The snapshots of a folder by their births.
fn snapshots_in(workshop: &Workshop, folder: &str) -> BTreeMap<u64, Archive> {
    let names = files_in(workshop, folder).into_keys();
    names
        .map(|name| {
            let births = name.strip_suffix(".npz").expect("only snapshots").parse().expect("births");
            let snapshot = archive::read(&workshop.path(folder).join(&name)).expect("a whole population");
            assert_eq!(snapshot.meta["births"], births);
            (births, snapshot)
        })
        .collect()
}

#[test]
fn snapshots_begin_at_the_start_come_by_births_and_end_with_the_result() {
    let workshop = Workshop::new();
    let row = workshop.evolve_to_row("-o a.npz --restarts 1 --save-run run --save-every 70");
    assert_eq!(row["output"], serde_json::json!(["a.npz", "run"]));
    let snapshots = snapshots_in(&workshop, "run");
    let births: Vec<u64> = snapshots.keys().copied().collect();
    let early = |births: u64| (births / 32).clamp(1, 70);
    assert!(births.windows(2).all(|pair| pair[1] - pair[0] <= early(pair[0])), "{births:?}");
    for due in [0, 70, 140, 210, 280, 300, 350, 420, 490, 560, 600] {
        assert!(births.contains(&due), "{due} in {births:?}");
    }
    assert!(snapshots.values().is_sorted_by(|a, b| a.meta["sae"].as_u64() >= b.meta["sae"].as_u64()));
    assert!(snapshots.iter().all(|(&births, snapshot)| snapshot.meta["run"] == u64::from(births > 300)));
    let (result, last) = (archive::read(&workshop.path("a.npz")).unwrap(), &snapshots[&600]);
    assert_eq!(last.population, result.population);
    assert_eq!([&last.meta["sae"], &last.meta["key"]], [&row["sae"], &row["key"]]);
}

#[test]
fn a_snapshot_is_a_population_to_go_on_from_with_the_error_that_it_tells() {
    let workshop = Workshop::new();
    workshop.evolve("-o a.png --save-run run --save-every 100");
    let told = archive::read(&workshop.path("run/000000000100.npz")).unwrap().meta;
    let again =
        workshop.run("evolve photo.png --scheme paper --init run/000000000100.npz --births 0 -o b.png --json").row();
    assert_eq!(again["sae"], told["sae"]);
}

#[test]
fn the_end_of_a_run_that_was_cut_short_is_kept_too() {
    let workshop = Workshop::new();
    let rest = "--births 10M --patience 50 --restarts 1 --save-run run --save-every 1M";
    let ran = workshop.run(&format!("evolve photo.png --scheme paper -n 60 -o a.png --json {rest}"));
    let count = |field: &str| ran.row()[field].as_u64().unwrap();
    let snapshots = snapshots_in(&workshop, "run");
    let end_of_first = count("births") - count("births_in_last_run");
    assert_eq!(snapshots[&end_of_first].meta["run"], 0);
    assert_eq!(snapshots[&count("births")].meta["run"], 1);
}

#[test]
fn neither_threads_nor_device_change_a_snapshot() {
    let workshop = Workshop::new();
    let options = "--batch-births 20 --restarts 1 --save-every 64 -o a.png";
    workshop.evolve(&format!("{options} --save-run one --threads 1"));
    workshop.evolve(&format!("{options} --save-run two --threads 2"));
    workshop.evolve(&format!("{options} --save-run gpu --device name:llvmpipe --validate"));
    let one = files_in(&workshop, "one");
    assert!(one.len() > 10);
    assert!(one == files_in(&workshop, "two") && one == files_in(&workshop, "gpu"));
}

#[test]
fn the_same_command_may_write_its_folder_again_and_another_may_not() {
    let workshop = Workshop::new();
    workshop.evolve("-o a.png --save-run run");
    workshop.write("run/notes.txt", b"mine");
    let before = files_in(&workshop, "run");
    workshop.evolve("-o a.png --save-run run");
    assert!(files_in(&workshop, "run") == before);

    let other = "evolve photo.png --scheme paper -n 60 --births 200 -o b.png --seed 1 --save-run run";
    let ran = workshop.run(other);
    assert_eq!(ran.code, Some(2));
    assert_eq!(
        ran.stderr,
        "smalti: run holds snapshots of another evolution; name another folder, or use this one with --force\n"
    );
    assert!(files_in(&workshop, "run") == before && !workshop.path("b.png").exists());

    workshop.write("run/202401010000.npz", b"mine");
    assert_eq!(workshop.run(&format!("{other} --force")).code, Some(0));
    let after = files_in(&workshop, "run");
    assert!(["notes.txt", "202401010000.npz"].iter().all(|name| after[*name] == b"mine"));
    std::fs::remove_file(workshop.path("run/202401010000.npz")).unwrap();
    assert!(!after.contains_key("000000000300.npz"), "the other evolution's last snapshot");
    assert_eq!(workshop.run(other).code, Some(0), "now it is its own");
}

#[test]
fn a_folder_of_other_files_or_a_file_is_refused_and_a_missing_folder_is_made() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("photos")).unwrap();
    workshop.write("photos/cat.jpg", b"cat");
    workshop.write("notes", b"mine");
    for (folder, code, words) in
        [("photos", 2, "photos holds files that are no snapshots"), ("notes", 1, "notes: cannot be used as a folder")]
    {
        let ran =
            workshop.run(&format!("evolve photo.png --scheme paper -n 60 --births 300 -o a.png --save-run {folder}"));
        assert_eq!(ran.code, Some(code), "{}", ran.stderr);
        assert!(ran.stderr.contains(words) && ran.stderr.lines().count() == 1, "{}", ran.stderr);
    }
    let before = workshop.files();
    let row = workshop.evolve_to_row("-o a.png --save-run new/run --dry-run");
    assert_eq!(row["output"], serde_json::json!(["a.png", "new/run"]));
    assert_eq!(workshop.files(), before, "a dry run makes nothing");
    workshop.evolve("-o a.png --save-run new/run");
    assert!(files_in(&workshop, "new/run").len() > 10);
}

#[test]
fn an_interrupt_leaves_whole_snapshots_up_to_where_it_came() {
    let workshop = Workshop::new();
    let endless = "evolve photo.png --scheme paper -n 60 --births 1000000M --progress json -o a.npz --save-run run --save-every 500";
    let (status, messages) = interrupted(&workshop, endless, &["INT"]);
    assert_eq!(status.code(), Some(75), "{messages}");
    let snapshots = snapshots_in(&workshop, "run");
    let (_, last) = snapshots.last_key_value().unwrap();
    let result = archive::read(&workshop.path("a.npz")).unwrap();
    assert_eq!(last.population, result.population);
    assert_eq!(last.meta["births"], result.meta["births"]);
}

#[test]
fn after_an_interrupted_run_the_same_command_leaves_the_folder_that_an_undisturbed_one_leaves() {
    let workshop = Workshop::new();
    let line = "evolve photo.png --scheme paper -n 60 --births 300k --progress json -o a.npz --save-every 50k";
    assert_eq!(workshop.run(&format!("{line} --save-run whole")).code, Some(0));
    let whole = files_in(&workshop, "whole");
    let line = format!("{line} --save-run run --force");
    let between = || {
        let (status, messages) = interrupted(&workshop, &line, &["INT"]);
        assert_eq!(status.code(), Some(75), "{messages}");
        files_in(&workshop, "run").into_keys().filter(|name| !whole.contains_key(name)).collect::<Vec<_>>()
    };
    // A signal that comes just where a snapshot is due anyway leaves none besides.
    let between = std::iter::repeat_with(between).take(5).find(|between| !between.is_empty()).unwrap_or_default();
    assert_eq!(between.len(), 1, "only the end of the interrupted run is kept besides: {between:?}");
    workshop.write("run/202401010000.npz", b"mine");
    assert_eq!(workshop.run(&line).code, Some(0));
    let mut after = files_in(&workshop, "run");
    assert_eq!(after.remove("202401010000.npz").as_deref(), Some(&b"mine"[..]));
    assert!(after == whole, "{:?} and {:?}", after.keys(), whole.keys());
}

#[test]
fn a_folder_that_is_the_input_or_another_output_is_refused() {
    let workshop = Workshop::new();
    for (rest, words) in [
        ("-o same.png --save-run same.png", "same.png is named twice"),
        ("-o a.png --save-target t.png --save-run ./t.png", "./t.png is named twice"),
        ("-o a.png --curve c.svg --save-run c.svg", "c.svg is named twice"),
        ("-o a.png --save-run ./photo.png", "./photo.png is an input"),
    ] {
        refused(&workshop, &format!("evolve photo.png --scheme paper {rest}"), 2, words);
    }
}

/// A device that is always full stands for a disk that becomes so.
#[cfg(target_os = "linux")]
#[test]
fn on_a_full_disk_new_snapshots_make_room_for_the_result() {
    let workshop = Workshop::new();
    let line = "evolve photo.png --scheme paper -n 60 --births 300 -o a.png --save-run run --save-every 100 --force";
    std::fs::create_dir(workshop.path("run")).unwrap();
    std::os::unix::fs::symlink("/dev/full", workshop.path("run/000000000200.npz")).unwrap();
    workshop.write("run/notes.txt", b"mine");
    let ran = workshop.run(line);
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert!(ran.stderr.contains("run: the disk is full, and the "), "{}", ran.stderr);
    assert!(ran.stderr.contains("new snapshots were removed to leave room for the result"), "{}", ran.stderr);
    assert_eq!(workshop.pixels("a.png").dimensions(), (40, 30), "the result is written");
    let left = std::fs::read_dir(workshop.path("run")).unwrap().map(|entry| entry.unwrap().file_name());
    let left: std::collections::BTreeSet<_> = left.map(|name| name.into_string().unwrap()).collect();
    assert_eq!(left, ["000000000200.npz", "notes.txt"].map(str::to_owned).into());
}
