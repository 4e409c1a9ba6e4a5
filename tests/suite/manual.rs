//! `smalti man`: shown on a terminal, and troff for whoever reads it from a pipe.

use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Stdio};

use crate::workshop::Workshop;

/// Runs a program on a terminal of its own; the first argument is the `PATH`.
const ON_A_TERMINAL: &str = "import os, pty, sys
os.environ['PATH'] = sys.argv[1]
sys.exit(os.waitstatus_to_exitcode(pty.spawn(sys.argv[2:])))";

/// What `smalti man evolve` shows on a terminal where `man` is this script, or is not there.
fn on_a_terminal(man: Option<&str>) -> String {
    let workshop = Workshop::new();
    if let Some(script) = man {
        workshop.write("man", format!("#!/bin/sh\n{script}\n").as_bytes());
        std::fs::set_permissions(workshop.path("man"), std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    let mut command = Command::new("python3");
    command.args(["-c", ON_A_TERMINAL]).arg(workshop.path("."));
    command.args([env!("CARGO_BIN_EXE_smalti"), "man", "evolve"]).stdin(Stdio::null());
    let output = command.output().expect("python3 is there");
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{told}");
    told
}

#[test]
fn a_page_is_troff_in_a_pipe() {
    let workshop = Workshop::new();
    for (line, title) in [("man", ".TH smalti 1"), ("man evolve", ".TH smalti-evolve 1")] {
        let ran = workshop.run(line);
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(0), ""));
        let page = String::from_utf8(ran.stdout).unwrap();
        assert!(page.contains(title) && page.contains("\n.SH NAME\n"), "{line}: {page}");
    }
    let ran = workshop.run("man evolv");
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
}

#[test]
fn on_a_terminal_man_shows_the_page() {
    let keep_the_title = "while IFS= read -r line; do case $line in .TH*) title=$line ;; esac; done";
    let told = on_a_terminal(Some(&format!("{keep_the_title}\necho \"man $*: $title\"")));
    assert!(told.starts_with("man -l -: .TH smalti-evolve 1"), "{told}");
    assert_eq!(told.lines().count(), 1, "{told}");
}

#[test]
fn on_a_terminal_without_man_or_with_one_that_fails_it_is_the_help() {
    for man in [None, Some("echo what is -l >&2; exit 1")] {
        let told = on_a_terminal(man);
        assert!(told.contains("Usage: smalti evolve") && told.contains("--tiles"), "{man:?}: {told}");
        assert!(!told.contains(".SH") && !told.contains("what is -l"), "{man:?}: {told}");
    }
}
