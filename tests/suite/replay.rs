//! Scripts: what a session was asked for on its way, kept in a file, makes the same bytes again.

use std::fs;

use smalti::{
    CarriedMask, Device, MaskKind, Mosaic, Picture, Script, Session, Step, StopReason, WrittenBounds, WrittenClass,
    WrittenMask, WrittenRecipe,
};

use crate::cli_interrupts::interrupted;
use crate::cli_refusals::refused;
use crate::workshop::Workshop;

const LEAF: &[u8] = br#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M1 1L8 3L5 8z"/></svg>"#;

/// A workshop with a photo in it.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/photos/parrots.png"), workshop.path("parrots.png")).unwrap();
    workshop
}

fn text(word: &str) -> Option<String> {
    Some(word.to_owned())
}

/// A quick recipe for the photo.
fn quick() -> WrittenRecipe {
    let (tiles, size, evals, seed) = (Some(200), Some(80), Some(12_000), Some(3));
    WrittenRecipe { style: text("mosaic"), tiles, size, evals, seed, ..WrittenRecipe::default() }
}

fn leaf() -> WrittenMask {
    WrittenMask::Carried(CarriedMask { name: "leaf.svg".to_owned(), kind: MaskKind::Svg, bytes: LEAF.to_vec() })
}

/// What is asked for first, and after some rounds each.
fn recipes() -> [WrittenRecipe; 3] {
    let bounds = WrittenBounds { side: Some([0.5, 2.0]), turn: Some(9.0), ..WrittenBounds::default() };
    let second = WrittenRecipe { bounds, grout: text("203040"), grout_width: Some(0.8), ..quick() };
    let third = WrittenRecipe { masks: vec![leaf()], seed: Some(8), evals: Some(20_000), ..second.clone() };
    [quick(), second, third]
}

/// A session with two changes and the script of it so far.
fn changed<'d>(picture: &Picture, device: &'d Device) -> (Session<'d>, Script) {
    let mut script = Script { input_sha256: picture.sha256().to_owned(), ..Script::default() };
    let [first, others @ ..] = recipes();
    let mut session = Session::begin(&first.recipe().unwrap(), picture, device).unwrap();
    script.steps.push(Step { evals: 0, recipe: first });
    for recipe in others {
        for _ in 0..3 {
            assert_eq!(session.step().unwrap(), None);
        }
        script.steps.push(Step { evals: session.evals(), recipe: recipe.clone() });
        session.change(&recipe.recipe().unwrap()).unwrap();
    }
    for _ in 0..3 {
        assert_eq!(session.step().unwrap(), None);
    }
    (session, script)
}

fn to_end(mut session: Session<'_>) -> Mosaic {
    while session.step().unwrap().is_none() {}
    session.finish().unwrap()
}

/// Runs a script over the photo, and compares what it writes with a mosaic.
fn assert_replayed(workshop: &Workshop, script: &Script, mosaic: &Mosaic, device: &str) {
    workshop.write("script.json", &script.write().unwrap());
    let outputs = "-o a.png -o a.npz -o a.svg";
    let ran = workshop.run(&format!("evolve parrots.png --replay script.json {outputs} --device {device} --force"));
    assert_eq!(ran.code, Some(0), "{device}: {}", ran.stderr);
    for (name, bytes) in [("a.png", mosaic.png()), ("a.npz", mosaic.npz()), ("a.svg", mosaic.svg())] {
        assert!(bytes.unwrap() == workshop.read(name), "{device}: {name}");
    }
}

#[test]
fn a_session_that_changed_twice_is_made_again_half_way_and_to_its_end_on_both_devices() {
    let workshop = workshop();
    let picture = Picture::open(workshop.path("parrots.png")).unwrap();
    for name in ["cpu", "vulkan"] {
        let device = if name == "cpu" { Device::cpu() } else { Device::named(name).unwrap() };
        let (mut session, mut script) = changed(&picture, &device);
        let half_way = session.mosaic().unwrap();
        script.until = session.until();
        assert_eq!((half_way.stop_reason(), Some(half_way.evals())), (StopReason::Evals, script.until));
        assert_replayed(&workshop, &script, &half_way, name);
        let marginal = session.marginal().unwrap();
        assert_eq!(marginal.len(), half_way.population().flies.len());

        let mosaic = to_end(session);
        script.until = None;
        assert_replayed(&workshop, &script, &mosaic, name);
        let undisturbed = to_end(changed(&picture, &device).0);
        assert!(undisturbed.npz().unwrap() == mosaic.npz().unwrap(), "{name}: a look at a session changes it");
        let replayed = script.replay(&picture, &device, &mut |share| (0.0..=1.0).contains(&share)).unwrap().unwrap();
        assert!(replayed.png().unwrap() == mosaic.png().unwrap(), "{name}");
        assert!(script.replay(&picture, &device, &mut |share| share < 0.3).unwrap().is_none());
    }
}

#[test]
fn a_mosaic_on_the_way_is_what_finish_makes_in_both_schemes_and_at_every_step() {
    let workshop = workshop();
    let (picture, device) = (Picture::open(workshop.path("parrots.png")).unwrap(), Device::cpu());
    let paper = WrittenRecipe {
        scheme: text("paper"),
        tiles: Some(50),
        size: Some(40),
        births: Some(900),
        ..WrittenRecipe::default()
    };
    for recipe in [paper, WrittenRecipe { evals: Some(2_000), size: Some(40), ..quick() }] {
        let recipe = recipe.recipe().unwrap();
        let make = recipe.make_quietly(&picture, &device).unwrap();
        for steps in 0.. {
            let begin = || Session::begin(&recipe, &picture, &device).unwrap();
            let (mut looked_at, mut alone) = (begin(), begin());
            for _ in 0..steps {
                looked_at.step().unwrap();
                looked_at.mosaic().unwrap();
                alone.step().unwrap();
            }
            let (stop, one) = (looked_at.stop_reason(), looked_at.mosaic().unwrap());
            let (two, three) = (looked_at.finish().unwrap(), alone.finish().unwrap());
            assert!(one.npz().unwrap() == two.npz().unwrap() && one.png().unwrap() == two.png().unwrap(), "{steps}");
            assert!(one.npz().unwrap() == three.npz().unwrap(), "{steps}");
            if stop.is_some() {
                assert!(make.npz().unwrap() == one.npz().unwrap());
                break;
            }
            assert_ne!(make.key(), one.key(), "{steps}");
        }
    }
}

#[test]
fn a_script_is_read_as_it_was_written() {
    let classes = vec![
        WrittenClass { share: 0.25, scale: 2.0, first_round: 0 },
        WrittenClass { share: 0.75, scale: 0.8, first_round: 2 },
    ];
    let full = WrittenRecipe {
        bounds: WrittenBounds { classes, guide: text("flow"), coherence: Some(7), ..WrittenBounds::default() },
        palette: vec!["102030".to_owned(), "f0e0d0".to_owned()],
        color_mode: text("pick"),
        background: text("none"),
        masks: vec![WrittenMask::Named("disc".to_owned()), leaf()],
        shader: text("flat"),
        seed: Some(u64::MAX),
        weight: Some((0..=255).collect()),
        ..quick()
    };
    let [first, second, _] = recipes();
    let steps = [(0, first), (96, second), (96, full.clone())].map(|(evals, recipe)| Step { evals, recipe }).to_vec();
    let script = Script { input_sha256: "ab".repeat(32), steps, until: Some(1_000) };
    let bytes = script.write().unwrap();
    assert_eq!(Script::read(&bytes).unwrap(), script);
    assert_eq!(Script::read(&bytes).unwrap().write().unwrap(), bytes);
    let text = String::from_utf8(bytes).unwrap();
    assert!(text.contains("\"smalti\": \"script\"") && !text.contains("null") && !text.contains("opacity"), "{text}");
    assert_eq!(full.flags(), None, "flags cannot carry a mask");
}

#[test]
fn a_script_of_one_step_is_what_its_flags_make() {
    let workshop = workshop();
    let small = WrittenRecipe { tiles: Some(60), size: Some(40), evals: Some(1_500), ..WrittenRecipe::default() };
    let picture = Picture::open(workshop.path("parrots.png")).unwrap();
    for recipe in [
        small.clone(),
        WrittenRecipe {
            style: text("mosaic"),
            grout: text("auto"),
            grout_width: Some(0.35),
            seed: Some(9),
            ..small.clone()
        },
        WrittenRecipe {
            style: text("spray"),
            masks: vec![WrittenMask::Named("disc".to_owned()), WrittenMask::Named("flower".to_owned())],
            opacity: Some(0.4),
            shader: text("fade"),
            color_mode: text("mean"),
            colors: Some(9),
            background: text("teal"),
            candidates: Some(3),
            patience: Some(900),
            target_sae: Some(5),
            ..small.clone()
        },
        WrittenRecipe { scheme: text("paper"), evals: None, births: Some(300), restarts: Some(1), ..small.clone() },
    ] {
        let script = Script {
            input_sha256: picture.sha256().to_owned(),
            steps: vec![Step { evals: 0, recipe: recipe.clone() }],
            until: None,
        };
        workshop.write("one.json", &script.write().unwrap());
        let flags = recipe.flags().expect("flags can say it").join(" ");
        let made = workshop.run(&format!("evolve parrots.png -o a.png -o a.npz --force {flags}"));
        assert_eq!(made.code, Some(0), "{flags}: {}", made.stderr);
        let (png, npz) = (workshop.read("a.png"), workshop.read("a.npz"));
        // It has the same key, so it may replace them.
        let ran = workshop.run("evolve parrots.png --replay one.json -o a.png -o a.npz --json");
        assert_eq!(ran.code, Some(0), "{flags}: {}", ran.stderr);
        assert!(workshop.read("a.png") == png && workshop.read("a.npz") == npz, "{flags}");
        assert_eq!(ran.row()["seed"], recipe.seed.unwrap_or(0));
    }
}

#[test]
fn what_a_script_made_tells_the_command_that_makes_it_again() {
    let workshop = workshop();
    let picture = Picture::open(workshop.path("parrots.png")).unwrap();
    let device = Device::cpu();
    let (mut session, mut script) = changed(&picture, &device);
    script.until = session.until();
    workshop.write("SCRIPT", &script.write().unwrap());
    let line = "evolve parrots.png --replay SCRIPT -o a.png --output-size 120";
    assert_eq!(workshop.run(line).code, Some(0));
    let bytes = workshop.read("a.png");
    let larger = session.mosaic().unwrap().resized(120, &device).unwrap();
    assert!(larger.png().unwrap() == bytes);
    let row = workshop.run("show a.png --input parrots.png --json").row();
    assert_eq!(row["commands"][0], "smalti evolve parrots.png --replay SCRIPT -o a.png --output-size 120");
    assert!(row["needs"]["SCRIPT"].as_str().unwrap().contains("2 changes"), "{row}");
    assert!(row["differs"].is_null(), "{row}");
    let again = workshop.run(line);
    assert_eq!(again.code, Some(0), "the same command may replace it: {}", again.stderr);
    assert!(workshop.read("a.png") == bytes);
    script.until = None;
    workshop.write("other.json", &script.write().unwrap());
    refused(&workshop, "evolve parrots.png --replay other.json -o a.png", 2, "made with other options");
    let other = workshop.run("evolve photo.png --replay other.json -o b.png");
    assert!(
        other.stderr.contains("photo.png is not the picture that other.json was recorded with"),
        "{}",
        other.stderr
    );
}

#[test]
fn a_signal_ends_a_script_and_leaves_nothing() {
    let workshop = workshop();
    let recipe = WrittenRecipe { evals: Some(u64::MAX), ..quick() };
    let script = Script { steps: vec![Step { evals: 0, recipe }], ..Script::default() };
    workshop.write("long.json", &script.write().unwrap());
    let files = workshop.files();
    let line = "evolve parrots.png --replay long.json -o a.png -o a.npz --progress json";
    let (status, messages) = interrupted(&workshop, line, &["INT"]);
    assert_eq!(status.code(), Some(75), "{messages}");
    assert_eq!(workshop.files(), files);
}

#[test]
fn a_script_that_cannot_be_followed_is_refused_by_its_name() {
    let workshop = Workshop::new();
    let step = |evals: &str, recipe: &str| format!(r#"{{"evals": {evals}, "recipe": {{{recipe}}}}}"#);
    let hash = Picture::open(workshop.path("photo.png")).unwrap().sha256().to_owned();
    let script = |version: &str, steps: &[String], rest: &str| {
        let steps = steps.join(", ");
        format!(r#"{{"smalti": "script", "version": {version}, "input-sha256": "{hash}", "steps": [{steps}]{rest}}}"#)
    };
    let first = || step("0", r#""tiles": 60, "evals": 900"#);
    for (content, words) in [
        ("", "is no script"),
        ("[1, 2]", "is no script of smalti"),
        (r#"{"smalti": "recipe"}"#, "is no script of smalti"),
        (&script("2", &[first()], ""), "has the version 2, and this smalti reads version 1"),
        (&script("1", &[], ""), "has no step"),
        (&script("1", &[step("5", "")], ""), "step 1 is at 5 evals, and the first one is at 0"),
        (&script("1", &[first(), step("9", ""), step("8", "")], ""), "step 3 is at 8 evals, before step 2, at 9"),
        (&script("1", &[first(), step("9", "")], r#", "until": 8"#), "until 8 is before the last step"),
        (&script("1", &[step("-1", "")], ""), "is no script (invalid value"),
        (&script("1", &[first()], r#", "then": 1"#), "unknown field `then`"),
        (&script("1", &[step("0", r#""tile": 5"#)], ""), "unknown field `tile`"),
        (&script("1", &[step("0", r#""tiles": 0"#)], ""), "step 1: tiles 0: must be 1 to 1000000"),
        (&script("1", &[step("0", r#""style": "glass""#)], ""), "step 1: recipe: there is no such style"),
        (&script("1", &[step("0", r#""masks": ["photo.png"]"#)], ""), "step 1: mask photo.png: there is no such mask"),
        (
            &script("1", &[step("0", r#""masks": [{"name": "a", "kind": "png", "bytes": "%"}]"#)], ""),
            "a mask is the name of a shape that comes with smalti",
        ),
        (
            &script("1", &[step("0", r#""masks": [{"name": "a", "kind": "png", "bytes": "AAAA"}]"#)], ""),
            "step 1: mask a: not a mask that can be read",
        ),
        (&script("1", &[step("0", r#""bounds": {"side": [2, 1]}"#)], ""), "step 1: recipe: side: the smallest"),
        (&script("1", &[step("0", r#""bounds": {"aspect": 900}"#)], ""), "900 is out of range, must be 1 to 64"),
        (&script("1", &[step("0", r#""weight": "AA==", "tiles": 60"#)], ""), "step 1: weight: "),
        (&script("1", &[step("0", r#""scheme": "best""#)], ""), "step 1: scheme best: there is no such scheme"),
        (&script("1", &[first(), step("60", r#""tiles": 61"#)], ""), "step 2: tiles: cannot change"),
        (&script("1", &[first(), step("1", r#""tiles": 60"#)], ""), "step 2 at 1: no round ends there"),
        (&script("1", &[first(), step("9000", r#""tiles": 60"#)], ""), "step 2 at 9000: the work comes to its end"),
        (&script("1", &[first()], r#", "until": 1"#), "until 1: no round ends there"),
    ] {
        workshop.write("bad.json", content.as_bytes());
        let ran = refused(&workshop, "evolve photo.png --replay bad.json -o o.png", 2, words);
        assert!(ran.stderr.contains("bad.json: "), "{}", ran.stderr);
    }
    workshop.write("large.json", &vec![b' '; (64 << 20) + 1]);
    refused(&workshop, "evolve photo.png --replay large.json -o o.png", 2, "more than 64 MiB, the limit for a script");
    refused(&workshop, "evolve photo.png --replay none.json -o o.png", 2, "none.json: there is no such file");
    workshop.write("good.json", script("1", &[first()], "").as_bytes());
    for rest in ["--seed 0", "--style mosaic", "-n 5", "--births 5", "--time 9s", "--curve c.csv", "--save-run r"] {
        refused(&workshop, &format!("evolve photo.png --replay good.json -o o.png {rest}"), 2, "cannot be used with");
    }
    refused(&workshop, "evolve photo.png --replay good.json -o good.json --force", 2, "good.json is an input");
}
