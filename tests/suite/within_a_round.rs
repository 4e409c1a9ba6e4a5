//! Searches that are ended in the middle of a round: they come to what a budget of the evals that they tell comes to.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use smalti::StopReason;
use smalti::cpu::cells::CpuSearch;
use smalti::evolve::cells::{Budget, run};
use smalti::evolve::{Brake, Observer, Seen, Undisturbed};
use smalti::gpu::{CellShape, VulkanSearch};
use smalti::model::Fly;
use smalti::model::cells::{Course, Search};
use smalti::studio::{Recipe, work};
use smalti::vk::DeviceOptions;

use crate::canary;
use crate::cells_vulkan::{check_equal, course, first_flies, narrow, parrots, star};
use crate::translucent_search;
use crate::workshop::Workshop;

const ENDLESS: Budget = Budget { evals: u64::MAX, target_sae: None, patience: None };

/// Ends a search when its brake was asked so many times.
struct AfterLooks {
    left: Arc<AtomicU64>,
    looks_at_rounds: bool,
}

impl AfterLooks {
    fn new(looks: u64, looks_at_rounds: bool) -> Self {
        Self { left: Arc::new(AtomicU64::new(looks)), looks_at_rounds }
    }
}

impl Observer for AfterLooks {
    fn looks_at_rounds(&self) -> bool {
        self.looks_at_rounds
    }

    fn brake(&self) -> Brake {
        let left = Arc::clone(&self.left);
        let less = |left: u64| left.checked_sub(1);
        let is_over = move || left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less).is_err();
        Brake::new(move || is_over().then_some(StopReason::Time))
    }

    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> smalti::Result<Option<StopReason>> {
        assert!(seen.stage().evals < 1_000_000, "the brake ends it");
        Ok(None)
    }
}

/// Ends searches after these numbers of looks, and compares each with one that a budget ends; then both go on. Returns
/// the numbers of rounds after which they ended.
fn check(
    begin: &mut dyn FnMut() -> Box<dyn Search>,
    course: &Course,
    first: Option<&[Fly]>,
    looks: impl Iterator<Item = u64>,
) -> Vec<u32> {
    let mut rounds = Vec::new();
    for looks in looks {
        let mut cut = begin();
        let mut observer = AfterLooks::new(looks, looks % 2 == 1);
        let reason = run(&mut *cut, first, &ENDLESS, &mut observer).expect("the device works");
        assert_eq!(reason, StopReason::Time);
        let mut spent = CpuSearch::new(course.clone());
        let budget = Budget { evals: cut.standing().evals, ..ENDLESS };
        run(&mut spent, first, &budget, &mut Undisturbed).expect("the twin works");
        let when = format!("after {looks} looks");
        rounds.push(cut.standing().rounds);
        // Before and after the pixels are put right.
        assert_eq!(cut.read_back().unwrap(), spent.read_back().unwrap(), "{when}");
        assert_eq!(cut.sae().unwrap(), spent.read_back_stacks().unwrap().sae(course), "SAE {when}");
        check_equal(&mut spent, &mut *cut, &when);
        for search in [&mut *cut, &mut spent] {
            search.advance(1).expect("the device works");
            search.renormalise().expect("the device works");
        }
        check_equal(&mut spent, &mut *cut, &format!("one round later than {when}"));
    }
    rounds
}

/// Opaque tiles, plain and dressed with penalties and weights, and translucent ones.
fn courses() -> [(&'static str, Course); 3] {
    let uneven = Arc::new(translucent_search::uneven(150, 130));
    let mosaic = work(&uneven, &Recipe::mosaic().tiles(300).seed(3)).expect("the recipe is right").course;
    [
        ("plain", course(parrots(60, 80, 150, 130), 300, |_| {})),
        ("mosaic", mosaic),
        ("translucent", translucent_search::course(translucent_search::uneven(110, 90), 120)),
    ]
}

#[test]
fn a_search_that_is_cut_in_a_round_is_where_a_budget_of_its_evals_ends_with_any_number_of_threads() {
    for (name, course) in courses() {
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a small pool");
            let rounds = pool.install(|| {
                let mut begin = || -> Box<dyn Search> { Box::new(CpuSearch::new(course.clone())) };
                check(&mut begin, &course, None, (0..9).chain([24, 51]))
            });
            assert!(rounds.contains(&0) && rounds.iter().any(|rounds| *rounds > 1), "{name}: {rounds:?}");
        }
    }
}

#[test]
fn a_search_that_begins_with_flies_and_is_cut_in_its_first_round_keeps_them_as_they_were() {
    for (name, course) in courses() {
        let first = first_flies(&course);
        let mut begin = || -> Box<dyn Search> { Box::new(CpuSearch::new(course.clone())) };
        let rounds = check(&mut begin, &course, Some(&first), 0..8);
        assert!(rounds.iter().filter(|rounds| **rounds == 0).count() > 1, "{name}: {rounds:?}");
    }
}

#[test]
fn a_search_on_a_device_is_cut_to_where_a_round_of_the_twin_ends() {
    for (name, course) in courses() {
        let first = first_flies(&course);
        canary::with_device(&DeviceOptions::default(), |device| {
            let shape = CellShape { budget: 25_000, ..narrow(&device) };
            let mut begin = || -> Box<dyn Search> {
                Box::new(VulkanSearch::with_shape(&device, course.clone(), shape).expect("it fits"))
            };
            let rounds = check(&mut begin, &course, None, [0, 1, 2, 5, 9, 14].into_iter());
            assert!(rounds.contains(&0) && rounds.iter().any(|rounds| *rounds > 1), "{name}: {rounds:?}");
            check(&mut begin, &course, Some(&first), [1, 4].into_iter());
        });
    }
}

#[test]
fn a_round_of_many_cells_takes_several_submissions_and_may_be_cut_between_them() {
    let course = course(star(544, 520), 8_600, |rules| rules.steps_per_fly = 1);
    canary::with_device(&DeviceOptions::default(), |device| {
        let mut begin =
            || -> Box<dyn Search> { Box::new(VulkanSearch::new(&device, course.clone()).expect("it fits")) };
        let rounds = check(&mut begin, &course, None, [1, 3, 8].into_iter());
        assert!(rounds.contains(&0) && rounds.iter().any(|rounds| *rounds > 1), "{rounds:?}");
    });
}

#[test]
fn the_row_of_a_picture_that_the_clock_ended_tells_the_evals_that_make_it_again() {
    let workshop = Workshop::new();
    workshop.paint("large.png", 400, 300);
    let row = |rest: &str| workshop.run(&format!("evolve large.png -n 900 {rest} --force --json")).row();
    let flies = |name| smalti::archive::read(&workshop.path(name)).unwrap().population.flies;
    for time in ["1ms", "400ms"] {
        let evals = row(&format!("-o a.png -o a.npz --time {time}"))["evals"].as_u64().unwrap();
        row(&format!("-o b.png -o b.npz --evals {evals}"));
        assert_eq!(workshop.pixels("a.png"), workshop.pixels("b.png"), "{evals} evals");
        assert_eq!(flies("a.npz"), flies("b.npz"), "{evals} evals");
    }
}
