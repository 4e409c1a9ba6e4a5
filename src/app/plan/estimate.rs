//! How long a picture takes, about, so that a shard can be made large enough.

use std::time::Instant;

use crate::app::job::Job;
use crate::app::options::{EvolveOptions, SchemeOptions};

/// Children that the search in cells tries in a second on two processors without a GPU (`smalti bench`).
const EVALS_PER_S: f64 = 800_000.0;
/// Births of the paper's scheme in a second, likewise.
const BIRTHS_PER_S: f64 = 50_000.0;
/// Pictures that are looked at.
const SAMPLES: usize = 5;

/// Mean time in seconds of a picture on two processors, by a few of them, evenly picked; none if none of these can be read.
pub(super) fn picture_s(item_count: usize, options: impl Fn(usize) -> EvolveOptions) -> Option<f64> {
    let sample_count = item_count.min(SAMPLES);
    let samples = (0..sample_count).map(|sample| options(sample * item_count / sample_count));
    let times: Vec<f64> = samples.filter_map(|options| time_s(&options)).collect();
    (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
}

fn time_s(options: &EvolveOptions) -> Option<f64> {
    let began = Instant::now();
    let job = Job::load(options).ok()?;
    let evolve_s = match &job.scheme {
        SchemeOptions::Cells(cells) => cells.budget(job.fly_count).evals as f64 / EVALS_PER_S,
        SchemeOptions::Paper(scheme) => (scheme.births * (u64::from(scheme.restarts) + 1)) as f64 / BIRTHS_PER_S,
    };
    let limit_s = options.time_limit.map_or(f64::INFINITY, |limit| limit.as_secs_f64());
    Some(began.elapsed().as_secs_f64() + evolve_s.min(limit_s))
}
