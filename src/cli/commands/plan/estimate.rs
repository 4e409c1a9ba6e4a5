//! Estimates how long a picture takes, so that shards can be made large enough.

use std::time::Instant;

use crate::cli::jobs::options::PictureOptions;
use crate::studio::{Job, Scheme};

/// Children that the search in cells tries in a second on two processors without a GPU (`smalti bench`).
const EVALS_PER_S: f64 = 800_000.0;
/// Births of the paper's scheme in a second, on the same machine.
const BIRTHS_PER_S: f64 = 50_000.0;
/// How many pictures are looked at, at most.
const SAMPLES: usize = 5;

/// Mean time in seconds of a picture on two processors, estimated from a few pictures at even distances. None if none
/// of these can be read.
pub(super) fn picture_s(item_count: usize, options: impl Fn(usize) -> PictureOptions) -> Option<f64> {
    let sample_count = item_count.min(SAMPLES);
    let samples = (0..sample_count).map(|sample| options(sample * item_count / sample_count));
    let times: Vec<f64> = samples.filter_map(|options| time_s(&options)).collect();
    (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
}

fn time_s(options: &PictureOptions) -> Option<f64> {
    let began = Instant::now();
    let job = Job::load(&options.input, &options.settings).ok()?;
    let per_s = match options.scheme() {
        Scheme::Cells => EVALS_PER_S,
        Scheme::Paper => BIRTHS_PER_S,
    };
    let evolve_s = job.evals_planned() as f64 / per_s;
    let limit_s = options.settings.time_limit.map_or(f64::INFINITY, |limit| limit.as_secs_f64());
    Some(began.elapsed().as_secs_f64() + evolve_s.min(limit_s))
}
