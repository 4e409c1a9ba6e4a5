//! `smalti render`: populations drawn again and written in other formats.

use serde_json::{Value, json};
use smalti::archive::{self, Archive};
use smalti::cpu::CpuPainter;
use smalti::model::{Canvas, Grout, Painter, Population};
use smalti::photo;

use crate::cli_refusals::refused;
use crate::files::archives::{Members, npy};
use crate::workshop::{Ran, Workshop};

/// A folder with `flies.npz`, and what else `evolve` wrote of it.
fn workshop(outputs: &str) -> Workshop {
    let workshop = Workshop::new();
    workshop.evolve(&format!("-o flies.npz --background 336699 {outputs}"));
    workshop
}

fn render(workshop: &Workshop, rest: &str) -> Ran {
    let ran = workshop.run(&format!("render flies.npz {rest}"));
    assert_eq!(ran.code, Some(0), "{rest}: {}", ran.stderr);
    ran
}

/// The metadata in a picture.
fn told(workshop: &Workshop, name: &str) -> Value {
    let entries = photo::read_metadata(&workshop.path(name)).unwrap();
    let (_, text) = entries.iter().find(|(keyword, _)| keyword == "smalti").expect("the picture tells how it was made");
    serde_json::from_str(text).unwrap()
}

#[test]
fn at_the_evolved_size_the_picture_is_the_one_that_was_scored() {
    let workshop = workshop("-o evolved.png -o evolved.csv");
    let ran = render(&workshop, "-o a.png -o b.webp -o c.csv -o d.npz");
    assert!(ran.stdout.is_empty() && ran.stderr.contains("wrote a.png, b.webp, c.csv, d.npz"), "{}", ran.stderr);
    let scored = workshop.pixels("evolved.png");
    assert_eq!(workshop.pixels("a.png"), scored);
    assert_eq!(workshop.pixels("b.webp"), scored);
    let [drawn, evolved] = ["c.csv", "evolved.csv"].map(|name| String::from_utf8(workshop.read(name)).unwrap());
    let columns = |line: &str| line.split(',').take(13).collect::<Vec<_>>().join(",");
    assert!(drawn.lines().map(columns).eq(evolved.lines().map(columns)), "fitness and all");
    let archives = ["flies.npz", "d.npz"].map(|name| archive::read(&workshop.path(name)).unwrap());
    assert!(archives[0].population == archives[1].population && archives[0].fitness == archives[1].fitness);
    assert_eq!(render(&workshop, "-o - -q").stdout, workshop.read("a.png"));
}

#[test]
fn at_another_size_the_picture_is_the_one_that_evolve_would_have_written() {
    for long_side_px in [8, 120] {
        let workshop = workshop(&format!("-o evolved.png --output-size {long_side_px}"));
        render(&workshop, &format!("-o a.png --output-size {long_side_px}"));
        assert_eq!(workshop.pixels("a.png"), workshop.pixels("evolved.png"), "{long_side_px} px");
    }
}

#[test]
fn every_format_has_the_size_that_was_asked_for() {
    let workshop = workshop("");
    render(&workshop, "--output-size 120 -o a.png -o a.jpg -o a.webp -o a.svg -o a.ora -o a.json");
    for name in ["a.png", "a.jpg", "a.webp"] {
        assert_eq!(workshop.pixels(name).dimensions(), (120, 90), "{name}");
    }
    let svg = String::from_utf8(workshop.read("a.svg")).unwrap();
    assert!(svg.contains("width=\"120\" height=\"90\" viewBox=\"-64 -64 5120 3840\""), "{svg}");
    let mut ora = zip::ZipArchive::new(std::io::Cursor::new(workshop.read("a.ora"))).unwrap();
    let mut merged = Vec::new();
    std::io::Read::read_to_end(&mut ora.by_name("mergedimage.png").unwrap(), &mut merged).unwrap();
    assert_eq!(merged, workshop.read("a.png"));
    let table: Value = serde_json::from_slice(&workshop.read("a.json")).unwrap();
    assert_eq!([&table["width_px"], &table["height_px"]], [40, 30], "a population has the size that it evolved at");
}

#[test]
fn another_background_shows_where_no_tile_is_and_only_there() {
    let workshop = Workshop::new();
    // Hardly any tiles, so that much of the background shows.
    let evolve = "evolve photo.png --scheme paper -n 3 --births 0 -o flies.npz -o blue.png --background 0000ff";
    assert_eq!(workshop.run(evolve).code, Some(0));
    render(&workshop, "-o white.png --background white");
    let (blue, white) = (workshop.pixels("blue.png"), workshop.pixels("white.png"));
    let mut changed = 0;
    for (before, after) in blue.pixels().zip(white.pixels()) {
        let is_background = before != after;
        assert!(!is_background || (before.0, after.0) == ([0, 0, 255], [255; 3]));
        changed += u32::from(is_background);
    }
    assert!((1..blue.pixels().len() as u32).contains(&changed), "{changed} pixels");
}

/// `flies.npz` with a change.
fn change(workshop: &Workshop, change: impl FnOnce(&mut Population)) -> Population {
    let Archive { mut population, fitness, meta } = archive::read(&workshop.path("flies.npz")).unwrap();
    change(&mut population);
    workshop.write("changed.npz", &archive::encode(&population, &fitness, &meta).unwrap());
    population
}

#[test]
fn the_grout_of_a_population_is_drawn_again_and_decides_what_may_be_replaced() {
    let workshop = workshop("");
    let grout = Grout { width: 50, color: [255, 0, 255] };
    let population = change(&workshop, |population| population.grout = Some(grout));
    render(&workshop, "-o a.png --output-size 90 --supersample 2");
    refused(&workshop, "render changed.npz -o a.png --output-size 90 --supersample 2", 2, "made with other options");
    let run = |line: &str| assert_eq!(workshop.run(line).code, Some(0), "{line}");
    run("render changed.npz -o b.png -o b.npz -o b.svg --output-size 90 --supersample 2");
    let drawn = CpuPainter.draw(&population, &Canvas::scaled(40, 30, 90), 2).unwrap();
    assert_eq!(workshop.pixels("b.png").as_raw(), drawn.pixels.as_flattened());
    assert_ne!(workshop.pixels("b.png"), workshop.pixels("a.png"));
    assert_eq!(archive::read(&workshop.path("b.npz")).unwrap().population, population);
    assert!(String::from_utf8(workshop.read("b.svg")).unwrap().contains("fill=\"#ff00ff\""));
    run("render changed.npz -o c.png --mask disc --blend opaque");
    refused(&workshop, "render changed.npz -o d.png --mask disc --blend translucent", 2, "has grout");
}

#[test]
fn more_samples_soften_edges() {
    let workshop = workshop("-o evolved.png");
    render(&workshop, "-o one.png --supersample 1");
    render(&workshop, "-o many.png --supersample 16");
    assert_eq!(workshop.pixels("one.png"), workshop.pixels("evolved.png"));
    assert_ne!(workshop.pixels("many.png"), workshop.pixels("evolved.png"));
}

#[test]
fn neither_threads_nor_device_nor_repetition_change_a_byte() {
    let workshop = workshop("");
    let outputs = |name: &str| ["png", "ora", "svg", "webp"].map(|ending| format!("-o {name}.{ending}")).join(" ");
    render(&workshop, &format!("{} --output-size 100 --threads 1", outputs("one")));
    render(&workshop, &format!("{} --output-size 100 --threads 2", outputs("two")));
    render(&workshop, &format!("{} --output-size 100 --device name:llvmpipe --validate", outputs("gpu")));
    for ending in ["png", "ora", "svg", "webp"] {
        let [one, two, gpu] = ["one", "two", "gpu"].map(|name| workshop.read(&format!("{name}.{ending}")));
        assert!(one == two && one == gpu, "{ending}");
    }
}

#[test]
fn the_metadata_tells_what_decides_the_picture_and_where_its_flies_came_from() {
    let workshop = workshop("-o evolved.png");
    let row = render(&workshop, "-o a.png -o b.npz --output-size 50 --supersample 3 --json -q").row();
    let found = told(&workshop, "a.png");
    assert_eq!(found["key"], row["key"]);
    assert_eq!([&found["output_size_px"], &found["supersampling"]], [50, 3]);
    assert_eq!([&found["background"], &found["software"]], ["336699", "smalti"]);
    assert_eq!(found["origin_key"], told(&workshop, "evolved.png")["key"]);
    let population = archive::read(&workshop.path("b.npz")).unwrap().meta;
    assert_eq!(population["origin_key"], found["origin_key"]);
    assert!(!found.to_string().contains("flies.npz"), "{found}");
}

#[test]
fn the_row_of_json_tells_what_was_done() {
    let workshop = workshop("");
    let row = render(&workshop, "-o a.png -o b.svg --json -q").row();
    for (field, value) in [
        ("id", json!("flies")),
        ("status", json!("complete")),
        ("output", json!(["a.png", "b.svg"])),
        ("tiles", json!(60)),
        ("device", json!("CPU")),
        ("version", json!(env!("CARGO_PKG_VERSION"))),
        ("error", json!(null)),
    ] {
        assert_eq!(row[field], value, "{field}");
    }
    assert!(["load_ms", "draw_ms", "save_ms"].iter().all(|field| row[field].is_f64()), "{row}");
    let row = refused(&workshop, "render missing.npz -o c.png --json", 2, "missing.npz").row();
    assert_eq!([&row["id"], &row["status"]], ["missing", "failed"]);
}

#[test]
fn the_key_changes_with_what_decides_the_picture_and_with_nothing_else() {
    let workshop = workshop("");
    let key = |rest: &str| render(&workshop, &format!("-o a.png --force --json -q {rest}")).row()["key"].clone();
    let plain = key("");
    for rest in ["--threads 1", "--output-size 40", "--supersample 1", "--background 336699", "-o b.npz"] {
        assert_eq!(key(rest), plain, "{rest}");
    }
    for rest in ["--output-size 41", "--supersample 2", "--background white"] {
        assert_ne!(key(rest), plain, "{rest}");
    }
    workshop.evolve("-o flies.npz --seed 1 --background 336699 --force");
    assert_ne!(key(""), plain, "other flies");
}

#[test]
fn only_force_replaces_what_the_same_command_would_not_have_written() {
    let workshop = workshop("");
    for ending in ["png", "jpg", "webp", "svg", "ora", "npz", "json"] {
        let name = format!("a.{ending}");
        workshop.write(&name, b"written by somebody else");
        let line = format!("render flies.npz -o {name}");
        refused(&workshop, &line, 2, &format!("{name} exists and was not made by smalti"));
        assert_eq!(workshop.read(&name), b"written by somebody else");
        render(&workshop, &format!("-o {name} --force"));
        let first = workshop.read(&name);
        render(&workshop, &format!("-o {name}"));
        refused(&workshop, &format!("{line} --background white"), 2, "made with other options");
        assert_eq!(workshop.read(&name), first);
    }
}

#[test]
fn a_csv_table_of_another_command_is_refused_before_the_work_unless_forced() {
    let workshop = workshop("-o a.csv");
    let first = workshop.read("a.csv");
    workshop.evolve("-o a.csv --background 336699");
    assert_eq!(workshop.read("a.csv"), first);
    refused(&workshop, "render flies.npz -o a.csv", 2, "a.csv exists and was made with other options");
    refused(
        &workshop,
        "evolve photo.png --scheme paper --births 1000M -o a.csv",
        2,
        "a.csv exists and was made with other options",
    );
    workshop.evolve("-o a.csv --seed 1 --force");
    assert_ne!(workshop.read("a.csv"), first);
    render(&workshop, "-o drawn.csv");
    render(&workshop, "-o drawn.csv");

    workshop.write("c.csv", b"x,y\n1,2\n");
    refused(&workshop, "render flies.npz -o c.csv", 2, "c.csv exists and was not made by smalti");
    refused(
        &workshop,
        "evolve photo.png --scheme paper --births 1000M -o c.csv",
        2,
        "c.csv exists and was not made by smalti",
    );
}

#[test]
fn populations_that_cannot_be_used_are_refused_and_nothing_is_written_or_lost() {
    let workshop = workshop("-o a.png");
    let (npz, kept) = (workshop.read("flies.npz"), workshop.read("a.png"));
    let column = |value: f32| npy("<f4", "(60,)", &value.to_le_bytes().repeat(60));
    let with = |name: &str, content: Vec<u8>| Members::of(&npz).with(name, content).zipped();
    let other = json!({"schema": 2, "width_px": 40, "height_px": 30, "background": [0, 0, 0]}).to_string();
    let empty = Population { flies: vec![], ..archive::read(&workshop.path("flies.npz")).unwrap().population };
    for (bytes, words) in [
        (npz[..npz.len() / 2].to_vec(), "bad.npz: is not a population"),
        (b"".to_vec(), "bad.npz: is not a population"),
        (with("meta.json", other.into_bytes()), "bad.npz: has layout 2, this program reads 1"),
        (with("x.npy", column(f32::NAN)), "bad.npz: its column `x` has a value that is no finite number (fly 0)"),
        (with("y.npy", column(30.0)), "bad.npz: its column `y` has 30.0 (fly 0); it must be 0 to 29"),
        (with("w.npy", column(-1.0)), "bad.npz: its column `w` has -1.0 (fly 0); it must be 0.25 to 4096"),
        (with("r.npy", column(2.0)), "bad.npz: its column `r` has 2.0 (fly 0); it must be 0 to 1"),
        (Members::of(&npz).without("angle.npy").zipped(), "bad.npz: is not a population: it has no `angle.npy`"),
        (archive::encode(&empty, &[], &serde_json::Map::new()).unwrap(), "bad.npz: holds no flies"),
    ] {
        workshop.write("bad.npz", &bytes);
        refused(&workshop, "render bad.npz -o a.png -o b.svg --force", 2, words);
        assert!(workshop.read("a.png") == kept && workshop.read("bad.npz") == bytes, "{words}");
    }
    refused(&workshop, "render photo.png -o b.png", 2, "photo.png: is a picture, which holds no population");
}

#[test]
fn values_and_outputs_that_make_no_sense_are_refused() {
    let workshop = workshop("");
    for (rest, code, words) in [
        ("", 2, "--output"),
        ("-o a.gif", 2, "a.gif: a mosaic is a still picture, such as .png"),
        ("-o a.npz -o a.csv -o a.json --output-size 80", 2, "--output-size 80: a population has no size"),
        ("-o a.svg --supersample 2", 2, "--supersample 2: no output has pixels"),
        ("-o a.png --supersample 0", 2, "--supersample 0: must be 1 to 16"),
        ("-o a.png --supersample 17", 2, "--supersample 17: must be 1 to 16"),
        ("-o a.png --output-size 40000 --supersample 2", 2, "allows at most 1"),
        ("-o a.png --output-size 65536", 2, "--output-size 65536"),
        ("-o a.webp --output-size 20000", 2, "a.webp: a WebP has at most 16383 px a side"),
        ("-o a.png --background reddish", 2, "--background"),
        ("-o a.png --threads 0", 2, "--threads 0"),
        ("-o a.png --device name:no-such-gpu", 4, "no-such-gpu"),
        ("-o a.png --validate", 2, "--validate"),
        ("-o a.png -q -v", 2, "--verbose"),
        ("-o - --json", 2, "stdout"),
        ("-o flies.npz --force", 2, "is an input"),
        ("-o a.png -o ./a.png", 2, "named twice"),
        ("-o nowhere/a.png", 1, "nowhere/a.png"),
    ] {
        refused(&workshop, &format!("render flies.npz {rest}"), code, words);
    }
}
