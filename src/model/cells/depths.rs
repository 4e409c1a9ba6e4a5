//! Spreads depths evenly. Births put tiles just in front of what shows, so depths would pile up there.

use crate::model::Fly;
use crate::model::blocks::{depth_order, index_of};
use crate::model::fly::Z_MAX;

/// Spreads the depths of the living flies evenly over the whole range. Their order stays the same, and so does the
/// picture.
pub fn spread(flies: &mut [Fly]) {
    let mut order = depth_order(flies);
    order.retain(|&key| flies[index_of(key) as usize].alive);
    let count = order.len() as u64;
    for (rank, key) in (0_u64..).zip(order) {
        flies[index_of(key) as usize].z = ((2 * rank + 1) * (u64::from(Z_MAX) + 1) / (2 * count)) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_keep_their_order_ties_by_index_and_absent_flies_stay_as_they_are() {
        let at = |z| Fly { z, alive: true, ..Fly::ABSENT };
        let mut flies = [at(9), Fly::ABSENT, at(3), at(9), at(0)];
        spread(&mut flies);
        assert_eq!(flies[1], Fly::ABSENT);
        let eighth = (Z_MAX + 1) / 8;
        assert_eq!([4, 2, 0, 3].map(|index: usize| flies[index].z), [eighth, 3 * eighth, 5 * eighth, 7 * eighth]);
        spread(&mut []);
    }
}
