//! Marginal fitness the slow way, as in the paper: one re-render per fly with that fly left out. It is the baseline of
//! `cargo bench --bench leave_one_out`, and has a shader of its own so that the one that evaluates does not carry it.

use super::GpuEvaluator;
use super::evaluate::create_kernel;
use super::lane::GpuLane;
use super::layout::ReRenderPush;
use super::shaders;
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
        if entries > self.pass.entry_capacity() || longest > super::evaluate::LIST_PIECE {
            let what = "re-rendering needs lists that fit a single dispatch".to_owned();
            return Err(Error::TooLarge { what, remedies: &[Remedy::FewerTiles] });
        }
        let (fly_count, item_count) = (lane.tiles().len() as u32, lists.block_count() as u32);
        // The work of a full evaluation stays in the buffers.
        self.evaluate_again()?;

        let bytes = u64::from(fly_count) * 8;
        let sums = Buffer::create(&self.device, "re-render sums", bytes, BufferUse::Storage, Residence::Device)?;
        let (constants, push_bytes) = (self.pass.variant.specialization(), size_of::<ReRenderPush>());
        let pipeline = create_kernel(&self.device, "re_render", &shaders::RE_RENDER, &constants, push_bytes)?;
        let group = self.pass.bind_with_sums(&pipeline, &sums)?;
        self.recorder.write_buffer(&sums, 0, &vec![0; bytes as usize])?;
        for first in (0..fly_count).step_by(RE_RENDERS_PER_SUBMISSION as usize) {
            let mut pass = self.recorder.compute_pass("re_render")?;
            pass.bind(&pipeline, &group);
            for left_out_fly in first..fly_count.min(first + RE_RENDERS_PER_SUBMISSION) {
                pass.push_constants(bytemuck::bytes_of(&ReRenderPush { item_count, left_out_fly }));
                self.pass.dispatch(&mut pass, item_count);
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
