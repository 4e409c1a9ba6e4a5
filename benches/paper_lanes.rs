//! Births per second of the paper's scheme on a Vulkan device, for 256x256 px, 2,500 flies and one birth per
//! generation. It measures 1, 4, 16 and 64 lanes in turn, several times over; numbers after `--` override these. The
//! time to create buffers and pipelines, and that of the first evaluation, does not count.

#![allow(clippy::print_stdout, reason = "a bench prints its table")]

mod common;

use std::time::Instant;

use smalti::engine::Engine;
use smalti::evolve::evolution::random_population;
use smalti::evolve::{Evolution, Observer, PaperScheme, Seen};
use smalti::gpu::GpuEvaluator;

/// Births of all lanes together that are timed.
const BIRTHS: u64 = 24_000;
const ROUNDS: usize = 5;

/// Begins to count when the first populations were evaluated.
#[derive(Default)]
struct Clock(Option<Instant>);

impl Observer for Clock {
    fn at_start(&mut self, _seen: &mut Seen<'_>) -> smalti::Result<()> {
        self.0 = Some(Instant::now());
        Ok(())
    }
}

fn main() {
    let device = common::device();
    let (scene, _) = common::scene(256, 256, 2_500);
    let named: Vec<usize> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    let lane_counts = if named.is_empty() { vec![1, 4, 16, 64] } else { named };
    let mut rates = vec![Vec::new(); lane_counts.len()];
    for _ in 0..ROUNDS {
        for (lanes, rates) in lane_counts.iter().copied().zip(&mut rates) {
            let evaluator = GpuEvaluator::create(&device, vec![scene.clone(); lanes]).expect("it fits");
            let births = (BIRTHS / lanes as u64).min(6_000);
            let evolution = |lane| {
                let scheme = PaperScheme { births, seed: lane as u64, ..PaperScheme::default() };
                Evolution::new(scheme, lane, 256, 256, random_population(256, 256, 2_500, lane as u64))
            };
            let mut engine = Engine::new(Box::new(evaluator), (0..lanes).map(evolution).collect());
            let mut clock = Clock::default();
            engine.run(&mut clock).expect("the evaluator works");
            let seconds = clock.0.expect("it began").elapsed().as_secs_f64();
            rates.push((births * lanes as u64) as f64 / seconds);
        }
    }
    for (lanes, rates) in lane_counts.iter().zip(&mut rates) {
        rates.sort_by(f64::total_cmp);
        let (low, median, high) = (rates[0], rates[ROUNDS / 2], rates[ROUNDS - 1]);
        println!("{lanes:2} lanes: {median:7.0} births/s ({low:.0} to {high:.0}), {:.1} us a birth", 1e6 / median);
    }
}
