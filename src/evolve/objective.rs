//! The objective that a search in cells lowers, and the SAE of the mosaic, which may differ from it.

use crate::error::Result;
use crate::model::Rgb;
use crate::model::cells::glaze::opacity_of;
use crate::model::cells::{Course, Search};
use crate::model::tile::unpack;
use crate::model::translucency::Compositing;

/// Whether the objective of a course is the SAE: all pixels are wanted and have the same weight, and nothing is
/// penalised.
#[must_use]
pub fn lowers_sae_alone(course: &Course) -> bool {
    let penalties = &course.rules.penalties;
    let is_plain = course.target.weights().is_none() && course.target.transparent().is_none();
    is_plain && (penalties.overlap, penalties.hole, penalties.turn) == (0, 0, 0)
}

/// The SAE of a search's current mosaic, over all wanted pixels, without weights.
///
/// # Errors
/// If the device fails.
pub fn sae(search: &mut dyn Search) -> Result<u64> {
    if lowers_sae_alone(search.course()) {
        return Ok(search.standing().objective.unsigned_abs());
    }
    let stacks = search.read_back_stacks()?;
    let Course { target, rules, .. } = search.course();
    let ground = unpack(rules.background);
    let is_translucent = search.course().is_translucent();
    let error = |(pixel, stack): (usize, &Vec<(u32, i32)>)| {
        if target.transparent().is_some_and(|transparent| transparent[pixel]) {
            return 0;
        }
        if is_translucent {
            let mut compositing = Compositing::START;
            stack.iter().for_each(|&(_, look)| compositing.add(opacity_of(look as u32), unpack(look as u32)));
            return difference(target.pixels()[pixel], compositing.over(ground));
        }
        let weight = target.weights().map_or(1, |weights| u64::from(weights[pixel]));
        stack.first().map_or_else(|| difference(target.pixels()[pixel], ground), |&(_, error)| error as u64 / weight)
    };
    Ok(stacks.pixels.iter().enumerate().map(error).sum())
}

fn difference(one: Rgb, other: Rgb) -> u64 {
    one.iter().zip(other).map(|(&a, b)| u64::from(a.abs_diff(b))).sum()
}
