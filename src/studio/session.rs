//! A picture on its way, step by step: to be looked at, steered, and gone on with.

use super::device::{Device, OpenedSearch};
use super::job::Job;
use super::look::Dress;
use super::make::PICTURE;
use super::making::{Plain, engine, finish_on};
use super::mosaic::{Image, Mosaic};
use super::parameters::contradiction;
use super::picture::Picture;
use super::progress::share;
use super::provenance::Provenances;
use super::recipe::Recipe;
use super::settings::SchemeSettings;
use super::story::Story;
use super::tile::Tile;
use crate::engine::{Engine, SearchTask, Task};
use crate::error::Result;
use crate::evolve::cells::{Budget, Drive, Pace};
use crate::evolve::{Ended, Ending, Seen, Stage, StopReason, Tally, Undisturbed, cells};
use crate::model::cells::{Search, depths};
use crate::model::{Fly, Population};

/// Generations of the paper's scheme in a step.
const GENERATIONS_PER_STEP: u32 = 256;

/// A picture on its way. It rests between two steps, so that its tiles can be looked at and its recipe changed.
///
/// The result is decided by the picture, the recipes, and the evals at which they changed; never by the clock. A
/// [`super::Script`] holds these, and makes the same result again.
pub struct Session<'d> {
    picture: Picture,
    device: &'d Device,
    job: Job,
    work: Work,
    /// Why the CPU searches in the place of the device, if it does.
    stand_in: Option<String>,
    /// Evals and births before the last change.
    before: (u64, u64),
    story: Story,
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
        let Begun { work, stand_in } = Begun::new(&job, device, first.as_deref(), 0)?;
        let story = Story::begin(Provenances::new(&settings, &job, None));
        Ok(Self { picture: picture.clone(), device, job, work, stand_in, before: (0, 0), story, stop: None })
    }

    /// Brings the picture on by a round of its search, or some births of the paper's scheme: hundredths of a second at
    /// 512 px. A reason if it has come to its end; then nothing more happens until its recipe is changed to a larger
    /// budget. Rounds without an eval are made together with the next one that has some, so that the number of evals
    /// tells how far the session is.
    ///
    /// # Errors
    /// If the device fails.
    pub fn step(&mut self) -> Result<Option<StopReason>> {
        if self.stop.is_some() {
            return Ok(self.stop);
        }
        match &mut self.work {
            Work::Search(search, drive) => {
                let evals = search.standing().evals;
                // Spreading depths is no step of its own.
                while self.stop.is_none() && search.standing().evals == evals {
                    self.stop = cells::step(&mut **search, drive, &mut Undisturbed)?;
                }
                if self.stop.is_none() {
                    self.stop = cells::end_if_spent(&mut **search, drive)?;
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
        check_goes_on(&self.job, &job)?;
        let provenances = Provenances::new(&settings, &job, None);
        let (evals, births) = (self.evals(), self.births());
        let population = self.population()?;
        let has_new_masks = job.masks() != population.masks;
        if has_new_masks && job.dress.is_none() && job.init.is_none() {
            // No mask is named, and here that is a change: back to squares.
            job.dress = Some(Dress { masks: job.masks(), layers_by_run: vec![vec![0]] });
        }
        job.init = Some(population.into());
        let first = if has_new_masks { job.given_flies(job.scheme.seed()) } else { job.kept_flies() };
        let Begun { work, stand_in } = Begun::new(&job, self.device, first.as_deref(), evals)?;
        self.story.go_on(evals, provenances);
        (self.job, self.work, self.stand_in) = (job, work, stand_in);
        (self.before, self.stop) = ((evals, births), None);
        Ok(())
    }

    /// How much of the budget is spent, 0 to 1.
    #[must_use]
    pub fn share(&mut self) -> f64 {
        let evals = self.evals();
        share(evals, &self.job)
    }

    /// Why it has come to its end, if it has.
    #[must_use]
    pub fn stop_reason(&self) -> Option<StopReason> {
        self.stop
    }

    /// The number of flies, absent ones too.
    #[cfg(feature = "view")]
    pub(crate) fn fly_count(&self) -> usize {
        self.job.fly_count
    }

    /// Children that are evaluated from the beginning on if nothing ends the work before; in the paper's scheme each is
    /// a birth. The round that spends them may make some more.
    #[must_use]
    pub fn evals_planned(&self) -> u64 {
        self.job.evals_planned()
    }

    /// What [`super::Script::until`] is to be if the session ends here: its evals, unless it has come to its end by
    /// itself.
    #[must_use]
    pub fn until(&mut self) -> Option<u64> {
        if self.stop.is_none() { Some(self.evals()) } else { None }
    }

    /// The fitted picture, which the tiles imitate: at the size at which it evolves, and in its colours.
    #[must_use]
    pub fn target(&self) -> Image {
        let target = &self.job.target;
        let alpha = |&is_transparent: &bool| if is_transparent { 0 } else { u8::MAX };
        Image {
            width_px: target.width_px(),
            height_px: target.height_px(),
            pixels: target.pixels().to_vec(),
            alpha: target.transparent().map(|transparent| transparent.iter().map(alpha).collect()),
        }
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

    /// The marginal fitness of all flies of [`Session::population`], in its order; that of absent ones is 0.
    ///
    /// # Errors
    /// If the device fails.
    pub fn marginal(&mut self) -> Result<Vec<i64>> {
        Ok(self.ended()?.fitness)
    }

    /// The mosaic as it is now: what [`Session::finish`] would make of it. The session goes on as if nobody had asked.
    ///
    /// Before the session has come to its end, the evals at which it is taken decide the result, too, and are in its
    /// key; it counts as complete.
    ///
    /// # Errors
    /// If the device fails, or has no room to draw.
    pub fn mosaic(&mut self) -> Result<Mosaic> {
        let (ended, provenances) = (self.ended()?, self.provenances());
        drawn(self.device, &self.job, ended, provenances)
    }

    /// Ends the session with the mosaic as it has become.
    ///
    /// # Errors
    /// If the device fails, and then the tiles are lost: [`Session::population`] before it keeps them.
    pub fn finish(mut self) -> Result<Mosaic> {
        let (ended, provenances) = (self.ended()?, self.provenances());
        let Self { device, job, work, .. } = self;
        // Its memory is room to draw.
        drop(work);
        drawn(device, &job, ended, provenances)
    }

    /// How the work would have ended here, and its population.
    pub(crate) fn ended(&mut self) -> Result<Ended> {
        let (evals, births) = self.before;
        let ended = match &mut self.work {
            Work::Search(search, _) => {
                let mut ended = Ended::of_search(&mut **search, self.stop.unwrap_or(StopReason::Evals))?;
                if self.stop.is_none() {
                    depths::spread(&mut ended.flies);
                }
                ended
            }
            Work::Paper(engine) => {
                let mut evolutions = engine.evolutions().to_vec();
                evolutions.iter_mut().for_each(|evolution| evolution.stop(StopReason::Births));
                // In another engine, since this one goes on with its population, which need not be the best.
                let evaluator = self.device.open_evaluator(vec![self.job.scene()])?;
                let mut last = Engine::new(evaluator, evolutions);
                last.end(&mut Undisturbed)?;
                last.ended(0)?
            }
        };
        Ok(Ended { ending: since_the_beginning(ended.ending, evals, births), ..ended })
    }

    /// What decides the mosaic as it is now.
    fn provenances(&mut self) -> Provenances {
        let until = self.until();
        self.story.provenances(until)
    }

    /// Why the CPU searches in the place of the device, if it does.
    pub(crate) fn stand_in(&self) -> Option<&str> {
        self.stand_in.as_deref()
    }

    /// How far it has come since it began.
    pub(crate) fn stage_in_all(&mut self) -> Stage {
        let (evals, births) = (self.evals(), self.births());
        Stage { evals, births, ..self.stage() }
    }

    fn stage(&mut self) -> Stage {
        self.work.seen().stage()
    }
}

/// Work that has begun.
struct Begun {
    work: Work,
    /// Why the CPU searches in the place of the device, if it does.
    stand_in: Option<String>,
}

impl Begun {
    /// Begins with the flies `first`, where a search may, when so many evals of the budget are spent.
    fn new(job: &Job, device: &Device, first: Option<&[Fly]>, spent: u64) -> Result<Self> {
        match job.task() {
            Task::Search(SearchTask { course, budget, .. }) => {
                let OpenedSearch { mut search, stand_in } = device.open_search(course)?;
                if let Some(flies) = first {
                    search.load(flies)?;
                }
                let evals = budget.evals.saturating_sub(spent);
                let drive = Drive::new(&*search, Budget { evals, ..budget }, Pace::Rounds);
                Ok(Self { work: Work::Search(search, drive), stand_in })
            }
            Task::Paper(task) => {
                let mut engine = engine(device, task, &Plain)?;
                engine.begin(&mut Undisturbed)?;
                Ok(Self { work: Work::Paper(engine), stand_in: None })
            }
        }
    }
}

impl Work {
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

/// The mosaic of a session that ended so.
fn drawn(device: &Device, job: &Job, ended: Ended, provenances: Provenances) -> Result<Mosaic> {
    let finished = finish_on(device, job, ended, None, PICTURE)?;
    Ok(Mosaic::with_provenance(finished, provenances.picture, provenances.population))
}

/// Refuses a next job that needs a beginning of its own.
///
/// # Errors
/// [`crate::Error::Parameter`] that names what cannot change.
pub(super) fn check_goes_on(present: &Job, next: &Job) -> Result<()> {
    let size = |job: &Job| (job.target.width_px(), job.target.height_px());
    let is_paper = |job: &Job| matches!(job.scheme, SchemeSettings::Paper(_));
    let needs_beginning = if is_paper(next) || is_paper(present) {
        "scheme"
    } else if size(next) != size(present) {
        "size"
    } else if next.fly_count != present.fly_count {
        "tiles"
    } else if next.masks().blend() != present.masks().blend() {
        "blend"
    } else {
        return Ok(());
    };
    Err(contradiction(needs_beginning, "cannot change while a picture is on its way; begin another session"))
}
