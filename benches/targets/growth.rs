//! Whether the cost of an eval grows with the picture or the number of tiles, while tiles keep their size.

use std::sync::Arc;
use std::time::Instant;

use smalti::cpu::cells::CpuSearch;
use smalti::model::Target;
use smalti::model::cells::Search;

use crate::report::{Report, Wanted};
use crate::{Gallery, common};

/// Rounds of four steps per tile that are timed.
const ROUNDS: u32 = 8;

/// The picture again and again, side by side, so that every size has the same to do per pixel.
fn repeated(target: &Target, side_px: u32) -> Arc<Target> {
    let (width_px, height_px) = (target.width_px(), target.height_px());
    let pixel = |x, y| target.pixels()[(y % height_px * width_px + x % width_px) as usize];
    let pixels = (0..side_px).flat_map(|y| (0..side_px).map(move |x| pixel(x, y))).collect();
    Arc::new(Target::new(side_px, side_px, pixels).expect("a valid size"))
}

pub fn measure(gallery: &Gallery, largest_px: u32, report: &mut Report) {
    report.section(
        "Nanoseconds per eval on all threads, parrots side by side, tiles of 5.12 px, first 32 steps per tile",
    );
    let mut side_px = 256;
    while side_px <= largest_px {
        let target = repeated(gallery.target("parrots", 256), side_px);
        let fly_count = 2_500 * (side_px as usize / 256).pow(2);
        let mut search = CpuSearch::new(common::cells::course(&target, "free", fly_count, 1));
        let began = Instant::now();
        search.advance(ROUNDS).expect("the search works");
        let took = began.elapsed();
        let cost_ns = took.as_nanos() as f64 / search.standing().evals as f64;
        report.row(&format!("{side_px} px, N={fly_count}"), cost_ns, Wanted::Anything, 0);
        side_px *= 2;
    }
}
