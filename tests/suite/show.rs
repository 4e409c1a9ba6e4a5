//! What files tell of how they were made: the command that is printed makes the same bytes again, from the files that
//! it asks for.

use std::fs;

use serde_json::Value;

use crate::workshop::Workshop;

const PRESET: &str = "style = \"mosaic\"\nside = [0.5, 2.25]\ngrout-width = 0.07\nguide = \"edges\"\nturn = 9\n\
    [[classes]]\nshare = 0.3\nscale = 2\n[[classes]]\nshare = 0.7\nscale = 0.8\nfirst-round = 2\n";

/// A workshop with files for all flags that name one.
fn furnished() -> Workshop {
    let workshop = Workshop::new();
    workshop.write("own.toml", PRESET.as_bytes());
    workshop.write("three.hex", b"102030\nf0e0d0\n00ff80\n");
    workshop.paint("map.png", 40, 30);
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/photos/alpha.png"), workshop.path("cut.png")).unwrap();
    workshop.write(
        "leaf.svg",
        br#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M1 1L8 3L5 8z"/></svg>"#,
    );
    workshop
}

/// The row of `smalti show --json` about a file.
fn shown(workshop: &Workshop, line: &str) -> Value {
    let ran = workshop.run(&format!("show {line} --json"));
    assert_eq!(ran.code, Some(0), "{line}: {}", ran.stderr);
    ran.row()
}

/// Runs what `smalti show` says of `file`, in a workshop of its own, with the files of `given` for the words in
/// capitals; the file must come out as it is.
fn assert_made_again(workshop: &Workshop, file: &str, given: &[(&str, &str)]) {
    let row = shown(workshop, file);
    let again = furnished();
    let needs = row["needs"].as_object().expect("needs are a map");
    let content_of = |what: &str| what.split_once("a file with\n").map(|(_, content)| content.to_owned());
    for (word, what) in needs {
        if let Some(content) = what.as_str().and_then(content_of) {
            again.write(word, content.as_bytes());
        }
    }
    let file_for = |word: &str| {
        let known = given.iter().find(|(known, _)| *known == word).map(|(_, name)| (*name).to_owned());
        known.unwrap_or_else(|| if word == "PICTURE" { "photo.png".to_owned() } else { word.to_owned() })
    };
    for (_, name) in given {
        fs::copy(workshop.path(name), again.path(name)).expect("the file is there");
    }
    for command in row["commands"].as_array().expect("there is a command") {
        let line = command.as_str().and_then(|line| line.strip_prefix("smalti ")).expect("it runs smalti");
        let word = |part: &str| {
            part.split(',')
                .map(|name| if needs.contains_key(name) { file_for(name) } else { name.to_owned() })
                .collect::<Vec<_>>()
                .join(",")
        };
        let line: Vec<String> = line.split(' ').map(word).collect();
        let ran = again.run(&line.join(" "));
        assert_eq!(ran.code, Some(0), "{command}: {}", ran.stderr);
    }
    assert!(again.read(file) == workshop.read(file), "{file} came out differently: {}", row["commands"]);
}

#[test]
fn the_command_that_is_shown_makes_the_same_bytes_again() {
    let workshop = furnished();
    for (rest, given) in [
        ("-n 60", &[][..]),
        ("-n 60 --evals 1k --seed 9 --size 32 --candidates 4 --patience 700 --target-sae 900 --color-mode mean", &[]),
        ("-n 60 --style mosaic", &[]),
        ("-n 60 --style mosaic --grout none", &[]),
        ("-n 60 --style mosaic --grout auto --grout-width 0.3 --output-size 64", &[]),
        ("-n 60 --grout 203040", &[]),
        ("-n 60 --style paint --opacity 0.35 --background ff0000", &[]),
        ("-n 60 --style spray --blend opaque --background none", &[]),
        ("-n 60 --style spray --shader fade --mask disc,leaf.svg,hexagon", &[("MASK", "leaf.svg")]),
        ("-n 60 --preset own.toml --palette three.hex", &[]),
        ("-n 60 --colors 7 --weight map.png", &[("WEIGHT", "map.png")]),
        ("--preset paper-6 -n 60 --births 300", &[]),
        ("--preset paper-11 -n 60 --births 300 --cool 0.3 --p-crossover 0.1 --new-blood 0.02 --no-rotation", &[]),
        (
            "--scheme paper -n 60 --births 300 --restarts 2 --mitosis 1 --mask leaf.svg --restart-mask leaf.svg,disc \
             --p-mutation 0.7 --tile-scale 1.3 --on-dry stop --batch-births 3 --color-mode pick",
            &[("MASK", "leaf.svg")],
        ),
    ] {
        let line = format!("evolve photo.png -o m.png -o m.npz --force --evals 1k {rest}");
        let line =
            if rest.contains("paper") || rest.contains("--evals") { line.replace(" --evals 1k", "") } else { line };
        let ran = workshop.run(&line);
        assert_eq!(ran.code, Some(0), "{line}: {}", ran.stderr);
        for file in ["m.png", "m.npz"] {
            assert_made_again(&workshop, file, given);
        }
    }
}

#[test]
fn every_kind_of_output_tells_its_command() {
    let workshop = furnished();
    let outputs = "-o m.jpg -o m.webp -o m.svg -o m.ora -o m.json -o m.npz -o m.csv";
    assert_eq!(workshop.run(&format!("evolve cut.png {outputs} -n 40 --evals 800")).code, Some(0));
    for file in ["m.jpg", "m.webp", "m.svg", "m.ora", "m.json", "m.npz"] {
        assert_made_again(&workshop, file, &[("PICTURE", "cut.png")]);
    }
    let flies = workshop.run("evolve cut.png -o more.png --init m.npz --evals 500 --seed 3");
    assert_eq!(flies.code, Some(0), "{}", flies.stderr);
    assert_made_again(&workshop, "more.png", &[("PICTURE", "cut.png"), ("FLIES.npz", "m.npz")]);
    let rendered = "render m.npz -o drawn.png -o drawn.svg --output-size 90 --mask leaf.svg,disc --shader flat --background 102030";
    assert_eq!(workshop.run(rendered).code, Some(0));
    for file in ["drawn.png", "drawn.svg"] {
        assert_made_again(&workshop, file, &[("POPULATION.npz", "m.npz"), ("MASK", "leaf.svg")]);
    }
    // A table has no room for more than a key.
    let ran = workshop.run("show m.csv");
    let text = String::from_utf8(ran.stdout).unwrap();
    assert!(ran.code == Some(0) && text.contains("key") && text.contains("another output"), "{text}");
}

#[test]
fn animations_tell_their_commands() {
    let workshop = furnished();
    assert_eq!(workshop.run("evolve photo.png -o m.png -n 40 --evals 2k --save-run run").code, Some(0));
    let films = "-o t.gif -o t.png -o t.mp4 -o t.webm";
    let ran = workshop.run(&format!("timelapse run {films} --output-size 64 --fps 10 --hold 0.7 --loop 2 --frames 12"));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    for film in ["t.gif", "t.png", "t.mp4", "t.webm"] {
        assert_made_again(&workshop, film, &[]);
    }
    fs::create_dir(workshop.path("frames")).unwrap();
    for (number, height_px) in [30, 30, 31].into_iter().enumerate() {
        let _ = height_px;
        workshop.paint(&format!("frames/{number}.png"), 40, 30);
    }
    let ran =
        workshop.run("video frames -o v.gif -n 40 --evals 900 --noise 3 --scene-cut off --fps 7 --max-tile-move 2.5");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let row = shown(&workshop, "v.gif");
    let command = row["commands"][0].as_str().unwrap();
    let flags = "-n 40 --size 40 --evals 900 --seed 0 --fps 7 --max-tile-move 2.5 --noise 3 --scene-cut off";
    assert_eq!(command, format!("smalti video FRAMES -o v.gif {flags}"));
}

#[test]
fn a_picture_is_told_from_another_and_the_exit_code_says_so() {
    let workshop = furnished();
    assert_eq!(workshop.run("evolve photo.png -o m.png -n 40 --evals 500").code, Some(0));
    let ran = workshop.run("show m.png --input photo.png");
    let text = String::from_utf8(ran.stdout).unwrap();
    assert!(ran.code == Some(0) && text.contains("photo.png is the picture"), "{text}");
    assert!(text.contains("smalti evolve photo.png -o m.png -n 40 --size 40 --evals 500 --seed 0\n"), "{text}");
    let ran = workshop.run("show m.png --input map.png --json");
    assert_eq!((ran.code, &ran.row()["input_matches"]), (Some(0), &true.into()), "the map has the same bytes");
    let ran = workshop.run("show m.png --input cut.png");
    let text = String::from_utf8(ran.stdout).unwrap();
    assert!(ran.code == Some(1) && text.contains("cut.png is not the picture"), "{text}");
    for (line, words) in [
        ("show photo.png", "photo.png: tells nothing of how it was made"),
        ("show own.toml", "own.toml: tells nothing of how it was made"),
        ("show missing.png", "missing.png: there is no such file"),
        ("show m.png --input missing.jpg", "missing.jpg: there is no such file"),
    ] {
        let ran = workshop.run(line);
        assert!(ran.code == Some(2) && ran.stderr.contains(words), "{line}: {:?} {}", ran.code, ran.stderr);
    }
}

#[test]
fn names_of_files_and_ways_to_work_are_in_no_output() {
    let (one, other) = (furnished(), furnished());
    other.paint("elsewhere.png", 40, 30);
    assert_eq!(
        one.run("evolve photo.png -o a.png -o a.svg -n 40 --evals 500 --mask leaf.svg --threads 1").code,
        Some(0)
    );
    fs::rename(other.path("leaf.svg"), other.path("blatt.svg")).unwrap();
    let line = "evolve elsewhere.png -o b.png -o b.svg -n 40 --evals 500 --mask blatt.svg --threads 2 --force";
    assert_eq!(other.run(line).code, Some(0));
    assert!(one.read("a.png") == other.read("b.png") && one.read("a.svg") == other.read("b.svg"));
}
