//! The curve of an evolution (paper Fig. 5): error and spread over evals, with the restarts. In the paper's scheme
//! evals are births.

use crate::cli::files::curve_file::{CELLS_CSV_HEADER, PAPER_CSV_HEADER, Tabled};
use crate::error::Result;
use crate::evolve::{Evolution, Observer, Seen, Spread, StopReason, objective};
use crate::model::cells::Search;
use crate::plot::{Mark, Plot, Scale, Series};

/// About how many points a curve has, not counting those of its restarts.
const POINTS: u64 = 500;

/// The state of the evolution at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub run: u32,
    pub births_in_run: u64,
    pub rounds: u32,
    pub evals: u64,
    pub births: u64,
    /// Global fitness of the population.
    pub sae: u64,
    /// What the evolution lowers: the objective of a search, or in the paper's scheme the global fitness of the best
    /// population since masks last changed or tiles last split. It rises at these changes and nowhere else.
    pub lowered: i64,
    /// Tiles that live.
    pub living: usize,
    /// How many restarts so far changed the masks.
    pub mask_changes: u32,
    pub spread: Spread,
}

/// Which columns a curve has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Paper,
    Cells,
}

/// Records an evolution at its start and end, at every k-th eval, where k is a 500th of the planned evals, and at its
/// restarts (of more than 500 restarts, at every k-th). So the points depend on nothing but evals.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    kind: Kind,
    points: Vec<Point>,
    /// Evals between two points.
    every: u64,
    /// Evals from which the next point is due.
    next_eval: u64,
    next_run: u32,
}

impl Curve {
    /// An empty curve for an evolution that plans this many evals.
    pub fn new(evals_planned: u64) -> Self {
        let every = (evals_planned / POINTS).max(1);
        Self { kind: Kind::Cells, points: Vec::new(), every, next_eval: 0, next_run: 0 }
    }

    /// The points, in the order of evals.
    pub fn into_points(self) -> Vec<Point> {
        self.points
    }

    fn look(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        let stage = seen.stage();
        let restarts_planned = match seen {
            Seen::Evolutions(evolutions) => {
                self.kind = Kind::Paper;
                evolutions.first().map_or(0, Evolution::restarts_planned)
            }
            Seen::Search(_) => 0,
        };
        let is_restart = self.kind == Kind::Paper && stage.restarts >= self.next_run;
        if stage.evals < self.next_eval && !is_restart {
            return Ok(());
        }
        self.points.extend(Point::of(seen)?);
        self.next_eval = (stage.evals / self.every + 1) * self.every;
        let every_run = (restarts_planned / POINTS as u32).max(1);
        self.next_run = (stage.restarts / every_run + 1) * every_run;
        Ok(())
    }

    /// Whether the last point already shows where the evolution ended.
    fn is_finished(&self, point: &Point) -> bool {
        let counted = |point: &Point| (point.rounds, point.evals, point.births, point.lowered);
        self.points.last().is_some_and(|last| match self.kind {
            Kind::Paper => last == point,
            // The last step of a search spreads the depths, which changes the spread and nothing else.
            Kind::Cells => counted(last) == counted(point),
        })
    }
}

impl Tabled for Curve {
    fn csv(&self, status: &str, key: &str) -> String {
        let mut text = String::from(match self.kind {
            Kind::Paper => PAPER_CSV_HEADER,
            Kind::Cells => CELLS_CSV_HEADER,
        });
        for point in &self.points {
            let Point { run, births_in_run, rounds, evals, births, sae, lowered, living, spread, .. } = point;
            let clark_evans = spread.clark_evans.map(|index| format!("{index:.6}")).unwrap_or_default();
            let Spread { z, color, log_size, angle, .. } = spread;
            text += &match self.kind {
                Kind::Paper => format!("{run},{births_in_run},{births},{sae},{lowered},"),
                Kind::Cells => format!("{rounds},{evals},{births},{sae},{lowered},{living},"),
            };
            text += &format!("{clark_evans},{z:.6},{color:.6},{log_size:.6},{angle:.6},{status},{key}\n");
        }
        text
    }

    fn plot(&self, title: String) -> Result<String> {
        let line = |label: &str, value: fn(&Point) -> f64| Series {
            label: label.to_owned(),
            points: self.points.iter().map(|point| (point.evals as f64, value(point))).collect(),
        };
        let (sae, lowered) = (|point: &Point| point.sae as f64, |point: &Point| point.lowered as f64);
        let values = self.points.iter().flat_map(|point| [sae(point), lowered(point)]);
        let (unit, series) = match self.kind {
            Kind::Paper => ("births", vec![line("population", sae), line("best population", lowered)]),
            Kind::Cells if self.points.iter().all(|point| sae(point) == lowered(point)) => {
                ("evals", vec![line("SAE", sae)])
            }
            Kind::Cells => ("evals", vec![line("SAE", sae), line("objective", lowered)]),
        };
        let restarts = self.points.iter().zip(self.points.iter().skip(1)).filter(|(one, next)| one.run < next.run);
        let mark = |(one, next): (&Point, &Point)| Mark { x: next.evals as f64, label: next.restart_after(one) };
        Plot {
            title,
            x_label: unit.to_owned(),
            y_label: "SAE".to_owned(),
            y_scale: Scale::fitting(values),
            series,
            marks: restarts.map(mark).collect(),
        }
        .svg()
    }
}

impl Point {
    /// The state of the evolution now; none before the first evaluation.
    fn of(seen: &mut Seen<'_>) -> Result<Option<Self>> {
        match seen {
            Seen::Evolutions(evolutions) => Ok(evolutions.first().and_then(Self::of_evolution)),
            Seen::Search(search) => Self::of_search(&mut **search).map(Some),
        }
    }

    fn of_evolution(evolution: &Evolution) -> Option<Self> {
        let outcome = evolution.outcome();
        Some(Self {
            run: outcome.restarts,
            births_in_run: evolution.births_in_run(),
            rounds: 0,
            evals: outcome.births,
            births: outcome.births,
            sae: evolution.sae()?,
            lowered: evolution.best_sae()? as i64,
            living: evolution.living(),
            mask_changes: evolution.mask_changes(),
            spread: evolution.spread(),
        })
    }

    fn of_search(search: &mut dyn Search) -> Result<Self> {
        let sae = objective::sae(search)?;
        let flies = search.read_back()?.flies;
        let (target, standing) = (&search.course().target, search.standing());
        Ok(Self {
            run: 0,
            births_in_run: 0,
            rounds: standing.rounds,
            evals: standing.evals,
            births: standing.births,
            sae,
            lowered: standing.objective,
            living: flies.iter().filter(|fly| fly.alive).count(),
            mask_changes: 0,
            spread: Spread::of(&flies, target.width_px(), target.height_px()),
        })
    }

    /// The label of the restart between `before` and this point, or of the last one if there were several.
    fn restart_after(&self, before: &Self) -> String {
        let masks = if self.mask_changes == before.mask_changes { "" } else { ", new masks" };
        let split = if self.living == before.living { "" } else { ", tiles split" };
        format!("restart {}{split}{masks}", self.run)
    }
}

impl Observer for Curve {
    fn at_start(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        self.look(seen)
    }

    fn looks_at_rounds(&self) -> bool {
        true
    }

    fn after_round(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        self.look(seen).map(|()| None)
    }

    fn at_end(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        let point = Point::of(seen)?.filter(|point| !self.is_finished(point));
        self.points.extend(point);
        Ok(())
    }
}
