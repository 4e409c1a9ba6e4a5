//! What people type who have not read the help: it is taken where it can mean one thing only, and otherwise the answer
//! is what to type instead. And the help itself: short enough to be read.

use std::process::{Output, Stdio};

use crate::cli_refusals::refused;
use crate::workshop::Workshop;

/// Most lines of a `-h`.
const LINES_MAX: usize = 40;

/// Runs the program with arguments that may contain blanks.
fn run(workshop: &Workshop, arguments: &[&str]) -> Output {
    workshop.command("").args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn succeeds(workshop: &Workshop, arguments: &[&str]) {
    let output = run(workshop, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn what_can_mean_one_thing_only_is_taken() {
    let workshop = Workshop::new();
    let picture = ["photo.png", "-o", "a.png", "-n", "60", "--evals", "200", "--size", "20", "--force", "-q"];
    succeeds(&workshop, &picture);
    assert!(workshop.path("a.png").is_file());
    for rest in [
        ["--style", "Mosaic"],
        ["--style", " SPRAY"],
        ["--preset", "Paint"],
        ["--mask", "disc, hexagon"],
        ["--mask", "Disc,TRIANGLE"],
        ["--grout", "Teal"],
        ["--grout", "#f80"],
        ["--grout", "Auto"],
        ["--background", "rebeccapurple"],
        ["--background", "transparent"],
        ["--colors", "Full"],
        ["--color-mode", "Mean"],
        ["--scheme", "Cells"],
        ["--time", "1min"],
        ["--time", "1.5 hours"],
        ["--target-sae", "2.5k"],
        ["--target-sae", "2,500"],
        ["--patience", "10_000"],
        ["--progress", "None"],
    ] {
        succeeds(&workshop, &[["evolve", "--dry-run"].as_slice(), &picture, &rest].concat());
    }
    succeeds(&workshop, &[["evolve"].as_slice(), &picture, &["--mask", "disc, Hexagon"]].concat());
    succeeds(&workshop, &["evolve", "photo.png", "-o", "b.npz", "-n", "0.05k", "--evals", "200", "-q"]);
    succeeds(&workshop, &["render", "b.npz", "-o", "b.png", "--mask", "Flower", "--shader", "Emboss", "-q"]);
    succeeds(
        &workshop,
        &["batch", "photo.png", "-o", "out", "--format", "png, .NPZ", "-n", "60", "--evals", "200", "-q"],
    );
    assert!(workshop.path("out/photo.png").is_file() && workshop.path("out/photo.npz").is_file());
}

#[test]
fn a_word_for_a_device_is_a_part_of_its_name() {
    let workshop = Workshop::new();
    let line = ["evolve", "photo.png", "-o", "a.png", "-n", "60", "--evals", "200", "--dry-run", "--device"];
    succeeds(&workshop, &[line.as_slice(), &["llvmpipe"]].concat());
    refused(&workshop, "evolve photo.png -o a.png --device gpu", 2, "write --device auto");
    refused(&workshop, "evolve photo.png -o a.png --device banana", 4, "--device name:banana fits no device");
}

#[test]
fn names_of_colours_are_taken_in_presets_and_palettes() {
    let workshop = Workshop::new();
    workshop.write(
        "mine.toml",
        b"style = 'Mosaic'\ngrout = 'Navy'\nbackground = '#fff'\nmasks = ['Disc']\nshader = 'Flat'\n",
    );
    workshop.write("mine.hex", b"black\nWhite\ntomato\n#0f0\n336699\n");
    let line = "evolve photo.png -n 60 --evals 200 -q -o";
    assert_eq!(workshop.run(&format!("{line} a.png --preset mine.toml")).code, Some(0));
    assert_eq!(workshop.run(&format!("{line} b.png --palette mine.hex --color-mode pick")).code, Some(0));
    workshop.write("mine.hex", b"black\nreddish\n");
    refused(&workshop, &format!("{line} c.png --palette mine.hex"), 2, "line 2 is not a colour");
}

#[test]
fn what_makes_no_sense_is_answered_with_what_to_type() {
    let workshop = Workshop::new();
    workshop.paint("other.png", 20, 20);
    std::fs::create_dir(workshop.path("photos")).unwrap();
    workshop.write("clip.mp4", b"whatever");
    workshop.write("tiles.npz", b"whatever");
    workshop.evolve("-o close.png");
    for (line, words) in [
        ("photos -o out", "smalti batch photos -o mosaics"),
        ("tiles.npz -o a.png", "smalti render tiles.npz -o mosaic.png"),
        ("clip.mp4 -o b.mp4", "smalti video clip.mp4 -o mosaic.mp4"),
        ("-o a.png photo.png", "-o needs a command before it, as in smalti evolve photo.jpg -o mosaic.png"),
        ("evlove photo.png -o a.png", "a similar subcommand exists: 'evolve'"),
        (
            "evolve photo.png a.png",
            "say smalti evolve photo.png -o a.png; for several pictures, say smalti batch photo.png a.png -o mosaics",
        ),
        ("evolve photo.png other.png -o a.png", "smalti batch photo.png other.png -o mosaics"),
        ("photo.png other.png -o a.png", "smalti evolve takes one picture, and other.png is a second one"),
        ("evolve photo.png", "--output is missing; say where to write, as in smalti evolve photo.png -o mosaic.png"),
        ("render tiles.npz a.png", "say smalti render tiles.npz -o a.png"),
        ("evolve photo.png -o a.png --width 1024", "has no --width; write --output-size PX"),
        ("evolve photo.png -o a.png --height=1024", "has no --height; write --output-size PX"),
        ("render tiles.npz -o a.png --width 1024", "smalti render has no --width; write --output-size PX"),
        ("evolve photo.png -o a.png --count 9", "write -n N"),
        ("evolve photo.png -o a.png --iterations 9", "write --evals E"),
        ("evolve photo.png -o a.png --colours 9", "write --colors K"),
        ("evolve photo.png -o a.png --color red", "write --grout COLOR, --background COLOR"),
        ("evolve photo.png -o a.png --shape disc", "write --mask NAME"),
        ("evolve photo.png --out a.png", "write -o FILE"),
        ("evolve --input photo.png -o a.png", "name the input without a flag"),
        ("evolve photo.png -o a.png --gpu", "write --device auto"),
        ("evolve photo.png -o a.png -j 4", "write --threads T"),
        ("evolve photo.png -o a.png --format gif", "smalti timelapse run -o mosaic.gif"),
        ("render tiles.npz -o a.png --format jpg", "the ending of -o decides the format"),
        ("evolve photo.png -o a.gif", "smalti timelapse run -o a.gif"),
        ("batch photos -o out --overwrite", "write --on-exists overwrite"),
        ("batch photos -o out --resume", "run the same command again"),
        ("video photos -o out --format gif", "for an animation write -o mosaic.gif"),
        ("evolve photo.png -o a.png --fps 9", "which is a flag of smalti video and timelapse"),
        ("evolve photo.png -o a.jpg --quality 80", "a .jpg is written at quality 92"),
        ("evolve photo.png -o a.png --frame 2", "the first frame or page of a picture is read"),
        ("evolve photo.png -o a.png --crop 3:4", "crop the picture first"),
        ("evolve photo.png -o a.png -s mosaic", "write --style NAME for the look"),
        ("evolve photo.png -o a.png --colors red,green", "that file as --palette FILE"),
        ("evolve photo.png -o a.png --palette red,white", "names a file of colours"),
        ("evolve photo.png -o a.png --time 0", "expected a time longer than 0"),
        ("evolve photos -o a.png", "is a folder; for all pictures in it write smalti batch photos -o mosaics"),
        ("evolve https://there.example/a.jpg -o a.png", "is an address, and smalti reads no network"),
        ("mosaic photo.png -o a.png", "write smalti evolve photo.jpg -o mosaic.png --style mosaic"),
        ("-o a.png evolve photo.png", "-o stands before the command; write smalti evolve first"),
        ("show close.png photo.png", "smalti show close.png --input photo.png"),
        ("score photo.png", "as in smalti score photo.png mosaic.png --fit"),
        ("evolve photo.png -o a.png -vf scale=64:-1", "-vf has one minus, so each of its letters is a flag"),
        ("evolve photo.png -o a.png -quality 90", "long flags have two, as in --colors 8"),
        ("evolve photo.png -o a.jpg -q 90", "-q is --quiet and takes no 90"),
        ("evolve photo.png -o a.png,b.svg", "repeat it, as in -o a.png -o b.svg"),
        ("evolve photo.png -o a.png --mosaic", "write --style mosaic"),
        ("evolve photo.png -o a.png --tile-size 8", "the more there are, the smaller they are"),
        ("evolve photo.png -o a.png --grout", "--grout '#f80'"),
        ("compare photo.png other.png", "write smalti score photo.jpg mosaic.png --fit"),
        ("info photo.png", "write smalti show mosaic.png"),
        ("styles", "the styles are free, mosaic, paint and spray"),
        ("score photo.png other.png --flicker", "is a file; name a folder of frames"),
        ("evolve photo.png -o a.png --sed 9", "a similar argument exists: '--seed'"),
        ("evolve photo.png -o a.png --style mosiac", "there are free, mosaic, paint, spray"),
        ("evolve photo.png -o a.png --tiles 2m", "for millions write 2M"),
        ("evolve photo.png -o a.png --grout reddish", "expected none, auto, or a colour such as red, #f00 or ff0000"),
        ("render close.png -o a.png", "is a picture, which holds no population"),
        ("render close.png -o a.png", "which smalti evolve writes with -o tiles.npz"),
        ("evolve photo.png -o a.png --init close.png", "is a picture, which holds no population"),
        (
            "timelapse close.png -o a.gif",
            "a timelapse needs a folder of snapshots; smalti evolve --save-run DIR keeps them",
        ),
        ("render tiles.npz -o a.png", "it is no .npz file, or is cut short"),
        ("plan photos -o out --shards 2 --shard 1/2", "each shard has its own"),
    ] {
        refused(&workshop, line, 2, words);
    }
}

#[test]
fn nobody_reads_the_words_of_a_library_or_the_number_of_an_error() {
    let workshop = Workshop::new();
    workshop.write("tiles.npz", b"whatever");
    let long = "x".repeat(300);
    for line in [
        "render tiles.npz -o a.png",
        "render photo.png/x -o a.png",
        "timelapse photo.png -o a.gif",
        "timelapse photo.png/x -o a.gif",
        "evolve photo.png -o photo.png/a.png",
        "evolve photo.png/x -o a.png",
        "evolve photo.png -o a.png --palette photo.png/x",
        "evolve photo.png -o a.png --preset photo.png/x.toml",
        "evolve photo.png -o a.png --mask photo.png/x",
        "evolve photo.png -o a.png --save-run photo.png/x",
        "batch photo.png -o photo.png/x",
        "batch --manifest photo.png/x -o out",
        "merge photo.png/x -o all.csv",
        "plan photo.png -o out --shards 1 --into photo.png/x",
        "gallery photo.png -o photo.png/x",
        "paper table1 -o photo.png/x",
        "video photo.png/x -o out",
        "video photo.png -o photo.png/x",
        "score photo.png photo.png/x",
        "man -o photo.png/x",
        &format!("evolve {long} -o a.png"),
        &format!("evolve photo.png -o {long}.png"),
        &format!("evolve photo.png -o a.png --save-run {long}"),
        &format!("batch photo.png -o {long}"),
    ] {
        let ran = workshop.run(line);
        assert_ne!(ran.code, Some(0), "{line}");
        for word in ["os error", "EOCD", "InvalidArchive", "Custom {"] {
            assert!(!ran.stderr.contains(word), "{line}: {}", ran.stderr);
        }
    }
}

fn commands(workshop: &Workshop) -> Vec<String> {
    let help = String::from_utf8(workshop.run("-h").stdout).unwrap();
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = listed.filter(|line| !line.starts_with("    ")).filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

fn help(workshop: &Workshop, line: &str) -> String {
    let output = workshop.command(line).env("COLUMNS", "80").output().unwrap();
    assert!(output.status.success(), "{line}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn each_short_help_fits_a_page_of_80_columns_and_names_the_long_one() {
    let workshop = Workshop::new();
    let commands = commands(&workshop);
    assert!(commands.len() >= 14, "{commands:?}");
    for line in commands.iter().map(|command| format!("{command} -h")).chain(["-h".to_owned()]) {
        let help = help(&workshop, &line);
        assert!(help.lines().count() <= LINES_MAX, "{line} has {} lines:\n{help}", help.lines().count());
        assert!(help.lines().all(|line| line.chars().count() <= 80), "{help}");
    }
    let evolve = help(&workshop, "evolve -h");
    let flags = ["-o, ", "--style", "-n, ", "--output-size", "--size", "--grout <", "--seed", "--time"];
    let places: Vec<_> = flags.iter().map(|flag| evolve.find(*flag)).collect();
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{places:?}\n{evolve}");
    assert!(evolve.contains("smalti evolve --help explains all flags"), "{evolve}");
}

#[test]
fn long_help_lists_every_flag_in_groups_with_those_of_the_paper_last() {
    let workshop = Workshop::new();
    for command in commands(&workshop) {
        let help = help(&workshop, &format!("{command} --help"));
        assert!(help.lines().filter(|line| *line == "Options:").count() <= 1, "{help}");
    }
    for command in ["evolve", "batch", "video"] {
        let help = help(&workshop, &format!("{command} --help"));
        let is_group = |line: &&str| line.ends_with(':') && !line.starts_with(' ') && !line.starts_with("Examples");
        let last = help.lines().rfind(is_group);
        assert_eq!(last, Some("Only with --scheme paper:"), "{help}");
        assert!(help.contains("--threads") && help.contains("--mitosis"), "{help}");
    }
    let plan = help(&workshop, "plan --help");
    assert!(!plan.contains("--shard <") && !plan.contains("--results") && plan.contains("--shards"), "{plan}");
    for line in ["completions bash", "completions zsh", "completions fish", "man", "man evolve", "man plan"] {
        assert!(!help(&workshop, line).is_empty());
    }
}
