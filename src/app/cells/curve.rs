//! The curve of a search: objective, SAE and spread over evals.

use crate::app::curve_file::Tabled;
use crate::error::Result;
use crate::evolve::{Spread, StopReason, cells};
use crate::model::cells::{Search, Standing};
use crate::plot::{Plot, Scale, Series};

/// About how many points a curve has at most.
const POINTS: u64 = 500;

/// The first line of a curve as CSV.
pub(in crate::app) const CSV_HEADER: &str = "rounds,evals,births,sae,objective,living,clark_evans,z_spread,color_spread,log_size_spread,angle_spread,status,key\n";

/// Where a search stood.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    standing: Standing,
    sae: u64,
    /// Flies that are not absent.
    living: usize,
    spread: Spread,
}

impl Point {
    fn sae(&self) -> f64 {
        self.sae as f64
    }

    fn objective(&self) -> f64 {
        self.standing.objective as f64
    }
}

/// Records a search at its start and end and after every round, or after every k-th of more than 500 evals.
#[derive(Clone, Debug)]
pub(super) struct SearchCurve {
    points: Vec<Point>,
    /// Evals between two points.
    every: u64,
    /// Evals from which the next one is due.
    due: u64,
}

impl SearchCurve {
    /// The curve of a search of so many evals, without a point.
    pub(super) fn new(evals_planned: u64) -> Self {
        Self { points: Vec::new(), every: (evals_planned / POINTS).max(1), due: 0 }
    }

    /// Adds the point of the end.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn finish(&mut self, search: &mut dyn Search) -> Result<()> {
        let is_there = self.points.last().is_some_and(|point| point.standing == search.standing());
        if is_there { Ok(()) } else { self.add(search) }
    }

    fn look(&mut self, search: &mut dyn Search) -> Result<()> {
        let evals = search.standing().evals;
        if evals < self.due {
            return Ok(());
        }
        self.due = (evals / self.every + 1) * self.every;
        self.add(search)
    }

    fn add(&mut self, search: &mut dyn Search) -> Result<()> {
        let sae = cells::sae(search)?;
        let flies = search.read_back()?.flies;
        let target = &search.course().target;
        let spread = Spread::of(&flies, target.width_px(), target.height_px());
        let living = flies.iter().filter(|fly| fly.alive).count();
        self.points.push(Point { standing: search.standing(), sae, living, spread });
        Ok(())
    }
}

impl cells::Observer for SearchCurve {
    fn at_start(&mut self, search: &mut dyn Search) -> Result<()> {
        self.look(search)
    }

    fn looks_at_rounds(&self) -> bool {
        true
    }

    fn after_round(&mut self, search: &mut dyn Search) -> Result<()> {
        self.look(search)
    }

    fn after_epoch(&mut self, _search: &mut dyn Search) -> Result<Option<StopReason>> {
        Ok(None)
    }
}

impl Tabled for SearchCurve {
    fn csv(&self, status: &str, key: &str) -> String {
        let mut text = String::from(CSV_HEADER);
        for Point { standing, sae, living, spread } in &self.points {
            let Standing { rounds, evals, births, objective, .. } = standing;
            let clark_evans = spread.clark_evans.map(|index| format!("{index:.6}")).unwrap_or_default();
            let Spread { z, color, log_size, angle, .. } = spread;
            text += &format!(
                "{rounds},{evals},{births},{sae},{objective},{living},{clark_evans},{z:.6},{color:.6},{log_size:.6},{angle:.6},{status},{key}\n"
            );
        }
        text
    }

    fn plot(&self, title: String) -> Result<String> {
        let line = |label: &str, value: fn(&Point) -> f64| Series {
            label: label.to_owned(),
            points: self.points.iter().map(|point| (point.standing.evals as f64, value(point))).collect(),
        };
        let mut series = vec![line("SAE", Point::sae)];
        if self.points.iter().any(|point| point.sae() != point.objective()) {
            series.push(line("objective", Point::objective));
        }
        let values = self.points.iter().flat_map(|point| [point.sae(), point.objective()]);
        Plot {
            title,
            x_label: "evals".to_owned(),
            y_label: "SAE".to_owned(),
            y_scale: Scale::fitting(values),
            series,
            marks: Vec::new(),
        }
        .svg()
    }
}
