//! Drives a search in cells: rounds in epochs, and when to stop.
//!
//! Stops are looked at between epochs, and the evals after every round that may spend them, so that every device ends after the
//! same round. Nothing here knows a device or
//! a clock; an [`Observer`] may.

use super::evolution::StopReason;
use crate::error::Result;
use crate::model::cells::glaze::opacity_of;
use crate::model::cells::{Course, Search, Standing};
use crate::model::tile::unpack;
use crate::model::translucency::Compositing;
use crate::model::{Fly, Rgb};

/// Version of the search: raised whenever the same picture, options and seed lead to another result.
pub const CELLS_VERSION: u32 = 1;
/// Most rounds of an epoch; after each so many, depths are spread evenly again.
pub const ROUNDS_PER_EPOCH: u32 = 4;
/// Evals that an epoch of several rounds may have: clock and interrupts are looked at between epochs, and have to wait no longer
/// than some tenths of a second.
const EVALS_PER_EPOCH: u64 = 250_000;
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
    let pace = if observer.looks_at_rounds() { Pace::Rounds } else { Pace::Epochs };
    let mut drive = Drive::new(search, *budget, pace);
    loop {
        match drive.next(search)? {
            Next::Advance(rounds) => {
                search.advance(rounds)?;
                if pace == Pace::Rounds {
                    observer.after_round(search)?;
                }
            }
            Next::Spread => {
                search.renormalise()?;
                if let Some(reason) = drive.end_epoch(search.standing()) {
                    return Ok(reason);
                }
                if let Some(reason) = observer.after_epoch(search)? {
                    return Ok(reason);
                }
            }
            Next::Done(reason) => return Ok(reason),
        }
    }
}

/// How many rounds a search is asked for at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Each alone.
    Rounds,
    /// Those of an epoch, where the budget allows, so that a device need not wait between them.
    Epochs,
}

/// What a search does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// So many rounds.
    Advance(u32),
    /// Its depths are spread, and then comes [`Drive::end_epoch`].
    Spread,
    /// Nothing any more.
    Done(StopReason),
}

/// The way of a search, step by step, for those who drive several at once; [`run`] goes it in one go.
///
/// Rounds are alike in evals on every device, so it is the same round everywhere after which the budget is spent.
#[derive(Clone, Debug)]
pub struct Drive {
    budget: Budget,
    pace: Pace,
    /// Where the objective had fallen by a thousandth for the last time.
    mark: Standing,
    idle_epochs: u32,
    /// Evals when the epoch began.
    begun_evals: u64,
    /// Rounds left of the epoch that is under way, if one is.
    rounds_left: Option<u32>,
}

impl Drive {
    /// The way of a search that stands where it begins.
    #[must_use]
    pub fn new(search: &dyn Search, budget: Budget, pace: Pace) -> Self {
        Self { budget, pace, mark: search.standing(), idle_epochs: 0, begun_evals: 0, rounds_left: None }
    }

    /// What the search does next, after it has done what was told before.
    ///
    /// # Errors
    /// If the device fails.
    pub fn next(&mut self, search: &mut dyn Search) -> Result<Next> {
        let evals = search.standing().evals;
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
                None => Next::Advance(self.begin_epoch(evals, evals_per_round(search.course()))),
            }),
        }
    }

    /// Begins an epoch; returns the rounds that are asked for first. Far from the end of the budget these are all.
    fn begin_epoch(&mut self, evals: u64, evals_per_round: u64) -> u32 {
        let rounds = (EVALS_PER_EPOCH / evals_per_round.max(1)).clamp(1, u64::from(ROUNDS_PER_EPOCH)) as u32;
        let is_near_the_end = self.budget.evals.saturating_sub(evals) <= evals_per_round * u64::from(rounds);
        let asked = if self.pace == Pace::Rounds || is_near_the_end { 1 } else { rounds };
        self.begun_evals = evals;
        self.rounds_left = Some(rounds - asked);
        asked
    }

    /// Ends an epoch whose depths were spread; a reason if the search makes no child any more.
    pub fn end_epoch(&mut self, standing: Standing) -> Option<StopReason> {
        self.idle_epochs = if standing.evals == self.begun_evals { self.idle_epochs + 1 } else { 0 };
        (self.idle_epochs == IDLE_EPOCHS_MAX).then_some(StopReason::Dry)
    }
}

/// The most evals that a round can have: steps for each fly, and all candidates in each.
fn evals_per_round(course: &Course) -> u64 {
    course.fly_count as u64 * u64::from(course.rules.steps_per_fly) * u64::from(course.rules.candidates)
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
    let is_translucent = search.course().is_translucent();
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
        stack.first().map_or_else(|| difference(target.pixels()[pixel], ground), |&(_, error)| error as u64 / weight)
    };
    Ok(stacks.pixels.iter().enumerate().map(error).sum())
}

fn difference(one: Rgb, other: Rgb) -> u64 {
    one.iter().zip(other).map(|(&a, b)| u64::from(a.abs_diff(b))).sum()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::model::cells::{Rules, SearchState, Stacks};
    use crate::model::{Guide, GuideSample, MaskSet, Target};

    /// A search of one white pixel whose objective falls by a share of itself each round, and that counts its calls.
    struct Scripted {
        course: Course,
        standing: Standing,
        evals_per_round: u64,
        /// The objective loses a part in so many.
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

        fn advance(&mut self, rounds: u32) -> Result<()> {
            self.calls.push(rounds);
            for _ in 0..rounds {
                self.standing.rounds += 1;
                self.standing.evals += self.evals_per_round;
                self.standing.objective -= self.standing.objective / self.loss;
            }
            Ok(())
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

        fn after_epoch(&mut self, search: &mut dyn Search) -> Result<Option<StopReason>> {
            Ok((search.standing().rounds >= self.0).then_some(StopReason::Time))
        }
    }

    const ENDLESS: Budget = Budget { evals: u64::MAX, target_sae: None, patience: None };

    fn run_until(search: &mut Scripted, budget: Budget) -> (StopReason, u32) {
        let reason = run(search, None, &budget, &mut None::<EndAt>).expect("nothing fails");
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
