//! The steady-state loop of one cell in one round: selection, mutation, evaluation, acceptance, removal.
//! Twin: `glsl/shared/cells_loop.glsl`.

use std::sync::atomic::Ordering;

use super::area::{Area, Exchanged};
use super::cover::Cover;
use super::ground::{Coloring, Ground, Paint, Piece, Swap};
use super::halt::Halt;
use super::shared::Shared;
use crate::model::cells::Course;
use crate::model::cells::footprint::Footprint;
use crate::model::cells::leash;
use crate::model::cells::operators::{self, Setting, slot};
use crate::model::cells::random::{Chain, below};
use crate::model::cells::rules::{Acceptance, BirthKind, ColorSource, STEP_FIRST, grown, shrunk};
use crate::model::cells::suit::Suit;
use crate::model::tile::{pack, unpack};
use crate::model::{Fly, GuideSample};

/// A fly of the cell.
#[derive(Clone, Copy, Debug)]
pub struct Member {
    pub index: u32,
    pub fly: Fly,
    /// Step size, u16.16.
    pub step: u32,
    /// Where its leash is tied: the fly as it was loaded, or an absent fly if it was born since then.
    pub origin: Fly,
}

/// What a cell did in a round.
#[derive(Clone, Copy, Debug, Default)]
pub struct Done {
    pub evals: u64,
    pub births: u64,
    pub accepted: u64,
    /// Change of the objective.
    pub change: i64,
}

/// A child that was evaluated.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Index of its victim among the members.
    victim: usize,
    fly: Fly,
    footprint: Footprint,
    is_birth: bool,
    change: i64,
}

/// Pixels of the boxes of children between two looks: some tenths of a millisecond, be the tiles small or large.
const PIXELS_PER_LOOK: u32 = 1 << 16;
/// What a step counts besides.
const PIXELS_PER_STEP: u32 = 1 << 6;

/// One cell at work.
pub struct Cell<'a, G: Ground> {
    pub shared: &'a Shared<'a>,
    pub halt: &'a Halt<'a>,
    pub number: u32,
    pub area: Area<'a, G>,
    pub members: Vec<Member>,
    pub desk: G::Desk,
    pub done: Done,
    /// Pixels of the boxes of children since the last look.
    pub unseen_px: u32,
}

impl<'a, G: Ground> Cell<'a, G> {
    /// Makes all steps of the round, then removes the flies that do not help. It leaves off where it is halted.
    pub fn run(&mut self, chain: Chain) {
        // A cell that nobody has begun needs no look at a clock to leave it so.
        if self.halt.was_called() {
            return;
        }
        let steps = self.members.len() as u32 * self.shared.course.rules.steps_per_fly;
        for step in 0..steps {
            self.step(chain.then(step));
            if self.is_halted() {
                return;
            }
        }
        for place in 0..self.members.len() {
            self.remove_useless(place);
            if self.is_halted() {
                return;
            }
        }
    }

    /// Whether it is halted, as far as anybody has looked.
    fn is_halted(&mut self) -> bool {
        self.unseen_px = self.unseen_px.saturating_add(PIXELS_PER_STEP);
        if self.unseen_px < PIXELS_PER_LOOK {
            return false;
        }
        self.unseen_px = 0;
        self.halt.is_called()
    }

    /// Removes all members from their pixels.
    pub fn lift(&mut self) {
        for place in 0..self.members.len() {
            let Member { index, fly, .. } = self.members[place];
            let (footprint, suit) = (self.footprint(&fly), self.suit(&fly));
            let swap = Swap {
                index,
                old: Piece { fly: &fly, footprint: &footprint, suit: suit.as_ref() },
                new: Piece { fly: &Fly::ABSENT, footprint: &Footprint::EMPTY, suit: None },
            };
            if fly.alive {
                G::swap(&mut self.area, self.shared, self.number, &swap, 0);
            }
        }
    }

    /// Puts all members where they are said to be; none of them may lie on any pixel.
    pub fn put_back(&mut self) {
        for place in 0..self.members.len() {
            let fly = std::mem::replace(&mut self.members[place].fly, Fly::ABSENT);
            if fly.alive {
                let footprint = self.footprint(&fly);
                self.replace(&Candidate { victim: place, fly, footprint, is_birth: true, change: 0 });
            }
        }
    }

    /// Puts a fly where an absent one was, if it covers a pixel and the stacks have room. A fly that covers no pixel
    /// would lie in no cell, so no step could ever reach it.
    pub fn place(&mut self, place: usize, fly: &Fly) {
        let footprint = Footprint::of(fly, (self.shared.grid.width_px, self.shared.grid.height_px));
        let child = Candidate { victim: place, fly: *fly, footprint, is_birth: true, change: 0 };
        if !footprint.is_empty() && self.has_room(&child) {
            self.replace(&child);
        }
    }

    fn fitness(&self, place: usize) -> i64 {
        self.shared.fitness[self.members[place].index as usize].load(Ordering::Relaxed)
    }

    fn step(&mut self, chain: Chain) {
        let place = chain.below(0, self.members.len() as u32) as usize;
        let fitness = self.fitness(place);
        let mut best: Option<Candidate> = None;
        let mut was_changed = false;
        for candidate in 1..=self.shared.course.rules.candidates {
            let draws = chain.then(candidate);
            let Some(child) = self.candidate(place, fitness, draws) else { continue };
            self.done.evals += 1;
            was_changed |= !child.is_birth;
            if best.is_none_or(|best| child.change < best.change) {
                best = Some(child);
            }
        }
        let highest = match self.shared.course.rules.acceptance {
            Acceptance::Neutral => 0,
            Acceptance::Strict => -1,
        };
        let accepted = best.filter(|best| best.change <= highest && self.has_room(best));
        match accepted {
            Some(child) => {
                self.replace(&child);
                let Member { step, origin, .. } = &mut self.members[child.victim];
                (*step, *origin) = if child.is_birth { (STEP_FIRST, Fly::ABSENT) } else { (grown(*step), *origin) };
                self.done.births += u64::from(child.is_birth);
                self.done.accepted += 1;
                self.done.change += child.change;
            }
            None if was_changed => self.members[place].step = shrunk(self.members[place].step),
            None => {}
        }
    }

    /// Makes and evaluates one child; `None` if it is invalid.
    fn candidate(&mut self, place: usize, fitness: i64, draws: Chain) -> Option<Candidate> {
        let rules = &self.shared.course.rules;
        let kind = draws.bits(slot::KIND);
        if fitness <= 0 || kind >> 16 < rules.mix.birth_q16 {
            return self.birth(place, fitness, draws);
        }
        self.changed(place, kind & 0xFFFF, draws)
    }

    /// What an operator needs for the member at `place`, where the guide says `local`.
    fn setting(&self, place: usize, local: GuideSample) -> Setting<'_> {
        let rules = &self.shared.course.rules;
        Setting {
            rules,
            own_side: rules.own_side(self.members[place].index, local),
            size_px: (self.shared.grid.width_px, self.shared.grid.height_px),
        }
    }

    /// What the guide says at a fly's centre.
    fn local(&self, fly: &Fly) -> GuideSample {
        self.shared.course.guide.at(fly.x >> 6, fly.y >> 6)
    }

    fn birth(&mut self, place: usize, fitness: i64, draws: Chain) -> Option<Candidate> {
        let rules = &self.shared.course.rules;
        let victim = if fitness <= 0 { place } else { self.victim(draws) };
        let child = match rules.births.kind {
            BirthKind::Fresh => {
                let (x, y, shown_z) = self.worst_pixel(draws);
                let local = self.shared.course.guide.at(x as i32, y as i32);
                operators::newborn(&self.setting(victim, local), (x, y), shown_z, local, draws)
            }
            BirthKind::Mutant => {
                let parent = draws.below(slot::PLACE, self.members.len() as u32) as usize;
                if self.fitness(parent) <= 0 {
                    return None;
                }
                let parent = &self.members[parent].fly;
                operators::mutant(parent, &self.setting(victim, self.local(parent)), draws)
            }
        };
        self.evaluate(victim, child, Paint::Birth)
    }

    fn changed(&mut self, place: usize, kind: u32, draws: Chain) -> Option<Candidate> {
        let Member { fly, step, .. } = self.members[place];
        let (setting, mix) = (self.setting(place, self.local(&fly)), &self.shared.course.rules.mix);
        let total = mix.edge + mix.turn + mix.shift + mix.depth + mix.recolor;
        let mut which = (kind * total) >> 16;
        let mut is = |weight: u32| {
            let hit = which < weight;
            which = which.wrapping_sub(weight);
            hit
        };
        let mut paint = if draws.bits(slot::RECOLOR) >> 16 < mix.recolor_q16 { Paint::Anew } else { Paint::Keep };
        let child = if is(mix.edge) {
            operators::edge_moved(&fly, &setting, step, draws)
        } else if is(mix.turn) {
            operators::turned(&fly, step, draws)
        } else if is(mix.shift) {
            operators::shifted(&fly, &setting, step, draws)
        } else if is(mix.depth) {
            operators::raised(&fly, step, draws)
        } else {
            paint = Paint::Anew;
            fly
        };
        let child = if paint == Paint::Anew && self.shared.course.rules.color == ColorSource::Evolved {
            operators::repainted(&child, step, draws)
        } else {
            child
        };
        self.evaluate(place, child, paint)
    }

    /// Who leaves for a new tile: the least helpful of some random flies of the cell.
    fn victim(&self, draws: Chain) -> usize {
        let mut best = (i64::MAX, 0);
        for number in 0..self.shared.course.rules.births.victim_tournament {
            let place = draws.below(slot::VICTIM + number, self.members.len() as u32) as usize;
            let fitness = self.fitness(place);
            if fitness < best.0 {
                best = (fitness, place);
            }
        }
        best.1
    }

    /// Column and row of the worst of some random pixels of the cell, and the depth of what shows there.
    fn worst_pixel(&self, draws: Chain) -> (u32, u32, u32) {
        let [x0, y0, x1, y1] = self.shared.grid.bounds(self.number);
        let mut worst = (-1, (x0, y0, 0));
        for number in 0..self.shared.course.rules.births.place_tournament {
            let bits = draws.bits(slot::PLACE + number);
            let (x, y) = (x0 + below(bits << 16, x1 - x0), y0 + below(bits & 0xFFFF_0000, y1 - y0));
            let (block, pixel) = self.area.place(x as i32, y as i32);
            let (error, z) = self.area.block(block).seen(pixel);
            if error > worst.0 {
                worst = (error, (x, y, z));
            }
        }
        worst.1
    }

    /// Fits the child to its bounds, gives it its colour, and computes the change that it would make.
    fn evaluate(&mut self, victim: usize, child: Fly, paint: Paint) -> Option<Candidate> {
        let (shared, rules) = (self.shared, &self.shared.course.rules);
        let local = self.local(&child);
        let Member { index, fly: old, origin, .. } = self.members[victim];
        let child = operators::bounded(&child, &rules.bounds, rules.own_side(index, local));
        if paint != Paint::Birth && paint != Paint::Anew && child == old {
            return None;
        }
        if paint != Paint::Birth && !leash::holds(rules.leash, &origin, &child) {
            return None;
        }
        let footprint = Footprint::of(&child, (shared.grid.width_px, shared.grid.height_px));
        self.unseen_px = self.unseen_px.saturating_add(footprint.area_px());
        if shared.grid.cell_of(&footprint) != self.number {
            return None;
        }
        let old_footprint = self.footprint(&old);
        let suits = [self.suit(&old), self.suit(&child)];
        let swap = Swap {
            index,
            old: Piece { fly: &old, footprint: &old_footprint, suit: suits[0].as_ref() },
            new: Piece { fly: &child, footprint: &footprint, suit: suits[1].as_ref() },
        };
        let own = G::without_victim(self.fitness(victim), turn_penalty(shared.course, &old))
            + operators::turn_penalty(&child, rules, local);
        let picked = if rules.color == ColorSource::Pick { self.picked(&child) } else { 0 };
        let (color, change) = G::painted(&mut self.area, &mut self.desk, shared, &swap, Coloring { paint, picked })?;
        let child = if color == pack(child.color()) { child } else { child.with_color(unpack(color)) };
        if child == old {
            return None;
        }
        Some(Candidate { victim, fly: child, footprint, is_birth: paint == Paint::Birth, change: own + change })
    }

    fn footprint(&self, fly: &Fly) -> Footprint {
        Footprint::of(fly, (self.shared.grid.width_px, self.shared.grid.height_px))
    }

    /// The target's pixel nearest to a fly's centre, packed.
    fn picked(&self, fly: &Fly) -> u32 {
        let (x, y) = ((fly.x + 32) >> 6, (fly.y + 32) >> 6);
        let target = &self.shared.course.target;
        pack(target.pixels()[y as usize * target.width_px() as usize + x as usize])
    }

    /// What a fly wears; `None` in a plain search.
    fn suit(&self, fly: &Fly) -> Option<Suit<'a>> {
        let Course { masks, rules, .. } = self.shared.course;
        (!self.shared.is_plain && fly.alive).then(|| Suit::of(fly, masks, rules))
    }

    /// Whether every pixel's stack has room for the child.
    fn has_room(&mut self, child: &Candidate) -> bool {
        if !self.area.is_full(&child.footprint) {
            return true;
        }
        let victim = self.members[child.victim].index;
        let mut has_room = true;
        let suit = self.suit(&child.fly);
        let cover = Cover { footprint: &child.footprint, suit: suit.as_ref() };
        self.area.exchange(&cover, &Cover::NONE, |block, &Exchanged { pixel, .. }| {
            has_room &= block.depth(pixel) < G::DEPTH_MAX || block.holds(pixel, victim);
        });
        has_room
    }

    /// Puts the child where its victim was.
    fn replace(&mut self, child: &Candidate) {
        let Member { index, fly: old, .. } = self.members[child.victim];
        self.shared.depths[index as usize].store(child.fly.z, Ordering::Relaxed);
        let footprint = self.footprint(&old);
        let suits = [self.suit(&old), self.suit(&child.fly)];
        let swap = Swap {
            index,
            old: Piece { fly: &old, footprint: &footprint, suit: suits[0].as_ref() },
            new: Piece { fly: &child.fly, footprint: &child.footprint, suit: suits[1].as_ref() },
        };
        G::swap(&mut self.area, self.shared, self.number, &swap, child.change);
        self.members[child.victim].fly = child.fly;
    }

    /// Removes a fly if it does not help; its marginal fitness becomes 0.
    fn remove_useless(&mut self, place: usize) {
        let Member { index, fly, .. } = self.members[place];
        if !fly.alive {
            return;
        }
        let footprint = self.footprint(&fly);
        let suit = self.suit(&fly);
        let swap = Swap {
            index,
            old: Piece { fly: &fly, footprint: &footprint, suit: suit.as_ref() },
            new: Piece { fly: &Fly::ABSENT, footprint: &Footprint::EMPTY, suit: None },
        };
        let penalty = turn_penalty(self.shared.course, &fly);
        let loss = G::loss(&mut self.area, &mut self.desk, self.shared, &swap, penalty);
        if loss <= 0 {
            G::swap(&mut self.area, self.shared, self.number, &swap, loss);
            self.shared.fitness[index as usize].store(0, Ordering::Relaxed);
            self.done.change += loss;
            self.members[place] = Member { fly: Fly::ABSENT, step: STEP_FIRST, ..self.members[place] };
        }
    }
}

/// What a fly costs for being turned away from the guide; nothing if it is absent.
pub fn turn_penalty(course: &Course, fly: &Fly) -> i64 {
    if course.rules.penalties.turn == 0 || !fly.alive {
        return 0;
    }
    operators::turn_penalty(fly, &course.rules, course.guide.at(fly.x >> 6, fly.y >> 6))
}
