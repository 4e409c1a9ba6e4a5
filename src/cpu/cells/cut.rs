//! Rounds that were cut short. The search is at once where the round began, but for its pixels: few ask for these once
//! a search has ended, so that they are only put right when somebody does.

use std::sync::atomic::Ordering;

use rayon::prelude::*;

use super::Cells;
use super::cell::{Cell, Done, Member};
use super::ground::Ground;
use super::halt::{Halt, NEVER};

/// The flies as they lie on the pixels, where that is not as the search has them, by their cells.
pub struct Changed(Vec<(u32, Vec<Member>)>);

/// Blocks whose depths are brought up to date between two looks.
const BLOCKS_AT_ONCE: usize = 64;

impl<G: Ground> Cells<G> {
    /// Takes back a round of which `cells` is what its cells came to. Flies, steps and counts were not yet touched.
    pub(super) fn take_back(&mut self, cells: Vec<(u32, Vec<Member>)>) {
        self.restore_fitness();
        if !self.flies.iter().any(|fly| fly.alive) {
            self.blocks.clear();
            return;
        }
        let flies = &self.flies;
        let is_changed = |member: &Member| member.fly != flies[member.index as usize];
        let changed = cells
            .into_par_iter()
            .map(|(number, members)| (number, members.into_iter().filter(is_changed).collect::<Vec<Member>>()));
        self.changed = Some(Changed(changed.filter(|(_, members)| !members.is_empty()).collect()));
    }

    /// Marginal fitness as it was when the round began.
    fn restore_fitness(&mut self) {
        self.fitness.iter_mut().zip(&self.fitness_before).for_each(|(fitness, before)| *fitness.get_mut() = *before);
    }

    /// Brings the pixels to where the search is; returns false if it was halted before that. A second call goes on.
    pub(super) fn settle(&mut self, halt: &Halt<'_>) -> bool {
        if !self.lay(halt) {
            return false;
        }
        let changed = self.changed.take();
        // All of them leave before the first comes back, so that no stack overflows. Their depths may have been spread
        // since then: those that stay get their new ones in between.
        if let Some(Changed(cells)) = &changed {
            self.in_cells(cells, |cell: &mut Cell<'_, G>| {
                cell.lift();
            });
        }
        let is_renumbered = self.renumber(if changed.is_some() { &NEVER } else { halt });
        if let Some(Changed(mut cells)) = changed {
            let flies = &self.flies;
            for Member { index, fly, .. } in cells.iter_mut().flat_map(|(_, members)| members) {
                *fly = flies[*index as usize];
            }
            self.in_cells(&cells, |cell: &mut Cell<'_, G>| {
                cell.put_back();
            });
            self.restore_fitness();
        }
        is_renumbered
    }

    /// Gives the pixels the depths of the flies, if these were spread; returns false if it was halted.
    fn renumber(&mut self, halt: &Halt<'_>) -> bool {
        if !self.has_old_depths {
            return true;
        }
        let depths = &self.depths;
        self.blocks.par_chunks_mut(BLOCKS_AT_ONCE).for_each(|blocks| {
            if halt.is_called() {
                return;
            }
            for block in blocks {
                block.renumber(|fly| depths[fly as usize].load(Ordering::Relaxed));
            }
        });
        // What was renumbered is so again next time, to the same depths.
        self.has_old_depths = halt.was_called();
        !self.has_old_depths
    }

    /// Does something in cells of the round that was cut short, with these flies as their members.
    fn in_cells(&mut self, cells: &[(u32, Vec<Member>)], act: impl Fn(&mut Cell<'_, G>) + Sync) {
        let grid = self.grid();
        let mut members: Vec<Vec<Member>> = (0..grid.cell_count()).map(|_| Vec::new()).collect();
        cells.iter().for_each(|(number, of_cell)| members[*number as usize].clone_from(of_cell));
        let (work, shared) = self.split(&grid, members);
        work.into_par_iter().for_each(|(number, area, members)| {
            let (desk, done) = (G::Desk::default(), Done::default());
            act(&mut Cell { shared: &shared, halt: &NEVER, number, area, members, desk, done, unseen_px: 0 });
        });
    }
}
