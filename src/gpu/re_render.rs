//! Marginal fitness the slow way, as in the paper: one re-render per fly with that fly left out. It is the baseline of
//! `cargo bench --bench leave_one_out`.

use super::GpuEvaluator;
use super::evaluate_pass::{Mode, Variant, create_pipeline};
use super::evaluator::GpuLane;
use super::layout::EvaluatePush;
use crate::error::{Error, Remedy, Result};
use crate::model::Evaluator;
use crate::vk::{Buffer, BufferUse, Residence};

/// Re-renders of one submission: short enough for the watchdog of any driver.
const RE_RENDERS_PER_SUBMISSION: u32 = 64;

impl GpuEvaluator {
    /// The marginal fitness of every fly of the only lane, by leaving each out of the picture that was loaded last.
    ///
    /// # Errors
    /// [`Error::Parameter`] unless there is one lane; [`Error::TooLarge`] unless its lists fit a single dispatch; or if
    /// the device fails.
    pub fn marginal_by_re_rendering(&mut self) -> Result<Vec<i64>> {
        let [Some(GpuLane { lane, .. })] = &self.lanes[..] else {
            return Err(Error::parameter("scenes", "re-rendering works on one lane"));
        };
        let lists = lane.lists();
        let longest = (0..lists.block_count()).map(|block| lists.list(block).len()).max().unwrap_or(0);
        let entries: usize = (0..lists.block_count()).map(|block| lists.list(block).len()).sum();
        if entries > self.pass.entry_capacity() || longest > super::evaluate_pass::LIST_PIECE {
            let what = "re-rendering needs lists that fit a single dispatch".to_owned();
            return Err(Error::TooLarge { what, remedies: &[Remedy::FewerTiles] });
        }
        let (fly_count, item_count) = (lane.tiles().len() as u32, lists.block_count() as u32);
        // The work of a full evaluation stays in the buffers.
        self.evaluate_again()?;

        let bytes = u64::from(fly_count) * 8;
        let sums = Buffer::create(&self.device, "re-render sums", bytes, BufferUse::Storage, Residence::Device)?;
        let pipeline = create_pipeline(&self.device, Variant { mode: Mode::ReRender, ..self.pass.variant })?;
        let group = self.pass.bind_with_sums(&pipeline, &sums)?;
        self.recorder.write_buffer(&sums, 0, &vec![0; bytes as usize])?;
        for first in (0..fly_count).step_by(RE_RENDERS_PER_SUBMISSION as usize) {
            let mut pass = self.recorder.compute_pass("evaluate")?;
            for fly in first..fly_count.min(first + RE_RENDERS_PER_SUBMISSION) {
                let push = EvaluatePush { item_count, left_out_fly: fly, sum_offset: fly };
                self.pass.dispatch(&mut pass, &pipeline, &group, push);
            }
            drop(pass);
            self.recorder.submit_and_wait()?;
        }
        let ticket = self.recorder.read_buffer(&sums, 0, bytes)?;
        self.recorder.submit_and_wait()?;
        let mut without = vec![0_u64; fly_count as usize];
        self.recorder.read_into(&ticket, bytemuck::cast_slice_mut(&mut without))?;
        let sae = self.evaluation(0).sae;
        // The high words of narrow sums stay 0, and an SAE is never negative.
        Ok(without.into_iter().map(|without| without as i64 - sae as i64).collect())
    }
}
