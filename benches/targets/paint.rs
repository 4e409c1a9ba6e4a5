//! Brush strokes against those of GIMPressionist.

use smalti::model::cells::Search;

use crate::report::{Report, Wanted};
use crate::{Gallery, Task, drawn_sae};

/// Picture, strokes, and the SAE of GIMPressionist (GIMP 2.10) with a square brush and tuned settings at 256x256.
const RIVAL: [(&str, usize, f64); 4] = [
    ("parrots", 2_500, 1_921_984.0),
    ("woman", 2_500, 1_725_340.0),
    ("parrots", 500, 2_980_576.0),
    ("woman", 500, 2_536_908.0),
];

pub fn measure(gallery: &Gallery, report: &mut Report) {
    report.section("SAE of the style paint, 256 px, 400 evals per stroke");
    for (name, fly_count, sae) in RIVAL {
        let evals = 400 * fly_count as u64;
        let task = Task { target: gallery.target(name, 256), fly_count, candidates: 1, evals };
        let (mut search, _) = task.search("paint", None);
        let painted = drawn_sae(&mut search);
        let living = search.read_back().expect("the search works").flies.iter().filter(|fly| fly.alive).count();
        report.row(&format!("{name}, N={fly_count}, {living} strokes"), painted as f64, Wanted::AtMost(sae), 0);
    }
}
