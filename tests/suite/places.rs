//! No output is an input, and no row of a manifest writes outside of the output folder, whatever the command.

use crate::workshop::Workshop;

/// A folder with files of every kind that is read.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    for folder in ["in", "out", "far"] {
        std::fs::create_dir(workshop.path(folder)).unwrap();
    }
    for name in ["mask.png", "weight.png", "in/1.png", "in/2.png", "in/template.jpg"] {
        workshop.paint(name, 40, 30);
    }
    workshop.evolve("-o flies.npz --save-run run --save-every 100");
    assert_eq!(workshop.run("timelapse run -o clip.gif").code, Some(0));
    workshop.write("own.toml", b"tiles = 50\n");
    workshop.write("rows.jsonl", br#"{"id":"a","status":"complete","output":["a.png"]}"#);
    workshop.write("manifest.jsonl", b"{\"input\": \"in/1.png\"}\n{\"input\": \"in/2.png\"}\n");
    workshop
}

/// Names for the same file: other spellings, and on Unix a symbolic and a hard link that end in `ending`.
fn names_of(workshop: &Workshop, input: &str, ending: &str) -> Vec<String> {
    let mut names = Vec::new();
    if input.ends_with(ending) {
        names.extend([input.to_owned(), format!("./far/../{input}")]);
    }
    if cfg!(unix) {
        let [soft, hard] = ["soft", "hard"].map(|kind| format!("far/{kind}-{}.{ending}", input.replace('/', "-")));
        let _ = std::fs::remove_file(workshop.path(&soft));
        let _ = std::fs::remove_file(workshop.path(&hard));
        #[cfg(unix)]
        std::os::unix::fs::symlink(workshop.path(input), workshop.path(&soft)).unwrap();
        std::fs::hard_link(workshop.path(input), workshop.path(&hard)).unwrap();
        names.extend([soft, hard]);
    }
    names
}

#[test]
fn no_command_writes_over_what_it_reads_under_any_name_and_no_force_makes_it() {
    let workshop = workshop();
    for (input, ending, line) in [
        ("photo.png", "png", "evolve photo.png -n 20 --evals 100 --force -o OUT"),
        ("flies.npz", "npz", "evolve photo.png --init flies.npz --evals 100 --force -o OUT"),
        ("mask.png", "png", "evolve photo.png --mask mask.png -n 20 --evals 100 --force -o OUT"),
        (
            "weight.png",
            "png",
            "evolve photo.png --weight weight.png -n 20 --evals 100 --force -o a.svg --save-target OUT",
        ),
        ("photo.png", "svg", "evolve photo.png -n 20 --evals 100 --force -o a.png --curve OUT"),
        ("photo.png", "json", "evolve photo.png -n 20 --evals 100 --force -o a.png --trace OUT"),
        ("own.toml", "toml", "evolve photo.png --preset own.toml --evals 100 --force -o a.png --trace OUT"),
        ("own.toml", "toml", "evolve photo.png --config own.toml --evals 100 --force -o a.png --trace OUT"),
        ("flies.npz", "npz", "render flies.npz --force -o OUT"),
        ("mask.png", "png", "render flies.npz --mask mask.png --force -o OUT"),
        ("run/000000000000.npz", "png", "timelapse run --force -o OUT"),
        ("rows.jsonl", "jsonl", "merge rows.jsonl --force -o OUT"),
        ("manifest.jsonl", "jsonl", "merge rows.jsonl --manifest manifest.jsonl --force -o OUT"),
        ("clip.gif", "gif", "video clip.gif -n 20 --evals 100 --force -o OUT"),
        ("in/1.png", "png", "video in/1.png in/2.png -n 20 --evals 100 --force -o OUT"),
        ("mask.png", "png", "video in/1.png in/2.png -n 20 --evals 100 --mask mask.png --force -o OUT"),
    ] {
        for name in names_of(&workshop, input, ending) {
            let (before, line) = (workshop.read(input), line.replace("OUT", &name));
            let ran = workshop.run(&line);
            assert_eq!(ran.code, Some(2), "{line}: {}", ran.stderr);
            assert!(ran.stderr.contains("is an input"), "{line}: {}", ran.stderr);
            assert_eq!(ran.stderr.lines().count(), 1, "{line}: {}", ran.stderr);
            assert_eq!(workshop.read(input), before, "{line}");
        }
    }
}

#[test]
fn no_folder_of_outputs_is_filled_over_what_is_read() {
    let workshop = workshop();
    assert_eq!(workshop.run("plan --manifest manifest.jsonl -o out --shards 2 --picture-time 1s").code, Some(0));
    for (from, to) in [("in/1.png", "out/000001.png"), ("in/1.png", "far/1.png"), ("in/1.png", "far/soft.jpg")] {
        std::fs::hard_link(workshop.path(from), workshop.path(to)).unwrap();
    }
    for (kept, line, told) in [
        (
            "run/000000000300.npz",
            "evolve photo.png --init run/000000000300.npz -o a.png --save-run run --force",
            "holds an",
        ),
        ("in/1.png", "batch in/1.png -n 20 --evals 100 -o in --on-exists overwrite", "is an input"),
        ("in/1.png", "batch in/1.png -n 20 --evals 100 -o far --on-exists overwrite", "is an input"),
        (
            "plan/manifest.jsonl",
            "plan --manifest plan/manifest.jsonl -o out --shards 1 --force --picture-time 1s",
            "is an",
        ),
        ("in/1.png", "video in -n 20 --evals 100 -o in --force", "holds the frames"),
        ("in/1.png", "video in/2.png in/1.png -n 20 --evals 100 -o out --force", "is an input"),
        ("in/template.jpg", "gallery in/template.jpg -o in --births 1 --force", "is an input"),
        ("in/1.png", "gallery far/soft.jpg in/1.png -o far --births 1 --force", "is an input"),
        ("in/1.png", "paper fig3 --images in -o ./in --births 1 --force", "holds the pictures"),
    ] {
        let before = workshop.read(kept);
        let ran = workshop.run(line);
        assert_eq!(ran.code, Some(2), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(told), "{line}: {}", ran.stderr);
        assert_eq!(workshop.read(kept), before, "{line}");
    }
}

#[test]
fn a_row_that_leaves_the_output_folder_is_refused_unless_that_is_allowed() {
    let workshop = workshop();
    let beyond = workshop.path("far/abs.png").display().to_string();
    let mut outputs = vec!["../far/a.png".to_owned(), "new/../../far/b.png".to_owned(), beyond];
    if cfg!(unix) {
        #[cfg(unix)]
        std::os::unix::fs::symlink(workshop.path("far"), workshop.path("out/link")).unwrap();
        outputs.push("link/c.png".to_owned());
    }
    for output in outputs {
        let row = format!("{{\"input\": \"in/1.png\"}}\n{{\"input\": \"in/2.png\", \"output\": \"{output}\"}}\n");
        workshop.write("m.jsonl", row.as_bytes());
        let line = "batch --manifest m.jsonl -o out -n 20 --evals 100 --on-exists overwrite";
        for command in [line.to_owned(), line.replace("batch", "plan --shards 2 --picture-time 1s")] {
            let ran = workshop.run(&command);
            assert_eq!(ran.code, Some(2), "{output}: {}", ran.stderr);
            assert!(ran.stderr.starts_with("smalti: m.jsonl: line 2: "), "{}", ran.stderr);
            assert!(ran.stderr.contains("lies outside of the folder out"), "{}", ran.stderr);
        }
        assert_eq!(std::fs::read_dir(workshop.path("far")).unwrap().count(), 0, "{output}");
        let ran = workshop.run(&format!("{line} --allow-outside"));
        assert_eq!(ran.code, Some(0), "{output}: {}", ran.stderr);
        let made = std::fs::read_dir(workshop.path("far")).unwrap().map(|entry| entry.unwrap().path());
        made.for_each(|path| std::fs::remove_file(path).unwrap());
    }
    workshop.write("m.jsonl", b"{\"input\": \"in/1.png\", \"id\": \"../far/x\"}\n");
    let ran = workshop.run("batch --manifest m.jsonl -o out --name {id}.{ext} -n 20 --evals 100");
    assert_eq!(ran.code, Some(2), "an id is a way out, too: {}", ran.stderr);
    // What stays inside is no concern.
    workshop.write("m.jsonl", b"{\"input\": \"in/1.png\", \"output\": \"new/../deep/../y.png\"}\n");
    let ran = workshop.run("batch --manifest m.jsonl -o out -n 20 --evals 100");
    assert_eq!((ran.code, workshop.path("out/y.png").exists()), (Some(0), true), "{}", ran.stderr);
}
