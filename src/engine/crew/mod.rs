//! A crew: pictures of either scheme that share a device. A picture that ends makes room for the next one at once.

mod evolutions;
mod searches;

use evolutions::Evolutions;
use searches::Searches;

use crate::error::{Error, Result};
use crate::evolve::cells::Budget;
use crate::evolve::{Ended, PaperScheme};
use crate::model::cells::{Course, SearchLanes};
use crate::model::{Evaluator, Fly, Scene};

/// A search in cells: what it needs, and where it begins.
#[derive(Clone, Debug)]
pub struct SearchTask {
    /// What stays the same during the search.
    pub course: Course,
    /// The flies to begin with. With none, all flies are absent at first.
    pub first: Option<Vec<Fly>>,
    /// When the search ends.
    pub budget: Budget,
}

/// An evolution in the paper's scheme: what it needs, and where it begins.
#[derive(Clone, Debug)]
pub struct PaperTask {
    /// The picture, and the look of its tiles.
    pub scene: Scene,
    /// The scheme.
    pub scheme: PaperScheme,
    /// The first population, from [`crate::evolve::first_population`] or [`crate::evolve::begin_from`].
    pub first_flies: Vec<Fly>,
}

/// The work on a picture.
#[derive(Clone, Debug)]
pub enum Task {
    /// A search in cells.
    Search(SearchTask),
    /// An evolution in the paper's scheme.
    Paper(PaperTask),
}

/// A picture that left the crew.
#[derive(Debug)]
pub struct Finished {
    /// The number that it was admitted under.
    pub ticket: u64,
    /// Its result, or why it failed. The others go on in either case.
    pub outcome: Result<Ended>,
}

/// Pictures in the lanes of a device. Each has the same result, byte for byte, as it would have alone.
#[derive(Default)]
pub struct Crew {
    searches: Option<Searches>,
    evolutions: Option<Evolutions>,
}

impl Crew {
    /// A crew for searches in cells. All `lanes` must be free.
    #[must_use]
    pub fn with_searches(self, lanes: Box<dyn SearchLanes>) -> Self {
        Self { searches: Some(Searches::new(lanes)), ..self }
    }

    /// A crew for evolutions in the paper's scheme.
    ///
    /// # Panics
    /// If the evaluator has lanes already.
    #[must_use]
    pub fn with_evolutions(self, evaluator: Box<dyn Evaluator>) -> Self {
        Self { evolutions: Some(Evolutions::new(evaluator)), ..self }
    }

    /// Number of pictures at work.
    #[must_use]
    pub fn len(&self) -> usize {
        self.searches.as_ref().map_or(0, Searches::len) + self.evolutions.as_ref().map_or(0, Evolutions::len)
    }

    /// Whether no picture is at work.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Children evaluated for all pictures at work.
    #[must_use]
    pub fn evals(&self) -> u64 {
        let searched = |searches: &Searches| searches.standings().map(|standing| standing.evals).sum::<u64>();
        self.searches.as_ref().map_or(0, searched) + self.evolutions.as_ref().map_or(0, Evolutions::births)
    }

    /// Takes in a picture under a number that the caller chooses. Returns false if there is no room until others
    /// finish; an empty crew returns an error instead. Work on the picture begins with the next step.
    ///
    /// # Errors
    /// [`Error::TooLarge`] or [`Error::OutOfDeviceMemory`] if the device cannot hold this picture, which does not
    /// affect the others; [`Error::Internal`] if the crew is for the other scheme; or if the device fails, which
    /// [`Crew::step`] will report, too.
    ///
    /// # Panics
    /// If the first population of a [`PaperTask`] is not as large as its scene says, or empty.
    pub fn admit(&mut self, ticket: u64, task: Task) -> Result<bool> {
        let missing = || Error::Internal("a crew was given a picture of a scheme that it has no lanes for".to_owned());
        match task {
            Task::Search(task) => self.searches.as_mut().ok_or_else(missing)?.admit(ticket, task),
            Task::Paper(task) => self.evolutions.as_mut().ok_or_else(missing)?.admit(ticket, task),
        }
    }

    /// Works on all pictures for a few milliseconds, or for about one epoch of a search at most. Returns the pictures
    /// that ended. Between steps the caller may look at the clock, and admit others.
    ///
    /// # Errors
    /// If the device fails, which ends all pictures.
    pub fn step(&mut self) -> Result<Vec<Finished>> {
        let mut finished = Vec::new();
        if let Some(searches) = self.searches.as_mut().filter(|searches| searches.len() > 0) {
            finished.extend(searches.step()?);
        }
        if let Some(evolutions) = self.evolutions.as_mut().filter(|evolutions| evolutions.len() > 0) {
            finished.extend(evolutions.step()?);
        }
        Ok(finished)
    }

    /// Drops all pictures. Their state is lost.
    pub fn cancel_all(&mut self) {
        if let Some(searches) = &mut self.searches {
            searches.cancel_all();
        }
        if let Some(evolutions) = &mut self.evolutions {
            evolutions.cancel_all();
        }
    }
}
