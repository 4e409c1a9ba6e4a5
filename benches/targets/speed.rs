//! How fast a search is.

use std::time::Duration;

use smalti::model::cells::Search;

use crate::report::{Report, Wanted};
use crate::{Gallery, Task};

/// Searches of which the median counts.
const REPEATS: usize = 3;
/// SAE that primg reaches with 2,500 rectangles at 256x256, in 94 CPU seconds.
const PRIMG: [(&str, i64); 2] = [("parrots", 838_809), ("woman", 820_812)];

/// The median time of a search by so many threads, and how many children it evaluated.
fn timed(task: &Task<'_>, threads: usize, enough: Option<i64>) -> (Duration, u64) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
    let mut runs: Vec<(Duration, u64)> = (0..REPEATS)
        .map(|_| {
            let (search, took) = pool.install(|| task.search("free", enough));
            (took, search.standing().evals)
        })
        .collect();
    runs.sort_unstable();
    runs[REPEATS / 2]
}

pub fn measure(gallery: &Gallery, report: &mut Report) {
    report.section("CPU twin, parrots, 2M evals, guide included");
    for (side_px, fly_count, wanted_ratio) in [(256, 2_500, 1.7), (512, 5_000, 1.8)] {
        let target = gallery.target("parrots", side_px);
        let task = Task { target, fly_count, candidates: 1, evals: 2_000_000 };
        let [(one, _), (two, _)] = [1, 2].map(|threads| timed(&task, threads, None));
        report.row(&format!("{side_px} px, 1 thread, s"), one.as_secs_f64(), Wanted::Anything, 2);
        let wanted = if side_px == 256 { Wanted::AtMost(3.0) } else { Wanted::Anything };
        report.row(&format!("{side_px} px, 2 threads, s"), two.as_secs_f64(), wanted, 2);
        let ratio = one.as_secs_f64() / two.as_secs_f64();
        report.row(&format!("{side_px} px, 1 thread over 2"), ratio, Wanted::AtLeast(wanted_ratio), 2);
    }
    report.section("CPU twin, 2 threads, seconds to the SAE that primg reaches with N=2500 at 256 px");
    for (name, sae) in PRIMG {
        let task = Task { target: gallery.target(name, 256), fly_count: 2_500, candidates: 1, evals: 10_000_000 };
        let (took, evals) = timed(&task, 2, Some(sae));
        report.row(&format!("{name}, {evals} evals"), took.as_secs_f64(), Wanted::AtMost(0.5), 3);
    }
    report.section("CPU twin, parrots, 256 px, N=2500, 2M evals, thousand evals per second");
    for candidates in [1, 8] {
        for threads in [1, 2] {
            let target = gallery.target("parrots", 256);
            let task = Task { target, fly_count: 2_500, candidates, evals: 2_000_000 };
            let (took, evals) = timed(&task, threads, None);
            let is_set = (candidates, threads) == (8, 1);
            let wanted = if is_set { Wanted::AtLeast(1_000.0) } else { Wanted::Anything };
            let what = format!("K={candidates}, {threads} threads");
            report.row(&what, evals as f64 / took.as_secs_f64() / 1e3, wanted, 0);
        }
    }
}
