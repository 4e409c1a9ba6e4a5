//! Names of files, ids and messages that would be more than text to a terminal or to a spreadsheet.

#[cfg(unix)]
use std::fs;

use crate::workshop::Workshop;

/// Names that would colour the terminal, begin a line of their own, and overwrite what stands before them.
#[cfg(unix)]
const NAMES: [&str; 3] = ["a\u{1b}[31mb.png", "a\nsmalti: all is well.png", "a\rsmalti: b\u{9b}.png"];

#[cfg(unix)]
#[test]
fn control_characters_in_names_never_reach_the_terminal() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.path("in")).unwrap();
    for name in NAMES {
        workshop.paint("x.png", 20, 20);
        fs::copy(workshop.path("x.png"), workshop.path("in").join(name)).unwrap();
    }
    workshop.write("in/c\u{1b}]0;title\u{7}.png", b"no picture");
    let assert_clean = |text: &str, line_count: Option<usize>| {
        let is_clean = text.chars().all(|char| char == '\n' || !char.is_control());
        assert!(is_clean && !text.contains("\nsmalti: all"), "{text:?}");
        assert!(line_count.is_none_or(|count| text.lines().count() == count), "{text:?}");
    };
    let batch = workshop.run("batch in -o out -n 8 --evals 500 --progress plain");
    assert_eq!(batch.code, Some(3), "{}", batch.stderr);
    assert!(batch.stderr.contains(r"c\u{1b}]0;title\u{7}.png"), "{}", batch.stderr);
    assert_clean(&batch.stderr, None);
    assert_clean(&workshop.run("batch in -o out2 --dry-run").stderr, None);
    assert_clean(&workshop.run("merge out -o all.csv").stderr, None);
    for name in NAMES {
        let mut command = workshop.command("evolve -n 8 --evals 500 -v -o");
        let evolved = command.arg(format!("out/{name}")).arg(workshop.path("in").join(name)).output().unwrap();
        assert_eq!(evolved.status.code(), Some(0));
        assert_clean(std::str::from_utf8(&evolved.stderr).unwrap(), None);
        let missing = workshop.command("evolve -o o.png").arg(format!("no{name}")).output().unwrap();
        assert_eq!(missing.status.code(), Some(2));
        assert_clean(std::str::from_utf8(&missing.stderr).unwrap(), Some(1));
        let scored = workshop.command("score x.png").arg(workshop.path("in").join(name)).output().unwrap();
        assert_clean(std::str::from_utf8(&scored.stdout).unwrap(), Some(2));
    }
}

#[test]
fn cells_of_merged_tables_are_no_formulas() {
    let workshop = Workshop::new();
    let row = r#"{"id":"=1+1","input":"@a.png","status":"complete","output":["-x.png"],"objective":-5,"error":null}"#;
    workshop.write("results.jsonl", format!("{row}\n").as_bytes());
    let ran = workshop.run("merge results.jsonl -o all.csv");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let table = String::from_utf8(workshop.read("all.csv")).unwrap();
    let cells: Vec<&str> = table.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(&cells[..5], ["'=1+1", "'@a.png", "complete", "", "'-x.png"]);
    assert!(cells.contains(&"-5"), "{table}");
}
