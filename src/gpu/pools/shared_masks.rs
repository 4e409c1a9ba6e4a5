//! The masks on a device. Lanes with the same masks share them.

use std::sync::Arc;

use super::Slice;
use crate::model::MaskSet;

/// Masks, the layers that they have on the device, and how many lanes use them.
struct SharedSet {
    masks: Arc<MaskSet>,
    layers: Slice,
    lanes: usize,
}

impl SharedSet {
    /// Whether these masks have the same texels. Their blend may differ, since it is not in the texels.
    fn holds(&self, masks: &Arc<MaskSet>) -> bool {
        Arc::ptr_eq(&self.masks, masks) || self.masks.layers() == masks.layers()
    }
}

/// All masks on the device.
#[derive(Default)]
pub(super) struct SharedMasks {
    sets: Vec<SharedSet>,
}

impl SharedMasks {
    /// Whether a lane uses these masks.
    pub fn contains(&self, masks: &Arc<MaskSet>) -> bool {
        self.sets.iter().any(|set| set.holds(masks))
    }

    /// Counts one more lane with these masks and returns their layers, if a lane uses them already.
    pub fn join(&mut self, masks: &Arc<MaskSet>) -> Option<Slice> {
        let set = self.sets.iter_mut().find(|set| set.holds(masks))?;
        set.lanes += 1;
        Some(set.layers)
    }

    /// Adds masks that no lane used before, for one lane.
    pub fn add(&mut self, masks: &Arc<MaskSet>, layers: Slice) {
        self.sets.push(SharedSet { masks: Arc::clone(masks), layers, lanes: 1 });
    }

    /// Counts one lane less with these masks and returns their layers, if it was the last.
    pub fn leave(&mut self, masks: &Arc<MaskSet>) -> Option<Slice> {
        let place = self.sets.iter().position(|set| set.holds(masks))?;
        self.sets[place].lanes -= 1;
        if self.sets[place].lanes > 0 {
            return None;
        }
        Some(self.sets.swap_remove(place).layers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Blend, Mask};

    #[test]
    fn masks_stay_until_the_last_of_the_lanes_that_share_them_leaves() {
        let plain = Arc::new(MaskSet::default());
        let two = Arc::new(MaskSet::with_layers(vec![Mask::square()]).expect("two layers"));
        let layers = Slice { first: 3, count: 1 };
        let mut shared = SharedMasks::default();
        assert_eq!((shared.contains(&plain), shared.join(&plain), shared.leave(&plain)), (false, None, None));
        shared.add(&plain, layers);
        let same_texels = Arc::new(MaskSet::default().with_blend(Blend::Translucent));
        assert_eq!((shared.join(&same_texels), shared.join(&two)), (Some(layers), None));
        assert_eq!((shared.leave(&plain), shared.leave(&same_texels)), (None, Some(layers)));
        assert!(!shared.contains(&plain));
    }
}
