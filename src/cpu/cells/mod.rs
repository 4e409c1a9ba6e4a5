//! Twin of `glsl/cells.comp`: the `cells` search on the CPU, a task for each cell.

mod area;
mod block;
mod cell;
mod cover;
mod cut;
mod dressed;
mod exchange;
mod glazed;
mod ground;
mod halt;
mod laid;
mod laying;
mod opaque;
mod pixels;
mod search;
mod shared;
mod translucent;

use std::sync::atomic::{AtomicI64, AtomicU32, Ordering};

use rayon::prelude::*;

pub use self::search::CpuSearch;

use self::area::Area;
use self::cell::{Cell, Done, Member};
use self::cut::Changed;
use self::ground::Ground;
use self::halt::{Halt, NEVER};
use self::shared::Shared;
use crate::error::Result;
use crate::model::Fly;
use crate::model::blocks::{depth_order, index_of};
use crate::model::cells::footprint::Footprint;
use crate::model::cells::grid::{BLOCK_SIDE_PX, cell_side_px};
use crate::model::cells::random::{Chain, Draw};
use crate::model::cells::rules::STEP_FIRST;
use crate::model::cells::{Ask, Course, Search, SearchState, Stacks, Standing, depths, leash, operators};
use crate::model::cells::{Grid, NO_CELL};
use crate::model::fly::Z_MAX;

/// Flies that are given their cells between two looks.
const FLIES_AT_ONCE: usize = 256;

/// A cell with its blocks and its members.
type Work<'a, G> = (u32, Area<'a, G>, Vec<Member>);

/// A search among tiles of one kind.
struct Cells<G> {
    course: Course,
    /// The blocks that were laid; all of them unless all flies are absent.
    blocks: Vec<G>,
    /// Blocks along the width.
    columns: u32,
    flies: Vec<Fly>,
    steps: Vec<u32>,
    /// For each fly, what [`Member::origin`] says.
    origins: Vec<Fly>,
    fitness: Vec<AtomicI64>,
    /// Marginal fitness when the round began.
    fitness_before: Vec<i64>,
    depths: Vec<AtomicU32>,
    owners: Vec<u32>,
    standing: Standing,
    /// What a round that was cut short has left on the pixels.
    changed: Option<Changed>,
    /// Whether the pixels still hold depths from before the last spreading.
    has_old_depths: bool,
}

impl<G: Ground> Cells<G> {
    fn new(course: Course) -> Self {
        let fly_count = course.fly_count;
        let mut search = Self {
            blocks: Vec::new(),
            columns: course.target.width_px().div_ceil(BLOCK_SIDE_PX),
            course,
            flies: vec![Fly::ABSENT; fly_count],
            steps: vec![STEP_FIRST; fly_count],
            origins: vec![Fly::ABSENT; fly_count],
            fitness: (0..fly_count).map(|_| AtomicI64::new(0)).collect(),
            fitness_before: Vec::new(),
            depths: (0..fly_count).map(|_| AtomicU32::new(Z_MAX)).collect(),
            owners: vec![NO_CELL; fly_count],
            standing: Standing::default(),
            changed: None,
            has_old_depths: false,
        };
        search.standing.objective = search.bare_objective();
        search
    }

    /// Removes all flies.
    fn clear(&mut self) {
        self.blocks.clear();
        self.flies.fill(Fly::ABSENT);
        self.steps.fill(STEP_FIRST);
        self.origins.fill(Fly::ABSENT);
        self.fitness.iter_mut().for_each(|fitness| *fitness.get_mut() = 0);
        self.standing = Standing::default();
        (self.changed, self.has_old_depths) = (None, false);
    }

    fn size_px(&self) -> (u32, u32) {
        (self.course.target.width_px(), self.course.target.height_px())
    }

    /// The grid of the round that is made next.
    fn grid(&self) -> Grid {
        let rules = &self.course.rules;
        Grid::new(rules.seed, self.standing.rounds, self.size_px(), cell_side_px(rules.side))
    }

    /// Makes one round; returns false if it was halted, which leaves the search where the round began.
    fn round(&mut self, halt: &Halt<'_>) -> bool {
        if !self.settle(halt) {
            return false;
        }
        let grid = self.grid();
        let Some(members) = self.deal(&grid, halt) else { return false };
        self.fitness_before.clear();
        self.fitness_before.extend(self.fitness.iter_mut().map(|fitness| *fitness.get_mut()));
        let chain = Chain::new(self.course.rules.seed, self.standing.rounds, Draw::Step);
        let (work, shared) = self.split(&grid, members);
        let results: Vec<(u32, Vec<Member>, Done)> = work
            .into_par_iter()
            .with_max_len(1)
            .map(|(number, area, members)| {
                let (desk, done) = (G::Desk::default(), Done::default());
                let mut cell = Cell { shared: &shared, halt, number, area, members, desk, done, unseen_px: 0 };
                cell.run(chain.then(number));
                (number, cell.members, cell.done)
            })
            .collect();
        if halt.was_called() {
            self.take_back(results.into_iter().map(|(number, members, _)| (number, members)).collect());
            return false;
        }
        for (_, members, done) in results {
            for Member { index, fly, step, origin } in members {
                self.flies[index as usize] = fly;
                self.steps[index as usize] = step;
                self.origins[index as usize] = origin;
            }
            self.standing.evals += done.evals;
            self.standing.births += done.births;
            self.standing.accepted += done.accepted;
            self.standing.objective += done.change;
        }
        self.standing.rounds += 1;
        self.refresh(&grid);
        true
    }

    /// The blocks and the members of each cell that has any, the longest work first, and what the cells share.
    fn split<'a>(&'a mut self, grid: &'a Grid, members: Vec<Vec<Member>>) -> (Vec<Work<'a, G>>, Shared<'a>) {
        let columns = self.columns;
        let mut areas: Vec<Vec<&mut G>> = (0..grid.cell_count()).map(|_| Vec::new()).collect();
        for (number, block) in self.blocks.iter_mut().enumerate() {
            let (x, y) = (number as u32 % columns * BLOCK_SIDE_PX, number as u32 / columns * BLOCK_SIDE_PX);
            areas[grid.cell_at(x, y) as usize].push(block);
        }
        let area = |number: u32, blocks| {
            let [x0, y0, x1, _] = grid.bounds(number);
            let columns = (x1.div_ceil(BLOCK_SIDE_PX) - x0 / BLOCK_SIDE_PX) as usize;
            Area::new(blocks, columns, ((x0 / BLOCK_SIDE_PX) as i32, (y0 / BLOCK_SIDE_PX) as i32))
        };
        let cells = members.into_iter().zip(areas).zip(0..).filter(|((members, _), _)| !members.is_empty());
        let mut work: Vec<_> =
            cells.map(|((members, blocks), number)| (number, area(number, blocks), members)).collect();
        work.sort_by_key(|(number, _, members)| (std::cmp::Reverse(members.len()), *number));
        let shared = Shared {
            course: &self.course,
            grid,
            owners: &self.owners,
            fitness: &self.fitness,
            depths: &self.depths,
            is_plain: self.course.is_plain(),
        };
        (work, shared)
    }

    /// Recomputes marginal fitness if cells only estimate it.
    fn refresh(&self, grid: &Grid) {
        let shared = Shared {
            course: &self.course,
            grid,
            owners: &self.owners,
            fitness: &self.fitness,
            depths: &self.depths,
            is_plain: self.course.is_plain(),
        };
        G::refresh(&self.blocks, &self.flies, &shared);
    }

    /// Assigns every fly to its cell; `None` if it was halted.
    fn deal(&mut self, grid: &Grid, halt: &Halt<'_>) -> Option<Vec<Vec<Member>>> {
        let round = self.standing.rounds;
        let chain = Chain::new(self.course.rules.seed, round, Draw::Deal);
        let cell_of = |index: u32, fly: &Fly| {
            if fly.alive {
                grid.cell_of(&Footprint::of(fly, self.size_px()))
            } else if self.course.rules.class_of(index).first_round > round {
                NO_CELL
            } else {
                self.deal_absent(grid, chain.then(index))
            }
        };
        let mut owners = vec![NO_CELL; self.flies.len()];
        let parts = owners.par_chunks_mut(FLIES_AT_ONCE).zip(self.flies.par_chunks(FLIES_AT_ONCE));
        parts.enumerate().for_each(|(part, (owners, flies))| {
            if !halt.is_called() {
                let first = (part * FLIES_AT_ONCE) as u32;
                owners
                    .iter_mut()
                    .zip(flies)
                    .zip(first..)
                    .for_each(|((owner, fly), index)| *owner = cell_of(index, fly));
            }
        });
        if halt.was_called() {
            return None;
        }
        self.owners = owners;
        let mut indices: Vec<Vec<u32>> = (0..grid.cell_count()).map(|_| Vec::new()).collect();
        for (index, &cell) in (0..).zip(&self.owners).filter(|(_, cell)| **cell != NO_CELL) {
            indices[cell as usize].push(index);
        }
        let member = |index: u32| {
            let place = index as usize;
            Member { index, fly: self.flies[place], step: self.steps[place], origin: self.origins[place] }
        };
        Some(indices.into_par_iter().map(|indices| indices.into_iter().map(member).collect()).collect())
    }

    /// The cell of the worst of some random pixels.
    fn deal_absent(&self, grid: &Grid, draws: Chain) -> u32 {
        let mut worst = (-1, 0);
        for number in 0..self.course.rules.deal_tournament {
            let (x, y) = (draws.below(2 * number, grid.width_px), draws.below(2 * number + 1, grid.height_px));
            let block = &self.blocks[(y / BLOCK_SIDE_PX * self.columns + x / BLOCK_SIDE_PX) as usize];
            let (error, _) = block.seen((y % BLOCK_SIDE_PX * BLOCK_SIDE_PX + x % BLOCK_SIDE_PX) as usize);
            if error > worst.0 {
                worst = (error, grid.cell_at(x, y));
            }
        }
        worst.1
    }
}

impl<G: Ground> Search for Cells<G> {
    fn course(&self) -> &Course {
        &self.course
    }

    fn load(&mut self, flies: &[Fly]) -> Result<()> {
        assert_eq!(flies.len(), self.course.fly_count, "a search keeps its number of flies");
        self.clear();
        self.lay(&NEVER);
        let (target, rules) = (&self.course.target, &self.course.rules);
        let grid = Grid::whole(target.width_px(), target.height_px());
        let shared = Shared {
            course: &self.course,
            grid: &grid,
            owners: &self.owners,
            fitness: &self.fitness,
            depths: &self.depths,
            is_plain: self.course.is_plain(),
        };
        let area = Area::new(self.blocks.iter_mut().collect(), self.columns as usize, (0, 0));
        let member = |(index, &origin)| Member { index, fly: Fly::ABSENT, step: STEP_FIRST, origin };
        let members = (0..).zip(flies).map(member).collect();
        let (desk, done) = (G::Desk::default(), Done::default());
        let mut cell = Cell { shared: &shared, halt: &NEVER, number: 0, area, members, desk, done, unseen_px: 0 };
        // Nearest first, so that the deepest flies are the ones that find no room.
        for key in depth_order(flies) {
            let index = index_of(key) as usize;
            if flies[index].alive {
                let local = self.course.guide.at(flies[index].x >> 6, flies[index].y >> 6);
                let own_side = rules.own_side(index as u32, local);
                let fly = operators::bounded(&flies[index], &rules.bounds, own_side);
                if leash::holds(rules.leash, &flies[index], &fly) {
                    cell.place(index, &fly);
                }
            }
        }
        for Member { index, fly, origin, .. } in cell.members {
            (self.flies[index as usize], self.origins[index as usize]) = (fly, origin);
        }
        self.standing.objective = self.objective();
        self.refresh(&grid);
        Ok(())
    }

    fn advance_until(&mut self, rounds: u32, is_over: Ask<'_>) -> Result<bool> {
        let halt = Halt::new(is_over);
        Ok((0..rounds).all(|_| self.round(&halt)))
    }

    fn renormalise(&mut self) -> Result<()> {
        depths::spread(&mut self.flies);
        for (depth, fly) in self.depths.iter().zip(&self.flies) {
            depth.store(fly.z, Ordering::Relaxed);
        }
        self.has_old_depths = true;
        Ok(())
    }

    fn standing(&self) -> Standing {
        self.standing
    }

    fn read_back(&mut self) -> Result<SearchState> {
        let fitness = self.fitness.iter().map(|fitness| fitness.load(Ordering::Relaxed)).collect();
        Ok(SearchState { flies: self.flies.clone(), steps: self.steps.clone(), fitness })
    }

    fn into_state(self: Box<Self>) -> Result<SearchState> {
        let Self { flies, steps, fitness, .. } = *self;
        Ok(SearchState { flies, steps, fitness: fitness.into_iter().map(AtomicI64::into_inner).collect() })
    }

    fn sae(&mut self) -> Result<u64> {
        if !self.is_bare() {
            self.settle(&NEVER);
        }
        Ok(self.shown_sae())
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
        self.settle(&NEVER);
        let (width, height) = self.size_px();
        let stack_at = |x: u32, y: u32| {
            let block = &self.blocks[(y / BLOCK_SIDE_PX * self.columns + x / BLOCK_SIDE_PX) as usize];
            let pixel = (y % BLOCK_SIDE_PX * BLOCK_SIDE_PX + x % BLOCK_SIDE_PX) as usize;
            block.stack(pixel)
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| stack_at(x, y)).collect();
        Ok(Stacks { pixels })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::block::Block;
    use super::*;
    use crate::model::cells::Rules;
    use crate::model::guide::SIZE_ONE;
    use crate::model::{Guide, GuideSample, MaskSet, Target};

    /// A disc, `shift` px from the left, on a gradient.
    fn course(shift: u32, leash: u32) -> Course {
        let is_inside = |x: u32, y: u32| x.abs_diff(20 + shift).pow(2) + y.abs_diff(30).pow(2) < 150;
        let pixels = (0..64 * 60).map(|place| (place % 64, place / 64));
        let pixel = |(x, y)| if is_inside(x, y) { [250, 220, 30] } else { [(3 * x) as u8, (4 * y) as u8, 90] };
        let target = Target::new(64, 60, pixels.map(pixel).collect()).expect("the pixels are of this size");
        let rules = Rules { leash, ..Rules::free(5, 360, 120, [0; 3]) };
        let samples = vec![GuideSample { direction: 0, coherence: 0, size_q12: SIZE_ONE }; 16 * 15];
        let guide = Arc::new(Guide { columns: 16, rows: 15, samples });
        Course { rules, target: Arc::new(target), guide, masks: Arc::new(MaskSet::default()), fly_count: 120 }
    }

    /// Of the flies that survive some rounds from one picture to another: how many are within `length` of where they
    /// were, how many of these moved, and how many are farther away.
    fn on_and_off(leash: u32, length: u32) -> (usize, usize, usize) {
        let mut search = Cells::<Block>::new(course(0, 0));
        search.advance(8).expect("nothing fails");
        let flies = search.flies;
        let mut search = Cells::<Block>::new(course(7, leash));
        search.load(&flies).expect("nothing fails");
        search.advance(12).expect("nothing fails");
        let lived: Vec<(&Fly, &Fly)> =
            search.origins.iter().zip(&search.flies).filter(|(origin, fly)| origin.alive && fly.alive).collect();
        assert!(lived.iter().all(|(origin, _)| flies.contains(origin)), "what they are tied to is what was loaded");
        let (on, off): (Vec<_>, Vec<_>) = lived.iter().partition(|(origin, fly)| leash::holds(length, origin, fly));
        let place = |fly: &Fly| (fly.x, fly.y, fly.w, fly.h, fly.angle);
        (on.len(), on.iter().filter(|(origin, fly)| place(origin) != place(fly)).count(), off.len())
    }

    #[test]
    fn no_fly_that_lives_on_leaves_its_leash() {
        let (held, moved, off) = on_and_off(128, 128);
        assert!(held > 40 && moved > 20, "{held} flies live on, {moved} moved");
        assert_eq!(off, 0);
        let (_, _, off) = on_and_off(0, 128);
        assert!(off > 10, "without a leash {off} flies go as far");
    }
}
