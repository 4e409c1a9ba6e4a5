//! Searches in cells that share a device, each with its own budget. A search that ends makes room for the next one at
//! once.

use super::{Finished, SearchTask};
use crate::error::Result;
use crate::evolve::cells::{Drive, Next, Pace};
use crate::evolve::{Ended, StopReason};
use crate::model::cells::{OneLane, SearchLanes, Standing};

/// A search at work.
struct Member {
    ticket: u64,
    lane: usize,
    drive: Drive,
}

/// Searches in the lanes of a device. Each has the same result, byte for byte, as with [`crate::evolve::cells::run`],
/// whatever searches run beside it.
pub(super) struct Searches {
    lanes: Box<dyn SearchLanes>,
    members: Vec<Member>,
}

impl Searches {
    /// Starts without searches. All `lanes` must be free.
    pub fn new(lanes: Box<dyn SearchLanes>) -> Self {
        Self { lanes, members: Vec::new() }
    }

    /// Number of searches at work.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// How far each search has come, in the order of their admission.
    pub fn standings(&self) -> impl Iterator<Item = Standing> {
        self.members.iter().map(|member| self.lanes.standing(member.lane))
    }

    /// Takes in a search under a number that the caller chooses. Returns false if there is no room until others finish.
    ///
    /// # Errors
    /// If the device cannot hold this search, which does not affect the others; or if the device fails.
    pub fn admit(&mut self, ticket: u64, task: SearchTask) -> Result<bool> {
        let SearchTask { course, first, budget } = task;
        let Some(lane) = self.lanes.admit(course, first.as_deref())? else { return Ok(false) };
        let drive = Drive::new(&OneLane { lanes: &mut *self.lanes, lane }, budget, Pace::Epochs);
        self.members.push(Member { ticket, lane, drive });
        Ok(true)
    }

    /// Works on all searches for about one epoch at most, in one submission that they share. Returns the searches that
    /// ended.
    ///
    /// # Errors
    /// If the device fails, which ends all searches.
    pub fn step(&mut self) -> Result<Vec<Finished>> {
        let mut finished = self.settle()?;
        // A search that ends without any work is returned first, so that the caller can reuse its lane.
        if finished.is_empty() {
            self.lanes.work()?;
            finished = self.settle()?;
        }
        Ok(finished)
    }

    /// Drops all searches. Their state is lost.
    pub fn cancel_all(&mut self) {
        let members = std::mem::take(&mut self.members);
        members.iter().for_each(|member| self.lanes.dismiss(member.lane));
    }

    /// Tells every waiting search what to do next.
    fn settle(&mut self) -> Result<Vec<Finished>> {
        let mut finished = Vec::new();
        // Two passes, since the end of an epoch begins the next one.
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
        Ended::of_search(&mut OneLane { lanes: &mut *self.lanes, lane }, stop)
    }

    fn finish(&mut self, place: usize, outcome: Result<Ended>) -> Finished {
        let Member { ticket, lane, .. } = self.members.remove(place);
        self.lanes.dismiss(lane);
        Finished { ticket, outcome }
    }
}
