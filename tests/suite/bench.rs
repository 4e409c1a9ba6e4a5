//! `smalti bench`: its JSON, its comparisons, and what it refuses.

use serde_json::{Value, json};
use smalti::evolve::evolution::random_population;
use smalti::gpu::GpuEvaluator;
use smalti::model::{Evaluator, Scene, Target};
use smalti::vk::DeviceOptions;

use crate::canary;
use crate::cli_refusals::refused;
use crate::workshop::{Ran, Workshop};

/// What is measured on the CPU, with its units.
const ROWS: [(&str, &str); 16] = [
    ("full evaluation, 256 px", "ms"),
    ("paper, 256 px", "births/s"),
    ("full evaluation, 512 px", "ms"),
    ("paper, 512 px", "births/s"),
    ("paper, 512 px, by 50", "births/s"),
    ("cells free, K=1, 256 px", "evals/s"),
    ("cells free, K=1, 256 px", "births/s"),
    ("cells free, K=8, 256 px", "evals/s"),
    ("cells free, K=8, 256 px", "births/s"),
    ("cells free, K=1, 512 px", "evals/s"),
    ("cells free, K=1, 512 px", "births/s"),
    ("cells free, K=8, 512 px", "evals/s"),
    ("cells free, K=8, 512 px", "births/s"),
    ("cells mosaic, K=1, 512 px", "evals/s"),
    ("cells mosaic, K=1, 512 px", "births/s"),
    ("picture, 512 px", "pictures/h"),
];

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

/// A result of `smalti bench` on the CPU, with these measurements.
fn result(measurements: &Value) -> Value {
    let machine = json!({
        "os": "linux", "architecture": "x86_64", "cpu_count": 2, "threads": 2, "device": "CPU", "driver": null
    });
    json!({
        "schema": "smalti-bench", "schema_version": 1, "version": "0.1.0", "picture": "built-in", "time_ms": 1500,
        "machine": machine, "measurements": measurements
    })
}

#[test]
fn the_figures_have_the_documented_schema_and_compare_with_older_ones() {
    let workshop = Workshop::new();
    let ran = workshop.run("bench --time 1ms --json --threads 2 --progress none");
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(0), ""));
    let figures = ran.row();
    let fields = ["machine", "measurements", "picture", "schema", "schema_version", "time_ms", "version"];
    assert_eq!(keys(&figures), fields);
    assert_eq!(keys(&figures["machine"]), ["architecture", "cpu_count", "device", "driver", "os", "threads"]);
    assert_eq!(figures["schema"], "smalti-bench");
    assert_eq!((&figures["picture"], &figures["time_ms"]), (&json!("built-in"), &json!(1)));
    assert_eq!((&figures["machine"]["device"], &figures["machine"]["threads"]), (&json!("CPU"), &json!(2)));
    let rows = figures["measurements"].as_array().expect("an array");
    let told: Vec<_> = rows.iter().map(|row| (row["name"].as_str().unwrap(), row["unit"].as_str().unwrap())).collect();
    assert_eq!(told, ROWS);
    for row in rows {
        assert_eq!(keys(row), ["high", "low", "name", "repeats", "unit", "value"]);
        let [low, value, high] = ["low", "value", "high"].map(|field| row[field].as_f64().unwrap());
        assert!(0.0 < low && low <= value && value <= high, "{row}");
        assert!(row["repeats"].as_u64().unwrap() > 0, "{row}");
    }

    // As if the first had once been much faster, and the last had been called something else.
    let mut old = figures.clone();
    old["measurements"][0]["value"] = 1e-9.into();
    old["measurements"][15]["name"] = "gone".into();
    workshop.write("old.json", old.to_string().as_bytes());
    let Ran { code, stdout, stderr } =
        workshop.run("bench --time 1ms --json --compare old.json --threads 2 --progress none");
    assert_eq!(code, Some(0), "what is slower is no failure: {stderr}");
    let told = |words: &str| stderr.lines().filter(|line| line.contains(words)).count();
    assert_eq!(told(" times as fast"), ROWS.len() - 1, "{stderr}");
    let first = stderr.lines().find(|line| line.starts_with(ROWS[0].0)).expect("a line for each measurement");
    assert!(first.ends_with("slower"), "{first}");
    assert_eq!((told("not then"), told("then also gone: ")), (1, 1), "{stderr}");
    assert_eq!(told("then: "), 0, "the machine is the same: {stderr}");
    assert!(serde_json::from_slice::<Value>(&stdout).is_ok(), "stdout has nothing but JSON");
}

#[test]
fn files_that_are_no_older_result_are_refused_by_name() {
    let workshop = Workshop::new();
    workshop.write("empty.json", b"");
    workshop.write("other.json", br#"[{"file": "a.png", "SAE": 5}]"#);
    let mut foreign = result(&json!([]));
    foreign["schema"] = "other".into();
    workshop.write("foreign.json", foreign.to_string().as_bytes());
    let mut newer = result(&json!([]));
    newer["schema_version"] = 2.into();
    workshop.write("newer.json", newer.to_string().as_bytes());
    let zero = json!([{ "name": "a", "unit": "ms", "value": 0.0, "low": 0.0, "high": 0.0, "repeats": 1 }]);
    workshop.write("zero.json", result(&zero).to_string().as_bytes());
    std::fs::create_dir(workshop.path("folder.json")).unwrap();
    for name in ["missing.json", "folder.json", "photo.png", "empty.json", "other.json", "foreign.json", "newer.json"] {
        refused(&workshop, &format!("bench --compare {name}"), 2, name);
    }
    refused(&workshop, "bench --compare zero.json", 2, "zero.json: holds a value that is not above 0");
}

#[test]
fn inputs_and_times_that_cannot_be_measured_with_are_refused() {
    let workshop = Workshop::new();
    refused(&workshop, "bench --time 0", 2, "--time");
    refused(&workshop, "bench --time 2h", 2, "--time");
    refused(&workshop, "bench --time soon", 2, "--time");
    refused(&workshop, "bench --input photo.png", 2, "photo.png: is 40x30 px");
    refused(&workshop, "bench --input missing.png", 2, "missing.png");
    refused(&workshop, "bench --device nothing", 4, "name:nothing fits no device");
}

#[test]
fn an_evaluator_with_timestamps_tells_the_time_of_its_passes_and_the_same_fitness() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let pixels = (0..64 * 48).map(|place: u32| [place as u8, (place / 7) as u8, (place / 64) as u8]).collect();
        let target = std::sync::Arc::new(Target::new(64, 48, pixels).expect("a valid size"));
        let scene = Scene { target, masks: std::sync::Arc::default(), background: [0; 3], fly_count: 50 };
        let flies = random_population(64, 48, 50, 0);
        let mut plain = GpuEvaluator::create(&device, vec![scene.clone()]).expect("it fits");
        let mut timed = GpuEvaluator::create_timed(&device, vec![scene]).expect("it fits");
        for evaluator in [&mut plain, &mut timed] {
            evaluator.load(&[(0, &flies)]).expect("the device works");
        }
        assert_eq!(plain.evaluation(0), timed.evaluation(0));
        assert!(plain.pass_times().is_empty());
        let mut names: Vec<&str> = timed.pass_times().iter().map(|time| time.name).collect();
        names.retain(|name| !["uploads", "read-backs"].contains(name));
        assert_eq!(names, ["zero sums", "evaluate"]);
        assert!(timed.pass_times().iter().all(|time| time.ms >= 0.0));
    });
}
