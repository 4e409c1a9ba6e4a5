//! A picture evolved and drawn, whatever its scheme: the one way from a job to a result.

use super::device::{Device, OpenedSearch};
use super::drawing::{Drawn, Pieces, View, difference};
use super::job::Job;
use super::settings::SchemeSettings;
use crate::engine::{Engine, PaperTask, SearchTask, Task};
use crate::error::{Error, Result};
use crate::evolve::{Ended, Ending, Evolution, Observer, cells};
use crate::model::cells::Search;
use crate::model::{Canvas, Evaluator, Painter};

/// Something that ends when it is dropped.
pub(crate) trait Running {}

impl<T> Running for T {}

/// Looks over the shoulder of the work, as a trace does; changes no result.
pub(crate) trait Instruments {
    /// The search, watched.
    fn search(&self, search: Box<dyn Search>) -> Box<dyn Search> {
        search
    }

    /// The evaluator, watched.
    fn evaluator(&self, evaluator: Box<dyn Evaluator>) -> Box<dyn Evaluator> {
        evaluator
    }

    /// Notes that something begins, which ends when what is returned is dropped.
    fn span(&self, _name: &'static str) -> Box<dyn Running + '_> {
        Box::new(())
    }

    /// Takes note that the CPU searches in place of a device that nobody asked for, and why.
    fn note_stand_in(&mut self, _reason: &str) {}
}

/// No instruments.
pub(crate) struct Plain;

impl Instruments for Plain {}

/// Evolves the picture of a job on a device, which is closed again before this returns.
///
/// # Errors
/// If the device fails, or `observer`.
pub(crate) fn evolve(
    job: &Job,
    device: &Device,
    observer: &mut dyn Observer,
    instruments: &mut dyn Instruments,
) -> Result<Ended> {
    let task = {
        // The guide is what takes time before a search.
        let _span = matches!(job.scheme, SchemeSettings::Cells(_)).then(|| instruments.span("guide"));
        job.task()
    };
    let ended = match task {
        Task::Search(SearchTask { course, first, budget }) => {
            let OpenedSearch { search, stand_in } = {
                let _span = instruments.span("open search");
                device.open_search(course)?
            };
            let mut search = instruments.search(search);
            if let Some(reason) = stand_in {
                instruments.note_stand_in(&reason);
            }
            let stop = cells::run(&mut *search, first.as_deref(), &budget, observer)?;
            Ended::of_last(search, stop)?
        }
        Task::Paper(task) => {
            let mut engine = engine(device, task, instruments)?;
            engine.run(observer)?;
            engine.ended(0)?
        }
    };
    device.check_validation()?;
    Ok(ended)
}

/// An engine for one picture by the paper's scheme.
pub(super) fn engine(device: &Device, task: PaperTask, instruments: &dyn Instruments) -> Result<Engine> {
    let PaperTask { scene, scheme, first_flies } = task;
    let (width_px, height_px) = (scene.target.width_px(), scene.target.height_px());
    let evaluator = instruments.evaluator(device.open_evaluator(vec![scene])?);
    let evolution = Evolution::new(scheme, 0, width_px, height_px, first_flies);
    Ok(Engine::new(evaluator, vec![evolution]))
}

/// A result that is drawn and checked.
#[derive(Debug)]
pub(crate) struct Finished {
    pub ending: Ending,
    pub drawn: Drawn,
    /// Peak signal-to-noise ratio in dB; none for a perfect likeness, whose ratio is infinite.
    pub psnr_db: Option<f64>,
}

/// Draws what the work on a job has come to at evaluation size, checks it against what was scored, and prepares to draw
/// it with a longer side of `resized_px`.
///
/// # Errors
/// If the device fails, or if the mosaic is not what was scored.
pub(crate) fn finish(job: &Job, ended: Ended, painter: &mut dyn Painter, resized_px: Option<u32>) -> Result<Finished> {
    let Ended { ending, flies, fitness } = ended;
    let (width_px, height_px) = (job.target.width_px(), job.target.height_px());
    let population = job.population(flies);
    let mosaic = painter.draw(&population, &Canvas::evaluation(width_px, height_px), 1)?;
    let difference = difference(&mosaic, &job.target);
    let (scored, drawn) = (ending.sae, difference.sae());
    if drawn != scored {
        return Err(Error::Internal(format!("the best population had an SAE of {scored} and is drawn with {drawn}")));
    }
    let view = View::new(width_px, height_px, resized_px);
    let picture = view.is_as_evolved().then(|| mosaic.into());
    let drawn = Drawn { population, marginal: fitness, view, picture, layers: None };
    Ok(Finished { ending, drawn, psnr_db: difference.psnr_db() })
}

/// As [`finish`], on a device, and draws `pieces`.
///
/// # Errors
/// As [`finish`].
pub(super) fn finish_on(
    device: &Device,
    job: &Job,
    ended: Ended,
    resized_px: Option<u32>,
    pieces: Pieces,
) -> Result<Finished> {
    let mut painter = device.open_painter()?;
    let mut finished = finish(job, ended, &mut *painter, resized_px)?;
    finished.drawn.draw(&mut *painter, pieces)?;
    drop(painter);
    device.check_validation()?;
    Ok(finished)
}
