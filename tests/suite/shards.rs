//! A batch in parts: shards, plans, and their results put together. `tests/slurm/run` does the same on a cluster.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::workshop::{Ran, Workshop};

const FLAGS: &str = "-n 30 --evals 3k --threads 1";

/// Seven pictures and a file that is none in `in`, and a manifest of them all, of which three are a group.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("in")).unwrap();
    workshop.write("in/p7.png", b"no picture");
    let mut manifest = String::new();
    for number in 1..=8 {
        if number != 7 {
            workshop.paint(&format!("in/p{number}.png"), 20 + number, 20);
        }
        let group = if number % 3 == 0 || number == 1 { r#", "group": "shot""# } else { "" };
        manifest += &format!("{{\"input\": \"in/p{number}.png\", \"seed\": {number}{group}}}\n");
    }
    workshop.write("all.jsonl", manifest.as_bytes());
    workshop
}

fn run(workshop: &Workshop, code: i32, line: &str) -> Ran {
    let ran = workshop.run(line);
    assert_eq!(ran.code, Some(code), "{line}: {}", ran.stderr);
    ran
}

fn rows(workshop: &Workshop, name: &str) -> Vec<Value> {
    let text = String::from_utf8(workshop.read(name)).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Names and bytes of the pictures below a folder of outputs.
fn pictures(workshop: &Workshop, folder: &str) -> Vec<(String, Vec<u8>)> {
    let names = (1..=8).filter(|&number| number != 7).map(|number| format!("{folder}/in/p{number}.png"));
    names.map(|name| (name[folder.len()..].to_owned(), workshop.read(&name))).collect()
}

#[test]
fn the_shards_of_a_plan_make_what_one_batch_makes_and_their_results_merge() {
    let workshop = workshop();
    run(&workshop, 3, &format!("batch --manifest all.jsonl -o whole {FLAGS}"));
    let ran = run(&workshop, 0, &format!("plan --manifest all.jsonl -o parts --shards 3 {FLAGS}"));
    assert!(ran.stderr.contains("8 pictures in 3 shards of at most 3"), "{}", ran.stderr);
    assert!(ran.stderr.contains("less than a minute of work"), "{}", ran.stderr);
    let script = String::from_utf8(workshop.read("plan/submit.slurm")).unwrap();
    assert!(script.contains("--tiles=30") && script.contains("--evals=3k"), "{script}");

    let shards = ["plan/shard-0001.jsonl", "plan/shard-0002.jsonl", "plan/shard-0003.jsonl"];
    let of_group = shards.map(|name| rows(&workshop, name).iter().filter(|row| row["group"] == "shot").count());
    assert_eq!((of_group.iter().max(), of_group.iter().sum::<usize>()), (Some(&3), 3), "{of_group:?}");
    let mut codes = Vec::new();
    for (index, shard) in (1..).zip(shards) {
        let results = format!("parts/results.{index}-of-3.jsonl");
        codes.push(
            workshop.run(&format!("batch --manifest {shard} -o parts --results {results} {FLAGS}")).code.unwrap(),
        );
    }
    codes.sort_unstable();
    assert_eq!(codes, [0, 0, 3], "one shard has the bad picture");
    assert_eq!(pictures(&workshop, "parts"), pictures(&workshop, "whole"));

    let ran = run(&workshop, 3, "merge parts -o merged.jsonl --manifest plan/manifest.jsonl");
    assert!(ran.stderr.contains("failed in/p7: in/p7.png") && !ran.stderr.contains("missing"), "{}", ran.stderr);
    let merged = rows(&workshop, "merged.jsonl");
    let ids: Vec<&str> = merged.iter().map(|row| row["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["in/p1", "in/p2", "in/p3", "in/p4", "in/p5", "in/p6", "in/p7", "in/p8"]);
}

#[test]
fn the_shards_of_a_batch_have_every_picture_once_and_groups_whole() {
    let workshop = workshop();
    let mut seen = Vec::new();
    for index in 1..=3 {
        let ran =
            workshop.run(&format!("batch --manifest all.jsonl -o out --shard {index}/3 --dry-run --json {FLAGS}"));
        let text = String::from_utf8(ran.stdout).unwrap();
        let rows: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let ids: BTreeSet<String> = rows.iter().map(|row| row["id"].as_str().unwrap().to_owned()).collect();
        let of_group = ["in/p1", "in/p3", "in/p6"].into_iter().filter(|&id| ids.contains(id)).count();
        assert!(of_group == 0 || of_group == 3, "{ids:?} tear a group apart");
        seen.extend(ids);
    }
    seen.sort();
    assert_eq!(seen, (1..=8).map(|number| format!("in/p{number}")).collect::<Vec<_>>());
}

#[test]
fn auto_takes_the_shard_from_the_scheduler_and_without_one_refuses() {
    let workshop = workshop();
    let line = "batch --manifest all.jsonl -o out --shard auto --dry-run";
    let refused = run(&workshop, 2, line);
    assert!(refused.stderr.contains("no scheduler names a shard"), "{}", refused.stderr);
    let mut command = workshop.command(line);
    for (name, value) in [("ID", "2"), ("MIN", "1"), ("MAX", "4"), ("COUNT", "4"), ("STEP", "1")] {
        command.env(format!("SLURM_ARRAY_TASK_{name}"), value);
    }
    let by_slurm = String::from_utf8(command.output().unwrap().stderr).unwrap();
    let given = run(&workshop, 0, "batch --manifest all.jsonl -o out --shard 2/4 --dry-run");
    assert_eq!(by_slurm, given.stderr);
    assert!(by_slurm.contains("2 pictures"), "{by_slurm}");
}

#[test]
fn a_merge_takes_the_newest_row_and_tells_of_rows_whose_files_hold_something_else() {
    let workshop = workshop();
    // The name of the older run sorts after that of the newer one.
    run(&workshop, 0, &format!("batch in/p1.png in/p2.png -o out --results out/results.z.jsonl {FLAGS}"));
    run(&workshop, 0, &format!("batch in/p1.png in/p2.png -o out --results out/results.a.jsonl {FLAGS} --seed 5"));
    let ran = run(&workshop, 0, "merge out -o merged.jsonl");
    assert!(!ran.stderr.contains("another result"), "{}", ran.stderr);
    assert!(rows(&workshop, "merged.jsonl").iter().all(|row| row["seed"] == 5));
    run(&workshop, 0, &format!("evolve in/p2.png -o out/p2.png --force {FLAGS} --seed 6"));
    let ran = run(&workshop, 0, "merge out -o merged.jsonl");
    let told: Vec<&str> = ran.stderr.lines().filter(|line| line.contains("another result")).collect();
    assert_eq!(told, ["smalti: p2: its row tells of another result than out/p2.png holds; run the batch again"]);
}

#[test]
fn a_merge_tells_what_is_missing_and_replaces_no_file_that_is_not_its_own() {
    let workshop = workshop();
    let row = r#"{"id":"in/p1","status":"complete","output":["out/in/p1.png"]}"#;
    workshop.write("results.jsonl", format!("{row}\n{}", &row[..30]).as_bytes());
    let ran = run(&workshop, 3, "merge results.jsonl -o merged.csv --manifest all.jsonl");
    assert!(ran.stderr.contains("missing 7 of 8 pictures: in/p2, in/p3"), "{}", ran.stderr);
    assert!(ran.stderr.contains("results.jsonl: line 2 is no whole row"), "{}", ran.stderr);
    let csv = String::from_utf8(workshop.read("merged.csv")).unwrap();
    assert!(csv.starts_with("id,input,status,") && csv.lines().count() == 2, "{csv}");
    // What is its own may be replaced, in either format.
    run(&workshop, 0, "merge results.jsonl -o merged.csv --format jsonl");
    assert_eq!(workshop.read("merged.csv"), format!("{row}\n").as_bytes());
    let printed = run(&workshop, 0, "merge results.jsonl -o - --quiet");
    assert_eq!(printed.stdout, format!("{row}\n").as_bytes());

    let refused = run(&workshop, 2, "merge results.jsonl -o photo.png");
    assert!(refused.stderr.contains("photo.png exists and holds no merged rows"), "{}", refused.stderr);
    for _ in 0..2 {
        run(&workshop, 0, "merge . -o results-all.jsonl");
    }
    let refused = run(&workshop, 2, "merge . -o results.jsonl");
    assert!(refused.stderr.contains("is an input"), "{}", refused.stderr);
    run(&workshop, 2, "merge nothing.jsonl -o new.jsonl");
    run(&workshop, 2, "merge photo.png -o new.jsonl");
    assert!(!workshop.files().contains("new.jsonl"));
}

#[test]
fn a_plan_counts_by_items_and_by_minutes_and_refuses_what_it_decides_itself() {
    let workshop = workshop();
    let plan = |rest: &str| workshop.run(&format!("plan in -o out --into {rest}"));
    let ran = plan("by-items --per-shard 3");
    assert!(ran.stderr.contains("8 pictures in 3 shards of at most 3"), "{}", ran.stderr);
    let ran = plan("by-minutes --minutes 2 --picture-time 30s");
    assert!(ran.stderr.contains("8 pictures in 2 shards of at most 4"), "{}", ran.stderr);
    assert!(ran.stderr.contains("about 2 min a shard, 30 s a picture"), "{}", ran.stderr);
    assert!(!ran.stderr.contains("less than a minute"), "{}", ran.stderr);
    let ran = plan("more-than-pictures --shards 100 --picture-time 90s");
    assert!(ran.stderr.contains("8 pictures in 8 shards of at most 1"), "{}", ran.stderr);
    for (rest, told) in [
        ("x", "--shards"),
        ("x --shards 0", "--shards 0: must be 1 to"),
        ("x --minutes 0", "--minutes 0: must be more than 0"),
        ("x --shards 2 --per-shard 2", "cannot be used with"),
        ("x --shards 2 --shard 1/2", "--shard: each shard has"),
        ("x --shards 2 --results r.jsonl", "--results: each shard has"),
        ("x --shards 2 --trace t.json", "--trace: each shard has"),
        ("x --shards 2 --style cubist", "cubist"),
    ] {
        let ran = plan(rest);
        assert_eq!(ran.code, Some(2), "{rest}: {}", ran.stderr);
        assert!(ran.stderr.contains(told), "{rest}: {}", ran.stderr);
    }
    assert!(!workshop.files().contains("x"), "nothing is written");
    let ran = plan("x --shards 2 --dry-run");
    assert_eq!((ran.code, workshop.files().contains("x")), (Some(0), false), "{}", ran.stderr);
}
