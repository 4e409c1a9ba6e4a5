//! Cells searches of 256x256 px with 2,500 tiles on a Vulkan device: 16 one by one, and as lanes that share its
//! dispatches.
//!
//! `cargo bench --bench cells_lanes -- [--lanes L] [--evals E] [--candidates K,..]`; `--evals` is the budget of each
//! search. Prints evals per second: the best of three runs, which take turns.

#![allow(clippy::print_stdout, reason = "a bench prints its table")]

mod common;

use std::time::Instant;

use clap::Parser;
use smalti::engine::{Crew, SearchTask, Task};
use smalti::evolve::cells::Budget;
use smalti::gpu::VulkanLanes;
use smalti::model::cells::Course;
use smalti::vk::Timing;

#[derive(Parser)]
struct Arguments {
    /// Searches.
    #[arg(long, default_value_t = 16)]
    lanes: u64,
    /// Evals of each.
    #[arg(long, default_value_t = 200_000)]
    evals: u64,
    /// Candidates of a step.
    #[arg(long, value_delimiter = ',', default_value = "1,8")]
    candidates: Vec<u32>,
    /// Said by cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Evals per second of searches of which so many are at work at once, each from nothing to the end of its budget.
fn speed(mut crew: Crew, course: &Course, (at_once, count): (usize, u64), evals: u64) -> f64 {
    let budget = Budget { evals, target_sae: None, patience: None };
    let mut course = course.clone();
    let mut tickets = 0..count;
    let mut made = 0;
    let begun = Instant::now();
    loop {
        while crew.len() < at_once
            && let Some(ticket) = tickets.next()
        {
            course.rules.seed = ticket;
            let task = Task::Search(SearchTask { course: course.clone(), first: None, budget });
            assert!(crew.admit(ticket, task).expect("it fits"), "no room for {ticket} lanes");
        }
        if crew.is_empty() {
            return made as f64 / begun.elapsed().as_secs_f64();
        }
        for finished in crew.step().expect("the device works") {
            made += finished.outcome.expect("no search fails").ending.evals();
        }
    }
}

fn main() {
    let device = common::device();
    let Arguments { lanes: lane_count, evals, candidates, .. } = Arguments::parse();
    let target = common::target(256, 256);
    for candidates in candidates {
        let course = common::cells::course(&target, "free", 2_500, candidates);
        let run = |at_once, (count, evals)| {
            let lanes = VulkanLanes::create(&device, Timing::Off).expect("the device works");
            speed(Crew::default().with_searches(Box::new(lanes)), &course, (at_once, count), evals)
        };
        // Shaders are compiled at their first use.
        run(2, (2, 1_000));
        let mut best = [0.0_f64; 2];
        for _ in 0..3 {
            for (best, at_once) in best.iter_mut().zip([1, lane_count as usize]) {
                *best = best.max(run(at_once, (lane_count, evals)));
            }
        }
        let [one, many] = best;
        println!(
            "{candidates} candidates: one by one {one:.0} evals/s, {lane_count} lanes {many:.0} evals/s ({:.2})",
            many / one
        );
    }
}
