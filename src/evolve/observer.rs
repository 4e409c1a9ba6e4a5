//! Observers, which watch the work on a picture in either scheme and may end it.

use super::brake::Brake;
use super::evolution::{Evolution, StopReason};
use super::objective::{self, lowers_sae_alone};
use crate::error::Result;
use crate::model::Fly;
use crate::model::cells::Search;

/// What an observer sees.
pub enum Seen<'a> {
    /// Evolutions in the paper's scheme, in the order of their lanes.
    Evolutions(&'a [Evolution]),
    /// A search in cells.
    Search(&'a mut dyn Search),
}

/// How far a picture has come, in terms of both schemes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stage {
    /// Children that were evaluated; in the paper's scheme each is a birth.
    pub evals: u64,
    /// Children that took a place.
    pub births: u64,
    /// The value that is lowered, for the best population: the SAE, or the objective of a search with weights or
    /// penalties.
    pub error: i64,
    /// Whether `error` is the SAE.
    pub is_sae: bool,
    /// Restarts made.
    pub restarts: u32,
}

impl Seen<'_> {
    /// How far the work has come. Several evolutions count together.
    #[must_use]
    pub fn stage(&self) -> Stage {
        match self {
            Self::Evolutions(evolutions) => {
                let births = evolutions.iter().map(|evolution| evolution.outcome().births).sum();
                let sae: u64 = evolutions.iter().filter_map(Evolution::best_sae).sum();
                let restarts = evolutions.iter().map(|evolution| evolution.outcome().restarts).sum();
                Stage { evals: births, births, error: sae as i64, is_sae: true, restarts }
            }
            Self::Search(search) => {
                let standing = search.standing();
                Stage {
                    evals: standing.evals,
                    births: standing.births,
                    error: standing.objective,
                    is_sae: lowers_sae_alone(search.course()),
                    restarts: 0,
                }
            }
        }
    }

    /// The SAE of the best population, summed over several evolutions.
    ///
    /// # Errors
    /// If the device fails.
    pub fn sae(&mut self) -> Result<u64> {
        match self {
            Self::Evolutions(evolutions) => Ok(evolutions.iter().filter_map(Evolution::best_sae).sum()),
            Self::Search(search) => objective::sae(&mut **search),
        }
    }

    /// The best population. Of several evolutions, that of the first.
    ///
    /// # Errors
    /// If the device fails.
    pub fn best_flies(&mut self) -> Result<Vec<Fly>> {
        match self {
            Self::Evolutions(evolutions) => {
                Ok(evolutions.first().map_or_else(Vec::new, |one| one.best_flies().to_vec()))
            }
            Self::Search(search) => Ok(search.read_back()?.flies),
        }
    }
}

/// Watches the work on a picture, and may end it.
pub trait Observer {
    /// Called once, after the first population was evaluated, or before the first round of a search.
    ///
    /// # Errors
    /// If the device fails.
    fn at_start(&mut self, _seen: &mut Seen<'_>) -> Result<()> {
        Ok(())
    }

    /// Whether it wants to be called after every round of a search, too. Then a device cannot make several rounds in
    /// one call.
    fn looks_at_rounds(&self) -> bool {
        false
    }

    /// What may end a search in the middle of a round, which is then as if it had never begun. It is taken once for
    /// each step.
    fn brake(&self) -> Brake {
        Brake::default()
    }

    /// Called after every generation of the paper's scheme, and after every round of a search if some observer looks at
    /// rounds. A returned reason ends the work. In a search the depths are not yet spread.
    ///
    /// # Errors
    /// If the device fails.
    fn after_round(&mut self, _seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        Ok(None)
    }

    /// Called after every generation of the paper's scheme, and after every epoch of a search. A returned reason ends
    /// the work.
    ///
    /// # Errors
    /// If the device fails.
    fn after_epoch(&mut self, _seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        Ok(None)
    }

    /// Called once, when the work has ended for any reason except a failure.
    ///
    /// # Errors
    /// If the device fails.
    fn at_end(&mut self, _seen: &mut Seen<'_>) -> Result<()> {
        Ok(())
    }
}

/// An observer that never ends anything.
#[derive(Clone, Copy, Debug, Default)]
pub struct Undisturbed;

impl Observer for Undisturbed {}

/// Observes only if there is an observer.
impl<O: Observer> Observer for Option<O> {
    fn at_start(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        self.as_mut().map_or(Ok(()), |observer| observer.at_start(seen))
    }

    fn looks_at_rounds(&self) -> bool {
        self.as_ref().is_some_and(O::looks_at_rounds)
    }

    fn brake(&self) -> Brake {
        self.as_ref().map_or_else(Brake::default, O::brake)
    }

    fn after_round(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        self.as_mut().map_or(Ok(None), |observer| observer.after_round(seen))
    }

    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        self.as_mut().map_or(Ok(None), |observer| observer.after_epoch(seen))
    }

    fn at_end(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        self.as_mut().map_or(Ok(()), |observer| observer.at_end(seen))
    }
}

/// Both observe. If both return a reason, the first one counts.
impl<A: Observer + ?Sized, B: Observer + ?Sized> Observer for (&mut A, &mut B) {
    fn at_start(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        self.0.at_start(seen)?;
        self.1.at_start(seen)
    }

    fn looks_at_rounds(&self) -> bool {
        self.0.looks_at_rounds() || self.1.looks_at_rounds()
    }

    fn brake(&self) -> Brake {
        self.0.brake().and(self.1.brake())
    }

    fn after_round(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        let (one, other) = (self.0.after_round(seen)?, self.1.after_round(seen)?);
        Ok(one.or(other))
    }

    fn after_epoch(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
        let (one, other) = (self.0.after_epoch(seen)?, self.1.after_epoch(seen)?);
        Ok(one.or(other))
    }

    fn at_end(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        self.0.at_end(seen)?;
        self.1.at_end(seen)
    }
}
