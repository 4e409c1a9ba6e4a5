//! The `cells` scheme at the command line, which is the default.

use serde_json::{Value, json};
use smalti::archive;
use smalti::evolve::ALGORITHM_VERSION;
use smalti::photo;

use crate::cli_interrupts::interrupted;
use crate::cli_refusals::refused;
use crate::workshop::Workshop;

/// A small search of `photo.png`.
const SMALL: &str = "evolve photo.png -n 60 --evals 3k";

/// Runs a command that must succeed, and returns its row.
fn row(workshop: &Workshop, line: &str) -> Value {
    let ran = workshop.run(&format!("{line} --json"));
    assert_eq!(ran.code, Some(0), "{line}: {}", ran.stderr);
    ran.row()
}

/// The sum of absolute errors of a written picture to the saved target.
fn sae(workshop: &Workshop, picture: &str, target: &str) -> u64 {
    let (picture, target) = (workshop.pixels(picture), workshop.pixels(target));
    picture.iter().zip(target.iter()).map(|(&a, &b)| u64::from(a.abs_diff(b))).sum()
}

#[test]
fn a_photo_becomes_a_mosaic_that_is_exactly_what_was_scored() {
    let workshop = Workshop::new();
    let photo = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/parrots.png");
    workshop.write("parrots.png", &std::fs::read(photo).unwrap());
    let line = "evolve parrots.png --size 96 -n 300 --evals 40k -o out.png -o out.npz --save-target target.png";
    let row = row(&workshop, line);
    assert_eq!([&row["scheme"], &row["stop"], &row["status"]], ["cells", "evals", "complete"]);
    assert_eq!([&row["tiles"], &row["restarts"], &row["fallback_kills"]], [300, 0, 0]);
    assert_eq!(row["sae"], row["objective"]);
    assert_eq!(row["sae"], sae(&workshop, "out.png", "target.png"));
    assert!(row["evals"].as_u64() >= Some(40_000) && row["births"].as_u64() >= Some(300), "{row}");
    assert!(row["psnr"].as_f64() > Some(22.0), "{row}");
    let archive = archive::read(&workshop.path("out.npz")).unwrap();
    assert_eq!([&archive.meta["scheme"], &archive.meta["evals"]], [&json!("cells"), &row["evals"]]);
    // All that a fly helps is told with it, and none harms.
    assert!(archive.fitness.iter().all(|&fitness| fitness >= 0));
}

#[test]
fn threads_change_no_byte_of_any_style_and_styles_and_seeds_change_all() {
    let workshop = Workshop::new();
    let mut seen = Vec::new();
    for rest in [
        "",
        "--seed 1",
        "--style mosaic",
        "--style paint",
        "--candidates 4",
        "--color-mode mean",
        "--mask disc --shader emboss",
        "--grout white --grout-width 0.5",
    ] {
        let [one, two] = [1, 2].map(|threads| {
            row(&workshop, &format!("{SMALL} {rest} -o {threads}.png -o {threads}.npz --threads {threads} --force"))
        });
        assert_eq!([&one["key"], &one["objective"]], [&two["key"], &two["objective"]], "{rest}");
        assert!(workshop.read("1.png") == workshop.read("2.png"), "{rest}");
        assert!(workshop.read("1.npz") == workshop.read("2.npz"), "{rest}");
        let picture = workshop.pixels("1.png");
        assert!(seen.iter().all(|(_, key, other)| *key != one["key"] && *other != picture), "{rest} changes nothing");
        seen.push((rest, one["key"].clone(), picture));
    }
}

#[test]
fn the_objective_of_a_style_with_penalties_is_above_the_sae_of_what_is_drawn() {
    let workshop = Workshop::new();
    let row = row(&workshop, &format!("{SMALL} --style mosaic -o out.png --save-target target.png"));
    assert_eq!(row["sae"], sae(&workshop, "out.png", "target.png"));
    assert!(row["objective"].as_u64() > row["sae"].as_u64(), "{row}");
}

#[test]
fn grout_keeps_the_brightness_of_the_picture_unless_another_colour_is_named() {
    let workshop = Workshop::new();
    let mean = |name: &str| {
        let pixels = workshop.pixels(name);
        pixels.iter().map(|&value| f64::from(value)).sum::<f64>() / pixels.len() as f64
    };
    let line = "evolve photo.png -n 60 --evals 10k --grout-width 1 --save-target target.png";
    for (grout, least, most) in [("auto", 0.9, 1.1), ("black", 0.0, 0.93), ("white", 1.07, 9.0)] {
        row(&workshop, &format!("{line} --grout {grout} -o {grout}.png"));
        let ratio = mean(&format!("{grout}.png")) / mean("target.png");
        assert!((least..most).contains(&ratio), "{grout}: {ratio}");
    }
}

#[test]
fn a_search_ends_for_the_reason_that_it_tells() {
    let workshop = Workshop::new();
    for (rest, stop) in [
        ("--evals 1M --target-sae 200k", "target-sae"),
        ("--evals 10M --patience 3k --target-sae 0", "patience"),
        ("--evals 1000M --time 200ms", "time"),
        ("--evals 0", "evals"),
        ("--style mosaic --evals 1M --target-sae 100k", "target-sae"),
    ] {
        let row = row(&workshop, &format!("evolve photo.png -n 60 -o a.png --force {rest}"));
        assert_eq!([&row["stop"], &row["status"]], [stop, "complete"], "{rest}: {row}");
        if stop == "target-sae" {
            assert!(row["sae"].as_u64() <= Some(200_000) && row["evals"].as_u64() > Some(0), "{rest}: {row}");
        }
    }
}

#[test]
fn a_search_that_the_clock_cut_can_be_repeated_from_its_evals() {
    let workshop = Workshop::new();
    let cut = row(&workshop, "evolve photo.png -n 60 -o a.npz --evals 1000M --time 150ms");
    assert_eq!(cut["stop"], "time");
    let again = row(&workshop, &format!("evolve photo.png -n 60 -o b.npz --evals {}", cut["evals"]));
    assert_eq!([&again["evals"], &again["objective"]], [&cut["evals"], &cut["objective"]]);
    let [a, b] = ["a.npz", "b.npz"].map(|name| archive::read(&workshop.path(name)).unwrap());
    assert!(a.population == b.population && a.fitness == b.fitness);
}

#[test]
fn a_population_is_searched_on_and_never_gets_worse() {
    let workshop = Workshop::new();
    let first = row(&workshop, &format!("{SMALL} -o flies.npz"));
    let kept = row(&workshop, "evolve photo.png --init flies.npz --evals 0 -o a.png");
    assert_eq!([&kept["sae"], &kept["tiles"]], [&first["sae"], &first["tiles"]]);
    let further = row(&workshop, "evolve photo.png --init flies.npz --evals 3k --seed 1 -o b.png");
    assert!(further["sae"].as_u64() < first["sae"].as_u64(), "{further}");
    assert_ne!(further["key"], kept["key"]);
    // From the paper's scheme and into it.
    workshop.evolve("-o paper.npz");
    row(&workshop, "evolve photo.png --init paper.npz --evals 1k -o c.png");
    row(&workshop, "evolve photo.png --scheme paper --init flies.npz --births 10 -o d.png");
}

#[test]
fn an_interrupt_leaves_the_last_whole_epoch_marked_as_partial_with_its_snapshots() {
    let workshop = Workshop::new();
    let line =
        "evolve photo.png -n 60 --evals 1000000M --progress json -o a.npz -o a.png --save-run run --save-every 5k";
    let (status, messages) = interrupted(&workshop, line, &["INT"]);
    assert_eq!(status.code(), Some(75), "{messages}");
    let archive = archive::read(&workshop.path("a.npz")).unwrap();
    assert_eq!([&archive.meta["status"], &archive.meta["stop"]], ["partial", "interrupted"]);
    let evals = archive.meta["evals"].as_u64().unwrap();
    let last = archive::read(&workshop.path(&format!("run/{evals:012}.npz"))).unwrap();
    assert!(last.population == archive.population);
    assert_eq!(last.meta["objective"], archive.meta["objective"]);
}

#[test]
fn curve_snapshots_and_timelapse_tell_the_same_course_on_any_threads() {
    let workshop = Workshop::new();
    let line = "evolve photo.png -n 60 --evals 6k -o a.png --curve a.csv --curve a.svg --save-run run";
    let row = row(&workshop, &format!("{line} --threads 1"));
    let table = String::from_utf8(workshop.read("a.csv")).unwrap();
    let points: Vec<Vec<u64>> = table
        .lines()
        .skip(1)
        .map(|line| line.split(',').take(6).map(|number| number.parse().unwrap()).collect())
        .collect();
    assert!(points.len() > 8, "{table}");
    assert!(points.windows(2).all(|pair| pair[0][1] < pair[1][1] && pair[0][4] >= pair[1][4]), "{table}");
    assert_eq!([points[0][1], points[0][5]], [0, 0], "it begins with nothing");
    let last = points.last().unwrap();
    assert_eq!([json!(last[1]), json!(last[3])], [row["evals"].clone(), row["sae"].clone()]);
    let before = (workshop.read("a.csv"), workshop.read("a.svg"), workshop.read("a.png"));
    assert_eq!(workshop.run(&format!("{line} --threads 2")).code, Some(0));
    assert!(before == (workshop.read("a.csv"), workshop.read("a.svg"), workshop.read("a.png")));
    let made = workshop.run("timelapse run -o film.gif --spacing evals");
    assert_eq!(made.code, Some(0), "{}", made.stderr);
}

#[test]
fn flags_of_the_other_scheme_are_refused_by_name() {
    let workshop = Workshop::new();
    for flag in [
        "--births 9",
        "--batch-births 2",
        "--restarts 1",
        "--restart-mask disc",
        "--cool 0.5",
        "--on-dry stop",
        "--p-mutation 1",
        "--p-crossover 0",
        "--new-blood 0",
        "--mitosis 0",
        "--no-rotation",
        "--tile-scale 1",
        "--preset paper-3 --scheme cells",
    ] {
        let name = flag.split(' ').next().unwrap();
        let words = "only --scheme paper has it, and this is --scheme cells; drop one of them";
        let ran = refused(&workshop, &format!("evolve photo.png -o a.png {flag}"), 2, words);
        assert!(ran.stderr.starts_with(&format!("smalti: {name}")), "{}", ran.stderr);
    }
    for flag in ["--evals 9", "--style mosaic", "--candidates 2", "--grout auto", "--grout-width 1", "--preset mosaic"]
    {
        let name = flag.split(' ').next().unwrap();
        let words = "only --scheme cells has it, and this is --scheme paper; drop one of them";
        let ran = refused(&workshop, &format!("evolve photo.png -o a.png --scheme paper {flag}"), 2, words);
        assert!(ran.stderr.starts_with(&format!("smalti: {name}")), "{}", ran.stderr);
    }
}

#[test]
fn values_of_a_search_out_of_range_are_refused_with_their_flag() {
    let workshop = Workshop::new();
    for (rest, words) in [
        ("--candidates 0", "--candidates 0: must be 1 to 64"),
        ("--candidates 65", "--candidates 65"),
        ("--evals many", "--evals"),
        ("--patience 0", "--patience 0"),
        ("--style cubist", "there are free, mosaic"),
        ("--preset cubist", "there are paper-1 to paper-12, free, mosaic"),
        ("--preset mosaic --style free", "--style"),
        ("--grout reddish", "none, auto"),
        ("--grout-width 0", "--grout-width 0: must be 0.02 to 64 px"),
        ("--grout-width 65", "--grout-width 65"),
        ("--grout-width NaN", "--grout-width NaN"),
        ("--grout none --grout-width 1", "contradict"),
        ("--blend translucent --mask disc --grout black", "--grout: translucent tiles have no rings"),
        ("--style mosaic --shader soft --grout-width 1", "--grout-width: translucent tiles have no rings"),
        ("--palette photo.png --color-mode mean", "--color-mode pick"),
    ] {
        refused(&workshop, &format!("evolve photo.png -o a.png {rest}"), 2, words);
    }
}

#[test]
fn a_palette_holds_all_tiles_to_its_colours() {
    let workshop = Workshop::new();
    workshop.write("three.hex", b"000000\nff8000\n0040c0\n");
    row(&workshop, &format!("{SMALL} --palette three.hex -o a.png"));
    let palette = [[0, 0, 0], [255, 128, 0], [0, 64, 192]];
    assert!(workshop.pixels("a.png").pixels().all(|pixel| palette.contains(&pixel.0)));
}

#[test]
fn palettes_of_one_picture_that_recolour_given_flies_differently_have_different_keys() {
    let workshop = Workshop::new();
    let black: Vec<u8> = (0..40 * 30).flat_map(|_| [0_u8; 3]).collect();
    image::RgbImage::from_raw(40, 30, black).unwrap().save(workshop.path("black.png")).unwrap();
    row(&workshop, &format!("{SMALL} -o flies.npz"));
    let made = ["000000\nff8000\n", "000000\n0040c0\n"].map(|colors| {
        workshop.write("own.hex", colors.as_bytes());
        let line = "evolve black.png --init flies.npz --palette own.hex --evals 0 -o a.npz --save-target t.png --force";
        let key = row(&workshop, line)["key"].clone();
        (key, workshop.read("t.png"), archive::read(&workshop.path("a.npz")).unwrap().population)
    });
    assert!(made[0].2 != made[1].2, "the flies differ");
    assert_ne!(made[0].0, made[1].0);
}

#[test]
fn a_preset_of_ones_own_is_a_style_with_changes_and_flags_go_before_it() {
    let workshop = Workshop::new();
    workshop.write("plain.toml", b"style = \"mosaic\"\n");
    workshop.write(
        "own.toml",
        b"style = \"mosaic\"\ntiles = 60\nevals = 2_000\ngrout = \"#102030\"\nside = [0.5, 2]\nturn = 5\n",
    );
    let key = |rest: &str| row(&workshop, &format!("evolve photo.png -o a.png --dry-run {rest}"))["key"].clone();
    assert_eq!(key("--preset plain.toml"), key("--style mosaic"));
    assert_eq!(key("--preset mosaic"), key("--style mosaic"));
    assert_ne!(key("--style mosaic"), key(""));
    let own = row(&workshop, "evolve photo.png -o own.png -o own.npz --preset own.toml");
    assert_eq!(own["tiles"], 60);
    assert!((2_000..3_500).contains(&own["evals"].as_u64().unwrap()), "{own}");
    let grout = archive::read(&workshop.path("own.npz")).unwrap().population.grout.unwrap();
    assert_eq!(grout.color, [0x10, 0x20, 0x30]);
    assert_eq!(row(&workshop, "evolve photo.png -o b.png --preset own.toml -n 30 --evals 0")["tiles"], 30);
    assert_ne!(key("--preset own.toml"), key("--preset mosaic -n 60 --evals 2k --grout 102030"));
    workshop.write("glaze.toml", b"style = \"spray\"\nopacity = 0.5\n");
    assert_eq!(key("--preset glaze.toml"), key("--style spray --opacity 0.5"));
    assert_eq!(key("--preset glaze.toml --blend opaque"), key("--style spray --blend opaque"));
    assert_ne!(key("--style spray --opacity 0.5"), key("--style spray"));
    workshop.write("cut.toml", b"style = \"spray\"\nblend = \"opaque\"\n");
    assert_eq!(key("--preset cut.toml"), key("--style spray --blend opaque"));
    assert_eq!(key("--preset cut.toml --opacity 0.5"), key("--style spray --opacity 0.5"));
}

#[test]
fn what_is_wrong_in_a_preset_is_told_with_its_file_its_line_and_what_is_allowed() {
    let workshop = Workshop::new();
    for (text, words) in [
        ("style = \"cubist\"", "line 1: there is no such style; there are free"),
        ("evals = 9\nsize = 64\ntilez = 3", "line 3: unknown field `tilez`, expected one of `style`, `tiles`"),
        ("evals = \"many\"", "line 1: invalid type: string"),
        ("overlap = -1", "line 1: -1 is out of range, must be 0 to 1000"),
        ("side = [0.5, 99]", "line 1: 99 is out of range, must be 0 to 16"),
        ("side = [2, 1]", "side: the smallest must not be larger"),
        ("guide = \"north\"", "line 1: unknown variant `north`, expected `edges` or `flow`"),
        ("grout = \"reddish\"", "line 1: expected none, auto"),
        ("style = mosaic", "line 1: "),
        ("[[classes]]\nshare = 0.5\n", "line 1: missing field `scale`"),
        ("[[classes]]\nshare = 0.5\nscale = 9\n", "9 is out of range, must be 0 to 8"),
        ("hole = 1001", "line 1: 1001 is out of range, must be 0 to 1000"),
        ("tiles = 0", "own.toml: tiles = 0: must be 1 to "),
        ("candidates = 99", "own.toml: candidates = 99: must be 1 to 64"),
        ("opacity = 0", "line 1: 0 is out of range, must be 0.01 to 1"),
        ("blend = \"opaque\"\nopacity = 0.5", "an opacity below 1 needs blend = \"translucent\""),
        ("grout = \"none\"\ngrout-width = 0.1", "grout = \"none\" and grout-width contradict"),
    ] {
        workshop.write("own.toml", text.as_bytes());
        let ran = refused(&workshop, "evolve photo.png -o a.png --preset own.toml", 2, words);
        assert!(ran.stderr.contains("own.toml: "), "{}", ran.stderr);
    }
    refused(&workshop, "evolve photo.png -o a.png --preset none.toml", 2, "none.toml: there is no such file");
}

#[test]
fn keys_change_only_with_the_version_of_the_algorithm() {
    let photo = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/rgb.png");
    let line = format!("evolve {} --scheme paper -n 60 -o a.png --dry-run", photo.display());
    let key = row(&Workshop::new(), &line)["key"].clone();
    assert_eq!(ALGORITHM_VERSION, 2, "with another version comes another key; write it down here");
    assert_eq!(key, "6886ef3e94f770dfd079666bc198d345768104fe722e6db4dce41f3ffba5362a");
}

#[test]
fn what_is_transparent_stays_so_and_a_background_fills_it() {
    let workshop = Workshop::new();
    let pixels: Vec<[u8; 4]> =
        (0..40 * 30).map(|place| if place % 40 < 20 { [200, 90, (place % 251) as u8, 255] } else { [0; 4] }).collect();
    workshop.write("cut.png", &photo::encode_png_with_alpha(40, 30, &pixels, &vec![]).unwrap());
    row(&workshop, "evolve cut.png -n 60 --evals 6k -o a.png");
    let written = image::open(workshop.path("a.png")).unwrap().to_rgba8();
    let clear =
        |left: u32| written.enumerate_pixels().filter(|(x, _, pixel)| *x / 20 == left && pixel.0[3] == 0).count();
    assert_eq!(clear(1), 600, "no tile lies where none is wanted");
    assert!(clear(0) < 60, "{} pixels are bare", clear(0));
    row(&workshop, "evolve cut.png -n 60 --evals 6k -o b.png --background white");
    assert!(!image::open(workshop.path("b.png")).unwrap().color().has_alpha());
}

#[test]
fn a_map_of_weights_moves_the_likeness_to_where_it_is_white() {
    let workshop = Workshop::new();
    let map = image::GrayImage::from_fn(40, 30, |x, _| image::Luma([if x < 20 { 255 } else { 0 }]));
    map.save(workshop.path("map.png")).unwrap();
    let error = |name: &str| -> u64 {
        let (made, target) = (workshop.pixels(name), workshop.pixels("photo.png"));
        let left = made.enumerate_pixels().filter(|(x, ..)| *x < 20);
        left.flat_map(|(x, y, pixel)| {
            let wanted = *target.get_pixel(x, y);
            (0..3).map(move |channel| u64::from(pixel.0[channel].abs_diff(wanted.0[channel])))
        })
        .sum()
    };
    let plain = row(&workshop, "evolve photo.png -n 60 --evals 10k -o plain.png");
    let weighed = row(&workshop, "evolve photo.png -n 60 --evals 10k -o weighed.png --weight map.png");
    assert!(error("weighed.png") < error("plain.png"));
    assert!(weighed["objective"].as_u64() > weighed["sae"].as_u64() && plain["objective"] == plain["sae"]);
}
