//! The work of the `cells` scheme: search, draw, and check what was drawn.

use super::CellsOptions;
use super::curve::SearchCurve;
use crate::app::curve_file::Tabled;
use crate::app::device::{Opened, OpenedSearch, Selected};
use crate::app::job::Job;
use crate::app::options::{EvolveOptions, Verbosity};
use crate::app::outputs::Drawn;
use crate::app::prepared::check_messages;
use crate::app::progress::Progress;
use crate::app::provenance::{Course, Ending};
use crate::app::report::{self, Row};
use crate::app::result::{self, Evolved};
use crate::app::watch::{Watch, Watchers};
use crate::engine::Ended;
use crate::error::Result;
use crate::evolve::{Spread, cells};
use crate::model::Evaluator;
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
    let ended = Ended { stop, standing: search.standing(), sae: cells::sae(&mut *search)?, state: search.read_back()? };
    drop(search);
    validation_log.map_or(Ok(()), |log| check_messages(&log))?;

    let Opened { evaluator, validation_log } = selected.open(Vec::new())?;
    let mut evaluator = options.tracer.evaluator(evaluator);
    let (ending, drawn) = finish_search((options, job), ended, &mut *evaluator, row)?;
    drop(evaluator);
    validation_log.map_or(Ok(()), |log| check_messages(&log))?;
    Ok(Evolved { ending, drawn, curve: curve.map(|curve| Box::new(curve) as Box<dyn Tabled>) })
}

/// Draws what a search of a job has come to; `row` takes it in.
///
/// # Errors
/// If the device fails.
pub(in crate::app) fn finish_search(
    (options, job): (&EvolveOptions, &Job),
    Ended { stop, standing, sae, state }: Ended,
    evaluator: &mut dyn Evaluator,
    row: &mut Row,
) -> Result<(Ending, Drawn)> {
    let ending = Ending::new(stop, sae, Course::Cells(standing));
    let SearchState { flies, fitness, .. } = state;
    row.note_search(&ending, &standing, &flies);
    row.spread = Spread::of(&flies, job.target.width_px(), job.target.height_px()).clark_evans;
    let (drawn, psnr) = result::draw(evaluator, (options, job), (job.population(flies), fitness), sae)?;
    row.psnr = psnr;
    Ok((ending, drawn))
}
