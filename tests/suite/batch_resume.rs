//! `smalti batch` when something is there already, cut short, in the way, or broken; and when it is ended half-way.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

use serde_json::Value;

use crate::batch::{ALL_FORMATS, batch, done, paint, rows, statuses, tree};
use crate::cli_interrupts::send;
use crate::workshop::Workshop;

/// Whether a name is that of a temporary file.
fn is_partial(name: &str) -> bool {
    name.contains(".smalti-")
}

#[test]
fn what_is_up_to_date_keeps_its_figures_and_what_is_replaced_is_counted() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("in")).unwrap();
    workshop.paint("in/a.png", 40, 30);
    workshop.paint("in/b.png", 30, 30);
    let run = |flags: &str| {
        let ran = workshop.run(&format!("batch in -o out -n 60 --evals 2k {flags}"));
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        ran.stderr
    };
    assert!(!run("").contains("there already"));
    assert!(run("").contains("2 of 2 outputs are there already: those of the same options stay"));
    let rows: Vec<Value> = String::from_utf8(workshop.read("out/results.jsonl"))
        .unwrap()
        .lines()
        .map(|line| line.parse().unwrap())
        .collect();
    for id in ["a", "b"] {
        let [first, again]: [&Value; 2] =
            rows.iter().filter(|row| row["id"] == id).collect::<Vec<_>>().try_into().unwrap();
        assert_eq!((&first["status"], &again["status"]), (&"complete".into(), &"unchanged".into()));
        for figure in ["psnr", "spread", "living", "sae", "evals", "evolve_ms", "device", "key"] {
            assert!(first[figure] == again[figure] && !first[figure].is_null(), "{figure}: {first} {again}");
        }
        assert!(first["ended_at"].as_str() < again["ended_at"].as_str(), "{first} {again}");
    }
    assert!(!run("").contains("replaced "), "nothing is replaced");
    std::fs::remove_file(workshop.path("out/b.png")).unwrap();
    let told = run("--seed 1");
    assert!(told.contains("1 of 2 outputs are there already"), "{told}");
    let replaced: Vec<&str> = told.lines().filter(|line| line.starts_with("replaced ")).collect();
    assert_eq!(
        replaced.iter().map(|line| line.split_whitespace().collect()).collect::<Vec<Vec<_>>>(),
        [["replaced", "1"]]
    );
}

#[test]
fn a_table_with_dead_tiles_of_an_older_version_is_made_anew_and_nothing_else_is() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("in")).unwrap();
    image::RgbImage::new(20, 20).save(workshop.path("in/black.png")).unwrap();
    workshop.paint("in/a.png", 40, 30);
    // So few evals that not all tiles are born; on black none is.
    let line = "batch in -o out -n 400 --evals 200 --format png,csv --progress none";
    let run = || {
        let ran = workshop.run(line);
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    };
    run();
    let table = String::from_utf8(workshop.read("out/a.csv")).unwrap();
    let (head, rows) = table.split_once('\n').unwrap();
    assert!(head.ends_with(",key,living") && !rows.contains(",false,"), "{head}");
    assert_eq!(
        rows.lines().count(),
        rows.lines().next().unwrap().rsplit(',').next().unwrap().parse::<usize>().unwrap()
    );
    let empty = workshop.read("out/black.csv");
    assert_eq!(empty.iter().filter(|&&byte| byte == b'\n').count(), 1);
    // As it was before: without the last column, and with the dead tiles.
    let mut old = head.strip_suffix(",living").unwrap().to_owned() + "\n";
    for row in rows.lines() {
        old += row.rsplit_once(',').unwrap().0;
        old += "\n";
    }
    let dead = old.lines().last().unwrap().replace(",true,", ",false,") + "\n";
    let missing = 400 - rows.lines().count();
    workshop.write("out/a.csv", (old + &dead.repeat(missing)).as_bytes());
    let picture = workshop.path("out/a.png").metadata().unwrap().modified().unwrap();
    run();
    assert_eq!(String::from_utf8(workshop.read("out/a.csv")).unwrap(), table);
    assert_eq!(workshop.read("out/black.csv"), empty);
    assert_eq!(workshop.path("out/a.png").metadata().unwrap().modified().unwrap(), picture);
    let one = "evolve in/black.png -n 400 --evals 200 -o black.csv";
    for _ in 0..2 {
        let ran = workshop.run(one);
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    }
}

#[test]
fn every_format_is_made_anew_wherever_it_was_cut_short() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png"]);
    let line = format!("in -o out --format {ALL_FORMATS}");
    done(&workshop, &line);
    let whole = tree(&workshop, "out");
    let most = whole.values().map(Vec::len).max().unwrap();
    // Near the beginning, near the end, and here and there between.
    let cuts = (0..4).chain([9, 41, 200]).chain((1..7).map(|part| most * part / 7)).chain([most - 1]);
    for cut in cuts {
        for (number, (name, bytes)) in whole.iter().enumerate() {
            // Not all at the same byte: from the beginning, and from the end.
            let length = if number % 2 == 0 { cut.min(bytes.len() - 1) } else { (bytes.len() - 1).saturating_sub(cut) };
            workshop.write(&format!("out/{name}"), &bytes[..length]);
        }
        done(&workshop, &line);
        assert!(tree(&workshop, "out") == whole, "cut at {cut}");
        assert_eq!(rows(&workshop, "out/results.jsonl").last().unwrap()["status"], "complete", "cut at {cut}");
    }
    done(&workshop, &line);
    assert_eq!(rows(&workshop, "out/results.jsonl").last().unwrap()["status"], "unchanged");
    // Zeros, as some file systems leave after a crash.
    for (name, bytes) in &whole {
        let mut zeroed = bytes.clone();
        zeroed[bytes.len() / 3..].fill(0);
        workshop.write(&format!("out/{name}"), &zeroed);
    }
    done(&workshop, &line);
    assert!(tree(&workshop, "out") == whole);
}

#[test]
fn only_what_is_missing_is_written_and_what_is_up_to_date_is_not_touched() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png"]);
    done(&workshop, "in -o out --format png,svg");
    let whole = tree(&workshop, "out");
    let changed = |name: &str| workshop.path(name).metadata().unwrap().modified().unwrap();
    let before = [changed("out/a.svg"), changed("out/b.png")];
    std::fs::remove_file(workshop.path("out/a.png")).unwrap();
    std::thread::sleep(Duration::from_millis(20));
    done(&workshop, "in -o out --format png,svg");
    assert_eq!(tree(&workshop, "out"), whole);
    assert_eq!([changed("out/a.svg"), changed("out/b.png")], before);
    let rows = rows(&workshop, "out/results.jsonl");
    assert_eq!(statuses(&rows[2..]), BTreeMap::from([("a", "complete"), ("b", "unchanged")]));
}

#[test]
fn what_is_there_is_treated_as_on_exists_says() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png", "in/c.png"]);
    done(&workshop, "in -o out");
    let first = tree(&workshop, "out");
    let run = |how: &str, code: i32| {
        let ran = batch(&workshop, &format!("in -o out {how}"));
        assert_eq!(ran.code, Some(code), "{how}: {}", ran.stderr);
        let rows = rows(&workshop, "out/results.jsonl");
        statuses(&rows[rows.len() - 3..]).into_values().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(run("--on-exists skip --seed 1", 0), ["skipped"; 3]);
    assert_eq!(run("--on-exists error", 3), ["failed"; 3]);
    assert_eq!(tree(&workshop, "out"), first);
    assert_eq!(run("--seed 1", 0), ["complete"; 3], "our own files with another key are replaced");
    assert_ne!(tree(&workshop, "out"), first);
    assert_eq!(run("--on-exists overwrite", 0), ["complete"; 3]);
    assert_eq!(tree(&workshop, "out"), first);
    std::fs::remove_file(workshop.path("out/b.png")).unwrap();
    assert_eq!(run("--on-exists error", 3), ["failed", "complete", "failed"]);
    assert_eq!(tree(&workshop, "out"), first);
}

#[test]
fn what_smalti_did_not_make_is_replaced_only_on_demand_whole_or_not() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png"]);
    let line = format!("in -o out --format {ALL_FORMATS}");
    done(&workshop, &line);
    let whole = tree(&workshop, "out");
    let png = workshop.read("photo.png");
    let foreign: [(&str, &[u8]); 9] = [
        ("a.png", &png),
        ("a.png", &png[..png.len() / 2]),
        ("a.png", b"notes"),
        ("a.svg", b"<svg xmlns=\"http://www.w3.org/2000/svg\"/>"),
        ("a.json", b"{\"mine\": 1}"),
        ("a.csv", b"x,y\n1,2\n"),
        ("a.npz", b"PK\x03\x04 but no more"),
        ("a.ora", b"\0\0\0mine"),
        ("a.jpg", &[0xFF, 0xD8, 0xFF, 0xD9]),
    ];
    for (name, bytes) in foreign {
        let name = format!("out/{name}");
        workshop.write(&name, bytes);
        let ran = batch(&workshop, &line);
        assert_eq!(ran.code, Some(3), "{name}: {}", ran.stderr);
        assert!(ran.stderr.contains("was not made by smalti"), "{}", ran.stderr);
        assert_eq!(workshop.read(&name), bytes, "{name}");
        done(&workshop, &format!("{line} --on-exists overwrite"));
        assert!(tree(&workshop, "out") == whole, "{name}");
    }
}

#[test]
fn what_is_in_the_way_of_an_output_fails_its_picture_and_no_other() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png", "in/c.png", "in/sub/d.png", "in/e.png"]);
    std::fs::create_dir_all(workshop.path("out/a.png")).unwrap();
    workshop.write("out/sub", b"a file");
    std::os::unix::fs::symlink("c.png", workshop.path("out/c.png")).unwrap();
    let made = Command::new("mkfifo").arg(workshop.path("out/b.png")).status().unwrap();
    assert!(made.success());
    for how in ["", "--on-exists overwrite"] {
        let ran = batch(&workshop, &format!("in --recursive -o out {how}"));
        assert_eq!(ran.code, Some(3), "{}", ran.stderr);
        let rows = rows(&workshop, "out/results.jsonl");
        let wanted = [("a", "failed"), ("b", "failed"), ("c", "failed"), ("e", "complete"), ("sub/d", "failed")];
        assert_eq!(statuses(&rows), BTreeMap::from(wanted));
    }
}

#[test]
fn a_folder_that_cannot_be_written_to_ends_the_batch_with_one_sentence() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png"]);
    workshop.write("file", b"not a folder");
    let mut lines = vec!["in -o file", "in -o file/below", "in -o out --results file/results.jsonl"];
    if std::fs::exists("/proc/1").unwrap() {
        lines.push("in -o /proc/1/below");
    }
    for line in lines {
        let ran = batch(&workshop, line);
        assert_eq!(ran.code, Some(1), "{line}: {}", ran.stderr);
        assert_eq!(ran.stderr.lines().count(), 1, "{}", ran.stderr);
    }
}

#[test]
fn names_that_are_no_text_and_folders_in_the_output_folder_are_no_obstacle() {
    use std::os::unix::ffi::OsStrExt;
    let workshop = Workshop::new();
    paint(&workshop, &["in/plain.png", "in/any/x.png", "in/with\nnewline.png", "in/q\"{stem}.png"]);
    for bytes in [b"caf\xE9.png", b"caf\xE8.png"] {
        let name = std::ffi::OsStr::from_bytes(bytes);
        std::fs::copy(workshop.path("in/plain.png"), workshop.path("in").join(name)).unwrap();
    }
    for wanted in ["complete", "unchanged"] {
        done(&workshop, "in --recursive -o out");
        let rows = rows(&workshop, "out/results.jsonl");
        assert_eq!(tree(&workshop, "out").len(), 6);
        assert!(workshop.path("out/caf%E9.png").exists());
        assert!(rows[rows.len() - 6..].iter().all(|row| row["status"] == wanted));
    }
}

#[test]
fn a_torn_last_line_of_the_results_stays_alone() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png"]);
    std::fs::create_dir(workshop.path("out")).unwrap();
    workshop.write("out/results.jsonl", b"{\"id\": \"a\", \"stat");
    done(&workshop, "in -o out");
    let text = String::from_utf8(workshop.read("out/results.jsonl")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 2);
    let row: Value = serde_json::from_str(lines[1]).unwrap();
    assert_eq!(row["status"], "complete");
}

/// The paths of two dozen pictures that take a while, and the rest of a command line that evolves them.
fn long_work(workshop: &Workshop) -> String {
    let names: Vec<String> = (0..24).map(|number| format!("in/{number}.png")).collect();
    paint(workshop, &names.iter().map(String::as_str).collect::<Vec<_>>());
    workshop.write("in/bad.png", b"no picture");
    "batch in -n 40 --evals 40k --progress none".to_owned()
}

#[test]
fn a_signal_ends_a_batch_with_75_and_the_same_command_finishes_it() {
    let workshop = Workshop::new();
    let work = long_work(&workshop);
    assert_eq!(workshop.run(&format!("{work} -o whole")).code, Some(3));
    let line = format!("{work} -o out");
    for signal in ["TERM", "USR1", "INT"] {
        let mut child = workshop.command(&format!("{line} --json")).spawn().unwrap();
        let mut printed = BufReader::new(child.stdout.take().unwrap());
        // Until it is at work.
        while !{
            let mut row = String::new();
            assert_ne!(printed.read_line(&mut row).unwrap(), 0, "it is still at work");
            row.contains("\"complete\"")
        } {}
        send(signal, &child);
        assert_eq!(child.wait().unwrap().code(), Some(75), "{signal}");
        let (made, whole) = (tree(&workshop, "out"), tree(&workshop, "whole"));
        assert!(made.len() < whole.len(), "{signal}");
        assert!(made.iter().all(|(name, bytes)| whole.get(name) == Some(bytes)), "only whole results: {signal}");
    }
    assert_eq!(workshop.run(&line).code, Some(3));
    assert_eq!(tree(&workshop, "out"), tree(&workshop, "whole"));
}

#[test]
fn what_is_killed_at_any_moment_is_finished_by_the_same_command_with_the_same_bytes() {
    let workshop = Workshop::new();
    let work = long_work(&workshop);
    assert_eq!(workshop.run(&format!("{work} -o whole")).code, Some(3));
    // Files that another process left when it was killed.
    std::fs::create_dir(workshop.path("out")).unwrap();
    workshop.write("out/.smalti-left.partial", b"half");
    let left = std::fs::File::options().write(true).open(workshop.path("out/.smalti-left.partial")).unwrap();
    left.set_modified(SystemTime::now() - Duration::from_secs(2 * 24 * 3600)).unwrap();
    for (number, delay_ms) in [20, 150, 60, 280, 100, 400].into_iter().enumerate() {
        let shard = if number % 3 == 2 { "--shard 2/3" } else { "" };
        let mut child = workshop.command(&format!("{work} -o out {shard}")).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(delay_ms));
        let _ = child.kill();
        child.wait().unwrap();
        let whole = tree(&workshop, "whole");
        let made = tree(&workshop, "out");
        let made = made.iter().filter(|(name, _)| !is_partial(name));
        assert!(made.into_iter().all(|(name, bytes)| whole.get(name) == Some(bytes)), "only whole results");
    }
    assert_eq!(workshop.run(&format!("{work} -o out")).code, Some(3));
    assert_eq!(tree(&workshop, "out"), tree(&workshop, "whole"));
}

#[test]
fn two_processes_on_the_same_work_corrupt_nothing() {
    let workshop = Workshop::new();
    let work = long_work(&workshop);
    assert_eq!(workshop.run(&format!("{work} -o whole")).code, Some(3));
    let children: Vec<_> =
        (0..2).map(|_| workshop.command(&format!("{work} -o out")).stdout(Stdio::null()).spawn().unwrap()).collect();
    for child in children {
        let ended = child.wait_with_output().unwrap();
        assert_eq!(ended.status.code(), Some(3), "{}", String::from_utf8_lossy(&ended.stderr));
    }
    assert_eq!(tree(&workshop, "out"), tree(&workshop, "whole"));
    assert_eq!(rows(&workshop, "out/results.jsonl").len(), 50, "every line is whole");
}

#[test]
fn a_file_that_may_not_grow_any_more_fails_its_picture_and_leaves_nothing_half() {
    let workshop = Workshop::new();
    paint(&workshop, &["in/a.png", "in/b.png"]);
    // Blocks of 512 bytes in sh, of 1,024 in some: a population has more than that, a row has less.
    let program = Path::new(env!("CARGO_BIN_EXE_smalti"));
    let script = "ulimit -f 4; exec \"$0\" batch in -o out -n 20 --evals 400 --progress none --format npz --device cpu";
    let ran = Command::new("sh").args(["-c", script]).arg(program).current_dir(workshop.path("")).output().unwrap();
    assert_eq!(ran.status.code(), Some(3), "{}", String::from_utf8_lossy(&ran.stderr));
    assert!(String::from_utf8_lossy(&ran.stderr).contains("ulimit -f"), "{}", String::from_utf8_lossy(&ran.stderr));
    assert!(tree(&workshop, "out").is_empty());
    done(&workshop, "in -o out --format npz");
    assert_eq!(tree(&workshop, "out").len(), 2);
}
