//! What each rule of the `cells` search is worth: pictures of 256 px, 2,500 tiles and 400,000 evals on the CPU twin,
//! with one rule switched off at a time.
//!
//! `cargo bench --bench ablation -- [FOLDER] [--evals E] [--seeds S]`: searches the five development pictures in
//! FOLDER, or, without FOLDER, the photo that ships with the tests. Prints a table with the mean error per channel of
//! each picture, the geometric mean of these errors over the photos, and the mean time of a search. Drawings are left
//! out of the geometric mean, since they may end without any error.

#![allow(clippy::print_stdout, reason = "a bench prints its table")]

mod common;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Parser;
use smalti::cpu::cells::CpuSearch;
use smalti::evolve::evolution::random_population;
use smalti::model::Target;
use smalti::model::cells::rules::{Acceptance, BirthDepth, BirthKind, ColorSource};
use smalti::model::cells::{Rules, Search};

const SIDE_PX: u32 = 256;
const FLY_COUNT: usize = 2_500;
/// Pictures of few colours and straight edges.
const DRAWINGS: [&str; 2] = ["star", "yin_yang"];

#[derive(Parser)]
struct Options {
    /// Folder with star.png, yin_yang.png, hats.png, parrots.png and woman.png, or some of them
    folder: Option<PathBuf>,
    /// Children to evaluate in each search
    #[arg(long, default_value_t = 400_000)]
    evals: u64,
    /// Searches of each picture
    #[arg(long, default_value_t = 1)]
    seeds: u64,
    /// What `cargo bench` says to every bench
    #[arg(long, hide = true)]
    bench: bool,
}

/// A name, and what it changes in the rules.
type Variant = (&'static str, fn(&mut Rules));

/// The search as it is, then without one rule each.
const VARIANTS: [Variant; 12] = [
    ("all in", |_| {}),
    ("evolved colour", |rules| rules.color = ColorSource::Evolved),
    ("strict acceptance", |rules| rules.acceptance = Acceptance::Strict),
    ("colour of the centre's pixel", |rules| rules.color = ColorSource::Pick),
    ("no edge move", |rules| rules.mix.edge = 0),
    // From random flies, as an empty picture has no parents.
    ("births only as mutated parents", |rules| rules.births.kind = BirthKind::Mutant),
    ("random depth of births", |rules| rules.births.depth = BirthDepth::Random),
    ("uniform places of births", |rules| rules.births.place_tournament = 1),
    // Beyond the highest coherence: so good as no birth follows the guide.
    ("no structure tensor", |rules| rules.births.coherence_range = 1 << 24),
    ("mean colour instead of median", |rules| rules.color = ColorSource::Mean),
    ("8 candidates a step", |rules| rules.candidates = 8),
    ("16 candidates a step", |rules| rules.candidates = 16),
];

/// The mean error per channel and the seconds of one search.
fn search(target: &Arc<Target>, (change, seed): (fn(&mut Rules), u64), evals: u64) -> (f64, f64) {
    let began = Instant::now();
    let mut course = common::cells::course(target, "free", FLY_COUNT, 1);
    course.rules.seed = seed;
    change(&mut course.rules);
    let needs_parents = course.rules.births.kind == BirthKind::Mutant;
    let mut search = CpuSearch::new(course);
    if needs_parents {
        let flies = random_population(target.width_px(), target.height_px(), FLY_COUNT, seed);
        search.load(&flies).expect("the search works");
    }
    common::cells::search_until(&mut search, evals, None);
    let channels = target.pixels().len() as f64 * 3.0;
    (search.standing().objective as f64 / channels, began.elapsed().as_secs_f64())
}

fn main() {
    let options = Options::parse();
    let paths = match &options.folder {
        Some(folder) => common::cells::pictures(folder),
        None => vec![("parrots", Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/parrots.png"))],
    };
    assert!(!paths.is_empty(), "the folder has none of {:?} as .png", common::cells::PICTURES);
    let names: Vec<&str> = paths.iter().map(|(name, _)| *name).collect();
    println!("{}, {} evals, seeds 0 to {}, {} threads\n", names.join(", "), options.evals, options.seeds - 1, {
        rayon::current_num_threads()
    });
    let targets: Vec<Arc<Target>> = paths.iter().map(|(_, path)| common::cells::read(path, SIDE_PX)).collect();
    println!(
        "| rule | {} | photos | against all in | seconds |\n|{}",
        names.join(" | "),
        "---|".repeat(names.len() + 4)
    );
    let mut all_in = None;
    for (name, change) in VARIANTS {
        let runs: Vec<Vec<(f64, f64)>> = targets
            .iter()
            .map(|target| (0..options.seeds).map(|seed| search(target, (change, seed), options.evals)).collect())
            .collect();
        let errors: Vec<f64> = runs.iter().map(|runs| mean(runs.iter().map(|run| run.0))).collect();
        let photos = names.iter().zip(&errors).filter(|(name, _)| !DRAWINGS.contains(name));
        let error = mean(photos.map(|(_, error)| error.ln())).exp();
        let seconds = mean(runs.iter().flatten().map(|run| run.1));
        let change_percent = (error / *all_in.get_or_insert(error) - 1.0) * 100.0;
        let errors: Vec<String> = errors.iter().map(|error| format!("{error:.3}")).collect();
        println!("| {name} | {} | {error:.3} | {change_percent:+.1} % | {seconds:.2} |", errors.join(" | "));
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value));
    sum / count
}
