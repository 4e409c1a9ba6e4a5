//! A crew: searches in cells that share a device, each with a budget of its own. Who ends makes room for the next at once.

use crate::error::Result;
use crate::evolve::StopReason;
use crate::evolve::cells::{Budget, Drive, Next, Pace, sae};
use crate::model::Fly;
use crate::model::cells::{Course, OneLane, SearchLanes, SearchState, Standing};

/// What a search has come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ended {
    /// Why it ended.
    pub stop: StopReason,
    /// How far it came.
    pub standing: Standing,
    /// The SAE of its mosaic.
    pub sae: u64,
    /// Its flies, step sizes and marginal fitness.
    pub state: SearchState,
}

/// A search that left the crew.
#[derive(Debug)]
pub struct Finished {
    /// The number that it was admitted under.
    pub ticket: u64,
    /// What it has come to, or why it failed; the others go on all the same.
    pub outcome: Result<Ended>,
}

/// A search at work.
struct Member {
    ticket: u64,
    lane: usize,
    drive: Drive,
}

/// Searches in the lanes of a device. Each comes to the bytes that [`crate::evolve::cells::run`] comes to, whatever searches beside it.
pub struct SearchCrew {
    lanes: Box<dyn SearchLanes>,
    members: Vec<Member>,
}

impl SearchCrew {
    /// A crew without members on lanes that are all free.
    #[must_use]
    pub fn new(lanes: Box<dyn SearchLanes>) -> Self {
        Self { lanes, members: Vec::new() }
    }

    /// Searches at work.
    #[must_use]
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether no search is at work.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// How far each search has come, in the order of their admission.
    pub fn standings(&self) -> impl Iterator<Item = Standing> {
        self.members.iter().map(|member| self.lanes.standing(member.lane))
    }

    /// Takes in a search, from `first` if there are flies to begin with, under a number of the caller's; false if there is no room before
    /// others finish. An empty crew has room, or there is an error.
    ///
    /// # Errors
    /// [`crate::Error::TooLarge`] or [`crate::Error::OutOfDeviceMemory`] if the device cannot hold this search, which concerns no other; or if the
    /// device fails, which [`SearchCrew::step`] will say, too.
    pub fn admit(&mut self, ticket: u64, course: Course, (first, budget): (Option<&[Fly]>, Budget)) -> Result<bool> {
        let Some(lane) = self.lanes.admit(course, first)? else { return Ok(false) };
        let drive = Drive::new(&OneLane { lanes: &mut *self.lanes, lane }, budget, Pace::Epochs);
        self.members.push(Member { ticket, lane, drive });
        Ok(true)
    }

    /// Brings all searches on by about an epoch at most, in one submission that they share; returns those that ended. Between steps the
    /// caller may look at the clock, and admit others.
    ///
    /// # Errors
    /// If the device fails, which ends all.
    pub fn step(&mut self) -> Result<Vec<Finished>> {
        let mut finished = self.settle()?;
        // Who ends at once leaves its lane to the caller first.
        if finished.is_empty() {
            self.lanes.work()?;
            finished = self.settle()?;
        }
        Ok(finished)
    }

    /// Lets go of all searches, whose state is lost; returns their numbers.
    pub fn cancel_all(&mut self) -> Vec<u64> {
        let members = std::mem::take(&mut self.members);
        members.iter().for_each(|member| self.lanes.dismiss(member.lane));
        members.iter().map(|member| member.ticket).collect()
    }

    /// Tells every search that waits what to do next.
    fn settle(&mut self) -> Result<Vec<Finished>> {
        let mut finished = Vec::new();
        // Twice: an epoch that ends begins the next one.
        for _ in 0..2 {
            let mut spread = Vec::new();
            for place in (0..self.members.len()).rev() {
                let Member { lane, drive, .. } = &mut self.members[place];
                let lane = *lane;
                if let Some(error) = self.lanes.failure(lane) {
                    finished.push(self.finish(place, Err(error)));
                    continue;
                }
                if self.lanes.is_busy(lane) {
                    continue;
                }
                match drive.next(&mut OneLane { lanes: &mut *self.lanes, lane })? {
                    Next::Advance(rounds) => self.lanes.ask(lane, rounds)?,
                    Next::Spread => spread.push(lane),
                    Next::Done(stop) => {
                        let ended = self.ended(lane, stop)?;
                        finished.push(self.finish(place, Ok(ended)));
                    }
                }
            }
            self.spread(&spread, &mut finished)?;
        }
        finished.sort_by_key(|finished| finished.ticket);
        Ok(finished)
    }

    /// Spreads the depths of lanes whose epoch is over.
    fn spread(&mut self, lanes: &[usize], finished: &mut Vec<Finished>) -> Result<()> {
        if lanes.is_empty() {
            return Ok(());
        }
        self.lanes.renormalise(lanes)?;
        for place in (0..self.members.len()).rev() {
            let Member { lane, drive, .. } = &mut self.members[place];
            let lane = *lane;
            if !lanes.contains(&lane) {
                continue;
            }
            if let Some(stop) = drive.end_epoch(self.lanes.standing(lane)) {
                let ended = self.ended(lane, stop)?;
                finished.push(self.finish(place, Ok(ended)));
            }
        }
        Ok(())
    }

    fn ended(&mut self, lane: usize, stop: StopReason) -> Result<Ended> {
        let sae = sae(&mut OneLane { lanes: &mut *self.lanes, lane })?;
        Ok(Ended { stop, standing: self.lanes.standing(lane), sae, state: self.lanes.read_back(lane)? })
    }

    fn finish(&mut self, place: usize, outcome: Result<Ended>) -> Finished {
        let Member { ticket, lane, .. } = self.members.remove(place);
        self.lanes.dismiss(lane);
        Finished { ticket, outcome }
    }
}
