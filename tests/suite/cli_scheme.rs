//! The parameters of the scheme and the curve at the command line.

use crate::workshop::Workshop;

#[test]
fn every_parameter_changes_the_result_and_the_key_and_its_default_changes_neither() {
    let workshop = Workshop::new();
    let (usual, picture) = (workshop.evolve_to_row("-o out.png"), workshop.read("out.png"));
    let defaults = "--p-mutation 1 --p-crossover 0 --new-blood 0 --mitosis 0 --tile-scale 1 --color-mode evolved";
    assert_eq!(workshop.evolve_to_row(&format!("-o out.png {defaults}"))["key"], usual["key"]);
    assert_eq!(workshop.read("out.png"), picture);
    for flag in [
        "--p-mutation 0.5",
        "--p-crossover 0.5",
        "--new-blood 0.2",
        "--mitosis 1 --restarts 1",
        "--no-rotation",
        "--tile-scale 3",
        "--color-mode pick",
        "--color-mode mean",
        "--color-mode median",
    ] {
        let row = workshop.evolve_to_row(&format!("-o out.png --force {flag}"));
        assert_ne!(row["key"], usual["key"], "{flag}");
        assert_ne!(row["sae"], usual["sae"], "{flag}");
        assert_eq!(workshop.evolve_to_row(&format!("-o out.png {flag} --threads 1"))["sae"], row["sae"], "{flag}");
    }
}

#[test]
fn the_row_tells_the_spread_of_the_result() {
    let row = Workshop::new().evolve_to_row("-o out.png");
    let spread = row["spread"].as_f64().expect("60 tiles have neighbours");
    assert!((0.3..1.5).contains(&spread), "{spread}");
}

/// The columns of a row of a curve.
fn numbers(line: &str) -> Vec<f64> {
    line.split(',').take(10).map(|text| text.parse().unwrap_or_else(|_| panic!("{line}"))).collect()
}

#[test]
fn a_curve_has_its_start_its_end_its_restarts_and_nothing_of_the_clock() {
    let workshop = Workshop::new();
    let line = "evolve photo.png --scheme paper -n 60 --births 1k --restarts 2 -o out.png --curve curve.csv --curve curve.svg --json";
    let row = workshop.run(&format!("{line} --threads 1")).row();
    let (csv, svg) = (workshop.read("curve.csv"), workshop.read("curve.svg"));
    let text = String::from_utf8(csv.clone()).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    assert!(header.starts_with("run,births_in_run,births,sae,best_sae,clark_evans,"), "{header}");
    let points: Vec<Vec<f64>> = lines.map(numbers).collect();
    assert_eq!(points[0][..3], [0.0, 0.0, 0.0]);
    let last = points.last().unwrap();
    assert_eq!(last[..3], [2.0, 1_000.0, 3_000.0]);
    assert_eq!(last[4], row["sae"].as_f64().unwrap());
    for (number, run) in [(1, 1.0), (2, 2.0)] {
        let at = [run, 0.0, 1_000.0 * f64::from(number)];
        let begins = points.iter().find(|point| point[..3] == at).expect("the restart has a point");
        assert_eq!(begins[3], begins[4], "a run begins from the best population");
    }
    assert!((500..520).contains(&points.len()), "{} points", points.len());
    assert!(points.is_sorted_by(|one, next| one[2] <= next[2] && one[4] >= next[4]));

    let plot = String::from_utf8(svg.clone()).unwrap();
    assert!(plot.contains("restart 1") && plot.contains("restart 2") && plot.contains("births"));
    assert_eq!(row["output"], serde_json::json!(["out.png", "curve.csv", "curve.svg"]), "curves count as outputs");
    assert_eq!(workshop.run(&format!("{line} --threads 2")).code, Some(0));
    assert_eq!((workshop.read("curve.csv"), workshop.read("curve.svg")), (csv, svg));
}

#[test]
fn a_curve_changes_neither_the_result_nor_its_key() {
    let workshop = Workshop::new();
    let (usual, picture) = (workshop.evolve_to_row("-o out.png"), workshop.read("out.png"));
    let row = workshop.evolve_to_row("-o out.png --curve curve.csv");
    assert_eq!((&row["key"], workshop.read("out.png")), (&usual["key"], picture));
}

#[test]
fn a_curve_replaces_only_a_curve_of_the_same_command_unless_forced() {
    let workshop = Workshop::new();
    workshop.evolve("-o out.png --curve curve.csv --curve curve.svg");
    workshop.evolve("-o out.png --curve curve.csv --curve curve.svg");
    workshop.write("notes.csv", b"mine,yours\n1,2\n");
    workshop.write("drawing.svg", b"<svg xmlns='http://www.w3.org/2000/svg'/>");
    for (name, why) in [
        ("curve.csv", "made with other options"),
        ("curve.svg", "made with other options"),
        ("notes.csv", "not made by smalti"),
        ("drawing.svg", "not made by smalti"),
    ] {
        let before = workshop.read(name);
        let line = format!("evolve photo.png --scheme paper -n 60 --births 300 --seed 5 -o other.png --curve {name}");
        let ran = workshop.run(&line);
        assert_eq!(ran.code, Some(2), "{name}: {}", ran.stderr);
        assert!(ran.stderr.contains(name) && ran.stderr.contains(why), "{name}: {}", ran.stderr);
        assert_eq!(workshop.read(name), before);
        assert_eq!(workshop.run(&format!("{line} --force")).code, Some(0), "{name}");
        assert_ne!(workshop.read(name), before);
    }
}

#[test]
fn a_dry_run_names_the_curve_and_writes_nothing() {
    let workshop = Workshop::new();
    let before = workshop.files();
    let row = workshop.evolve_to_row("-o out.png --curve curve.svg --dry-run");
    assert_eq!(row["output"], serde_json::json!(["out.png", "curve.svg"]));
    assert_eq!(workshop.files(), before);
}

#[test]
fn values_of_the_scheme_out_of_range_are_refused_with_their_flag() {
    let workshop = Workshop::new();
    workshop.evolve("-o flies.npz");
    let before = workshop.files();
    for (rest, words, code) in [
        ("--p-mutation 1.5", "--p-mutation 1.5: must be 0 to 1", 2),
        ("--p-mutation NaN", "--p-mutation NaN", 2),
        ("--p-crossover=-0.1", "--p-crossover -0.1", 2),
        ("--new-blood 2", "--new-blood 2", 2),
        ("--new-blood much", "--new-blood", 2),
        ("--mitosis 21 --restarts 30", "--mitosis 21: must be 0 to 20", 2),
        ("--mitosis 2 --restarts 1", "--restarts at least 2", 2),
        ("--mitosis 2", "--restarts", 2),
        ("--mitosis 1 --restarts 1 --init flies.npz", "--init", 2),
        ("-n 60 --mitosis 6 --restarts 6", "needs at least 64 tiles", 2),
        ("-n 60 --mitosis 2 --restarts 2 --batch-births 16", "first number of tiles, 15", 2),
        ("--tile-scale 0.05", "--tile-scale 0.05: must be 0.1 to 100", 2),
        ("--tile-scale 101", "--tile-scale 101", 2),
        ("--tile-scale inf", "--tile-scale inf", 2),
        ("--tile-scale 2 --init flies.npz", "--tile-scale", 2),
        ("--color-mode blue", "--color-mode", 2),
        ("--curve curve.png", "must end in .csv or .svg", 2),
        ("--curve curve", "must end in .csv or .svg", 2),
        ("--curve a.csv --curve ./a.csv", "named twice", 2),
        ("--curve missing/a.csv", "missing/a.csv", 1),
    ] {
        let ran = workshop.run(&format!("evolve photo.png --scheme paper -o out.png {rest}"));
        assert_eq!(ran.code, Some(code), "{rest}: {}", ran.stderr);
        let sentence = ran.stderr.strip_prefix("smalti: ").unwrap_or_else(|| panic!("{rest}: {:?}", ran.stderr));
        assert!(sentence.lines().count() == 1 && sentence.contains(words), "{rest}: {sentence}");
        assert_eq!(workshop.files(), before, "{rest} left something behind");
    }
}

#[test]
fn a_target_that_is_reached_before_the_last_change_of_masks_or_split_ends_only_that_run() {
    let workshop = Workshop::new();
    for (flags, restarts) in [("--restart-mask flower --restarts 3", 1), ("--mitosis 2 --restarts 2", 2)] {
        let row = workshop.evolve_to_row(&format!("-o a.png --force --target-sae 10M {flags}"));
        assert_eq!([&row["stop"], &row["status"]], ["target-sae", "complete"], "{flags}");
        assert_eq!([&row["restarts"], &row["births"], &row["living"]], [restarts, 0, 60], "{flags}");
    }
    let row = workshop.evolve_to_row("-o a.png --force --target-sae 10M --restarts 2");
    assert_eq!([&row["restarts"], &row["births"]], [0, 0], "nothing changes, so the first run will do");
}

#[test]
fn a_cut_before_the_last_split_or_change_of_masks_is_told() {
    let workshop = Workshop::new();
    let line = "evolve photo.png --scheme paper -n 60 --births 1000M --time 200ms -o a.png --force --json";
    let ran = workshop.run(&format!("{line} --mitosis 2 --restarts 2"));
    assert_eq!([&ran.row()["tiles"], &ran.row()["living"]], [60, 15]);
    let told = "ended when the time was up before the last split or change of masks, with 15 tiles alive";
    assert!(ran.stderr.contains(told), "{}", ran.stderr);
    let ran = workshop.run(&format!("{line} --restarts 1 --restart-mask flower"));
    assert!(ran.stderr.contains("ended when the time was up before the last change of masks\n"), "{}", ran.stderr);
    assert_eq!([&ran.row()["tiles"], &ran.row()["living"]], [60, 60]);
    let ran = workshop.run(&format!("{line} --restarts 1"));
    assert!(ran.stderr.contains("ended when the time was up\n"), "{}", ran.stderr);
}

#[test]
fn a_curve_says_at_which_restarts_the_best_population_began_anew() {
    let workshop = Workshop::new();
    workshop.evolve("--restarts 2 --mitosis 1 -o a.png --curve split.svg");
    workshop.evolve("--restarts 2 --restart-mask flower -o b.png --curve masks.svg");
    workshop.evolve("--restarts 2 --mitosis 1 --restart-mask flower -o c.png --curve both.svg");
    for (name, label) in [
        ("split.svg", "restart 1, tiles split\n"),
        ("masks.svg", "restart 1, new masks\n"),
        ("both.svg", "restart 1, tiles split, new masks\n"),
    ] {
        let plot = String::from_utf8(workshop.read(name)).unwrap();
        assert!(plot.contains(label) && plot.contains("restart 2\n"), "{name}: {plot}");
    }
}
