//! Evolves one frame after the other, each anew or from the tiles of the frame before.

use std::sync::Arc;
use std::time::Instant;

use super::options::{Leash, VideoOptions};
use super::plan::{Begin, Planned, frame_options};
use super::show::Watcher;
use super::store::Store;
use crate::archive::Archive;
use crate::cli::files::destination;
use crate::cli::files::outputs::{self, EncodedFile};
use crate::cli::jobs::row::Row;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::{self, Verbosity, aside, milliseconds};
use crate::error::{Error, Result};
use crate::evolve::cells::{self, Budget};
use crate::evolve::held::Held;
use crate::evolve::{Ended, Ending, StopReason, Tally};
use crate::model::cells::{Course, Standing};
use crate::model::{Canvas, Fly, Mosaic, Painter, Population, Target};
use crate::studio::{CellsSettings, Device, Drawn, Job, OpenedSearch, SchemeSettings, Told, View, difference};

/// Gives each frame of a shot its own random numbers: 2^64 over the golden ratio, as an odd number.
const SEED_STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// A frame as it was evolved.
#[derive(Clone, Debug)]
struct Last {
    number: usize,
    population: Population,
    /// Marginal fitness of its flies.
    fitness: Vec<i64>,
    /// At evaluation size.
    mosaic: Mosaic,
}

/// What a frame is evolved towards, and the course of its search.
struct Task {
    job: Job,
    /// The unchanged picture, which the mosaic is measured against.
    picture: Arc<Target>,
    course: Course,
    budget: Budget,
    flies: Option<Vec<Fly>>,
}

/// Makes frames in order.
pub(super) struct Shooter<'a> {
    options: &'a VideoOptions,
    planned: &'a [Planned],
    store: &'a Store,
    device: &'a Device,
    interrupt: &'a Interrupt,
    painter: Box<dyn Painter>,
    last: Option<Last>,
    /// The held pixels after the frame with this number.
    held: Option<(usize, Held)>,
}

impl<'a> Shooter<'a> {
    /// Opens the device.
    ///
    /// # Errors
    /// If the device has no room.
    pub(super) fn open(
        options: &'a VideoOptions,
        planned: &'a [Planned],
        store: &'a Store,
        device: &'a Device,
        interrupt: &'a Interrupt,
    ) -> Result<Self> {
        let painter = device.open_painter()?;
        Ok(Self { options, planned, store, device, interrupt, painter, last: None, held: None })
    }

    /// Evolves a frame and writes its files, or only those that are missing; returns its row.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the user interrupts. Then nothing of the frame is written.
    pub(super) fn shoot(&mut self, frame: &Planned, watcher: &mut Watcher<'_>) -> Result<Row> {
        let mut row = self.row(frame);
        let began = Instant::now();
        let Task { job, picture, course, budget, flies } = self.task(frame)?;
        row.load_ms = milliseconds(began.elapsed());
        let began = Instant::now();
        let wanted = Arc::clone(&course.target);
        let OpenedSearch { mut search, stand_in } = self.device.open_search(course)?;
        if let Some(reason) = stand_in.filter(|_| self.options.pictures.verbosity == Verbosity::Verbose) {
            terminal::say(&format!("smalti: searching on the CPU, since {reason}"));
        }
        let stop = cells::run(&mut *search, flies.as_deref(), &budget, watcher)?;
        if stop == StopReason::Interrupted {
            return Err(Error::Interrupted);
        }
        let ended = Ended::of_last(search, stop)?;
        self.device.check_validation()?;
        row.evolve_ms = milliseconds(began.elapsed());

        let began = Instant::now();
        let Ended { ending, flies, fitness } = ended;
        let population = job.population(flies);
        let mosaic = self.draw(&population)?;
        let drawn = difference(&mosaic, &wanted).sae();
        if drawn != ending.sae {
            let scored = ending.sae;
            return Err(Error::Internal(format!("a frame had an SAE of {scored} and is drawn with {drawn}")));
        }
        let likeness = difference(&mosaic, &picture);
        // Measured against the unchanged picture, not against the held values of its still pixels.
        let ending = Ending { sae: likeness.sae(), ..ending };
        row.note_population(&population);
        row.note_ending(&ending);
        row.psnr = likeness.psnr_db();
        let last = Last { number: frame.number, population, fitness, mosaic };
        row.output = self.write(frame, &last, &ending, watcher)?;
        self.last = Some(last);
        row.save_ms = milliseconds(began.elapsed());
        Ok(row)
    }

    /// Draws the picture of a frame again from its complete population; returns its row.
    ///
    /// # Errors
    /// If it cannot be drawn or written.
    pub(super) fn redraw(&mut self, frame: &Planned, watcher: &Watcher<'_>) -> Result<Row> {
        let mut row = self.row(frame);
        let path = self.store.population(frame.number);
        let gone = || Error::input(&path, "disappeared while frames were made; run the same command again");
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
        let ending = Ending { stop, sae: number("sae"), tally: Tally::Cells(standing) };
        row.note_ending(&ending);
        row.living = Some(archive.population.flies.iter().filter(|fly| fly.alive).count());
        let is_drawn = self.store.has_picture(frame)?;
        if !is_drawn {
            let mosaic = self.draw(&archive.population)?;
            let Archive { population, fitness, .. } = archive;
            let last = Last { number: frame.number, population, fitness, mosaic };
            row.output = self.write(frame, &last, &ending, watcher)?;
            self.last = Some(last);
        }
        Ok(row)
    }

    /// The row of a frame before its result is known.
    fn row(&self, frame: &Planned) -> Row {
        let pictures = &self.options.pictures;
        let mut row = Row::new(&frame.input, pictures.seed(), pictures.scheme());
        row.device = Some(self.device.label().to_owned());
        row.tiles = Some(frame.tiles);
        let told = if self.options.folder.is_some() { &frame.picture } else { &frame.population };
        row.key = Some(told.key().to_owned());
        row
    }

    /// Draws a population at the size at which it evolved.
    fn draw(&mut self, population: &Population) -> Result<Mosaic> {
        self.painter.draw(population, &Canvas::evaluation(population.width_px, population.height_px), 1)
    }

    /// Writes the files of a frame. The population comes first, since the others can be made again from it.
    /// Returns their paths.
    fn write(&mut self, frame: &Planned, last: &Last, ending: &Ending, watcher: &Watcher<'_>) -> Result<Vec<String>> {
        let told =
            Told { picture: frame.picture.describe(Some(ending)), population: frame.population.describe(Some(ending)) };
        let destinations = self.store.destinations(frame.number)?;
        let view =
            View::new(last.population.width_px, last.population.height_px, self.options.pictures.output_long_side_px);
        let picture = view.is_as_evolved().then(|| last.mosaic.clone().into());
        let (population, marginal) = (last.population.clone(), last.fitness.clone());
        let mut drawn = Drawn { population, marginal, view, picture, layers: None };
        drawn.draw(&mut *self.painter, destination::pieces(&destinations))?;
        let destinations: Vec<_> = destinations.iter().collect();
        let files: Vec<EncodedFile<'_>> = outputs::encode(&destinations, &drawn, &told, Verbosity::Quiet)?;
        files.iter().try_for_each(|file| self.store.check_remade(file))?;
        let mut paths = Vec::new();
        outputs::write(&files, watcher.interrupt, &mut paths).map(|()| paths)
    }

    fn load(&self, frame: &Planned) -> Result<Job> {
        let options = frame_options(self.options, &frame.input);
        let job = aside::unless_interrupted(self.interrupt, move || Job::load(&options.input, &options.settings))?;
        let expected = frame.population.decisive("input_sha256");
        if expected != job.input_sha256.as_str() {
            return Err(Error::input(&frame.input, "changed while frames were made; run the same command again"));
        }
        Ok(job)
    }

    /// What a frame is evolved towards.
    fn task(&mut self, frame: &Planned) -> Result<Task> {
        let mut job = self.load(frame)?;
        let SchemeSettings::Cells(cells) = job.scheme.clone() else {
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
        // All frames of a shot keep the ground and grout of its first frame.
        job.grout = last.population.grout;
        job.background = last.population.background.color();
        let aim = held.target(&last.mosaic, &target)?;
        job.target = Arc::new(held.picture(&target)?);
        let budget = of_rest(budget, held, &last.mosaic, &target);
        let mut course = warm_course(&job, &cells, aim, (frame.number - frame.shot) as u64);
        course.rules.leash = self.options.max_tile_move.map_or(0, |Leash(units)| units);
        Ok(Task { job, picture: target, course, budget, flies: Some(last.population.flies) })
    }

    /// The mosaic of the frame before, from memory or from its file.
    fn last_before(&mut self, frame: &Planned) -> Result<Last> {
        let number = frame.number - 1;
        if let Some(last) = self.last.take_if(|last| last.number == number) {
            return Ok(last);
        }
        let planned = &self.planned[number - self.planned[0].number];
        let path = self.store.population(number);
        let gone = || Error::input(&path, "disappeared while frames were made; run the same command again");
        let Archive { population, fitness, .. } = self.store.whole_population(planned).ok_or_else(gone)?;
        let mosaic = self.draw(&population)?;
        Ok(Last { number, population, fitness, mosaic })
    }

    /// The held pixels at a frame whose picture is `target`. They follow from those after the frame before, or else
    /// from going through the shot from its beginning.
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

/// The budget of a frame with still pixels. A target for the SAE is for all pixels, so the SAE of the still ones is
/// subtracted.
fn of_rest(budget: Budget, held: &Held, shown: &Mosaic, target: &Target) -> Budget {
    let shown = shown.over_black();
    let error = |pixel: usize| {
        let pairs = shown[pixel].iter().zip(target.pixels()[pixel]);
        pairs.map(|(&a, b)| u64::from(a.abs_diff(b))).sum::<u64>()
    };
    let of_still: u64 = (0..shown.len()).filter(|&pixel| held.is_still(pixel)).map(error).sum();
    Budget { target_sae: budget.target_sae.map(|sae| sae.saturating_sub(of_still)), ..budget }
}

/// The course of a frame towards `aim`; `since` counts the frames since its shot began.
fn warm_course(job: &Job, cells: &CellsSettings, aim: Target, since: u64) -> Course {
    let mut course = job.course(cells);
    course.target = Arc::new(aim);
    course.rules.seed = course.rules.seed.wrapping_add(since.wrapping_mul(SEED_STEP));
    course
}
