//! A lane of the evaluator: what the host keeps of it, and what the device reported.

use super::evaluate::needs_wide_sums;
use super::lane_buffers::LaneSpan;
use crate::model::{Blend, Lane};

/// One lane: what the host keeps, where it lies on the device, and what the device last reported of it if it is opaque.
pub(super) struct GpuLane {
    pub lane: Lane,
    pub span: LaneSpan,
    pub sae: u64,
    pub marginal: Vec<i64>,
    pub unread: Unread,
}

/// The flies whose marginal fitness may not be what the device last reported.
pub(super) enum Unread {
    All,
    /// Some of them more than once.
    Some(Vec<u32>),
}

impl Unread {
    /// Adds flies.
    pub fn add(&mut self, more: impl Iterator<Item = u32>) {
        if let Self::Some(flies) = self {
            flies.extend(more);
        }
    }
}

impl GpuLane {
    /// Takes in the SAE, and the marginal fitness of the flies that are unread, from the 64-bit sums of all flies.
    pub fn take_in(&mut self, marginal: &[u8], sae: u64) {
        let is_wide = needs_wide_sums(self.lane.scene());
        let (words, _) = marginal.as_chunks::<8>();
        let number = |word: &[u8; 8]| {
            let [low, high] = bytemuck::pod_read_unaligned::<[u32; 2]>(word);
            // Of narrow sums only the low words count.
            if is_wide { (u64::from(high) << 32 | u64::from(low)) as i64 } else { i64::from(low as i32) }
        };
        match &mut self.unread {
            Unread::Some(flies) if flies.len() < words.len() => {
                for fly in flies.drain(..) {
                    self.marginal[fly as usize] = number(&words[fly as usize]);
                }
            }
            unread => {
                self.marginal.iter_mut().zip(words).for_each(|(place, word)| *place = number(word));
                *unread = Unread::Some(Vec::new());
            }
        }
        self.sae = if is_wide { sae } else { sae & u64::from(u32::MAX) };
    }
}

/// Whether the lane's fitness is the work of [`super::translucent::TranslucentPass`].
pub(super) fn is_translucent(lane: &Lane) -> bool {
    lane.scene().masks.blend() == Blend::Translucent
}
