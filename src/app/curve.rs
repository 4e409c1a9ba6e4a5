//! The curve of an evolution (paper Fig. 5): global fitness and spread over births, with the restarts.

use super::curve_file::Tabled;
use crate::engine::Observer;
use crate::error::Result;
use crate::evolve::{Evolution, Spread, StopReason};
use crate::plot::{Mark, Plot, Scale, Series};

/// About how many points a curve has, besides those of its restarts.
const POINTS: u64 = 500;

/// Where an evolution stood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub run: u32,
    pub births_in_run: u64,
    pub births: u64,
    /// Global fitness of the population.
    pub sae: u64,
    /// Global fitness of the best population since masks changed or tiles split for the last time: it rises there, and
    /// nowhere else.
    pub best_sae: u64,
    /// Tiles that take part.
    pub living: usize,
    /// How many restarts so far changed the masks.
    pub mask_changes: u32,
    pub spread: Spread,
}

/// Records the evolution of one lane: at its start and end, at every k-th birth, where k is a 500th of the births planned,
/// and at its restarts, or at every k-th of more than 500. So the points depend on nothing but births.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    lane: usize,
    points: Vec<Point>,
    next_birth: u64,
    next_run: u32,
}

impl Curve {
    /// The curve of `lane`, without a point.
    pub(super) fn new(lane: usize) -> Self {
        Self { lane, points: Vec::new(), next_birth: 0, next_run: 0 }
    }

    /// Adds the point of the end.
    pub(super) fn finish(&mut self, evolutions: &[Evolution]) {
        let point = Point::of(&evolutions[self.lane]);
        if self.points.last() != point.as_ref() {
            self.points.extend(point);
        }
    }

    /// The points, in the order of births.
    pub(super) fn into_points(self) -> Vec<Point> {
        self.points
    }

    fn look(&mut self, evolution: &Evolution) {
        let (births, run) = (evolution.outcome().births, evolution.outcome().restarts);
        if births < self.next_birth && run < self.next_run {
            return;
        }
        self.points.extend(Point::of(evolution));
        let every = (evolution.births_planned() / POINTS).max(1);
        self.next_birth = (births / every + 1) * every;
        let every_run = (evolution.restarts_planned() / POINTS as u32).max(1);
        self.next_run = (run / every_run + 1) * every_run;
    }
}

impl Tabled for Curve {
    fn csv(&self, status: &str, key: &str) -> String {
        let mut text = String::from(CSV_HEADER);
        for point in &self.points {
            let Point { run, births_in_run, births, sae, best_sae, spread, .. } = point;
            let clark_evans = spread.clark_evans.map(|index| format!("{index:.6}")).unwrap_or_default();
            let Spread { z, color, log_size, angle, .. } = spread;
            text += &format!(
                "{run},{births_in_run},{births},{sae},{best_sae},{clark_evans},{z:.6},{color:.6},{log_size:.6},{angle:.6},{status},{key}\n"
            );
        }
        text
    }

    fn plot(&self, title: String) -> Result<String> {
        let line = |label: &str, value: fn(&Point) -> u64| Series {
            label: label.to_owned(),
            points: self.points.iter().map(|point| (point.births as f64, value(point) as f64)).collect(),
        };
        let restarts = self.points.iter().zip(self.points.iter().skip(1)).filter(|(one, next)| one.run < next.run);
        let mark = |(one, next): (&Point, &Point)| Mark { x: next.births as f64, label: next.restart_after(one) };
        let values = self.points.iter().flat_map(|point| [point.sae as f64, point.best_sae as f64]);
        Plot {
            title,
            x_label: "births".to_owned(),
            y_label: "SAE".to_owned(),
            y_scale: Scale::fitting(values),
            series: vec![line("population", |point| point.sae), line("best population", |point| point.best_sae)],
            marks: restarts.map(mark).collect(),
        }
        .svg()
    }
}

/// The first line of a curve as CSV.
pub(super) const CSV_HEADER: &str =
    "run,births_in_run,births,sae,best_sae,clark_evans,z_spread,color_spread,log_size_spread,angle_spread,status,key\n";

impl Point {
    /// Where `evolution` stands, once it was evaluated.
    fn of(evolution: &Evolution) -> Option<Self> {
        Some(Self {
            run: evolution.outcome().restarts,
            births_in_run: evolution.births_in_run(),
            births: evolution.outcome().births,
            sae: evolution.sae()?,
            best_sae: evolution.best_sae()?,
            living: evolution.living(),
            mask_changes: evolution.mask_changes(),
            spread: evolution.spread(),
        })
    }
}

impl Point {
    /// What is said of the restart, or the last of several, between `before` and this point.
    fn restart_after(&self, before: &Self) -> String {
        let masks = if self.mask_changes == before.mask_changes { "" } else { ", new masks" };
        let split = if self.living == before.living { "" } else { ", tiles split" };
        format!("restart {}{split}{masks}", self.run)
    }
}

impl Observer for Curve {
    fn at_start(&mut self, evolutions: &[Evolution]) {
        self.look(&evolutions[self.lane]);
    }

    fn after_generation(&mut self, evolutions: &[Evolution]) -> Option<StopReason> {
        self.look(&evolutions[self.lane]);
        None
    }
}
