//! Drives a search in cells: groups rounds into epochs, and decides when to stop.
//!
//! Reasons to stop are checked between epochs, and the number of evals after every round that may reach the limit. So
//! every device ends after the same round. Nothing here knows a device or a clock; an [`Observer`] may, and its brake
//! may cut a round short: then the search ends where an earlier round did, as a budget of so many evals ends it.

use std::sync::OnceLock;

use super::brake::Brake;
use super::evolution::StopReason;
use super::objective::{lowers_sae_alone, sae};
use super::observer::{Observer, Seen};
use crate::error::Result;
use crate::model::Fly;
use crate::model::cells::{Search, Standing};

/// Most rounds of an epoch. After each epoch, depths are spread evenly again.
pub const ROUNDS_PER_EPOCH: u32 = 4;
/// Most evals of an epoch of several rounds, so that observers see it every some tenths of a second.
const EVALS_PER_EPOCH: u64 = 250_000;
/// Default number of evals for each fly: two million for the 5,000 flies of a picture of 512x512 px.
pub const EVALS_PER_FLY: u64 = 400;
/// After this many epochs in a row without an eval, none is to be expected, for instance because the picture is too
/// small for a child.
const IDLE_EPOCHS_MAX: u32 = 256;
/// The search counts as improving if the objective falls by its share of one divided by this number: a thousandth.
const IMPROVEMENT: i64 = 1_000;

/// When a search ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// After this many children were evaluated.
    pub evals: u64,
    /// Once the SAE is at most this.
    pub target_sae: Option<u64>,
    /// After this many children were evaluated in a row while the objective fell by less than a thousandth.
    pub patience: Option<u64>,
}

/// Runs a search until the budget is spent or `observer` ends it. It begins with the flies of `first`, if given. The
/// last population is the best one, since the objective never rises.
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
    observer.at_start(&mut Seen::Search(search))?;
    let pace = if observer.looks_at_rounds() { Pace::Rounds } else { Pace::Epochs };
    let mut drive = Drive::new(search, *budget, pace);
    let reason = loop {
        if let Some(reason) = step(search, &mut drive, observer)? {
            break reason;
        }
    };
    observer.at_end(&mut Seen::Search(search))?;
    Ok(reason)
}

/// Does the next step of a search; returns a reason if the search has ended.
///
/// # Errors
/// If the device fails, or `observer`.
pub fn step(search: &mut dyn Search, drive: &mut Drive, observer: &mut dyn Observer) -> Result<Option<StopReason>> {
    match drive.next(search)? {
        Next::Advance(rounds) => {
            if let Some(reason) = advance(search, rounds, &observer.brake())? {
                // Where an epoch ended, depths are spread already, and in the first population nobody spreads them.
                if search.standing().rounds == drive.begun.rounds {
                    return Ok(Some(reason));
                }
                drive.cut_epoch(reason);
                return Ok(None);
            }
            if drive.pace == Pace::Rounds
                && let Some(reason) = observer.after_round(&mut Seen::Search(search))?
            {
                drive.cut_epoch(reason);
            }
            Ok(None)
        }
        Next::Spread => {
            search.renormalise()?;
            let ended = drive.end_epoch(search.standing());
            if ended.is_some() {
                return Ok(ended);
            }
            let reason = observer.after_epoch(&mut Seen::Search(search))?;
            Ok(drive.cut.or(reason))
        }
        Next::Done(reason) => Ok(Some(reason)),
    }
}

/// Ends a search that stands between two epochs and has no reason to go on, as its next [`step`] would; returns that
/// reason. Otherwise nothing happens.
///
/// # Errors
/// If the device fails.
pub fn end_if_spent(search: &mut dyn Search, drive: &mut Drive) -> Result<Option<StopReason>> {
    let is_within_an_epoch = drive.rounds_left.is_some_and(|left| left > 0);
    if is_within_an_epoch && search.standing().evals < drive.budget.evals {
        return Ok(None);
    }
    let Some(reason) = spent(search, &drive.budget, &mut drive.mark)? else { return Ok(None) };
    if drive.rounds_left.take().is_some() {
        search.renormalise()?;
    }
    Ok(Some(reason))
}

/// Makes some rounds; returns a reason if one of them was cut short.
fn advance(search: &mut dyn Search, rounds: u32, brake: &Brake) -> Result<Option<StopReason>> {
    if brake.is_absent() {
        // A device need not remember where the rounds began.
        return search.advance(rounds).map(|()| None);
    }
    let found = OnceLock::new();
    let is_over = || {
        let reason = brake.reason();
        reason.inspect(|reason| _ = found.set(*reason));
        reason.is_some()
    };
    let is_whole = search.advance_until(rounds, &is_over)?;
    Ok(if is_whole { None } else { found.get().copied() })
}

/// How many rounds a search makes in one call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// One at a time.
    Rounds,
    /// All rounds of an epoch, if the budget allows it, so that a device need not wait between them.
    Epochs,
}

/// What a search does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Make this many rounds.
    Advance(u32),
    /// Spread the depths, then call [`Drive::end_epoch`].
    Spread,
    /// Nothing: the search has ended.
    Done(StopReason),
}

/// Drives a search step by step, for callers that drive several at the same time. [`run`] does all steps in one call.
///
/// A round makes the same number of evals on every device, so the budget is spent after the same round everywhere.
#[derive(Clone, Debug)]
pub struct Drive {
    budget: Budget,
    pace: Pace,
    /// Evals and objective when the objective had last fallen by a thousandth.
    mark: Standing,
    idle_epochs: u32,
    /// Where the epoch began.
    begun: Standing,
    /// Rounds left of the current epoch, if there is one.
    rounds_left: Option<u32>,
    /// Why an observer ended the search in the middle of an epoch.
    cut: Option<StopReason>,
}

impl Drive {
    /// The drive of a search that is at its beginning.
    #[must_use]
    pub fn new(search: &dyn Search, budget: Budget, pace: Pace) -> Self {
        let (mark, begun) = (search.standing(), Standing::default());
        Self { budget, pace, mark, idle_epochs: 0, begun, rounds_left: None, cut: None }
    }

    /// The next step of the search. The caller must have done the step before.
    ///
    /// # Errors
    /// If the device fails.
    pub fn next(&mut self, search: &mut dyn Search) -> Result<Next> {
        let standing = search.standing();
        let evals = standing.evals;
        match self.rounds_left {
            Some(left) if left == 0 || evals >= self.budget.evals => {
                self.rounds_left = None;
                Ok(Next::Spread)
            }
            Some(left) => {
                self.rounds_left = Some(left - 1);
                Ok(Next::Advance(1))
            }
            None => Ok(match spent(search, &self.budget, &mut self.mark)? {
                Some(reason) => Next::Done(reason),
                None => Next::Advance(self.begin_epoch(standing, search.course().evals_per_round())),
            }),
        }
    }

    /// Begins an epoch; returns the number of rounds to make first. Far from the end of the budget these are all.
    fn begin_epoch(&mut self, begun: Standing, evals_per_round: u64) -> u32 {
        let rounds = (EVALS_PER_EPOCH / evals_per_round.max(1)).clamp(1, u64::from(ROUNDS_PER_EPOCH)) as u32;
        let is_near_the_end = self.budget.evals.saturating_sub(begun.evals) <= evals_per_round * u64::from(rounds);
        let asked = if self.pace == Pace::Rounds || is_near_the_end { 1 } else { rounds };
        self.begun = begun;
        self.rounds_left = Some(rounds - asked);
        asked
    }

    /// Skips the rest of the epoch. The search ends for this reason once its depths are spread, just as after the round
    /// that spends the budget.
    fn cut_epoch(&mut self, reason: StopReason) {
        self.rounds_left = self.rounds_left.map(|_| 0);
        self.cut = Some(reason);
    }

    /// Ends an epoch whose depths were spread; returns a reason if the search makes no more children.
    pub fn end_epoch(&mut self, standing: Standing) -> Option<StopReason> {
        self.idle_epochs = if standing.evals == self.begun.evals { self.idle_epochs + 1 } else { 0 };
        (self.idle_epochs == IDLE_EPOCHS_MAX).then_some(StopReason::Dry)
    }
}

/// Why the search ends here, if it does. `mark` tells when the objective had last fallen by a thousandth.
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

/// Whether the SAE is at most `target`. The objective is never lower than the SAE, so it often answers this without
/// reading pixels.
fn is_reached(search: &mut dyn Search, target: u64) -> Result<bool> {
    let objective = search.standing().objective;
    if u64::try_from(objective).is_ok_and(|objective| objective <= target) {
        return Ok(true);
    }
    Ok(!lowers_sae_alone(search.course()) && sae(search)? <= target)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::evolve::observer::Undisturbed;
    use crate::model::cells::{Ask, Course, Rules, SearchState, Stacks};
    use crate::model::{Guide, GuideSample, MaskSet, Target};

    /// A search of one white pixel. Its objective falls by a share of itself each round, and it counts its calls.
    struct Scripted {
        course: Course,
        standing: Standing,
        evals_per_round: u64,
        /// The objective loses one part in this many.
        loss: i64,
        calls: Vec<u32>,
    }

    impl Scripted {
        fn new(evals_per_round: u64, loss: i64) -> Self {
            let target = Target::new(1, 1, vec![[255; 3]]).expect("one pixel is 1x1");
            let sample = GuideSample { direction: 0, coherence: 0, size_q12: 1 << 12 };
            let course = Course {
                rules: Rules::free(0, 64, 1, [0; 3]),
                target: Arc::new(target),
                guide: Arc::new(Guide { columns: 1, rows: 1, samples: vec![sample] }),
                masks: Arc::new(MaskSet::default()),
                fly_count: 4,
            };
            let standing = Standing { objective: 1_000_000, ..Standing::default() };
            Self { course, standing, evals_per_round, loss, calls: Vec::new() }
        }
    }

    impl Search for Scripted {
        fn course(&self) -> &Course {
            &self.course
        }

        fn load(&mut self, _flies: &[Fly]) -> Result<()> {
            self.standing.objective = 500_000;
            Ok(())
        }

        fn advance_until(&mut self, rounds: u32, is_over: Ask<'_>) -> Result<bool> {
            self.calls.push(rounds);
            for _ in 0..rounds {
                if is_over() {
                    return Ok(false);
                }
                self.standing.rounds += 1;
                self.standing.evals += self.evals_per_round;
                self.standing.objective -= self.standing.objective / self.loss;
            }
            Ok(true)
        }

        fn renormalise(&mut self) -> Result<()> {
            self.calls.push(0);
            Ok(())
        }

        fn standing(&self) -> Standing {
            self.standing
        }

        fn read_back(&mut self) -> Result<SearchState> {
            Ok(SearchState { flies: vec![Fly::ABSENT], steps: vec![0], fitness: vec![0] })
        }

        fn read_back_stacks(&mut self) -> Result<Stacks> {
            Ok(Stacks { pixels: vec![vec![(0, 18)]] })
        }
    }

    /// Looks at every round, and ends at the given one.
    struct EndAt(u32);

    impl Observer for EndAt {
        fn looks_at_rounds(&self) -> bool {
            true
        }

        fn after_epoch(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
            let Seen::Search(search) = seen else { panic!("it is a search") };
            Ok((search.standing().rounds >= self.0).then_some(StopReason::Time))
        }
    }

    const ENDLESS: Budget = Budget { evals: u64::MAX, target_sae: None, patience: None };

    fn run_until(search: &mut Scripted, budget: Budget) -> (StopReason, u32) {
        let reason = run(search, None, &budget, &mut Undisturbed).expect("nothing fails");
        (reason, search.standing.rounds)
    }

    #[test]
    fn a_search_ends_after_the_round_that_spends_its_evals_and_the_epoch_that_reaches_its_target() {
        let evals = |evals| run_until(&mut Scripted::new(10, 2), Budget { evals, ..ENDLESS });
        assert_eq!([evals(0), evals(1), evals(40), evals(41)].map(|(_, rounds)| rounds), [0, 1, 4, 5]);
        let mut far = Scripted::new(10, 2);
        assert_eq!(run_until(&mut far, Budget { evals: 75, ..ENDLESS }).1, 8);
        assert_eq!(far.calls, [4, 0, 1, 1, 1, 1, 0], "rounds are asked for at once until the budget is near");
        assert_eq!(evals(41).0, StopReason::Evals);
        let reached = run_until(&mut Scripted::new(10, 2), Budget { target_sae: Some(100_000), ..ENDLESS });
        assert_eq!(reached, (StopReason::TargetSae, 4));
    }

    #[test]
    fn patience_ends_a_search_whose_objective_falls_by_less_than_a_thousandth() {
        let budget = Budget { patience: Some(80), evals: 4_000, ..ENDLESS };
        assert_eq!(run_until(&mut Scripted::new(10, 100_000), budget), (StopReason::Patience, 8));
        assert_eq!(run_until(&mut Scripted::new(10, 1_000), budget), (StopReason::Evals, 400));
    }

    #[test]
    fn a_search_that_makes_no_child_any_more_ends() {
        assert_eq!(run_until(&mut Scripted::new(0, 2), ENDLESS), (StopReason::Dry, 4 * IDLE_EPOCHS_MAX));
    }

    #[test]
    fn an_observer_of_rounds_sees_each_and_changes_nothing_but_the_number_of_submissions() {
        let (mut watched, mut alone) = (Scripted::new(10, 7), Scripted::new(10, 7));
        let reason = run(&mut watched, Some(&[Fly::ABSENT]), &ENDLESS, &mut EndAt(8)).expect("nothing fails");
        assert_eq!(reason, StopReason::Time);
        assert_eq!(watched.calls, [1, 1, 1, 1, 0, 1, 1, 1, 1, 0]);
        alone.load(&[Fly::ABSENT]).expect("nothing fails");
        run_until(&mut alone, Budget { evals: 80, ..ENDLESS });
        assert_eq!((alone.calls, alone.standing), (vec![4, 0, 1, 1, 1, 1, 0], watched.standing));
    }

    /// Ends after the given round, wherever in an epoch that is.
    struct CutAt(u32);

    impl Observer for CutAt {
        fn looks_at_rounds(&self) -> bool {
            true
        }

        fn after_round(&mut self, seen: &mut Seen<'_>) -> Result<Option<StopReason>> {
            let Seen::Search(search) = seen else { panic!("it is a search") };
            Ok((search.standing().rounds >= self.0).then_some(StopReason::Interrupted))
        }
    }

    #[test]
    fn a_search_that_is_cut_amid_an_epoch_is_where_a_budget_of_its_evals_ends() {
        let (mut cut, mut spent) = (Scripted::new(10, 7), Scripted::new(10, 7));
        let reason = run(&mut cut, None, &ENDLESS, &mut CutAt(6)).expect("nothing fails");
        assert_eq!(reason, StopReason::Interrupted);
        run_until(&mut spent, Budget { evals: 60, ..ENDLESS });
        assert_eq!((cut.standing, cut.calls), (spent.standing, vec![1, 1, 1, 1, 0, 1, 1, 0]));
    }

    #[test]
    fn the_sae_is_without_penalties_weights_and_what_is_transparent() {
        let mut search = Scripted::new(10, 2);
        assert_eq!(sae(&mut search).expect("nothing fails"), 1_000_000);
        search.course.rules.penalties.overlap = 5;
        assert!(!lowers_sae_alone(&search.course));
        assert_eq!(sae(&mut search).expect("nothing fails"), 18);
        let white = Target::new(2, 1, vec![[255; 3]; 2]).expect("two pixels");
        search.course.target = Arc::new(white.clone().with_weights(vec![9, 1]).expect("two weights"));
        assert_eq!(sae(&mut search).expect("nothing fails"), 2);
        search.course.target = Arc::new(white.with_transparent(vec![true, false]).expect("two pixels"));
        assert_eq!(sae(&mut search).expect("nothing fails"), 0);
    }
}
