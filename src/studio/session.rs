//! A picture on its way, step by step: to be looked at, steered, and gone on with.

use serde_json::{Value, json};

use super::device::Device;
use super::job::Job;
use super::look::Dress;
use super::make::PICTURE;
use super::making::{Plain, engine, finish_on};
use super::mosaic::Mosaic;
use super::parameters::contradiction;
use super::picture::Picture;
use super::progress::share;
use super::provenance::Provenances;
use super::recipe::Recipe;
use super::settings::{SchemeSettings, Settings};
use super::tile::Tile;
use crate::engine::{Engine, SearchTask, Task};
use crate::error::Result;
use crate::evolve::cells::{Budget, Drive, Pace};
use crate::evolve::{Ended, Ending, Seen, Stage, StopReason, Tally, Undisturbed, cells};
use crate::model::cells::Search;
use crate::model::{Fly, Population};

/// Generations of the paper's scheme in a step.
const GENERATIONS_PER_STEP: u32 = 256;

/// A picture on its way. It rests between two steps, so that its tiles can be looked at and its recipe changed.
///
/// The result is decided by the picture, the recipes, and the evals at which they changed; never by the clock.
pub struct Session<'d> {
    picture: Picture,
    device: &'d Device,
    settings: Settings,
    job: Job,
    work: Work,
    /// Evals and births before the last change.
    before: (u64, u64),
    /// What was changed and when, for the key of the result.
    changes: Vec<Value>,
    stop: Option<StopReason>,
}

enum Work {
    Search(Box<dyn Search>, Drive),
    Paper(Engine),
}

impl<'d> Session<'d> {
    /// Begins a picture by a recipe on a device.
    ///
    /// # Errors
    /// As [`Recipe::make`].
    pub fn begin(recipe: &Recipe, picture: &Picture, device: &'d Device) -> Result<Self> {
        let (settings, job) = recipe.job(picture)?;
        let first = job.given_flies(job.scheme.seed());
        let work = Work::begin(&job, device, first.as_deref(), 0)?;
        let picture = picture.clone();
        Ok(Self { picture, device, settings, job, work, before: (0, 0), changes: Vec::new(), stop: None })
    }

    /// Brings the picture on by a round of its search, or some births of the paper's scheme: hundredths of a second at
    /// 512 px. A reason if it has come to its end; then nothing more happens until its recipe is changed to a larger
    /// budget.
    ///
    /// # Errors
    /// If the device fails.
    pub fn step(&mut self) -> Result<Option<StopReason>> {
        if self.stop.is_some() {
            return Ok(self.stop);
        }
        match &mut self.work {
            Work::Search(search, drive) => {
                let rounds = search.standing().rounds;
                // Spreading depths is no step of its own.
                while self.stop.is_none() && search.standing().rounds == rounds {
                    self.stop = cells::step(&mut **search, drive, &mut Undisturbed)?;
                }
            }
            Work::Paper(engine) => {
                for _ in 0..GENERATIONS_PER_STEP {
                    if !engine.step(&mut Undisturbed)? {
                        self.stop = engine.evolutions()[0].stop_reason();
                        break;
                    }
                }
            }
        }
        Ok(self.stop)
    }

    /// Changes the recipe and goes on from the present tiles: a search takes new bounds, penalties, grout, colours,
    /// masks, weights, seed and budget from here on. Tiles are held to the new bounds, and step sizes are learnt anew.
    /// An `init` of the recipe only tells the number of tiles, and masks and background where the recipe names none.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if the recipe is wrong, or if it needs a new beginning: another number of tiles,
    /// another size of the picture, another scheme, or any change in the paper's scheme; [`crate::Error::Input`] about
    /// a file that it names; or if the device has no room for the new search beside the old one. Then the session goes
    /// on as before.
    pub fn change(&mut self, recipe: &Recipe) -> Result<()> {
        let (settings, mut job) = recipe.job(&self.picture)?;
        let size = |job: &Job| (job.target.width_px(), job.target.height_px());
        let is_paper = |job: &Job| matches!(job.scheme, SchemeSettings::Paper(_));
        let needs_beginning = if is_paper(&job) || is_paper(&self.job) {
            Some("scheme")
        } else if size(&job) != size(&self.job) {
            Some("size")
        } else if job.fly_count != self.job.fly_count {
            Some("tiles")
        } else if job.masks().blend() != self.job.masks().blend() {
            Some("blend")
        } else {
            None
        };
        if let Some(name) = needs_beginning {
            return Err(contradiction(name, "cannot change while a picture is on its way; begin another session"));
        }
        let (evals, births) = (self.evals(), self.births());
        let population = self.population()?;
        let has_new_masks = job.masks() != population.masks;
        if has_new_masks && job.dress.is_none() && job.init.is_none() {
            // No mask is named, and here that is a change: back to squares.
            job.dress = Some(Dress { masks: job.masks(), layers_by_run: vec![vec![0]] });
        }
        job.init = Some(population.into());
        let first = if has_new_masks { job.given_flies(job.scheme.seed()) } else { job.kept_flies() };
        let work = Work::begin(&job, self.device, first.as_deref(), evals)?;
        let changed = Provenances::new(&settings, &job, None).population;
        self.changes.push(json!({ "evals": evals, "key": changed.key() }));
        (self.settings, self.job, self.work) = (settings, job, work);
        (self.before, self.stop) = ((evals, births), None);
        Ok(())
    }

    /// How much of the budget is spent, 0 to 1.
    #[must_use]
    pub fn share(&mut self) -> f64 {
        let evals = self.evals();
        share(evals, &self.job)
    }

    /// Children that were evaluated since the session began.
    #[must_use]
    pub fn evals(&mut self) -> u64 {
        self.before.0 + self.stage().evals
    }

    /// New tiles that took a place since the session began; tiles that were only changed do not count.
    #[must_use]
    pub fn births(&mut self) -> u64 {
        self.before.1 + self.stage().births
    }

    /// What is lowered, of the best population so far: the SAE, with the penalties of the style and the weights if
    /// there are any.
    #[must_use]
    pub fn objective(&mut self) -> i64 {
        self.stage().error
    }

    /// The sum of absolute errors of the best population so far.
    ///
    /// # Errors
    /// If the device fails.
    pub fn sae(&mut self) -> Result<u64> {
        self.work.seen().sae()
    }

    /// The tiles of the best population so far.
    ///
    /// # Errors
    /// If the device fails.
    pub fn tiles(&mut self) -> Result<Vec<Tile>> {
        let flies = self.work.seen().best_flies()?;
        Ok(Tile::of(&flies, None).collect())
    }

    /// The best population so far.
    ///
    /// # Errors
    /// If the device fails.
    pub fn population(&mut self) -> Result<Population> {
        let flies = self.work.seen().best_flies()?;
        Ok(self.job.population(flies))
    }

    /// Ends the session with the mosaic as it has become.
    ///
    /// # Errors
    /// If the device fails, and then the tiles are lost: [`Session::population`] before it keeps them.
    pub fn finish(self) -> Result<Mosaic> {
        let stop = self.stop.unwrap_or(StopReason::Interrupted);
        let (evals, births) = self.before;
        let ended = match self.work {
            Work::Search(mut search, _) => {
                if self.stop.is_none() {
                    search.renormalise()?;
                }
                Ended::of_last(search, stop)?
            }
            Work::Paper(mut engine) => {
                engine.stop(stop);
                engine.end(&mut Undisturbed)?;
                engine.ended(0)?
            }
        };
        let ended = Ended { ending: since_the_beginning(ended.ending, evals, births), ..ended };
        let finished = finish_on(self.device, &self.job, ended, None, PICTURE)?;
        let Provenances { mut picture, mut population, .. } = Provenances::new(&self.settings, &self.job, None);
        if !self.changes.is_empty() {
            let changes = || [("changes".to_owned(), Value::from(self.changes.clone()))].into_iter().collect();
            (picture, population) = (picture.with(changes()), population.with(changes()));
        }
        Ok(Mosaic::with_provenance(finished, picture, population))
    }

    fn stage(&mut self) -> Stage {
        self.work.seen().stage()
    }
}

impl Work {
    /// Begins with the flies `first`, where a search may, when so many evals of the budget are spent.
    fn begin(job: &Job, device: &Device, first: Option<&[Fly]>, spent: u64) -> Result<Self> {
        match job.task() {
            Task::Search(SearchTask { course, budget, .. }) => {
                let mut search = device.open_search(course)?.search;
                if let Some(flies) = first {
                    search.load(flies)?;
                }
                let evals = budget.evals.saturating_sub(spent);
                let drive = Drive::new(&*search, Budget { evals, ..budget }, Pace::Rounds);
                Ok(Self::Search(search, drive))
            }
            Task::Paper(task) => {
                let mut engine = engine(device, task, &Plain)?;
                engine.begin(&mut Undisturbed)?;
                Ok(Self::Paper(engine))
            }
        }
    }

    fn seen(&mut self) -> Seen<'_> {
        match self {
            Self::Search(search, _) => Seen::Search(&mut **search),
            Self::Paper(engine) => Seen::Evolutions(engine.evolutions()),
        }
    }
}

/// The ending of a search, with what was counted before its last change.
fn since_the_beginning(ending: Ending, evals: u64, births: u64) -> Ending {
    let Tally::Cells(mut standing) = ending.tally else { return ending };
    standing.evals += evals;
    standing.births += births;
    Ending { tally: Tally::Cells(standing), ..ending }
}
