//! What a search answers, whoever computes it: the CPU twin or a device.

use std::sync::Arc;

use super::rules::Rules;
use crate::error::{Error, Result};
use crate::model::{Blend, Fly, Guide, MaskSet, Target};

/// What stays the same while a picture is searched.
#[derive(Clone, Debug)]
pub struct Course {
    /// What decides the steps.
    pub rules: Rules,
    /// The picture to match.
    pub target: Arc<Target>,
    /// Directions and sizes for the tiles.
    pub guide: Arc<Guide>,
    /// Tile shapes that the flies may wear.
    pub masks: Arc<MaskSet>,
    /// Number of flies, absent ones included.
    pub fly_count: usize,
}

impl Course {
    /// Whether all tiles are squares of one colour without grout, and all pixels count the same: evaluators have a faster way for that.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        !self.is_translucent()
            && self.masks.layers().len() == 1
            && self.rules.grout == 0
            && self.target.weights().is_none()
            && self.target.transparent().is_none()
    }
}

impl Course {
    /// Whether the masks' coverage is opacity: then pixels show all tiles on them, nearest first ([`crate::model::translucency`]), tiles
    /// have no grout, and the only penalty is that for turning.
    #[must_use]
    pub fn is_translucent(&self) -> bool {
        self.masks.blend() == Blend::Translucent
    }
}

/// How far a search has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Standing {
    /// Rounds made.
    pub rounds: u32,
    /// Children evaluated.
    pub evals: u64,
    /// Children born at a place of large error that were accepted.
    pub births: u64,
    /// Children accepted in all.
    pub accepted: u64,
    /// What the search lowers: the error, weighed as the target says, and all penalties.
    pub objective: i64,
}

/// The population as a search leaves it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SearchState {
    /// The flies.
    pub flies: Vec<Fly>,
    /// Their step sizes, u16.16.
    pub steps: Vec<u32>,
    /// Their marginal fitness: the objective without a fly minus the objective with it.
    pub fitness: Vec<i64>,
}

/// The flies on every pixel, nearest first, and their errors or, if they are translucent, their looks (`model::cells::glaze`); pixels
/// row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stacks {
    /// Per pixel, (fly, error or look) of each fly on it.
    pub pixels: Vec<Vec<(u32, i32)>>,
}

/// Searches one picture, round by round. Every implementation comes to the same state after every round.
pub trait Search: Send {
    /// What stays the same.
    fn course(&self) -> &Course;

    /// Replaces the population, and begins to count anew. Flies that would stack deeper on a pixel than the search keeps track
    /// of become absent, and so do those that the bounds of their sides would take off their leash.
    ///
    /// # Errors
    /// If the device fails.
    fn load(&mut self, flies: &[Fly]) -> Result<()>;

    /// Makes some rounds.
    ///
    /// # Errors
    /// If the device fails.
    fn advance(&mut self, rounds: u32) -> Result<()>;

    /// Spreads the depths evenly over their range, in the same order: the picture stays as it is.
    ///
    /// # Errors
    /// If the device fails.
    fn renormalise(&mut self) -> Result<()>;

    /// How far it has come.
    fn standing(&self) -> Standing;

    /// The population.
    ///
    /// # Errors
    /// If the device fails.
    fn read_back(&mut self) -> Result<SearchState>;

    /// The flies on every pixel.
    ///
    /// # Errors
    /// If the device fails.
    fn read_back_stacks(&mut self) -> Result<Stacks>;
}

/// Searches several pictures side by side on one device. A lane is one search; what it comes to never depends on the others.
///
/// # Panics
/// All methods that name a lane may, if it was not admitted or was dismissed.
pub trait SearchLanes: Send {
    /// Takes in a search, which begins with the flies of `first` or, without, with absent ones; returns its lane. None: there is no room
    /// until others are dismissed.
    ///
    /// # Errors
    /// If the search alone is too large for the device, which concerns no other lane; or if the device fails.
    fn admit(&mut self, course: Course, first: Option<&[Fly]>) -> Result<Option<usize>>;

    /// Lets a search go; its lane may be another one's next.
    fn dismiss(&mut self, lane: usize);

    /// What stays the same in a lane.
    fn course(&self, lane: usize) -> &Course;

    /// How far a lane has come.
    fn standing(&self, lane: usize) -> Standing;

    /// As [`Search::load`].
    ///
    /// # Errors
    /// If the device fails.
    fn load(&mut self, lane: usize, flies: &[Fly]) -> Result<()>;

    /// Asks for so many rounds more.
    ///
    /// # Errors
    /// If the device fails.
    fn ask(&mut self, lane: usize, rounds: u32) -> Result<()>;

    /// Whether a lane has rounds to make.
    fn is_busy(&self, lane: usize) -> bool;

    /// Makes one submission for all lanes that have rounds to make: until about one of them is done, and no longer than the clock may
    /// wait.
    ///
    /// # Errors
    /// If the device fails, which ends all lanes.
    fn work(&mut self) -> Result<()>;

    /// Why a lane will make no more rounds, if it failed; told once. It is not busy then.
    fn failure(&mut self, lane: usize) -> Option<Error>;

    /// As [`Search::renormalise`], of lanes that are not busy.
    ///
    /// # Errors
    /// If the device fails.
    fn renormalise(&mut self, lanes: &[usize]) -> Result<()>;

    /// As [`Search::read_back`].
    ///
    /// # Errors
    /// If the device fails.
    fn read_back(&mut self, lane: usize) -> Result<SearchState>;

    /// As [`Search::read_back_stacks`].
    ///
    /// # Errors
    /// If the device fails.
    fn read_back_stacks(&mut self, lane: usize) -> Result<Stacks>;
}

/// One lane as a search of its own. While it makes rounds, the others make those that they were asked for.
pub struct OneLane<'a> {
    /// All lanes.
    pub lanes: &'a mut dyn SearchLanes,
    /// The one.
    pub lane: usize,
}

impl Search for OneLane<'_> {
    fn course(&self) -> &Course {
        self.lanes.course(self.lane)
    }

    fn load(&mut self, flies: &[Fly]) -> Result<()> {
        self.lanes.load(self.lane, flies)
    }

    fn advance(&mut self, rounds: u32) -> Result<()> {
        self.lanes.ask(self.lane, rounds)?;
        while self.lanes.is_busy(self.lane) {
            self.lanes.work()?;
        }
        self.lanes.failure(self.lane).map_or(Ok(()), Err)
    }

    fn renormalise(&mut self) -> Result<()> {
        self.lanes.renormalise(&[self.lane])
    }

    fn standing(&self) -> Standing {
        self.lanes.standing(self.lane)
    }

    fn read_back(&mut self) -> Result<SearchState> {
        self.lanes.read_back(self.lane)
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
        self.lanes.read_back_stacks(self.lane)
    }
}
