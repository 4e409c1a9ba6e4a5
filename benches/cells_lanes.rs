//! Cells searches of 256x256 px with 2,500 tiles on a Vulkan device: one alone, and 16 that share its dispatches.
//!
//! `cargo bench --bench cells_lanes -- [--lanes L] [--evals E] [--candidates K]`; evals are those of each search.

mod common;

use std::time::Instant;

use smalti::engine::SearchCrew;
use smalti::evolve::cells::Budget;
use smalti::evolve::style::Style;
use smalti::gpu::VulkanLanes;
use smalti::model::cells::Course;
use smalti::vk::Timing;

/// The number after a flag.
fn given(flag: &str) -> Option<u64> {
    let mut arguments = std::env::args().skip_while(|argument| argument != flag);
    arguments.nth(1).map(|value| value.parse().unwrap_or_else(|_| panic!("{flag}: {value} is no number")))
}

/// Seconds and evals of so many searches at once, each from nothing to the end of its budget.
fn search(lanes: VulkanLanes, course: &Course, (lane_count, evals): (u64, u64)) -> (f64, u64) {
    let mut crew = SearchCrew::new(Box::new(lanes));
    let budget = Budget { evals, target_sae: None, patience: None };
    let mut course = course.clone();
    let begun = Instant::now();
    for ticket in 0..lane_count {
        course.rules.seed = ticket;
        assert!(crew.admit(ticket, course.clone(), (None, budget)).expect("it fits"), "no room for {ticket} lanes");
    }
    let mut made = 0;
    while !crew.is_empty() {
        for finished in crew.step().expect("the device works") {
            made += finished.outcome.expect("no search fails").standing.evals;
        }
    }
    (begun.elapsed().as_secs_f64(), made)
}

fn main() {
    let device = common::device();
    let lane_count = given("--lanes").unwrap_or(16);
    let evals = given("--evals").unwrap_or(200_000);
    let target = common::target(256, 256);
    for candidates in given("--candidates").map_or(vec![1, 8], |candidates| vec![candidates as u32]) {
        let course = common::cells::course(&target, &Style::free(), 2_500, candidates);
        let run = |counts| {
            let lanes = VulkanLanes::create(&device, Timing::Off).expect("the device works");
            let (seconds, made) = search(lanes, &course, counts);
            made as f64 / seconds
        };
        // Shaders are compiled at their first use.
        run((1, 1_000));
        let mut best = [0.0_f64; 2];
        for _ in 0..3 {
            for (best, count) in best.iter_mut().zip([1, lane_count]) {
                *best = best.max(run((count, evals)));
            }
        }
        let [one, many] = best;
        println!(
            "{candidates} candidates: 1 lane {one:.0} evals/s, {lane_count} lanes {many:.0} evals/s ({:.2})",
            many / one
        );
    }
}
