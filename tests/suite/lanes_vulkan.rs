//! Cells searches side by side on a Vulkan device come to what each comes to alone on the CPU, `==`.

use std::sync::Arc;

use smalti::cpu::cells::CpuSearch;
use smalti::engine::{Crew, Finished, SearchTask, Task};
use smalti::evolve::cells::{self, Budget, ROUNDS_PER_EPOCH};
use smalti::evolve::{Ended, StopReason, Undisturbed};
use smalti::gpu::{CellForm, CellShape, VulkanLanes};
use smalti::model::Fly;
use smalti::model::cells::rules::BirthKind;
use smalti::model::cells::{Course, OneLane, Search, SearchLanes};
use smalti::vk::{Device, DeviceOptions, Timing};

use crate::cells_vulkan::{check_equal, course, courses, first_flies, narrow, parrots, star};
use crate::{canary, glazed_vulkan};

/// Searches of other sizes, numbers of flies, rules and styles, opaque and translucent.
fn mixed_courses() -> Vec<(String, Course)> {
    let sized = [(64, 64, 40, 8), (149, 40, 300, 1), (33, 120, 50, 2)].map(|(width, height, fly_count, candidates)| {
        let course = course(star(width, height), fly_count, |rules| rules.candidates = candidates);
        (format!("a star of {width}x{height} px"), course)
    });
    let named = courses().into_iter().chain(glazed_vulkan::courses());
    let mut all: Vec<(String, Course)> = named.map(|(name, course)| (name.to_owned(), course)).collect();
    // Those that are alike do not lie side by side from the beginning.
    all.splice(4..4, sized);
    all
}

/// Flies to begin with, where births need some.
fn given_flies(course: &Course) -> Option<Vec<Fly>> {
    (course.rules.births.kind == BirthKind::Mutant).then(|| first_flies(course))
}

/// The twin of a lane after so many rounds, with depths spread after each `spread_every`.
fn twin_after(course: &Course, rounds: u32, spread_every: u32) -> CpuSearch {
    let mut twin = CpuSearch::new(course.clone());
    if let Some(flies) = given_flies(course) {
        twin.load(&flies).expect("the twin works");
    }
    for round in 1..=rounds {
        twin.advance(1).expect("the twin works");
        if round.is_multiple_of(spread_every) {
            twin.renormalise().expect("the twin works");
        }
    }
    twin
}

fn admit(lanes: &mut VulkanLanes, course: &Course, shape: CellShape) -> usize {
    let flies = given_flies(course);
    let admitted = lanes.admit_with_shape(course.clone(), flies.as_deref(), shape);
    admitted.expect("it fits").expect("there is room")
}

/// Lets all lanes come to the end of their rounds, and spreads the depths of each as soon as it is there.
fn finish(lanes: &mut VulkanLanes, mut busy: Vec<usize>) {
    while !busy.is_empty() {
        lanes.work().expect("the device works");
        let (still_busy, done): (Vec<_>, Vec<_>) = busy.into_iter().partition(|&lane| lanes.is_busy(lane));
        lanes.renormalise(&done).expect("the device works");
        busy = still_busy;
    }
}

#[test]
fn lanes_of_all_styles_and_sizes_come_to_the_twins_state_side_by_side() {
    canary::with_device(&DeviceOptions::default(), |device| all_side_by_side(&device));
}

/// Hardware spreads depths itself, and its submissions follow the time that they take.
#[test]
fn lanes_of_hardware_come_to_the_twins_state_side_by_side() {
    canary::with_hardware(|device| all_side_by_side(&device));
}

fn all_side_by_side(device: &Arc<Device>) {
    let all = mixed_courses();
    let mut lanes = VulkanLanes::create(device, Timing::Off).expect("the device works");
    let wide = CellShape { lanes: 32, form: CellForm::Wide, budget: 60_000 };
    let shape = |place: usize| if place % 3 == 1 { wide } else { narrow(device) };
    let taken: Vec<usize> =
        all.iter().enumerate().map(|(place, (_, course))| admit(&mut lanes, course, shape(place))).collect();
    for rounds in [2, 4] {
        for &lane in &taken {
            lanes.ask(lane, 2).expect("the device works");
        }
        finish(&mut lanes, taken.clone());
        for ((name, course), &lane) in all.iter().zip(&taken) {
            let mut twin = twin_after(course, rounds, 2);
            let mut lane = OneLane { lanes: &mut lanes, lane };
            check_equal(&mut twin, &mut lane, &format!("{name} after {rounds} rounds"));
        }
    }
}

/// Lanes of a small budget, so that a submission ends in the middle of a round.
fn refill_mid_round(device: &Arc<Device>) {
    let shape = CellShape { budget: 25_000, ..narrow(device) };
    let all = mixed_courses();
    let mut lanes = VulkanLanes::create(device, Timing::Off).expect("the device works");
    let mut taken: Vec<(usize, usize)> = (0..4).map(|place| (place, admit(&mut lanes, &all[place].1, shape))).collect();
    for &(_, lane) in &taken {
        lanes.ask(lane, 3).expect("the device works");
    }
    let is_mid_round = |lanes: &VulkanLanes, lane: usize| lanes.is_busy(lane) && lanes.standing(lane).evals > 0;
    for (next, (_, course)) in all.iter().enumerate().skip(4) {
        lanes.work().expect("the device works");
        let (_, leaving) = taken.remove(0);
        lanes.dismiss(leaving);
        let lane = admit(&mut lanes, course, shape);
        lanes.ask(lane, 3).expect("the device works");
        taken.push((next, lane));
        if next == 4 {
            assert!(taken.iter().any(|&(_, lane)| is_mid_round(&lanes, lane)), "all lanes were between rounds");
        }
    }
    finish(&mut lanes, taken.iter().map(|&(_, lane)| lane).collect());
    for (place, lane) in taken {
        let (name, course) = &all[place];
        let mut twin = twin_after(course, 3, 3);
        check_equal(&mut twin, &mut OneLane { lanes: &mut lanes, lane }, &format!("{name}, refilled"));
    }
}

#[test]
fn lanes_that_are_refilled_while_others_are_in_mid_round_disturb_nobody() {
    canary::with_device(&DeviceOptions::default(), |device| refill_mid_round(&device));
}

/// Depths that a device is still to spread must not be those of whoever comes next to the same place.
#[test]
fn lanes_that_come_and_go_after_hardware_was_to_spread_depths_disturb_nobody() {
    canary::with_hardware(|device| {
        let shape = narrow(&device);
        let all = mixed_courses();
        let mut lanes = VulkanLanes::create(&device, Timing::Off).expect("the device works");
        for pair in all.chunks_exact(2).take(6) {
            let taken: Vec<usize> = pair.iter().map(|(_, course)| admit(&mut lanes, course, shape)).collect();
            taken.iter().for_each(|&lane| lanes.ask(lane, 2).expect("the device works"));
            finish(&mut lanes, taken.clone());
            // Nothing was submitted since. One lane leaves, another one goes on.
            lanes.dismiss(taken[0]);
            let next = admit(&mut lanes, &pair[0].1, shape);
            for lane in [next, taken[1]] {
                lanes.ask(lane, 2).expect("the device works");
            }
            finish(&mut lanes, vec![next, taken[1]]);
            for (lane, (name, course), rounds) in [(next, &pair[0], 2), (taken[1], &pair[1], 4)] {
                let mut twin = twin_after(course, rounds, 2);
                check_equal(&mut twin, &mut OneLane { lanes: &mut lanes, lane }, name);
                lanes.dismiss(lane);
            }
        }
    });
}

#[test]
fn a_lane_that_fails_ends_alone() {
    let course = course(star(64, 64), 40, |_| {});
    canary::with_device(&DeviceOptions::default(), |device| {
        let mut lanes = VulkanLanes::create(&device, Timing::Off).expect("the device works");
        let failing = admit(&mut lanes, &course, CellShape { budget: 150, ..narrow(&device) });
        let lane = admit(&mut lanes, &course, narrow(&device));
        for lane in [failing, lane] {
            lanes.ask(lane, 3).expect("the device works");
        }
        finish(&mut lanes, vec![lane]);
        let told = lanes.failure(failing).expect("a step cannot fit").to_string();
        assert!(told.contains("a step of cell") && !lanes.is_busy(failing), "{told}");
        assert!(lanes.ask(failing, 1).is_err() && lanes.failure(lane).is_none());
        lanes.dismiss(failing);
        check_equal(&mut twin_after(&course, 3, 3), &mut OneLane { lanes: &mut lanes, lane }, "beside a failure");
    });
}

#[test]
fn lanes_wait_while_the_device_is_full_and_refuse_what_it_can_never_hold() {
    let small = |side| course(star(side, side), 60, |_| {});
    let large = course(star(1_024, 1_000), 300, |_| {});
    canary::with_device(&DeviceOptions::default(), |device| {
        assert_eq!(device.info().limits.storage_buffer_bytes, 128 << 20, "the sizes here are for this limit");
        let mut lanes = VulkanLanes::create(&device, Timing::Off).expect("the device works");
        // Lanes with cells of another shape have buffers of their own. At this width all steps are short enough for any
        // subgroup.
        let shape = CellShape { lanes: 64, form: CellForm::Wide, ..narrow(&device) };
        let try_admit = |lanes: &mut VulkanLanes, course: &Course| lanes.admit_with_shape(course.clone(), None, shape);
        let first = try_admit(&mut lanes, &small(96)).expect("it fits").expect("there is room");
        lanes.ask(first, 2).expect("the device works");
        lanes.work().expect("the device works");
        let second = try_admit(&mut lanes, &large).expect("it fits").expect("there is room");
        // No buffer could hold the stacks of all, so this one has others.
        let third = try_admit(&mut lanes, &small(200)).expect("it fits").expect("there is room");
        lanes.ask(third, 1).expect("the device works");
        finish(&mut lanes, vec![first, third]);
        for (lane, side, rounds, what) in [(first, 96, 2, "moved"), (third, 200, 1, "apart")] {
            check_equal(&mut twin_after(&small(side), rounds, rounds), &mut OneLane { lanes: &mut lanes, lane }, what);
        }
        let gigantic = course(star(1_100, 1_000), 300, |_| {});
        for lane in [first, second, third] {
            assert_eq!(try_admit(&mut lanes, &gigantic).expect("nobody knows yet"), None);
            lanes.dismiss(lane);
        }
        let told = try_admit(&mut lanes, &gigantic).expect_err("it is too large").to_string();
        assert!(told.contains("storage buffers end at"), "{told}");
        let third = try_admit(&mut lanes, &small(200)).expect("it fits").expect("there is room");
        lanes.ask(third, 1).expect("the device works");
        finish(&mut lanes, vec![third]);
        check_equal(
            &mut twin_after(&small(200), 1, 1),
            &mut OneLane { lanes: &mut lanes, lane: third },
            "in its place",
        );
    });
}

/// What a search comes to alone on the CPU.
fn alone(course: &Course, first: Option<&[Fly]>, budget: &Budget) -> Ended {
    let mut search = CpuSearch::new(course.clone());
    let stop = cells::run(&mut search, first, budget, &mut Undisturbed).expect("the twin works");
    Ended::of_search(&mut search, stop).expect("the twin works")
}

fn task(course: &Course, first: Option<&[Fly]>, budget: Budget) -> Task {
    Task::Search(SearchTask { course: course.clone(), first: first.map(<[Fly]>::to_vec), budget })
}

/// Courses with budgets that end them for every reason, in the middle of an epoch and at its end.
fn jobs() -> Vec<(Course, Option<Vec<Fly>>, Budget)> {
    let evals = |evals| Budget { evals, target_sae: None, patience: None };
    let mut jobs: Vec<_> = mixed_courses()
        .into_iter()
        .zip([700, 3_000, 1_500, 5_000].into_iter().cycle())
        .map(|((_, course), count)| (course.clone(), given_flies(&course), evals(count)))
        .collect();
    let plain = || course(parrots(180, 120, 70, 50), 90, |_| {});
    let far = Budget { evals: u64::MAX, target_sae: None, patience: None };
    jobs.push((plain(), None, evals(0)));
    jobs.push((plain(), None, Budget { target_sae: Some(400_000), ..far }));
    jobs.push((plain(), None, Budget { patience: Some(2_000), evals: 60_000, ..far }));
    jobs.push((course(star(40, 40), 30, |rules| rules.steps_per_fly = 0), None, far));
    jobs.push((plain(), Some(first_flies(&plain())), evals(4_000)));
    jobs
}

#[test]
fn a_crew_that_is_refilled_comes_to_what_each_search_comes_to_alone() {
    let jobs = jobs();
    let mut found: Vec<Finished> = Vec::new();
    canary::with_device(&DeviceOptions::default(), |device| {
        let lanes = VulkanLanes::create(&device, Timing::Off).expect("the device works");
        let mut crew = Crew::default().with_searches(Box::new(lanes));
        let mut waiting = (0_u64..).zip(&jobs);
        let too_large = course(star(64, 64), 480_001, |_| {});
        loop {
            while crew.len() < 5 {
                let Some((ticket, (course, first, budget))) = waiting.next() else { break };
                let admitted = crew.admit(ticket, task(course, first.as_deref(), *budget));
                assert!(admitted.expect("it fits"), "there is room for five");
                assert!(crew.admit(99, task(&too_large, None, *budget)).is_err());
            }
            if crew.is_empty() {
                break;
            }
            found.extend(crew.step().expect("the device works"));
        }
    });
    assert_eq!(found.len(), jobs.len());
    let mut reasons = Vec::new();
    for Finished { ticket, outcome } in found {
        let (course, first, budget) = &jobs[ticket as usize];
        let expected = alone(course, first.as_deref(), budget);
        let ended = outcome.expect("no search fails");
        assert_eq!(ended.ending, expected.ending, "{ticket}");
        assert!(ended == expected, "the flies of search {ticket} differ");
        reasons.push(ended.ending.stop);
    }
    for reason in [StopReason::Evals, StopReason::TargetSae, StopReason::Patience, StopReason::Dry] {
        assert!(reasons.contains(&reason), "no search ended by {reason:?}");
    }
}

#[test]
fn a_crew_that_is_cancelled_is_empty_and_takes_others() {
    let course = course(star(64, 64), 40, |_| {});
    let budget = Budget { evals: 10_000, target_sae: None, patience: None };
    canary::with_device(&DeviceOptions::default(), |device| {
        let lanes = VulkanLanes::create(&device, Timing::Off).expect("the device works");
        let mut crew = Crew::default().with_searches(Box::new(lanes));
        for ticket in [7, 8] {
            assert!(crew.admit(ticket, task(&course, None, budget)).expect("it fits"));
        }
        assert!(crew.step().expect("the device works").is_empty());
        assert_eq!(crew.len(), 2);
        crew.cancel_all();
        assert!(crew.is_empty());
        assert!(crew.admit(9, task(&course, None, budget)).expect("it fits"));
        let ended = loop {
            if let Some(Finished { ticket: 9, outcome }) = crew.step().expect("the device works").pop() {
                break outcome.expect("it does not fail");
            }
        };
        assert!(ended == alone(&course, None, &budget));
    });
}

#[test]
fn the_stages_of_a_timed_submission_have_the_stems_of_their_shaders() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let mut lanes = VulkanLanes::create(&device, Timing::On).expect("the device works");
        let courses = [course(star(64, 64), 40, |_| {}), glazed_vulkan::courses()[0].1.clone()];
        let taken: Vec<usize> = courses.iter().map(|course| admit(&mut lanes, course, narrow(&device))).collect();
        let mut seen = Vec::new();
        for &lane in &taken {
            lanes.ask(lane, ROUNDS_PER_EPOCH).expect("the device works");
            while lanes.is_busy(lane) {
                lanes.work().expect("the device works");
                seen.extend(lanes.pass_times().iter().map(|time| time.name));
            }
            lanes.renormalise(&[lane]).expect("the device works");
        }
        lanes.dismiss(taken[0]);
        lanes.ask(taken[1], 1).expect("the device works");
        lanes.work().expect("the device works");
        let names = lanes.pass_times().iter().map(|time| time.name);
        // Through staging buffers there are copies, too.
        let last: Vec<&str> = names.filter(|name| !["uploads", "read-backs"].contains(name)).collect();
        let stems = ["cells_depths", "cells_deal", "cells_scan", "cells_scatter", "cells_sort", "cells_glazed"];
        assert_eq!(last[..6], stems);
        assert_eq!(last[6..8], ["cells_fitness", "cells_fitness"]);
        assert!(["cells", "cells_glazed", "cells_depths"].iter().all(|stem| seen.contains(stem)), "{seen:?}");
    });
}
