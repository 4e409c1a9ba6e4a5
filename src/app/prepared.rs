//! One picture on its way: read and checked, then evolved and drawn. What is written, and where, its command decides.

use std::time::Instant;

use super::curve::Curve;
use super::curve_file::Tabled;
use super::device::{Opened, Selected};
use super::job::Job;
use super::options::{EvolveOptions, SchemeOptions};
use super::outputs::Drawn;
use super::progress::Progress;
use super::provenance::{Ending, Provenances};
use super::report::{self, Row};
use super::result::Evolved;
use super::watch::{Watch, Watchers};
use super::{cells, destination, memory, result, scheme};
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::evolve::{Evolution, PaperScheme, Spread};
use crate::model::{Canvas, Evaluator};
use crate::vk::ValidationLog;

/// A picture that can be evolved.
#[derive(Debug)]
pub(super) struct Prepared {
    pub job: Job,
    pub provenances: Provenances,
    /// About how many bytes the work needs.
    pub memory_bytes: u64,
}

impl Prepared {
    /// Reads and checks the picture of `options`; `row` takes in what is known then.
    ///
    /// # Errors
    /// As [`Job::load`]; [`Error::TooLarge`] if the work does not fit into memory.
    pub(super) fn load(options: &EvolveOptions, row: &mut Row) -> Result<Self> {
        let began = Instant::now();
        let _span = options.tracer.span("load").tell("picture", row.id.as_str());
        let job = Job::load(options)?;
        row.load_ms = report::milliseconds(began.elapsed());
        row.tiles = Some(job.fly_count);
        let resized_px = result::resized_px(options, job.target.width_px(), job.target.height_px());
        let provenances = Provenances::new(options, &job, resized_px);
        row.key = Some(provenances.of_row(options).key().to_owned());
        let memory_bytes = check_job(options, &job)?;
        Ok(Self { job, provenances, memory_bytes })
    }

    /// Evolves the picture and draws its best population.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn evolve(
        &self,
        options: &EvolveOptions,
        selected: &Selected,
        watchers: &mut Watchers<'_>,
        row: &mut Row,
    ) -> Result<Evolved> {
        let _span = options.tracer.span("evolve").tell("picture", row.id.as_str());
        match &self.job.scheme {
            SchemeOptions::Paper(scheme) => evolve_job(options, &self.job, (scheme, selected), watchers, row),
            SchemeOptions::Cells(cells) => cells::search_job(options, &self.job, (cells, selected), watchers, row),
        }
    }
}

/// Checks what depends on the picture's size; returns about how many bytes the work needs.
fn check_job(options: &EvolveOptions, job: &Job) -> Result<u64> {
    let (width_px, height_px) = (job.target.width_px(), job.target.height_px());
    let pixel_count = u64::from(width_px) * u64::from(height_px);
    let search_bytes = match &job.scheme {
        SchemeOptions::Cells(_) => memory::search_bytes(pixel_count, job.masks().blend()),
        SchemeOptions::Paper(scheme) => scheme::check_fly_count(scheme, job.fly_count).map(|()| 0)?,
    };
    let output = options.output_long_side_px.map(|long| Canvas::scaled(width_px, height_px, long));
    let output_pixel_count =
        output.map_or(pixel_count, |canvas| u64::from(canvas.width_px) * u64::from(canvas.height_px));
    let written = output.map_or((width_px, height_px), |canvas| (canvas.width_px, canvas.height_px));
    destination::check_fits_formats(&options.outputs, written)?;
    let list_bytes = job.init.as_ref().map_or(0, memory::list_bytes);
    let needed_bytes = memory::estimate_bytes(
        pixel_count,
        job.fly_count,
        output_pixel_count * destination::memory_weight(&options.outputs),
    )
    .saturating_add(list_bytes)
    .saturating_add(search_bytes);
    memory::check(needed_bytes)?;
    Ok(needed_bytes)
}

/// Evolves the job by the paper's scheme, records its curve if one is asked for, and draws its best population; the device
/// is closed before it returns.
fn evolve_job(
    options: &EvolveOptions,
    job: &Job,
    (scheme, selected): (&PaperScheme, &Selected),
    watchers: &mut Watchers<'_>,
    row: &mut Row,
) -> Result<Evolved> {
    let mut curve = (!options.curves.is_empty()).then(|| Curve::new(0));
    let Opened { evaluator, validation_log } = selected.open(vec![job.scene()])?;
    let (width_px, height_px) = (job.target.width_px(), job.target.height_px());
    let evolution = Evolution::new(scheme.clone(), 0, width_px, height_px, job.first_flies(scheme));
    let mut engine = Engine::new(options.tracer.evaluator(evaluator), vec![evolution]);
    let mut watch = Watch::begin(watchers, options.time_limit, Progress::new(options.progress));
    let mut course = options.tracer.course();
    let ran = engine.run(&mut (&mut (&mut watch, &mut curve), &mut course));
    if let Some(course) = course {
        course.finish(engine.evolutions());
    }
    if let Some(curve) = &mut curve {
        curve.finish(engine.evolutions());
    }
    row.evolve_ms = report::milliseconds(watch.finish(&engine.evolutions()[0]));
    ran?;
    let evolution = engine.evolutions()[0].clone();
    let evaluation = engine.evaluator().evaluation(0);
    let scored = (evaluation.sae, evaluation.marginal.to_vec());
    let (ending, drawn) = finish_evolution((options, job), (&evolution, scored), engine.evaluator(), row)?;
    drop(engine);
    validation_log.map_or(Ok(()), |log| check_messages(&log))?;
    Ok(Evolved { ending, drawn, curve: curve.map(|curve| Box::new(curve) as Box<dyn Tabled>) })
}

/// Draws the best population of an evolution of a job, which was evaluated once more to this SAE and these marginals; `row`
/// takes it in.
///
/// # Errors
/// If the device fails, or the SAE is another one than it was.
pub(super) fn finish_evolution(
    (options, job): (&EvolveOptions, &Job),
    (evolution, (scored, marginal)): (&Evolution, (u64, Vec<i64>)),
    evaluator: &mut dyn Evaluator,
    row: &mut Row,
) -> Result<(Ending, Drawn)> {
    row.note_evolution(evolution);
    row.spread = Spread::of(evolution.best_flies(), job.target.width_px(), job.target.height_px()).clark_evans;
    let ending = Ending::of(evolution);
    if scored != ending.sae {
        let sentence = format!("the best population had an SAE of {} and is evaluated to {scored}", ending.sae);
        return Err(Error::Internal(sentence));
    }
    let population = job.population(evolution.best_flies().to_vec());
    let (drawn, psnr) = result::draw(evaluator, (options, job), (population, marginal), ending.sae)?;
    row.psnr = psnr;
    Ok((ending, drawn))
}

/// Turns what the validation layer said into an error.
pub(super) fn check_messages(log: &ValidationLog) -> Result<()> {
    let messages = log.messages();
    let Some(first) = messages.first() else { return Ok(()) };
    let first = first.split_whitespace().collect::<Vec<_>>().join(" ");
    Err(Error::Validation(format!("{first} ({} messages in all)", messages.len())))
}
