//! Drives a search in cells: rounds in epochs, and when to stop.
//!
//! Stops are looked at between epochs alone, so that every device ends after the same round. Nothing here knows a device or
//! a clock; an [`Observer`] may.

use super::evolution::StopReason;
use crate::error::Result;
use crate::model::cells::{Course, Search, Standing};
use crate::model::tile::unpack;
use crate::model::{Fly, Rgb};

/// Version of the search: raised whenever the same picture, options and seed lead to another result.
pub const CELLS_VERSION: u32 = 1;
/// Rounds between two looks at the budget; after each so many, depths are spread evenly again.
pub const ROUNDS_PER_EPOCH: u32 = 4;
/// Evals for each fly, unless asked otherwise: two million for the 5,000 flies of a picture of 512x512 px.
pub const EVALS_PER_FLY: u64 = 400;
/// Epochs in a row without an eval after which none is to be expected any more, as of a picture too small for a child.
const IDLE_EPOCHS_MAX: u32 = 256;
/// Of the objective, the share that it must fall by for the search to count as improving: a thousandth.
const IMPROVEMENT: i64 = 1_000;

/// When a search ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Once so many children were evaluated.
    pub evals: u64,
    /// Once the SAE is at most this.
    pub target_sae: Option<u64>,
    /// Once so many children were evaluated in a row while the objective fell by less than a thousandth.
    pub patience: Option<u64>,
}

/// Watches a search and may end it.
pub trait Observer {
    /// Called once before the first round.
    ///
    /// # Errors
    /// If the device fails.
    fn at_start(&mut self, _search: &mut dyn Search) -> Result<()> {
        Ok(())
    }

    /// Whether it wants to be called after every round, too: then a device cannot make several at once.
    fn looks_at_rounds(&self) -> bool {
        false
    }

    /// Called after every round, if some observer wants that.
    ///
    /// # Errors
    /// If the device fails.
    fn after_round(&mut self, _search: &mut dyn Search) -> Result<()> {
        Ok(())
    }

    /// Called after every epoch; a reason ends the search.
    ///
    /// # Errors
    /// If the device fails.
    fn after_epoch(&mut self, search: &mut dyn Search) -> Result<Option<StopReason>>;
}

/// Observes only if there is an observer.
impl<O: Observer> Observer for Option<O> {
    fn at_start(&mut self, search: &mut dyn Search) -> Result<()> {
        self.as_mut().map_or(Ok(()), |observer| observer.at_start(search))
    }

    fn looks_at_rounds(&self) -> bool {
        self.as_ref().is_some_and(O::looks_at_rounds)
    }

    fn after_round(&mut self, search: &mut dyn Search) -> Result<()> {
        self.as_mut().map_or(Ok(()), |observer| observer.after_round(search))
    }

    fn after_epoch(&mut self, search: &mut dyn Search) -> Result<Option<StopReason>> {
        self.as_mut().map_or(Ok(None), |observer| observer.after_epoch(search))
    }
}

/// Both observe; the first reason counts.
impl<A: Observer, B: Observer> Observer for (&mut A, &mut B) {
    fn at_start(&mut self, search: &mut dyn Search) -> Result<()> {
        self.0.at_start(search)?;
        self.1.at_start(search)
    }

    fn looks_at_rounds(&self) -> bool {
        self.0.looks_at_rounds() || self.1.looks_at_rounds()
    }

    fn after_round(&mut self, search: &mut dyn Search) -> Result<()> {
        self.0.after_round(search)?;
        self.1.after_round(search)
    }

    fn after_epoch(&mut self, search: &mut dyn Search) -> Result<Option<StopReason>> {
        let (one, other) = (self.0.after_epoch(search)?, self.1.after_epoch(search)?);
        Ok(one.or(other))
    }
}

/// Searches, from `first` if there are flies to begin with, until the budget is spent or `observer` says so. The last
/// population is the best one, since the objective never rises.
///
/// # Errors
/// If the device fails.
pub fn run(
    search: &mut dyn Search,
    first: Option<&[Fly]>,
    budget: &Budget,
    observer: &mut dyn Observer,
) -> Result<StopReason> {
    if let Some(flies) = first {
        search.load(flies)?;
    }
    observer.at_start(search)?;
    let mut mark = search.standing();
    let mut idle_epochs = 0;
    loop {
        if let Some(reason) = spent(search, budget, &mut mark)? {
            return Ok(reason);
        }
        let evals = search.standing().evals;
        if observer.looks_at_rounds() {
            for _ in 0..ROUNDS_PER_EPOCH {
                search.advance(1)?;
                observer.after_round(search)?;
            }
        } else {
            search.advance(ROUNDS_PER_EPOCH)?;
        }
        search.renormalise()?;
        idle_epochs = if search.standing().evals == evals { idle_epochs + 1 } else { 0 };
        if idle_epochs == IDLE_EPOCHS_MAX {
            return Ok(StopReason::Dry);
        }
        if let Some(reason) = observer.after_epoch(search)? {
            return Ok(reason);
        }
    }
}

/// Why the search ends here, if it does; `mark` is where the objective had fallen by a thousandth for the last time.
fn spent(search: &mut dyn Search, budget: &Budget, mark: &mut Standing) -> Result<Option<StopReason>> {
    let now = search.standing();
    if let Some(target) = budget.target_sae
        && is_reached(search, target)?
    {
        return Ok(Some(StopReason::TargetSae));
    }
    if now.evals >= budget.evals {
        return Ok(Some(StopReason::Evals));
    }
    if now.objective < mark.objective - mark.objective / IMPROVEMENT {
        *mark = now;
    }
    let is_stuck = budget.patience.is_some_and(|patience| now.evals - mark.evals >= patience);
    Ok(is_stuck.then_some(StopReason::Patience))
}

/// Whether the SAE is at most `target`; the objective, which is never lower, often tells.
fn is_reached(search: &mut dyn Search, target: u64) -> Result<bool> {
    let objective = search.standing().objective;
    if u64::try_from(objective).is_ok_and(|objective| objective <= target) {
        return Ok(true);
    }
    Ok(!lowers_sae_alone(search.course()) && sae(search)? <= target)
}

/// Whether the objective of a course is the SAE: no pixel weighs more than another, all are wanted, and nothing is penalised.
#[must_use]
pub fn lowers_sae_alone(course: &Course) -> bool {
    let penalties = &course.rules.penalties;
    let is_plain = course.target.weights().is_none() && course.target.transparent().is_none();
    is_plain && (penalties.overlap, penalties.hole, penalties.turn) == (0, 0, 0)
}

/// The SAE of the mosaic as a search stands: over all pixels that are wanted, whatever they weigh.
///
/// # Errors
/// If the device fails.
pub fn sae(search: &mut dyn Search) -> Result<u64> {
    if lowers_sae_alone(search.course()) {
        return Ok(search.standing().objective.unsigned_abs());
    }
    let stacks = search.read_back_stacks()?;
    let Course { target, rules, .. } = search.course();
    let ground = unpack(rules.background);
    let error = |(pixel, stack): (usize, &Vec<(u32, i32)>)| {
        if target.transparent().is_some_and(|transparent| transparent[pixel]) {
            return 0;
        }
        let weight = target.weights().map_or(1, |weights| u64::from(weights[pixel]));
        stack.first().map_or_else(|| difference(target.pixels()[pixel], ground), |&(_, error)| error as u64 / weight)
    };
    Ok(stacks.pixels.iter().enumerate().map(error).sum())
}

fn difference(one: Rgb, other: Rgb) -> u64 {
    one.iter().zip(other).map(|(&a, b)| u64::from(a.abs_diff(b))).sum()
}
