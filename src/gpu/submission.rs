//! The work of the evaluator: the lists of blocks become work items, work items are submitted, and fitness is read
//! back.

use super::GpuEvaluator;
use super::evaluate::LIST_PIECE;
use super::lane::{GpuLane, Unread, is_translucent};
use super::lane_buffers::Part;
use super::layout::{FLAG_CONTINUED, FLAG_FRESH, FLAG_UNFINISHED, WorkItem};
use super::work::Pending;
use crate::error::Result;
use crate::model::blocks::index_of;
use crate::vk::{ReadTicket, Recorder};

impl GpuEvaluator {
    /// Evaluates all blocks of `lanes` afresh.
    pub(super) fn evaluate_all(&mut self, lanes: &[usize]) -> Result<()> {
        let mut zeroes = self.recorder.transfer_pass("zero sums")?;
        for &number in lanes {
            let known = self.lanes[number].as_mut().expect("the lane was released");
            known.unread = Unread::All;
            for part in [Part::Marginal, Part::Sums] {
                let sums = self.pass.buffers.range(part, &known.span);
                zeroes.fill(&sums.buffer, sums.offset, sums.size_bytes, 0);
            }
            let blocks = 0..known.lane.lists().block_count() as u32;
            self.work.pending.extend(blocks.map(|block| Pending { lane: number, block, from: 0 }));
        }
        drop(zeroes);
        self.run(lanes, FLAG_FRESH)
    }

    /// Evaluates the blocks that replacements made stale.
    pub(super) fn evaluate_touched(&mut self) -> Result<()> {
        let mut stale = Vec::new();
        for (number, known) in self.lanes.iter_mut().enumerate() {
            let Some(GpuLane { lane, .. }) = known else { continue };
            if lane.touched().is_empty() {
                continue;
            }
            let blocks = lane.touched().iter();
            self.work.pending.extend(blocks.map(|&block| Pending { lane: number, block, from: 0 }));
            lane.clear_touched();
            stale.push(number);
        }
        self.run(&stale, 0)
    }

    /// Evaluates all pending blocks and reads the fitness of `lanes` back.
    fn run(&mut self, lanes: &[usize], first_flags: u32) -> Result<()> {
        let mut pending = std::mem::take(&mut self.work.pending);
        // Each round looks at one piece of every list, so that a piece always finds what the one before it left.
        while !pending.is_empty() {
            let mut rest = Vec::new();
            for block in &pending {
                if is_translucent(&self.known(block.lane).lane) {
                    self.push_stack(*block)?;
                } else {
                    self.push_piece(*block, first_flags, &mut rest)?;
                }
            }
            if rest.is_empty() {
                break;
            }
            self.submit(&[])?;
            pending = rest;
        }
        self.submit(lanes)?;
        pending.clear();
        self.work.pending = pending;
        Ok(())
    }

    /// Adds a block of a translucent lane to the work.
    fn push_stack(&mut self, Pending { lane, block, .. }: Pending) -> Result<()> {
        let length = self.known(lane).lane.lists().list(block as usize).len();
        if self.translucent.as_ref().is_some_and(|pass| !pass.has_room(length)) {
            self.submit(&[])?;
        }
        let first_pixel = self.first_pixel(lane, block);
        if let (Some(pass), Some(known)) = (&mut self.translucent, &self.lanes[lane]) {
            pass.add(lane, &known.lane, block, first_pixel);
        }
        Ok(())
    }

    /// Adds the next piece of a block's list to the work; what is left goes to `rest`.
    fn push_piece(&mut self, pending: Pending, first_flags: u32, rest: &mut Vec<Pending>) -> Result<()> {
        let list_length = self.known(pending.lane).lane.lists().list(pending.block as usize).len();
        let piece = pending.from..list_length.min(pending.from + LIST_PIECE);
        let items_max = (self.pass.item_capacity() as u64).min(self.pace.units());
        let is_full = self.work.items.len() as u64 >= items_max
            || self.work.entries.len() + piece.len() > self.pass.entry_capacity();
        if is_full {
            self.submit(&[])?;
        }
        let mut flags = if pending.from == 0 { first_flags } else { FLAG_CONTINUED };
        if piece.end < list_length {
            flags |= FLAG_UNFINISHED;
            rest.push(Pending { from: piece.end, ..pending });
        }
        let first_pixel = self.first_pixel(pending.lane, pending.block);
        let first_entry = self.work.entries.len();
        let GpuLane { lane, unread, .. } = self.lanes[pending.lane].as_mut().expect("the lane was released");
        let (x, y) = lane.lists().origin(pending.block as usize);
        let list = &lane.lists().list(pending.block as usize)[piece.clone()];
        self.work.entries.extend(list.iter().map(|&key| index_of(key)));
        // What shows or showed in the block is in its list, or was replaced.
        unread.add(list.iter().map(|&key| index_of(key)));
        self.work.items.push(WorkItem {
            lane: pending.lane as u32,
            first_pixel: first_pixel as u32,
            x: x as i32,
            y: y as i32,
            first_entry: first_entry as u32,
            entry_count: piece.len() as u32,
            flags,
            padding: 0,
        });
        Ok(())
    }

    /// Runs the collected work items, if any, and reads the fitness of `lanes` back.
    fn submit(&mut self, lanes: &[usize]) -> Result<()> {
        let (pass, recorder, work) = (&mut self.pass, &mut self.recorder, &mut self.work);
        let parts = match &mut self.translucent {
            Some(translucent) => translucent.record(recorder, &pass.buffers)?,
            None => None,
        };
        if !work.items.is_empty() {
            pass.record(recorder, &work.items, &work.entries)?;
        }
        let mut tickets = Vec::with_capacity(lanes.len());
        for &number in lanes {
            let Some(known) = self.lanes[number].as_ref().filter(|known| !is_translucent(&known.lane)) else {
                continue;
            };
            let marginal = pass.buffers.range(Part::Marginal, &known.span);
            tickets.push((number, recorder.read_buffer(&marginal.buffer, marginal.offset, marginal.size_bytes)?));
        }
        let sums = pass.buffers.part(Part::Sums);
        let sums_ticket =
            if tickets.is_empty() { None } else { Some(recorder.read_buffer(sums, 0, sums.size_bytes())?) };
        recorder.submit_and_wait()?;
        if parts.is_none() {
            self.pace.note(work.items.len() as u64, recorder.took());
        }
        if let (Some(translucent), Some(parts)) = (&mut self.translucent, parts) {
            translucent.absorb(recorder, &parts)?;
        }
        if let Some(sums) = sums_ticket {
            take_in(recorder, &tickets, &sums, &mut self.lanes)?;
        }
        work.items.clear();
        work.entries.clear();
        Ok(())
    }

    /// Number of a block's first pixel in the layers.
    fn first_pixel(&self, lane: usize, block: u32) -> usize {
        self.known(lane).span.first_pixel + block as usize * self.pass.variant.shape.block_pixels()
    }
}

/// Takes in the fitness of opaque lanes, each with the ticket for its marginal fitness.
fn take_in(
    recorder: &Recorder,
    tickets: &[(usize, ReadTicket)],
    sums: &ReadTicket,
    lanes: &mut [Option<GpuLane>],
) -> Result<()> {
    let sums: Vec<u64> = recorder.look(sums, bytemuck::pod_collect_to_vec)?;
    for (number, ticket) in tickets {
        if let Some(known) = &mut lanes[*number] {
            recorder.look(ticket, |marginal| known.take_in(marginal, sums[*number]))?;
        }
    }
    Ok(())
}
