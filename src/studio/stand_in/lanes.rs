//! Searches of a device that the CPU goes on with when the device is lost: of each lane there is an account of what it
//! was asked for, which the twin repeats.

use rayon::prelude::*;

use super::StandIn;
use crate::cpu::cells::CpuSearch;
use crate::error::{Error, Result};
use crate::model::Fly;
use crate::model::cells::{Course, Only, Search, SearchLanes, SearchState, Stacks, Standing};

/// What a lane was asked for and has done.
#[derive(Clone, Debug)]
enum Deed {
    Load(Vec<Fly>),
    Rounds(u32),
    Renormalise,
}

/// The account of a lane.
struct Account {
    course: Course,
    done: Vec<Deed>,
    /// Deeds when it was marked.
    marked: usize,
    /// Rounds that it was asked for and has not made.
    left: u32,
    /// The twin, once it has taken over. It has made the deeds, and some of the rounds that were left.
    twin: Option<CpuSearch>,
    /// Rounds that the twin made since then.
    ahead: u32,
}

impl Account {
    fn new(course: Course, first: Option<&[Fly]>) -> Self {
        let done = first.map(|flies| Deed::Load(flies.to_vec())).into_iter().collect();
        Self { course, done, marked: 0, left: 0, twin: None, ahead: 0 }
    }

    /// Has the twin make all deeds.
    fn repeat(&mut self) -> Result<()> {
        let mut twin = CpuSearch::new(self.course.clone());
        for deed in &self.done {
            match deed {
                Deed::Load(flies) => twin.load(flies)?,
                Deed::Rounds(rounds) => twin.advance(*rounds)?,
                Deed::Renormalise => twin.renormalise()?,
            }
        }
        (self.twin, self.ahead) = (Some(twin), 0);
        Ok(())
    }

    /// Takes note that the rounds that were left are made.
    fn settle(&mut self) {
        if self.left + self.ahead > 0 {
            self.done.push(Deed::Rounds(self.left + self.ahead));
        }
        (self.left, self.ahead) = (0, 0);
    }

    /// A round of the twin, if one is left.
    fn step(&mut self) -> Result<()> {
        let Some(twin) = self.twin.as_mut().filter(|_| self.left > 0) else { return Ok(()) };
        twin.advance(1)?;
        (self.left, self.ahead) = (self.left - 1, self.ahead + 1);
        if self.left == 0 {
            self.settle();
        }
        Ok(())
    }
}

/// Searches of a device, or of the CPU once the device is lost.
pub(in crate::studio) struct LanesOrTwins {
    device: Option<Box<dyn SearchLanes>>,
    accounts: Vec<Option<Account>>,
    stand_in: StandIn,
}

impl LanesOrTwins {
    pub(in crate::studio) fn new(device: Box<dyn SearchLanes>, stand_in: StandIn) -> Self {
        Self { device: Some(device), accounts: Vec::new(), stand_in }
    }

    /// Does something on the device; none if the device is lost, and the twins have come to where it was.
    fn on_device<T>(&mut self, act: impl FnOnce(&mut dyn SearchLanes) -> Result<T>) -> Result<Option<T>> {
        let Some(device) = self.device.as_mut() else { return Ok(None) };
        match act(&mut **device) {
            Err(error) if self.stand_in.takes_over(&error) => {
                self.device = None;
                self.accounts.par_iter_mut().flatten().try_for_each(Account::repeat)?;
                Ok(None)
            }
            outcome => outcome.map(Some),
        }
    }

    fn account(&self, lane: usize) -> &Account {
        self.accounts[lane].as_ref().unwrap_or_else(|| panic!("lane {lane} was never admitted, or was dismissed"))
    }

    fn account_mut(&mut self, lane: usize) -> &mut Account {
        self.accounts[lane].as_mut().unwrap_or_else(|| panic!("lane {lane} was never admitted, or was dismissed"))
    }

    /// The twin of a lane, after the device was lost.
    fn twin(&mut self, lane: usize) -> Result<&mut CpuSearch> {
        let twin = self.account_mut(lane).twin.as_mut();
        twin.ok_or_else(|| Error::Internal(format!("lane {lane} has no twin, and its device is lost")))
    }
}

impl SearchLanes for LanesOrTwins {
    fn admit(&mut self, course: Course, first: Option<&[Fly]>) -> Result<Option<usize>> {
        let mut account = Account::new(course.clone(), first);
        let lane = match self.on_device(|device| device.admit(course, first))? {
            Some(None) => return Ok(None),
            Some(Some(lane)) => lane,
            None => {
                account.repeat()?;
                self.accounts.iter().position(Option::is_none).unwrap_or(self.accounts.len())
            }
        };
        if self.accounts.len() <= lane {
            self.accounts.resize_with(lane + 1, || None);
        }
        self.accounts[lane] = Some(account);
        Ok(Some(lane))
    }

    fn dismiss(&mut self, lane: usize) {
        self.accounts[lane] = None;
        if let Some(device) = &mut self.device {
            device.dismiss(lane);
        }
    }

    fn course(&self, lane: usize) -> &Course {
        &self.account(lane).course
    }

    fn standing(&self, lane: usize) -> Standing {
        match &self.device {
            Some(device) => device.standing(lane),
            None => self.account(lane).twin.as_ref().map_or_else(Standing::default, CpuSearch::standing),
        }
    }

    fn load(&mut self, lane: usize, flies: &[Fly]) -> Result<()> {
        let account = self.account_mut(lane);
        (account.done, account.marked) = (vec![Deed::Load(flies.to_vec())], 0);
        (account.left, account.ahead) = (0, 0);
        let had_twin = self.device.is_none();
        if self.on_device(|device| device.load(lane, flies))?.is_none() && had_twin {
            self.account_mut(lane).repeat()?;
        }
        Ok(())
    }

    fn mark(&mut self, lane: usize) -> Result<()> {
        let account = self.account_mut(lane);
        account.marked = account.done.len();
        self.on_device(|device| device.mark(lane)).map(|_| ())
    }

    fn cut(&mut self, lane: usize) -> Result<()> {
        let is_lost = self.device.is_none();
        let account = self.account_mut(lane);
        if is_lost {
            // The twin has made whole rounds and is not taken back: any round will do.
            account.left = 0;
            account.settle();
            return Ok(());
        }
        account.done.truncate(account.marked);
        account.left = 0;
        self.on_device(|device| device.cut(lane)).map(|_| ())
    }

    fn rounds_between_marks(&self, lane: usize) -> u32 {
        self.device.as_ref().map_or(1, |device| device.rounds_between_marks(lane))
    }

    fn ask(&mut self, lane: usize, rounds: u32) -> Result<()> {
        self.account_mut(lane).left += rounds;
        self.on_device(|device| device.ask(lane, rounds)).map(|_| ())
    }

    fn is_busy(&self, lane: usize) -> bool {
        match &self.device {
            Some(device) => device.is_busy(lane),
            None => self.account(lane).left > 0,
        }
    }

    fn work(&mut self) -> Result<()> {
        self.on_device(|device| device.work())?;
        let Some(device) = &self.device else {
            return self.accounts.par_iter_mut().flatten().try_for_each(Account::step);
        };
        for (lane, account) in self.accounts.iter_mut().enumerate() {
            if let Some(account) = account.as_mut().filter(|_| !device.is_busy(lane)) {
                account.settle();
            }
        }
        Ok(())
    }

    fn failure(&mut self, lane: usize) -> Option<Error> {
        self.device.as_mut().and_then(|device| device.failure(lane))
    }

    fn renormalise(&mut self, lanes: &[usize]) -> Result<()> {
        if self.on_device(|device| device.renormalise(lanes))?.is_none() {
            lanes.iter().try_for_each(|&lane| self.twin(lane)?.renormalise())?;
        }
        lanes.iter().for_each(|&lane| self.account_mut(lane).done.push(Deed::Renormalise));
        Ok(())
    }

    fn read_back(&mut self, lane: usize) -> Result<SearchState> {
        match self.on_device(|device| device.read_back(lane))? {
            Some(state) => Ok(state),
            None => self.twin(lane)?.read_back(),
        }
    }

    fn read_back_stacks(&mut self, lane: usize) -> Result<Stacks> {
        match self.on_device(|device| device.read_back_stacks(lane))? {
            Some(stacks) => Ok(stacks),
            None => self.twin(lane)?.read_back_stacks(),
        }
    }
}

/// One search of a device, or of the CPU once the device is lost.
///
/// # Errors
/// If the device fails, or has no room for it.
pub(in crate::studio) fn search_or_twin(mut lanes: LanesOrTwins, course: Course) -> Result<Only<LanesOrTwins>> {
    let lane = lanes.admit(course, None)?;
    let lane = lane.ok_or_else(|| Error::Internal("a device without lanes has no room for one".to_owned()))?;
    Ok(Only::of(lanes, lane))
}
