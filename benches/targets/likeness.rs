//! How close the style `free` comes.

use crate::report::{Report, Wanted};
use crate::{Gallery, Task};

/// Name, and the largest SAE at 256x256 with 2,500 tiles and at 512x512 with 5,000, after two million evals.
const LIMITS: [(&str, [f64; 2]); 5] = [
    ("star", [12_000.0, 55_000.0]),
    ("yin_yang", [35_000.0, 160_000.0]),
    ("hats", [380_000.0, 1_850_000.0]),
    ("parrots", [600_000.0, 2_500_000.0]),
    ("woman", [640_000.0, 3_050_000.0]),
];
/// With eight candidates a step the SAE may be so much larger.
const SLACK: f64 = 1.08;
const EVALS: u64 = 2_000_000;

pub fn measure(gallery: &Gallery, report: &mut Report) {
    for (size, (side_px, fly_count)) in [(256, 2_500), (512, 5_000)].into_iter().enumerate() {
        for (candidates, slack) in [(1, 1.0), (8, SLACK)] {
            report.section(&format!("SAE, {side_px} px, N={fly_count}, K={candidates}, 2M evals"));
            for (name, limits) in LIMITS {
                let task = Task { target: gallery.target(name, side_px), fly_count, candidates, evals: EVALS };
                report.row(name, task.free_sae() as f64, Wanted::AtMost(limits[size] * slack), 0);
            }
        }
    }
}
