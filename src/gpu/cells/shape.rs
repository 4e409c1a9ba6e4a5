//! How the work of a cell is cut for a device.

use super::plan::Plan;
use crate::error::{Error, Remedy, Result};
use crate::model::cells::Course;
use crate::model::cells::pixel::TRANSLUCENT_DEPTH;
use crate::vk::{DeviceInfo, DeviceKind};

/// Turns of loops that lavapipe grants an invocation, less a margin. On hardware this keeps a dispatch to some
/// milliseconds; there a single step may take more.
const BUDGET: u32 = 60_000;
/// Most invocations of a workgroup that is chosen here.
const LANES_MAX: u32 = 1_024;
/// Invocations of a workgroup on hardware.
const LANES_WIDE: u32 = 64;

/// How the invocations of a cell work together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CellForm {
    /// A workgroup is one subgroup, which needs no barrier: best on software Vulkan.
    Narrow = 0,
    /// A workgroup may have several subgroups.
    Wide = 1,
}

/// How the work of a cell is cut; it never changes a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct CellShape {
    /// Invocations of a workgroup, a power of two; in the narrow form those of a subgroup.
    pub lanes: u32,
    /// How they work together.
    pub form: CellForm,
    /// Most turns of loops in an invocation of one dispatch.
    pub budget: u32,
}

impl CellShape {
    /// The shape for a device: the fewest invocations whose longest step fits the budget. If there is none, the most
    /// invocations, and as many turns as that step takes.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if the device cuts loops short, and the steps of this search are too long for it.
    pub fn for_device(info: &DeviceInfo, course: &Course) -> Result<Self> {
        // All flies may lie in one cell, whose members are ranked eight in a turn of a loop.
        if info.cuts_loops_short() && course.fly_count as u64 > 8 * u64::from(BUDGET) {
            let what = format!("{} tiles are too many for one dispatch of software Vulkan", course.fly_count);
            return Err(Error::TooLarge { what, remedies: &[Remedy::FewerTiles, Remedy::Cpu] });
        }
        let narrow = Self { lanes: info.subgroup_size, form: CellForm::Narrow, budget: BUDGET };
        let wide = |lanes| Self { lanes, form: CellForm::Wide, budget: BUDGET };
        let most = LANES_MAX.min(info.limits.workgroup_invocations);
        let first = (info.kind == DeviceKind::Cpu && info.has_subgroup_arithmetic()).then_some(narrow);
        // What software gains by width it pays for barriers.
        let narrowest =
            if info.kind == DeviceKind::Cpu { (2 * info.subgroup_size).min(LANES_WIDE) } else { LANES_WIDE };
        let lanes = (narrowest.ilog2()..=most.ilog2()).map(|power| 1 << power);
        let mut shapes = first.into_iter().chain(lanes.map(wide));
        if let Some(shape) = shapes.find(|shape| shape.longest_step(course) <= u64::from(BUDGET)) {
            return Ok(shape);
        }
        let widest = wide(1 << most.ilog2());
        let longest = widest.longest_step(course);
        u32::try_from(longest)
            .ok()
            .filter(|_| !info.cuts_loops_short())
            .map(|budget| Self { budget, ..widest })
            .ok_or_else(|| {
                let what = format!(
                    "one step of {} candidates with tiles this large is too long for a dispatch of the Vulkan device",
                    course.rules.candidates
                );
                Error::TooLarge { what, remedies: &[Remedy::MoreTiles, Remedy::FewerCandidates, Remedy::Cpu] }
            })
    }

    /// Refuses a narrow workgroup that is not one subgroup.
    pub(super) fn check(self, info: &DeviceInfo) -> Result<()> {
        let size = if info.has_subgroup_arithmetic() { info.subgroup_size } else { 1 };
        if self.form == CellForm::Narrow && self.lanes != size {
            let reason = format!("a narrow workgroup has the {size} of a subgroup, not {}", self.lanes);
            return Err(Error::parameter("lanes", reason));
        }
        Ok(())
    }

    /// Words of scratch for each cell of a search, which hold the pixels of a child.
    pub(super) fn scratch_words(self, course: &Course, plan: &Plan) -> u64 {
        let rows = self.lanes / self.lanes.min(8);
        let side = plan.cell_side_px;
        let words = match course.is_translucent() {
            true => 4,
            false => 1 + u64::from(!course.is_plain()),
        };
        words * u64::from(side.min(plan.block_columns * 8)) * u64::from(side.min(plan.height_px) + rows)
    }

    /// Most turns of loops that one step may take; counted as `glsl/shared/cells_loop.glsl` and its stages do.
    fn longest_step(self, course: &Course) -> u64 {
        let plan = Plan::new(course);
        let (columns, rows) = (self.lanes.min(8), self.lanes / self.lanes.min(8));
        let turns = |(across, down): (u64, u64), inner: u64| 3 + 3 * down + across * down * (1 + inner);
        // A box may begin anywhere in a patch, so it may need one more. The two boxes of an exchange, or the box around
        // both, need another one in each direction.
        let patches = |(width, height): (u32, u32), more: u64| {
            (u64::from(width.div_ceil(columns)) + 1 + more, u64::from(height.div_ceil(rows)) + more)
        };
        let rules = &course.rules;
        let (width, height) = plan.largest_box(rules);
        let (across, down) = patches((width, height), 0);
        // A convex shape holds at most as many points of a lattice as its area and half the outline of its box,
        // measured in cells of the lattice.
        let side = u64::from(plan.largest_side_px(rules));
        let own = (across * down).min(side * side / u64::from(self.lanes) + across + down + 1);
        let tournaments = u64::from(rules.births.place_tournament + rules.births.victim_tournament);
        let batches = u64::from(rules.candidates.div_ceil(self.lanes.min(64)));
        let making = 2 * 40 + batches * (40 + tournaments) + 12 * u64::from(rules.candidates);
        let side = plan.cell_side_px;
        let both = ((2 * width).min(side).min(plan.width_px), (2 * height).min(side).min(plan.height_px));
        let exchange = |inner: u64| 3 + 3 * patches(both, 2).1 + turns(patches(both, 2), inner);
        let candidates = u64::from(rules.candidates);
        if course.is_translucent() {
            // A pass over both boxes with four layers of a stack in a turn, for each candidate as for the exchange.
            let pass = exchange(TRANSLUCENT_DEPTH as u64 / 4 + 1);
            return making + candidates * (48 + pass + own) + pass;
        }
        let candidate = 28 + turns((across, down), 0) + 9 * own;
        making + candidates * candidate + turns((across, down), 0) + exchange(17)
    }
}
