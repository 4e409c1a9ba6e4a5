//! Machines as they are: no more threads, files that may not grow, signals at any time, and what killed runs left.

use std::process::Command;
use std::time::{Duration, Instant};

use crate::cli_interrupts::send;
use crate::workshop::{Ran, Workshop};

/// A stack that no thread can have, so that none is started.
const NO_THREADS: (&str, &str) = ("RUST_MIN_STACK", "140737488355328");

/// A folder with a picture, two folders of pictures, a population, snapshots, and rows.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    workshop.evolve("-o flies.npz -o mosaic.png --save-run run --save-every 100");
    std::fs::create_dir(workshop.path("in")).unwrap();
    ["in/1.png", "in/2.png"].iter().for_each(|name| workshop.paint(name, 20, 16));
    assert_eq!(workshop.run("batch in -o made -n 20 --evals 500").code, Some(0));
    workshop
}

fn ran(command: &mut Command) -> Ran {
    let output = command.output().expect("the program starts");
    let stderr = String::from_utf8(output.stderr).expect("messages are UTF-8");
    Ran { code: output.status.code(), stdout: output.stdout, stderr }
}

/// The program, begun by a shell after `before`.
fn after(workshop: &Workshop, before: &str, line: &str) -> Command {
    let mut command = Command::new("sh");
    let program = env!("CARGO_BIN_EXE_smalti");
    command.args(["-c", &format!("{before}; exec {program} {line}")]);
    command.current_dir(workshop.path(".")).env("SMALTI_DEVICE", "cpu").stdin(std::process::Stdio::null());
    command
}

fn has_leftovers(workshop: &Workshop) -> bool {
    ["", "run", "made", "new", "pages"].iter().any(|folder| {
        let entries = std::fs::read_dir(workshop.path(folder)).into_iter().flatten();
        entries.flatten().any(|entry| entry.file_name().to_string_lossy().ends_with(".partial"))
    })
}

#[test]
fn where_no_thread_can_be_started_the_work_is_done_without_or_refused_in_one_sentence() {
    let workshop = workshop();
    let small = "-n 20 --evals 500";
    for (line, code) in [
        ("evolve photo.png -o one.png -n 60 --evals 2k --quiet", 0),
        ("evolve photo.png -o paper.png --scheme paper -n 60 --births 300 --quiet", 0),
        ("render flies.npz -o drawn.png --quiet", 0),
        ("score photo.png mosaic.png", 0),
        ("merge made -o all.jsonl --quiet", 0),
        ("man -o pages", 0),
        ("plan in -o out --shards 2 --quiet --picture-time 1s", 0),
        ("gallery photo.png -o gallery --births 1 --quiet", 0),
        (&format!("evolve photo.png -o two.png {small} --save-run new --quiet"), 1),
        (&format!("batch in -o new {small} --quiet"), 1),
        ("timelapse run -o a.gif --quiet", 1),
        (&format!("evolve photo.png -o three.png {small} --threads 2"), 2),
    ] {
        let told = ran(workshop.command(line).env(NO_THREADS.0, NO_THREADS.1));
        assert_eq!(told.code, Some(code), "{line}: {}", told.stderr);
        let failures = told.stderr.lines().filter(|line| line.starts_with("smalti: ")).count();
        assert_eq!(failures, usize::from(code != 0), "{line}: {}", told.stderr);
        assert_eq!(told.stderr.contains("threads can"), code != 0, "{line}: {}", told.stderr);
        assert!(!told.stderr.contains("panicked") && !told.stderr.contains("internal error"), "{}", told.stderr);
    }
    assert!(!has_leftovers(&workshop));
    assert_eq!(workshop.run("evolve photo.png -o usual.png -n 60 --evals 2k").code, Some(0));
    assert_eq!(workshop.read("usual.png"), workshop.read("one.png"), "no result depends on the number of threads");
}

#[cfg(unix)]
#[test]
fn a_file_that_may_not_grow_is_told_by_every_command_and_leaves_nothing() {
    let workshop = workshop();
    for line in [
        "evolve photo.png -o a.svg --scheme paper -n 60 --births 300",
        "render flies.npz -o a.svg",
        "merge made -o all.jsonl",
        "plan in -o out --shards 2 --into new --picture-time 1s",
        "man -o pages",
        "completions bash > completions",
        "timelapse run -o a.png",
    ] {
        let told = ran(&mut after(&workshop, "ulimit -f 0", line));
        assert_eq!(told.code, Some(1), "{line}: {}", told.stderr);
        assert!(told.stderr.contains("ulimit -f") || told.stderr.contains("cannot be written"), "{}", told.stderr);
        assert!(!has_leftovers(&workshop), "{line}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn what_a_killed_run_left_is_swept_by_every_command_that_writes_there() {
    let workshop = workshop();
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
    let plain = |char: char| if char.is_ascii_alphanumeric() || char == '.' { char } else { '-' };
    let host: String = host.trim().chars().map(plain).take(64).collect();
    std::fs::create_dir(workshop.path("pages")).unwrap();
    std::fs::create_dir(workshop.path("new")).unwrap();
    for (folder, line) in [
        ("", "evolve photo.png -o a.svg --scheme paper -n 60 --births 300"),
        ("new", "evolve photo.png -o b.svg --scheme paper -n 60 --births 300 --save-run new"),
        ("", "render flies.npz -o c.svg"),
        ("", "merge made -o all.jsonl"),
        ("plan", "plan in -o out --shards 2 --picture-time 1s"),
        ("pages", "man -o pages"),
        ("", "timelapse run -o a.png"),
        ("gallery", "gallery photo.png -o gallery --births 1"),
        ("figures", "paper table1 -o figures"),
    ] {
        std::fs::create_dir_all(workshop.path(folder)).unwrap();
        let left = workshop.path(folder).join(format!(".smalti-{host}@abc.partial"));
        std::fs::write(&left, b"half").unwrap();
        let told = workshop.run(line);
        assert_eq!(told.code, Some(0), "{line}: {}", told.stderr);
        assert!(!left.exists(), "{line}");
    }
}

/// Starts the program, sends it a signal after a moment, and returns its exit code; none if it does not end.
#[cfg(unix)]
fn code_after(command: &mut Command, signals: &[&str]) -> Option<i32> {
    let mut child = command.spawn().expect("the program starts");
    for signal in signals {
        std::thread::sleep(Duration::from_millis(700));
        send(signal, &child);
    }
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(10) {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    None
}

/// A pipe that nobody writes to stands for a picture that takes for ever to be read.
#[cfg(unix)]
#[test]
fn while_pictures_are_still_being_read_the_first_signal_ends_every_command() {
    let workshop = workshop();
    assert!(Command::new("mkfifo").arg(workshop.path("endless.png")).status().unwrap().success());
    for line in [
        "evolve endless.png -o a.png",
        "evolve endless.png -o a.png --trace trace.json",
        "render endless.png -o a.png",
        "score endless.png photo.png",
        "gallery endless.png -o new",
        "video endless.png photo.png -o new",
        "batch --manifest endless.png -o new",
    ] {
        for signal in ["TERM", "INT", "HUP"] {
            let before = workshop.files();
            assert_eq!(code_after(&mut workshop.command(line), &[signal]), Some(75), "{line} {signal}");
            assert!(!has_leftovers(&workshop), "{line}");
            assert_eq!(workshop.files(), before, "{line}");
        }
    }
    // A batch has begun its folder by then. A mask may be refused for being a pipe, but it keeps nobody waiting.
    for line in ["batch in -o other --mask endless.png", "video in -o other --mask endless.png"] {
        let code = code_after(workshop.command(line).stderr(std::process::Stdio::null()), &["TERM"]);
        assert!(matches!(code, Some(75 | 2 | 3)), "{line}: {code:?}");
        assert!(!has_leftovers(&workshop), "{line}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn what_was_started_to_outlive_its_terminal_does() {
    let workshop = Workshop::new();
    let endless = "evolve photo.png --scheme paper -n 60 --births 1000000M -o a.npz --quiet";
    let mut command = after(&workshop, "trap '' HUP", endless);
    assert_eq!(code_after(&mut command, &["HUP", "INT"]), Some(75));
    let archive = smalti::archive::read(&workshop.path("a.npz")).unwrap();
    assert_eq!(archive.meta["status"], "partial");
    assert!(archive.meta["births"].as_u64() > Some(0));
}
