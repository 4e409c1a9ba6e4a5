//! The interface of a search, whether the CPU twin or a device computes it.

use std::sync::Arc;

use super::glaze::opacity_of;
use super::rules::Rules;
use crate::error::{Error, Result};
use crate::model::tile::unpack;
use crate::model::translucency::Compositing;
use crate::model::{Blend, Fly, Guide, MaskSet, Rgb, Target};

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
    /// Whether all tiles are plain squares without grout and all pixels have the same weight. Evaluators are faster
    /// then.
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
    /// The most evals that a round can have: a fixed number of steps for each fly, each with all candidates.
    #[must_use]
    pub fn evals_per_round(&self) -> u64 {
        self.fly_count as u64 * u64::from(self.rules.steps_per_fly) * u64::from(self.rules.candidates)
    }

    /// Whether the masks' coverage is opacity. Then a pixel shows all tiles on it ([`crate::model::translucency`]),
    /// tiles have no grout, and only turning is penalised.
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
    /// What the search minimises: the error, weighted by the target's weights, plus all penalties.
    pub objective: i64,
}

/// The population of a search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SearchState {
    /// The flies.
    pub flies: Vec<Fly>,
    /// Their step sizes, u16.16.
    pub steps: Vec<u32>,
    /// Their marginal fitness: the objective without a fly minus the objective with it.
    pub fitness: Vec<i64>,
}

/// The flies on every pixel, nearest first, with their errors or, if they are translucent, their looks
/// (`model::cells::glaze`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stacks {
    /// (fly, error or look) of each fly on a pixel; pixels row by row.
    pub pixels: Vec<Vec<(u32, i32)>>,
}

impl Stacks {
    /// The SAE of the mosaic of these stacks, over all wanted pixels, without weights.
    #[must_use]
    pub fn sae(&self, Course { target, rules, masks, .. }: &Course) -> u64 {
        let ground = unpack(rules.background);
        let is_translucent = masks.blend() == Blend::Translucent;
        let error = |(pixel, stack): (usize, &Vec<(u32, i32)>)| {
            if target.transparent().is_some_and(|transparent| transparent[pixel]) {
                return 0;
            }
            if is_translucent {
                let mut compositing = Compositing::START;
                stack.iter().for_each(|&(_, look)| compositing.add(opacity_of(look as u32), unpack(look as u32)));
                return difference(target.pixels()[pixel], compositing.over(ground));
            }
            let weight = target.weights().map_or(1, |weights| u64::from(weights[pixel]));
            stack
                .first()
                .map_or_else(|| difference(target.pixels()[pixel], ground), |&(_, error)| error as u64 / weight)
        };
        self.pixels.iter().enumerate().map(error).sum()
    }
}

fn difference(one: Rgb, other: Rgb) -> u64 {
    one.iter().zip(other).map(|(&a, b)| u64::from(a.abs_diff(b))).sum()
}

/// Asks whether a search is to be cut short: many times in a round, and from any thread.
pub type Ask<'a> = &'a (dyn Fn() -> bool + Sync);

/// Searches one picture, round by round. Every implementation reaches the same state after every round.
pub trait Search: Send {
    /// What stays the same.
    fn course(&self) -> &Course;

    /// Replaces the population and resets all counts. A fly becomes absent if it would lie deeper on a pixel than the
    /// search keeps track of, or if fitting its sides to the bounds would move it beyond its leash.
    ///
    /// # Errors
    /// If the device fails.
    fn load(&mut self, flies: &[Fly]) -> Result<()>;

    /// Makes some rounds.
    ///
    /// # Errors
    /// If the device fails.
    fn advance(&mut self, rounds: u32) -> Result<()> {
        self.advance_until(rounds, &|| false).map(|_| ())
    }

    /// Makes some rounds, or fewer if `is_over` says so in the middle of one. Then the search is where a round ended,
    /// as if that one had never begun, and this returns false. Which of these rounds it was may differ from device to
    /// device.
    ///
    /// # Errors
    /// If the device fails.
    fn advance_until(&mut self, rounds: u32, is_over: Ask<'_>) -> Result<bool>;

    /// Spreads the depths evenly over their range, in the same order: the picture stays as it is.
    ///
    /// # Errors
    /// If the device fails.
    fn renormalise(&mut self) -> Result<()>;

    /// How far the search has come.
    fn standing(&self) -> Standing;

    /// The population.
    ///
    /// # Errors
    /// If the device fails.
    fn read_back(&mut self) -> Result<SearchState>;

    /// As [`Search::read_back`], of a search that has ended. What it holds need not be copied.
    ///
    /// # Errors
    /// If the device fails.
    fn into_state(mut self: Box<Self>) -> Result<SearchState> {
        self.read_back()
    }

    /// The SAE of the current mosaic, over all wanted pixels, without weights.
    ///
    /// # Errors
    /// If the device fails.
    fn sae(&mut self) -> Result<u64> {
        let stacks = self.read_back_stacks()?;
        Ok(stacks.sae(self.course()))
    }

    /// The flies on every pixel.
    ///
    /// # Errors
    /// If the device fails.
    fn read_back_stacks(&mut self) -> Result<Stacks>;
}

/// Searches several pictures side by side on one device. A lane is one search; its result never depends on the others.
///
/// # Panics
/// Methods that name a lane may panic if it was never admitted, or was dismissed.
pub trait SearchLanes: Send {
    /// Adds a search and returns its lane. The search begins with the flies of `first`, or with absent flies without
    /// it. Returns `None` if there is no room until another lane is dismissed.
    ///
    /// # Errors
    /// If the search is too large for the device even alone, which leaves the other lanes as they are; or if the device
    /// fails.
    fn admit(&mut self, course: Course, first: Option<&[Fly]>) -> Result<Option<usize>>;

    /// Removes a search; its lane may go to the next one.
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

    /// Marks where a lane is that is not busy, so that [`SearchLanes::cut`] can take it back there.
    ///
    /// # Errors
    /// If the device fails.
    fn mark(&mut self, lane: usize) -> Result<()>;

    /// Takes a lane back to where it was marked, or to where a later round ended; it is not busy then.
    ///
    /// # Errors
    /// If the device fails.
    fn cut(&mut self, lane: usize) -> Result<()>;

    /// Most rounds to ask a lane for at once if they may be cut short: all of them are lost then.
    fn rounds_between_marks(&self, lane: usize) -> u32;

    /// Asks for `rounds` more rounds.
    ///
    /// # Errors
    /// If the device fails.
    fn ask(&mut self, lane: usize, rounds: u32) -> Result<()>;

    /// Whether a lane has rounds to make.
    fn is_busy(&self, lane: usize) -> bool;

    /// Makes one submission for all lanes that have rounds to make. It ends about when the first of them is done, and
    /// sooner if it would keep the caller from its clock for too long.
    ///
    /// # Errors
    /// If the device fails, which ends all lanes.
    fn work(&mut self) -> Result<()>;

    /// Why a lane failed, if it did. A failed lane is not busy and makes no more rounds; its error is returned only
    /// once.
    fn failure(&mut self, lane: usize) -> Option<Error>;

    /// As [`Search::renormalise`], for lanes that are not busy.
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

/// One lane as a search of its own. While it makes rounds, the other lanes make theirs.
pub struct OneLane<'a> {
    /// All lanes.
    pub lanes: &'a mut dyn SearchLanes,
    /// The lane that this search is.
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

    fn advance_until(&mut self, rounds: u32, is_over: Ask<'_>) -> Result<bool> {
        let mut left = rounds;
        while left > 0 {
            let asked = left.min(self.lanes.rounds_between_marks(self.lane));
            self.lanes.mark(self.lane)?;
            self.lanes.ask(self.lane, asked)?;
            while self.lanes.is_busy(self.lane) {
                if is_over() {
                    self.lanes.cut(self.lane)?;
                    return Ok(false);
                }
                self.lanes.work()?;
            }
            if let Some(error) = self.lanes.failure(self.lane) {
                return Err(error);
            }
            left -= asked;
        }
        Ok(true)
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

/// Lanes of which there is one, as a search.
pub struct Only<L> {
    lanes: L,
    lane: usize,
}

impl<L: SearchLanes> Only<L> {
    /// The search of this lane, the only one of these.
    pub fn of(lanes: L, lane: usize) -> Self {
        Self { lanes, lane }
    }

    fn only(&mut self) -> OneLane<'_> {
        OneLane { lanes: &mut self.lanes, lane: self.lane }
    }
}

impl<L: SearchLanes> Search for Only<L> {
    fn course(&self) -> &Course {
        self.lanes.course(self.lane)
    }

    fn load(&mut self, flies: &[Fly]) -> Result<()> {
        self.only().load(flies)
    }

    fn advance(&mut self, rounds: u32) -> Result<()> {
        self.only().advance(rounds)
    }

    fn advance_until(&mut self, rounds: u32, is_over: Ask<'_>) -> Result<bool> {
        self.only().advance_until(rounds, is_over)
    }

    fn renormalise(&mut self) -> Result<()> {
        self.only().renormalise()
    }

    fn standing(&self) -> Standing {
        self.lanes.standing(self.lane)
    }

    fn read_back(&mut self) -> Result<SearchState> {
        self.only().read_back()
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
        self.only().read_back_stacks()
    }
}
