//! `--trace` and `--capture`: what is in a trace, and that neither changes a result.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::cli_refusals::refused;
use crate::workshop::Workshop;

/// Small evolutions by both schemes, and what their traces must tell of the program.
const LINES: [(&str, &[&str]); 2] = [
    (
        "evolve photo.png -n 60 --evals 4k",
        &[
            "load",
            "decode",
            "guide",
            "open search",
            "evolve",
            "epoch",
            "rounds",
            "spread depths",
            "draw",
            "encode",
            "write",
        ],
    ),
    (
        "evolve photo.png --scheme paper -n 60 --births 300",
        &["load", "decode", "evolve", "load population", "generations", "draw", "encode", "write"],
    ),
];

/// An event with a duration; times in nanoseconds.
struct Span<'a> {
    name: &'a str,
    begin: i64,
    end: i64,
    submission: Option<u64>,
}

fn nanoseconds(value: &Value) -> i64 {
    (value.as_f64().expect("a time is a number") * 1e3).round() as i64
}

/// The spans of a trace by process and thread, in the order in which they begin, the longer ones first.
fn spans(trace: &Value) -> BTreeMap<(u64, u64), Vec<Span<'_>>> {
    let mut tracks: BTreeMap<(u64, u64), Vec<Span<'_>>> = BTreeMap::new();
    for event in trace["traceEvents"].as_array().expect("there are events").iter().filter(|event| event["ph"] == "X") {
        let begin = nanoseconds(&event["ts"]);
        let span = Span {
            name: event["name"].as_str().expect("a span has a name"),
            begin,
            end: begin + nanoseconds(&event["dur"]),
            submission: event["args"]["submission"].as_u64(),
        };
        let track = (event["pid"].as_u64().unwrap(), event["tid"].as_u64().unwrap());
        tracks.entry(track).or_default().push(span);
    }
    for spans in tracks.values_mut() {
        spans.sort_by_key(|span| (span.begin, -span.end));
    }
    tracks
}

/// Each span lies within the one under way when it begins, or begins after its end.
fn check_nesting(spans: &[Span<'_>], slack_ns: i64) {
    let mut open: Vec<&Span<'_>> = Vec::new();
    for span in spans {
        assert!(span.begin >= 0 && span.end >= span.begin, "{} runs from {} to {}", span.name, span.begin, span.end);
        open.retain(|outer| outer.end > span.begin + slack_ns);
        if let Some(outer) = open.last() {
            let ends = (span.end, outer.end);
            assert!(span.end <= outer.end + slack_ns, "{} is cut by the end of {}: {ends:?}", span.name, outer.name);
        }
        open.push(span);
    }
}

/// Every pass lies within the wait of some thread for its submission.
fn check_device_track(trace: &Value, tracks: &BTreeMap<(u64, u64), Vec<Span<'_>>>) {
    let device = &tracks[&(2, 1)];
    let clock = &trace["smalti"]["clocks"]["2"];
    assert_eq!(clock["method"], "calibrated timestamps");
    let slack_ns = nanoseconds(&clock["largest_deviation_us"]) + 2;
    check_nesting(device, 2);
    let program = tracks.iter().filter(|((process, _), _)| *process == 1);
    let waits = program.flat_map(|(_, spans)| spans).filter(|span| span.name == "submit and wait");
    let waits: BTreeMap<u64, &Span<'_>> = waits.map(|span| (span.submission.unwrap(), span)).collect();
    assert!(waits.keys().copied().eq(1..=waits.len() as u64), "submissions are counted from 1");
    for pass in device {
        let wait = waits[&pass.submission.expect("a pass is of a submission")];
        let is_within = pass.begin >= wait.begin - slack_ns && pass.end <= wait.end + slack_ns;
        let times = [wait.begin, pass.begin, pass.end, wait.end];
        assert!(is_within, "{} is not within its submission: {times:?}, slack {slack_ns} ns", pass.name);
    }
}

#[test]
fn a_trace_has_the_work_of_threads_and_device_on_one_clock_and_changes_no_byte() {
    for (device, pass_names) in
        [("cpu", [&[][..]; 2]), ("vulkan", [&["cells_deal", "cells", "mosaic"], &["evaluate", "mosaic"]])]
    {
        for ((line, names), passes) in LINES.into_iter().zip(pass_names) {
            let workshop = Workshop::new();
            let run = |rest: &str| {
                let ran = workshop.run(&format!("{line} --device {device} {rest}"));
                assert_eq!(ran.code, Some(0), "{line}: {}", ran.stderr);
                ran
            };
            run("-o plain.png -o plain.npz");
            let ran = run("-o traced.png -o traced.npz --trace trace.json");
            assert!(ran.stderr.contains("trace.json has "), "{}", ran.stderr);
            assert_eq!(workshop.read("plain.png"), workshop.read("traced.png"));
            assert_eq!(workshop.read("plain.npz"), workshop.read("traced.npz"));
            assert!(!workshop.files().iter().any(|name| name.ends_with(".partial")), "{:?}", workshop.files());

            let trace: Value = serde_json::from_slice(&workshop.read("trace.json")).expect("the trace is JSON");
            assert_eq!(trace["smalti"]["events_left_out"], 0);
            assert_eq!(trace["smalti"]["events"], trace["traceEvents"].as_array().unwrap().len());
            let tracks = spans(&trace);
            let program = &tracks[&(1, 1)];
            check_nesting(program, 0);
            // Pictures are read by a thread of their own.
            let told: Vec<&Span> =
                tracks.iter().filter(|((process, _), _)| *process == 1).flat_map(|(_, all)| all).collect();
            for name in names {
                assert!(told.iter().any(|span| span.name == *name), "{device}: no {name}");
            }
            let counters: Vec<&Value> =
                trace["traceEvents"].as_array().unwrap().iter().filter(|event| event["ph"] == "C").collect();
            for counter in counters {
                let name = counter["name"].as_str().unwrap();
                assert!(["SAE", "evals/s", "births/s"].contains(&name), "{name}");
                assert!(counter["args"][name].as_f64() >= Some(0.0), "{counter}");
            }
            let Some(device_track) = tracks.get(&(2, 1)) else {
                assert_eq!(device, "cpu");
                continue;
            };
            check_device_track(&trace, &tracks);
            for name in passes {
                assert!(device_track.iter().any(|span| span.name == *name), "no pass {name}");
            }
        }
    }
}

#[test]
fn the_trace_of_a_batch_has_all_threads_and_pictures() {
    for device in ["cpu", "vulkan"] {
        let workshop = Workshop::new();
        let names = ["a", "b", "c", "d"];
        for name in names {
            workshop.paint(&format!("{name}.png"), 30, 20);
        }
        let line =
            "batch a.png b.png c.png d.png -o out -n 20 --evals 800 --in-flight 2 --io-threads 2:2 --trace trace.json";
        let ran = workshop.run(&format!("{line} --device {device}"));
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        let trace: Value = serde_json::from_slice(&workshop.read("trace.json")).expect("the trace is JSON");
        let tracks = spans(&trace);
        let of_program: Vec<_> = tracks.iter().filter(|((process, _), _)| *process == 1).collect();
        assert!(of_program.len() >= 3, "threads read, evolve and save");
        of_program.iter().for_each(|(_, spans)| check_nesting(spans, 0));
        let events = trace["traceEvents"].as_array().unwrap();
        // A device has many pictures at once, which come and go.
        let evolving = if device == "cpu" { &["evolve"][..] } else { &["admit", "finish"] };
        for &stage in ["load", "save"].iter().chain(evolving) {
            let mut told: Vec<&str> = events
                .iter()
                .filter(|event| event["name"] == stage)
                .map(|event| event["args"]["picture"].as_str().expect("it tells its picture"))
                .collect();
            told.sort_unstable();
            assert_eq!(told, names, "{stage}");
        }
        assert_eq!(tracks.contains_key(&(2, 1)), device == "vulkan");
        if device == "vulkan" {
            check_device_track(&trace, &tracks);
        }
    }
}

#[test]
fn counters_follow_the_error_down() {
    let workshop = Workshop::new();
    let ran = workshop.run("evolve photo.png -n 60 --evals 200k -o out.png --trace trace.json --json");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let trace: Value = serde_json::from_slice(&workshop.read("trace.json")).expect("the trace is JSON");
    let of = |name: &str| -> Vec<f64> {
        let events = trace["traceEvents"].as_array().unwrap().iter();
        events.filter(|event| event["ph"] == "C").filter_map(|event| event["args"][name].as_f64()).collect()
    };
    let (errors, rates) = (of("SAE"), of("evals/s"));
    assert!(errors.len() > 2 && errors.len() == rates.len(), "{errors:?}");
    assert!(errors.windows(2).all(|pair| pair[1] <= pair[0]), "{errors:?}");
    assert!(*errors.last().unwrap() >= ran.row()["sae"].as_f64().unwrap());
    assert!(rates.iter().all(|&rate| rate > 0.0), "{rates:?}");
    assert!(ran.row()["output"].as_array().unwrap().iter().any(|path| path == "trace.json"));
}

#[test]
fn a_trace_replaces_a_trace_but_no_other_file() {
    let workshop = Workshop::new();
    let line = "evolve photo.png -n 20 --evals 200 -o out.png";
    for _ in 0..2 {
        assert_eq!(workshop.run(&format!("{line} --trace trace.json")).code, Some(0));
    }
    workshop.write("notes.json", b"{\"otherData\":{}}");
    refused(&workshop, &format!("{line} --trace notes.json"), 2, "notes.json exists and was not made by smalti");
    assert_eq!(workshop.run(&format!("{line} --trace notes.json --force")).code, Some(0));
    refused(&workshop, &format!("{line} --trace photo.png"), 2, "--trace photo.png: it is an input");
    refused(&workshop, &format!("{line} --trace out.png"), 2, "--trace out.png: it is an input or another output");
    refused(&workshop, &format!("{line} --trace missing/trace.json"), 1, "its folder does not exist");
    assert_eq!(workshop.run(&format!("{line} --dry-run --trace dry.json")).code, Some(0));
    assert!(!workshop.files().contains("dry.json"));
}

#[test]
fn a_capture_needs_renderdoc_and_a_vulkan_device() {
    let workshop = Workshop::new();
    let line = "evolve photo.png -n 20 --evals 200 -o out.png";
    refused(&workshop, &format!("{line} --device vulkan --capture 1"), 2, "RenderDoc was not loaded");
    refused(&workshop, &format!("{line} --device cpu --capture 1"), 4, "--device vulkan");
    refused(&workshop, &format!("{line} --device vulkan --capture 0"), 2, "such as 12 or 12+3");
}
