//! The search as its users see it, for opaque and for translucent tiles.

use super::Cells;
use super::block::Block;
use super::glazed::Glazed;
use crate::error::Result;
use crate::model::Fly;
use crate::model::cells::{Ask, Course, Search, SearchState, Stacks, Standing};

/// A search on the CPU.
pub struct CpuSearch {
    cells: Box<dyn Search>,
}

impl CpuSearch {
    /// A search that begins with absent flies.
    #[must_use]
    pub fn new(course: Course) -> Self {
        let cells: Box<dyn Search> = if course.is_translucent() {
            Box::new(Cells::<Glazed>::new(course))
        } else {
            Box::new(Cells::<Block>::new(course))
        };
        Self { cells }
    }
}

impl Search for CpuSearch {
    fn course(&self) -> &Course {
        self.cells.course()
    }

    fn load(&mut self, flies: &[Fly]) -> Result<()> {
        self.cells.load(flies)
    }

    fn advance_until(&mut self, rounds: u32, is_over: Ask<'_>) -> Result<bool> {
        self.cells.advance_until(rounds, is_over)
    }

    fn renormalise(&mut self) -> Result<()> {
        self.cells.renormalise()
    }

    fn standing(&self) -> Standing {
        self.cells.standing()
    }

    fn read_back(&mut self) -> Result<SearchState> {
        self.cells.read_back()
    }

    fn into_state(self: Box<Self>) -> Result<SearchState> {
        self.cells.into_state()
    }

    fn sae(&mut self) -> Result<u64> {
        self.cells.sae()
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
        self.cells.read_back_stacks()
    }
}
