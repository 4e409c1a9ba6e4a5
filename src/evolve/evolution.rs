//! One evolution: the current population of a lane, its best, and what to do next.
//!
//! It alternates with an evaluator: [`Evolution::breed`] says what to change, the evaluator evaluates, and
//! [`Evolution::absorb`] takes the new fitness in.

use std::collections::BTreeSet;

use super::breeder::Breeder;
pub use super::first::random_population;
use super::first::wear;
use super::restart::BestPopulation;
use super::scheme::{OnDry, PaperScheme};
use super::selection::{Selection, Victim};
use super::spread::Spread;
use crate::model::rng::{Purpose, Stream};
use crate::model::{Change, Evaluation, Fly, Lane, Target};

/// Why an evolution ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// All births of all runs were made.
    Births,
    /// A search in cells spent its evals.
    Evals,
    /// The last run found no better population for as many births as its patience allows; in cells, no clearly better
    /// one for as many evals.
    Patience,
    /// No fly with marginal fitness <= 0 was left; in cells, no child was possible.
    Dry,
    /// The global fitness reached the target.
    TargetSae,
    /// The caller ended it: the time was up.
    Time,
    /// The caller ended it: it was interrupted.
    Interrupted,
}

impl StopReason {
    /// The word for results and metadata.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Births => "births",
            Self::Evals => "evals",
            Self::Patience => "patience",
            Self::Dry => "dry",
            Self::TargetSae => "target-sae",
            Self::Time => "time",
            Self::Interrupted => "interrupted",
        }
    }
}

/// What an evolution wants next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Replace the flies that were added to the changes.
    Replace,
    /// Load [`Evolution::flies`] afresh: a restart.
    Restart,
    /// Nothing: the evolution has ended.
    Stop(StopReason),
}

/// The counts of an evolution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Births of all runs.
    pub births: u64,
    /// Births whose victim was chosen by the fallback.
    pub fallback_kills: u64,
    /// Restarts made.
    pub restarts: u32,
}

/// The steady-state loop of one lane.
#[derive(Clone, Debug)]
pub struct Evolution {
    scheme: PaperScheme,
    lane: usize,
    width_px: u32,
    height_px: u32,
    flies: Vec<Fly>,
    /// How many flies live. They come first; the others are absent until mitosis.
    living: usize,
    sae: Option<u64>,
    best: Option<BestPopulation>,
    breeder: Breeder,
    selection: Selection,
    outcome: Outcome,
    births_in_run: u64,
    births_at_best: u64,
    mask_changes: u32,
    stop: Option<StopReason>,
}

impl Evolution {
    /// An evolution of `lane`, a picture of `width_px` x `height_px`, that begins from `flies`: a population from
    /// [`super::first_population`] or [`super::begin_from`].
    ///
    /// # Panics
    /// If there are no flies.
    #[must_use]
    pub fn new(scheme: PaperScheme, lane: usize, width_px: u32, height_px: u32, flies: Vec<Fly>) -> Self {
        assert!(!flies.is_empty(), "an evolution needs a fly");
        let living = scheme.living(0, flies.len());
        let layers = match scheme.layers(0) {
            [] => layers_worn(&flies),
            named => named.to_vec(),
        };
        Self {
            breeder: Breeder::new(&scheme, (width_px, height_px), living, &layers),
            selection: Selection::new(flies.len()),
            scheme,
            lane,
            width_px,
            height_px,
            flies,
            living,
            sae: None,
            best: None,
            outcome: Outcome::default(),
            births_in_run: 0,
            births_at_best: 0,
            mask_changes: 0,
            stop: None,
        }
    }

    /// The lane that this evolution drives.
    #[must_use]
    pub fn lane(&self) -> usize {
        self.lane
    }

    /// The current population.
    #[must_use]
    pub fn flies(&self) -> &[Fly] {
        &self.flies
    }

    /// How many flies live. Before the last split there are fewer than in the whole population.
    #[must_use]
    pub fn living(&self) -> usize {
        self.living
    }

    /// How many restarts so far changed the masks.
    #[must_use]
    pub fn mask_changes(&self) -> u32 {
        self.mask_changes
    }

    /// Whether masks change or flies split after the current (or last) run. Then its populations are not yet of the
    /// kind that the result will be.
    #[must_use]
    pub fn is_warming_up(&self) -> bool {
        self.scheme.is_warm_up(self.outcome.restarts)
    }

    /// The best population since masks last changed or flies last split. Before the first evaluation, the current one.
    #[must_use]
    pub fn best_flies(&self) -> &[Fly] {
        self.best.as_ref().map_or(&self.flies, BestPopulation::flies)
    }

    /// Global fitness of the best population, once there is one.
    #[must_use]
    pub fn best_sae(&self) -> Option<u64> {
        self.best.as_ref().map(BestPopulation::sae)
    }

    /// Global fitness of the current population, once it was evaluated.
    #[must_use]
    pub fn sae(&self) -> Option<u64> {
        self.sae
    }

    /// How diverse the current population is.
    #[must_use]
    pub fn spread(&self) -> Spread {
        Spread::of(&self.flies, self.width_px, self.height_px)
    }

    /// What was counted so far.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Births of the current or last run. There are fewer than planned if it was cut short.
    #[must_use]
    pub fn births_in_run(&self) -> u64 {
        self.births_in_run
    }

    /// Births that all runs make if nothing stops them.
    #[must_use]
    pub fn births_planned(&self) -> u64 {
        self.scheme.births.saturating_mul(u64::from(self.scheme.restarts) + 1)
    }

    /// Restarts that are made if nothing stops the evolution.
    #[must_use]
    pub fn restarts_planned(&self) -> u32 {
        self.scheme.restarts
    }

    /// Why the evolution ended, if it has.
    #[must_use]
    pub fn stop_reason(&self) -> Option<StopReason> {
        self.stop
    }

    /// Ends the evolution for a reason of the caller's.
    pub fn stop(&mut self, reason: StopReason) {
        self.stop.get_or_insert(reason);
    }

    /// Decides the next step from the current population, as `lane` holds it, and from its fitness. Adds its changes to
    /// `changes`.
    pub fn breed(&mut self, lane: &Lane, evaluation: &Evaluation<'_>, changes: &mut Vec<Change>) -> Step {
        if let Some(reason) = self.stop {
            return Step::Stop(reason);
        }
        let left = self.scheme.births - self.births_in_run;
        if left == 0 {
            return self.end_run(StopReason::Births, &lane.scene().target);
        }
        if self.has_reached_target() {
            return self.end_run(StopReason::TargetSae, &lane.scene().target);
        }
        if self.scheme.patience.is_some_and(|patience| self.births_in_run - self.births_at_best >= patience) {
            return self.end_run(StopReason::Patience, &lane.scene().target);
        }
        self.selection.begin_generation();
        // No fly dies twice in a generation.
        let births = left.min(u64::from(self.scheme.batch_births)).min(self.living as u64);
        for birth in 0..births {
            if !self.give_birth(lane, &evaluation.marginal[..self.living], changes) {
                if birth == 0 {
                    return self.end_run(StopReason::Dry, &lane.scene().target);
                }
                break;
            }
        }
        Step::Replace
    }

    /// One death and one birth; returns false if no fly may die.
    fn give_birth(&mut self, lane: &Lane, marginal: &[i64], changes: &mut Vec<Change>) -> bool {
        let run = self.outcome.restarts;
        let mut stream = Stream::new(self.scheme.seed, Purpose::Birth, run, self.births_in_run);
        let index = match self.selection.choose_victim(marginal, self.scheme.on_dry, &mut stream) {
            Victim::Bad(fly) => fly,
            Victim::Fallback(fly) => {
                self.outcome.fallback_kills += 1;
                fly
            }
            Victim::Dry => return false,
        };
        let child = self.breeder.child(&self.scheme, &self.flies, marginal, &mut stream);
        let fly = self.scheme.color.born(lane, index, &child);
        changes.push(Change { lane: self.lane, index, fly });
        self.births_in_run += 1;
        self.outcome.births += 1;
        true
    }

    /// Ends a run. If a run is left, it begins from the best population with smaller mutation steps.
    fn end_run(&mut self, reason: StopReason, target: &Target) -> Step {
        let dry_stop = reason == StopReason::Dry && self.scheme.on_dry == OnDry::Stop;
        if dry_stop || self.outcome.restarts == self.scheme.restarts {
            self.stop = Some(reason);
            return Step::Stop(reason);
        }
        self.outcome.restarts += 1;
        self.births_in_run = 0;
        self.births_at_best = 0;
        self.breeder.cool(self.scheme.cool_q16);
        if let Some(best) = &mut self.best {
            best.restore(&mut self.flies);
        }
        let (has_split, has_changed_masks) = (self.split(target), self.change_masks());
        if has_split || has_changed_masks {
            // Populations with fewer flies or other masks do not compare with those to come.
            self.best = None;
        }
        Step::Restart
    }

    /// Mitosis, if it is due: in the run that begins, twice as many flies live. Their steps and first sides follow from
    /// Eq. 1 for that number.
    fn split(&mut self, target: &Target) -> bool {
        let run = self.outcome.restarts;
        if run > self.scheme.mitosis {
            return false;
        }
        let living = self.scheme.living(run, self.flies.len());
        let layers = self.breeder.layers().to_vec();
        let before = std::mem::replace(&mut self.living, living);
        self.breeder = Breeder::new(&self.scheme, (self.width_px, self.height_px), living, &layers);
        (0..run).for_each(|_| self.breeder.cool(self.scheme.cool_q16));
        self.breeder.split(&self.scheme, target, &mut self.flies, before, run);
        true
    }

    /// Gives every fly a mask of the run that begins, if the masks differ from those of the run before.
    fn change_masks(&mut self) -> bool {
        let run = self.outcome.restarts;
        let layers = self.scheme.layers(run);
        if layers.is_empty() || layers == self.breeder.layers() {
            return false;
        }
        wear(&mut self.flies, layers, self.scheme.seed, run);
        self.mask_changes += 1;
        self.breeder.set_layers(layers);
        true
    }

    /// Takes in the changes since the last call, and the global fitness that they led to.
    pub fn absorb(&mut self, changes: &[Change], sae: u64) {
        self.sae = Some(sae);
        let best = self.best.get_or_insert_with(|| BestPopulation::new(&self.flies, sae));
        for change in changes {
            self.flies[change.index as usize] = change.fly;
            best.note_change(change.index);
        }
        if best.offer(&self.flies, sae) {
            self.births_at_best = self.births_in_run;
        }
        // While the evolution warms up, this ends only the run, in the next step.
        if self.has_reached_target() && !self.is_warming_up() {
            self.stop(StopReason::TargetSae);
        }
    }

    fn has_reached_target(&self) -> bool {
        self.scheme.target_sae.is_some_and(|target| self.best_sae().is_some_and(|sae| sae <= target))
    }
}

/// The mask layers that living flies wear, each once.
fn layers_worn(flies: &[Fly]) -> Vec<u16> {
    let worn: BTreeSet<u16> = flies.iter().filter(|fly| fly.alive).map(|fly| fly.mask).collect();
    worn.into_iter().collect()
}
