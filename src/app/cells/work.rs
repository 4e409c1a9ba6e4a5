//! The work of the `cells` scheme: search, draw, and check what was drawn.

use super::CellsOptions;
use super::curve::SearchCurve;
use crate::app::curve_file::Tabled;
use crate::app::device::{Opened, OpenedSearch, Selected};
use crate::app::job::Job;
use crate::app::options::{EvolveOptions, Verbosity};
use crate::app::prepared::check_messages;
use crate::app::progress::Progress;
use crate::app::provenance::{Course, Ending};
use crate::app::report::{self, Row};
use crate::app::result::{self, Evolved};
use crate::app::watch::{Watch, Watchers};
use crate::error::Result;
use crate::evolve::{Spread, cells};
use crate::model::cells::SearchState;

/// Searches for the mosaic of a job, records its curve if one is asked for, and draws it; the device is closed before it
/// returns.
pub(in crate::app) fn search_job(
    options: &EvolveOptions,
    job: &Job,
    (cells, selected): (&CellsOptions, &Selected),
    watchers: &mut Watchers<'_>,
    row: &mut Row,
) -> Result<Evolved> {
    let budget = cells.budget(job.fly_count);
    let mut watch = Watch::begin(watchers, options.time_limit, Progress::new(options.progress)).of_search(budget.evals);
    let course = {
        let _span = options.tracer.span("guide");
        job.course(cells)
    };
    let OpenedSearch { search, stand_in, validation_log } = {
        let _span = options.tracer.span("open search");
        selected.open_search(course)?
    };
    let mut search = options.tracer.search(search);
    if let Some(reason) = stand_in {
        row.device = Some("CPU".to_owned());
        if options.verbosity > Verbosity::Quiet {
            report::say(&format!("smalti: searching on the CPU, since {reason}"));
        }
    }
    let mut curve = (!options.curves.is_empty()).then(|| SearchCurve::new(budget.evals));
    let given = job.given_flies(cells.seed);
    let observers = &mut (&mut (&mut watch, &mut curve), &mut options.tracer.course());
    let ran = cells::run(&mut *search, given.as_deref(), &budget, observers);
    let stop = watch.finish_search(&mut *search).and_then(|took| {
        row.evolve_ms = report::milliseconds(took);
        ran
    })?;
    if let Some(curve) = &mut curve {
        curve.finish(&mut *search)?;
    }
    let standing = search.standing();
    let ending = Ending::new(stop, cells::sae(&mut *search)?, Course::Cells(standing));
    let SearchState { flies, fitness, .. } = search.read_back()?;
    drop(search);
    row.note_search(&ending, &standing, &flies);
    row.spread = Spread::of(&flies, job.target.width_px(), job.target.height_px()).clark_evans;
    validation_log.map_or(Ok(()), |log| check_messages(&log))?;

    let Opened { evaluator, validation_log } = selected.open(vec![job.scene()])?;
    let mut evaluator = options.tracer.evaluator(evaluator);
    let (drawn, psnr) = result::draw(&mut *evaluator, options, (job.population(flies), fitness), ending.sae)?;
    row.psnr = psnr;
    drop(evaluator);
    validation_log.map_or(Ok(()), |log| check_messages(&log))?;
    Ok(Evolved { ending, drawn, curve: curve.map(|curve| Box::new(curve) as Box<dyn Tabled>) })
}
