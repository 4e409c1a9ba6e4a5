//! One frame after the other: the search of each, from nothing or from the tiles of the frame before.

use std::sync::Arc;
use std::time::Instant;

use super::options::{Leash, VideoOptions};
use super::plan::{Begin, Planned, frame_options};
use super::show::Watcher;
use super::store::Store;
use crate::app::cells::CellsOptions;
use crate::app::device::{Opened, OpenedSearch, Selected};
use crate::app::job::Job;
use crate::app::options::{SchemeOptions, Verbosity};
use crate::app::outputs::{self, Drawn, EncodedFile, Told, View};
use crate::app::prepared::check_messages;
use crate::app::provenance::{self, Ending};
use crate::app::report::{self, Row};
use crate::app::result;
use crate::error::{Error, Result};
use crate::evolve::cells::{self, Budget};
use crate::evolve::held::Held;
use crate::evolve::{Spread, StopReason};
use crate::model::cells::{Course, SearchState, Standing};
use crate::model::{Canvas, Evaluator, Fly, MaskSet, Mosaic, Population, Scene, Target};

/// Names the random numbers of the frames of a shot apart: an odd number, 2^64 over the golden ratio.
const SEED_STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// A frame as it was evolved.
#[derive(Clone, Debug)]
struct Last {
    number: usize,
    population: Population,
    /// At evaluation size.
    mosaic: Mosaic,
}

/// What a frame is evolved towards, and by.
struct Task {
    job: Job,
    /// The picture as it is, to measure the mosaic by.
    picture: Arc<Target>,
    course: Course,
    budget: Budget,
    flies: Option<Vec<Fly>>,
}

/// Makes frames in their order.
pub(super) struct Shooter<'a> {
    options: &'a VideoOptions,
    planned: &'a [Planned],
    store: &'a Store,
    selected: &'a Selected,
    /// Draws; nothing is evaluated by it.
    evaluator: Box<dyn Evaluator>,
    last: Option<Last>,
    /// What is held after the frame of this number.
    held: Option<(usize, Held)>,
}

impl<'a> Shooter<'a> {
    /// Opens the device.
    ///
    /// # Errors
    /// If it has no room.
    pub(super) fn open(
        options: &'a VideoOptions,
        planned: &'a [Planned],
        store: &'a Store,
        selected: &'a Selected,
    ) -> Result<Self> {
        // An evaluator has at least one lane.
        let target = Arc::new(Target::new(1, 1, vec![[0; 3]])?);
        let scene = Scene { target, masks: Arc::new(MaskSet::default()), background: [0; 3], fly_count: 1 };
        let Opened { evaluator, .. } = selected.open(vec![scene])?;
        Ok(Self { options, planned, store, selected, evaluator, last: None, held: None })
    }

    /// Evolves a frame and writes its files, or only those that are missing; `row` takes in what came of it.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if somebody asked for the end; then nothing of the frame is written.
    pub(super) fn shoot(&mut self, frame: &Planned, watcher: &mut Watcher<'_>, row: &mut Row) -> Result<()> {
        let began = Instant::now();
        let Task { job, picture, course, budget, flies } = self.task(frame)?;
        row.load_ms = report::milliseconds(began.elapsed());
        let began = Instant::now();
        let wanted = Arc::clone(&course.target);
        let OpenedSearch { mut search, stand_in, validation_log } = self.selected.open_search(course)?;
        if let Some(reason) = stand_in.filter(|_| self.options.pictures.verbosity == Verbosity::Verbose) {
            report::say(&format!("smalti: searching on the CPU, since {reason}"));
        }
        let stop = cells::run(&mut *search, flies.as_deref(), &budget, watcher)?;
        if stop == StopReason::Interrupted {
            return Err(Error::Interrupted);
        }
        let (standing, scored) = (search.standing(), cells::sae(&mut *search)?);
        let SearchState { flies, fitness, .. } = search.read_back()?;
        drop(search);
        validation_log.map_or(Ok(()), |log| check_messages(&log))?;
        row.evolve_ms = report::milliseconds(began.elapsed());

        let began = Instant::now();
        let population = job.population(flies);
        let mosaic = self.draw(&population)?;
        let drawn = result::difference(&mosaic.pixels, &wanted).sae();
        if drawn != scored {
            return Err(Error::Internal(format!("a frame had an SAE of {scored} and is drawn with {drawn}")));
        }
        let likeness = result::difference(&mosaic.pixels, &picture);
        let ending = Ending::new(stop, likeness.sae(), provenance::Course::Cells(standing));
        row.note_search(&ending, &standing, &population.flies);
        row.psnr = likeness.psnr_db();
        row.spread = Spread::of(&population.flies, population.width_px, population.height_px).clark_evans;
        let last = Last { number: frame.number, population, mosaic };
        self.write(frame, &last, (&fitness, &ending), watcher, row)?;
        self.last = Some(last);
        row.save_ms = report::milliseconds(began.elapsed());
        Ok(())
    }

    /// Draws the picture of a frame again whose population is whole.
    ///
    /// # Errors
    /// If it cannot be drawn or written.
    pub(super) fn redraw(&mut self, frame: &Planned, watcher: &Watcher<'_>, row: &mut Row) -> Result<()> {
        let path = self.store.population(frame.number);
        let gone = || Error::input(&path, "went away while frames were made; run the same command again");
        let archive = self.store.whole_population(frame).ok_or_else(gone)?;
        let number = |word: &str| archive.meta.get(word).and_then(serde_json::Value::as_u64).unwrap_or_default();
        let standing = Standing {
            evals: number("evals"),
            births: number("births"),
            objective: archive.meta.get("objective").and_then(serde_json::Value::as_i64).unwrap_or_default(),
            ..Standing::default()
        };
        let stop = archive.meta.get("stop").and_then(serde_json::Value::as_str).unwrap_or_default();
        let reasons = [StopReason::Evals, StopReason::TargetSae, StopReason::Patience, StopReason::Dry];
        let stop = reasons.into_iter().find(|reason| reason.word() == stop).unwrap_or(StopReason::Evals);
        let ending = Ending::new(stop, number("sae"), provenance::Course::Cells(standing));
        row.note_search(&ending, &standing, &archive.population.flies);
        let is_drawn = self.store.has_picture(frame)?;
        if !is_drawn {
            let mosaic = self.draw(&archive.population)?;
            let last = Last { number: frame.number, population: archive.population, mosaic };
            self.write(frame, &last, (&archive.fitness, &ending), watcher, row)?;
            self.last = Some(last);
        }
        Ok(())
    }

    /// Draws a population as it evolved.
    fn draw(&mut self, population: &Population) -> Result<Mosaic> {
        self.evaluator.draw(population, &Canvas::evaluation(population.width_px, population.height_px), 1)
    }

    /// Writes the files of a frame, its population first: with it, the rest can be made again.
    fn write(
        &mut self,
        frame: &Planned,
        last: &Last,
        (fitness, ending): (&[i64], &Ending),
        watcher: &Watcher<'_>,
        row: &mut Row,
    ) -> Result<()> {
        let told =
            Told { picture: frame.picture.describe(Some(ending)), population: frame.population.describe(Some(ending)) };
        let destinations = self.store.destinations(frame.number)?;
        let view =
            View::new(last.population.width_px, last.population.height_px, self.options.pictures.output_long_side_px);
        let picture = view.is_as_evolved().then(|| last.mosaic.clone());
        let (population, marginal) = (last.population.clone(), fitness.to_vec());
        let mut drawn = Drawn { population, marginal, view, picture, layers: None };
        drawn.draw(&mut *self.evaluator, &destinations, Verbosity::Quiet)?;
        let destinations: Vec<_> = destinations.iter().collect();
        let files: Vec<EncodedFile<'_>> = outputs::encode(&destinations, drawn, &told)?;
        files.iter().try_for_each(|file| self.store.check_remade(file))?;
        outputs::write(&files, watcher.interrupt, &mut row.output)
    }

    fn load(&self, frame: &Planned) -> Result<Job> {
        let job = Job::load(&frame_options(self.options, &frame.input))?;
        let expected = frame.population.decisive("input_sha256");
        if expected != job.input_sha256.as_str() {
            return Err(Error::input(&frame.input, "changed while frames were made; run the same command again"));
        }
        Ok(job)
    }

    /// What a frame is evolved towards.
    fn task(&mut self, frame: &Planned) -> Result<Task> {
        let mut job = self.load(frame)?;
        let SchemeOptions::Cells(cells) = job.scheme.clone() else {
            return Err(Error::Internal("a sequence is evolved by a search in cells".to_owned()));
        };
        let budget = Budget { evals: frame.evals, ..cells.budget(job.fly_count) };
        if frame.begin != Begin::Warm {
            let course = job.course(&cells);
            self.held = Some((frame.number, Held::new(&job.target, self.options.noise)));
            return Ok(Task { picture: Arc::clone(&job.target), job, course, budget, flies: None });
        }
        let last = self.last_before(frame)?;
        let target = Arc::clone(&job.target);
        let held = self.held_at(frame, &target)?;
        // A shot keeps its ground and its grout, whatever its later frames would have chosen.
        job.grout = last.population.grout;
        job.background = last.population.background.color();
        let aim = held.target(&last.mosaic, &target)?;
        job.target = Arc::new(held.picture(&target)?);
        let budget = of_rest(budget, held, &last.mosaic, &target);
        let mut course = warm_course(&job, &cells, aim, (frame.number - frame.shot) as u64);
        course.rules.leash = self.options.max_tile_move.map_or(0, |Leash(units)| units);
        Ok(Task { job, picture: target, course, budget, flies: Some(last.population.flies) })
    }

    /// The frame before, from memory or from its file.
    fn last_before(&mut self, frame: &Planned) -> Result<Last> {
        let number = frame.number - 1;
        if let Some(last) = self.last.take_if(|last| last.number == number) {
            return Ok(last);
        }
        let planned = &self.planned[number - self.planned[0].number];
        let path = self.store.population(number);
        let gone = || Error::input(&path, "went away while frames were made; run the same command again");
        let population = self.store.whole_population(planned).ok_or_else(gone)?.population;
        let mosaic = self.draw(&population)?;
        Ok(Last { number, population, mosaic })
    }

    /// What is held at a frame whose picture is `target`: as after the frame before, or else found by going through its shot.
    fn held_at(&mut self, frame: &Planned, target: &Target) -> Result<&Held> {
        let (mut number, mut held) = match self.held.take() {
            Some((number, held)) if (frame.shot..frame.number).contains(&number) => (number, held),
            _ => {
                let first = &self.planned[frame.shot - self.planned[0].number];
                (frame.shot, Held::new(&self.load(first)?.target, self.options.noise))
            }
        };
        while number + 1 < frame.number {
            number += 1;
            held.advance(&self.load(&self.planned[number - self.planned[0].number])?.target);
        }
        held.advance(target);
        Ok(&self.held.insert((frame.number, held)).1)
    }
}

/// The budget of a frame of which some pixels are still: an SAE that is asked for is that of all.
fn of_rest(budget: Budget, held: &Held, shown: &Mosaic, target: &Target) -> Budget {
    let error = |pixel: usize| {
        let pairs = shown.pixels[pixel].iter().zip(target.pixels()[pixel]);
        pairs.map(|(&a, b)| u64::from(a.abs_diff(b))).sum::<u64>()
    };
    let of_still: u64 = (0..shown.pixels.len()).filter(|&pixel| held.is_still(pixel)).map(error).sum();
    Budget { target_sae: budget.target_sae.map(|sae| sae.saturating_sub(of_still)), ..budget }
}

/// The course of a frame towards `aim`, so many frames after the beginning of its shot.
fn warm_course(job: &Job, cells: &CellsOptions, aim: Target, since: u64) -> Course {
    let mut course = job.course(cells);
    course.target = Arc::new(aim);
    course.rules.seed = course.rules.seed.wrapping_add(since.wrapping_mul(SEED_STEP));
    course
}
