//! Signals: the first ends the evolution in order, the second Ctrl-C ends the process at once.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use crate::workshop::Workshop;

const ENDLESS: &str = "evolve photo.png --scheme paper -n 60 --births 1000000M --progress json";

pub fn send(signal: &str, child: &Child) {
    let status = Command::new("sh").args(["-c", &format!("kill -{signal} {}", child.id())]).status().unwrap();
    assert!(status.success(), "the signal is sent");
}

/// Starts the program, sends the signals once it is evolving, and returns its end with the rest of its messages.
pub fn interrupted(workshop: &Workshop, line: &str, signals: &[&str]) -> (ExitStatus, String) {
    let mut child = workshop.command(line).spawn().unwrap();
    let mut messages = BufReader::new(child.stderr.take().unwrap());
    let mut text = String::new();
    messages.read_line(&mut text).unwrap();
    for signal in signals {
        send(signal, &child);
        // So that two of a kind do not become one.
        std::thread::sleep(Duration::from_millis(100));
    }
    messages.read_to_string(&mut text).unwrap();
    (child.wait().unwrap(), text)
}

fn status_of(workshop: &Workshop, name: &str) -> String {
    let archive = smalti::archive::read(&workshop.path(name)).unwrap();
    archive.meta["status"].as_str().unwrap().to_owned()
}

#[test]
fn every_signal_that_asks_for_an_end_leaves_the_best_so_far_marked_as_partial() {
    for signal in ["INT", "TERM", "USR1", "HUP"] {
        let workshop = Workshop::new();
        let (status, messages) = interrupted(&workshop, &format!("{ENDLESS} -o a.png -o a.npz"), &[signal]);
        assert_eq!(status.code(), Some(75), "{signal}: {messages}");
        assert!(messages.contains("partial"), "{messages}");
        assert_eq!(workshop.pixels("a.png").dimensions(), (40, 30));
        assert_eq!(status_of(&workshop, "a.npz"), "partial");
        assert_eq!(workshop.files().len(), 3, "{:?}", workshop.files());
    }
}

#[test]
fn the_same_command_may_replace_a_partial_result_and_another_may_not() {
    let workshop = Workshop::new();
    let command = format!("{ENDLESS} -o a.npz");
    assert_eq!(interrupted(&workshop, &command, &["INT"]).0.code(), Some(75));
    let other = workshop.run(&format!("{command} --seed 1"));
    assert_eq!(other.code, Some(2), "{}", other.stderr);
    assert_eq!(interrupted(&workshop, &command, &["INT"]).0.code(), Some(75));
}

#[test]
fn a_partial_result_replaces_no_complete_one_and_force_asks_for_just_that() {
    let workshop = Workshop::new();
    // The clock decides how far the first one gets; the second is interrupted before that.
    let command = format!("{ENDLESS} --time 4s -o a.png -o a.npz -o a.webp -o a.svg -o a.ora -o a.json");
    assert_eq!(workshop.run(&command).code, Some(0));
    let (picture, population) = (workshop.read("a.png"), workshop.read("a.npz"));
    std::fs::remove_file(workshop.path("a.png")).unwrap();
    let (status, messages) = interrupted(&workshop, &command, &["INT"]);
    assert_eq!(status.code(), Some(75), "{messages}");
    for ending in ["npz", "webp", "svg", "ora", "json"] {
        assert!(messages.contains(&format!("a.{ending} is kept")), "{messages}");
    }
    assert!(messages.contains("wrote a.png (partial"), "{messages}");
    assert_eq!(workshop.read("a.npz"), population);
    assert_ne!(workshop.read("a.png"), picture);
    assert_eq!(interrupted(&workshop, &format!("{command} --force"), &["INT"]).0.code(), Some(75));
    assert_eq!(status_of(&workshop, "a.npz"), "partial");
}

#[test]
fn a_partial_result_has_a_row_that_says_so() {
    let workshop = Workshop::new();
    let mut child = workshop.command(&format!("{ENDLESS} -o a.png --json")).spawn().unwrap();
    BufReader::new(child.stderr.as_mut().unwrap()).read_line(&mut String::new()).unwrap();
    send("INT", &child);
    let mut text = String::new();
    child.stdout.as_mut().unwrap().read_to_string(&mut text).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(75));
    let row: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!([&row["status"], &row["stop"]], ["partial", "interrupted"]);
    assert!(row["births"].as_u64() > Some(0) && row["error"].is_null());
}

#[test]
fn the_second_ctrl_c_ends_the_process_at_once_and_leaves_nothing() {
    let workshop = Workshop::new();
    let before = workshop.files();
    // Large enough that drawing and encoding are still going on when the second one comes.
    let (status, messages) = interrupted(&workshop, &format!("{ENDLESS} -o a.png --output-size 8000"), &["INT", "INT"]);
    assert_eq!(status.code(), Some(130), "{messages}");
    assert_eq!(workshop.files(), before);
}

#[test]
fn a_partial_table_makes_room_for_the_whole_one_and_no_partial_one_replaces_a_whole() {
    let workshop = Workshop::new();
    let command = format!("{ENDLESS} --time 4s -o a.csv --curve curve.csv --curve curve.svg");
    let names = ["a.csv", "curve.csv", "curve.svg"];
    let last_line = |name| String::from_utf8(workshop.read(name)).unwrap().lines().next_back().unwrap().to_owned();
    let all_are = |word: &str| names.iter().all(|name| last_line(name).split([',', ' ']).any(|part| part == word));
    assert_eq!(interrupted(&workshop, &command, &["INT"]).0.code(), Some(75));
    assert!(all_are("partial"));
    let ran = workshop.run(&command);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(all_are("complete"));

    let whole = names.map(|name| workshop.read(name));
    let (status, messages) = interrupted(&workshop, &command, &["INT"]);
    assert_eq!(status.code(), Some(75), "{messages}");
    assert!(names.iter().all(|name| messages.contains(&format!("{name} is kept"))), "{messages}");
    assert_eq!(names.map(|name| workshop.read(name)), whole);
    assert_eq!(interrupted(&workshop, &format!("{command} --force"), &["INT"]).0.code(), Some(75));
    assert!(all_are("partial"));
}

#[test]
fn before_the_first_round_is_over_nothing_is_replaced() {
    let workshop = Workshop::new();
    workshop.write("a.png", b"made with care");
    let line = "evolve photo.png -o a.png --force -n 900000 --save-run run --progress none -q";
    let mut child = workshop.command(line).stderr(Stdio::piped()).spawn().unwrap();
    // Snapshots begin where the first round does.
    while !workshop.path("run/000000000000.npz").is_file() {
        assert!(child.try_wait().unwrap().is_none(), "it ended");
        std::thread::sleep(Duration::from_millis(5));
    }
    send("INT", &child);
    let ended = child.wait_with_output().unwrap();
    let messages = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(
        (ended.status.code(), messages.as_str()),
        (Some(75), "smalti: interrupted; run the same command again\n")
    );
    assert_eq!(workshop.read("a.png"), b"made with care");
}

#[test]
fn a_time_too_short_for_a_round_is_told() {
    let workshop = Workshop::new();
    let ran = workshop.run("evolve photo.png -o a.png -n 300000 --time 1ms --json");
    assert_eq!((ran.code, ran.row()["evals"].as_u64()), (Some(0), Some(0)), "{}", ran.stderr);
    assert!(ran.stderr.contains("no round was over in that time"), "{}", ran.stderr);
}
