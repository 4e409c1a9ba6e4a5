//! Twin of `glsl/cells.comp`: the `cells` search on the CPU, a task for each cell.

mod area;
mod block;
mod cell;
mod cover;
mod dressed;
mod exchange;
mod glazed;
mod ground;
mod laid;
mod opaque;
mod pixels;
mod search;
mod shared;
mod translucent;

use std::sync::atomic::{AtomicI64, AtomicU32, Ordering};

use rayon::prelude::*;

pub use self::search::CpuSearch;

use self::area::Area;
use self::block::PIXELS;
use self::cell::{Cell, Done, Member, turn_penalty};
use self::ground::Ground;
use self::pixels::Bare;
use self::shared::Shared;
use crate::error::Result;
use crate::model::Fly;
use crate::model::blocks::{depth_order, index_of};
use crate::model::cells::footprint::Footprint;
use crate::model::cells::grid::{BLOCK_SIDE_PX, cell_side_px};
use crate::model::cells::pixel::{INSIDE, TRANSPARENT, difference};
use crate::model::cells::random::{Chain, Draw};
use crate::model::cells::rules::STEP_FIRST;
use crate::model::cells::{Course, Search, SearchState, Stacks, Standing, depths, leash, operators};
use crate::model::cells::{Grid, NO_CELL};
use crate::model::fly::Z_MAX;
use crate::model::tile::pack;

/// A search among tiles of one kind.
struct Cells<G> {
    course: Course,
    blocks: Vec<G>,
    /// Blocks along the width.
    columns: u32,
    flies: Vec<Fly>,
    steps: Vec<u32>,
    /// For each fly, what [`Member::origin`] says.
    origins: Vec<Fly>,
    fitness: Vec<AtomicI64>,
    depths: Vec<AtomicU32>,
    owners: Vec<u32>,
    standing: Standing,
}

impl<G: Ground> Cells<G> {
    fn new(course: Course) -> Self {
        let (width, height) = (course.target.width_px(), course.target.height_px());
        let (columns, rows) = (width.div_ceil(BLOCK_SIDE_PX), height.div_ceil(BLOCK_SIDE_PX));
        let fly_count = course.fly_count;
        let mut search = Self {
            course,
            blocks: vec![G::outside(); (columns * rows) as usize],
            columns,
            flies: vec![Fly::ABSENT; fly_count],
            steps: vec![STEP_FIRST; fly_count],
            origins: vec![Fly::ABSENT; fly_count],
            fitness: (0..fly_count).map(|_| AtomicI64::new(0)).collect(),
            depths: (0..fly_count).map(|_| AtomicU32::new(Z_MAX)).collect(),
            owners: vec![NO_CELL; fly_count],
            standing: Standing::default(),
        };
        search.clear();
        search
    }

    /// Removes all flies.
    fn clear(&mut self) {
        let Course { target, rules, .. } = &self.course;
        let (width, height) = (target.width_px(), target.height_px());
        for (number, block) in self.blocks.iter_mut().enumerate() {
            *block = G::outside();
            let (x, y) = (number as u32 % self.columns * BLOCK_SIDE_PX, number as u32 / self.columns * BLOCK_SIDE_PX);
            for row in 0..BLOCK_SIDE_PX.min(height - y) {
                for column in 0..BLOCK_SIDE_PX.min(width - x) {
                    let place = ((y + row) * width + x + column) as usize;
                    let color = pack(target.pixels()[place]);
                    let pixel = (row * BLOCK_SIDE_PX + column) as usize;
                    let weight = target.weights().map_or(1, |weights| i32::from(weights[place]));
                    let is_unwanted = target.transparent().is_some_and(|transparent| transparent[place]);
                    let (flag, bare) =
                        if is_unwanted { (TRANSPARENT, 0) } else { (0, difference(color, rules.background) * weight) };
                    let bare = Bare { target: color | INSIDE | flag, weight, error: bare };
                    block.lay_bare(pixel, &bare, rules);
                }
            }
        }
        self.flies.fill(Fly::ABSENT);
        self.steps.fill(STEP_FIRST);
        self.origins.fill(Fly::ABSENT);
        self.fitness.iter_mut().for_each(|fitness| *fitness.get_mut() = 0);
        self.standing = Standing { objective: self.objective(), ..Standing::default() };
    }

    /// The objective, summed over pixels and flies.
    fn objective(&self) -> i64 {
        let of_pixels: i64 = self
            .blocks
            .iter()
            .flat_map(|block| {
                (0..PIXELS).filter(|&pixel| block.target()[pixel] & INSIDE != 0).map(move |pixel| (block, pixel))
            })
            .map(|(block, pixel)| block.objective(pixel, &self.course.rules))
            .sum();
        let of_flies: i64 = self.flies.iter().map(|fly| turn_penalty(&self.course, fly)).sum();
        of_pixels + of_flies
    }

    fn size_px(&self) -> (u32, u32) {
        (self.course.target.width_px(), self.course.target.height_px())
    }

    /// Makes one round.
    fn round(&mut self) {
        let grid = Grid::new(
            self.course.rules.seed,
            self.standing.rounds,
            self.size_px(),
            cell_side_px(self.course.rules.side),
        );
        let members = self.deal(&grid);
        let shared = Shared {
            course: &self.course,
            grid: &grid,
            owners: &self.owners,
            fitness: &self.fitness,
            depths: &self.depths,
            is_plain: self.course.is_plain(),
        };
        let chain = Chain::new(self.course.rules.seed, self.standing.rounds, Draw::Step);
        let mut areas: Vec<Vec<&mut G>> = (0..grid.cell_count()).map(|_| Vec::new()).collect();
        for (number, block) in self.blocks.iter_mut().enumerate() {
            let (x, y) = (number as u32 % self.columns * BLOCK_SIDE_PX, number as u32 / self.columns * BLOCK_SIDE_PX);
            areas[grid.cell_at(x, y) as usize].push(block);
        }
        let mut work: Vec<_> = members.into_iter().zip(areas).zip(0..).filter(|((m, _), _)| !m.is_empty()).collect();
        work.sort_by_key(|((members, _), number)| (std::cmp::Reverse(members.len()), *number));
        let results: Vec<(Vec<Member>, Done)> = work
            .into_par_iter()
            .with_max_len(1)
            .map(|((members, blocks), number)| {
                let [x0, y0, x1, _] = grid.bounds(number);
                let columns = (x1.div_ceil(BLOCK_SIDE_PX) - x0 / BLOCK_SIDE_PX) as usize;
                let first = ((x0 / BLOCK_SIDE_PX) as i32, (y0 / BLOCK_SIDE_PX) as i32);
                let area = Area::new(blocks, columns, first);
                let shared = &shared;
                let mut cell = Cell { shared, number, area, members, desk: G::Desk::default(), done: Done::default() };
                cell.run(chain.then(number));
                (cell.members, cell.done)
            })
            .collect();
        for (members, done) in results {
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

    /// Assigns every fly to its cell.
    fn deal(&mut self, grid: &Grid) -> Vec<Vec<Member>> {
        let chain = Chain::new(self.course.rules.seed, self.standing.rounds, Draw::Deal);
        let mut members: Vec<Vec<Member>> = (0..grid.cell_count()).map(|_| Vec::new()).collect();
        let round = self.standing.rounds;
        for (index, fly) in (0_u32..).zip(&self.flies) {
            let cell = if fly.alive {
                grid.cell_of(&Footprint::of(fly, self.size_px()))
            } else if self.course.rules.class_of(index).first_round > round {
                NO_CELL
            } else {
                self.deal_absent(grid, chain.then(index))
            };
            self.owners[index as usize] = cell;
            if cell != NO_CELL {
                let (step, origin) = (self.steps[index as usize], self.origins[index as usize]);
                members[cell as usize].push(Member { index, fly: *fly, step, origin });
            }
        }
        members
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
        let mut cell =
            Cell { shared: &shared, number: 0, area, members, desk: G::Desk::default(), done: Done::default() };
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

    fn advance(&mut self, rounds: u32) -> Result<()> {
        (0..rounds).for_each(|_| self.round());
        Ok(())
    }

    fn renormalise(&mut self) -> Result<()> {
        depths::spread(&mut self.flies);
        for (depth, fly) in self.depths.iter().zip(&self.flies) {
            depth.store(fly.z, Ordering::Relaxed);
        }
        let depths = &self.depths;
        self.blocks.par_iter_mut().for_each(|block| {
            block.renumber(|fly| depths[fly as usize].load(Ordering::Relaxed));
        });
        Ok(())
    }

    fn standing(&self) -> Standing {
        self.standing
    }

    fn read_back(&mut self) -> Result<SearchState> {
        let fitness = self.fitness.iter().map(|fitness| fitness.load(Ordering::Relaxed)).collect();
        Ok(SearchState { flies: self.flies.clone(), steps: self.steps.clone(), fitness })
    }

    fn read_back_stacks(&mut self) -> Result<Stacks> {
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
