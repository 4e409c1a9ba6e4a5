//! The compiled shaders, as committed in `spirv/`: one module per stage, and a second one of those that add up over
//! subgroups.

use crate::vk::DeviceInfo;

/// A stage that adds up over subgroups, and its like for drivers without such operations. Both give the same bytes.
pub(super) struct Twofold {
    with_subgroups: &'static [u8],
    plain: &'static [u8],
}

impl Twofold {
    /// The module for a device.
    pub fn for_device(&self, info: &DeviceInfo) -> &'static [u8] {
        if info.has_subgroup_arithmetic() { self.with_subgroups } else { self.plain }
    }
}

macro_rules! twofold {
    ($stage:literal) => {
        Twofold {
            with_subgroups: include_bytes!(concat!("../../spirv/", $stage, ".spv")),
            plain: include_bytes!(concat!("../../spirv/", $stage, ".plain.spv")),
        }
    };
}

/// Twin: `cpu/evaluate.rs`.
pub(super) const EVALUATE: Twofold = twofold!("evaluate.comp");
/// What only tests and benches compare with.
pub(super) const RE_RENDER: Twofold = twofold!("re_render.comp");
/// Twin: `cpu/mosaic.rs`.
pub(super) const MOSAIC_VERTEX: &[u8] = include_bytes!("../../spirv/mosaic.vert.spv");
/// Twin: `cpu/mosaic.rs`.
pub(super) const MOSAIC_FRAGMENT: &[u8] = include_bytes!("../../spirv/mosaic.frag.spv");

/// Twin: `cpu/translucent.rs`.
pub(super) const TRANSLUCENT: Twofold = twofold!("translucent.comp");

/// Twin: `cpu/mosaic.rs`.
pub(super) const COMPOSE: &[u8] = include_bytes!("../../spirv/compose.comp.spv");

/// Twin: `cpu/cells/cell.rs`.
pub(super) const CELLS: Twofold = twofold!("cells.comp");
/// Twin: `deal` in `cpu/cells/mod.rs`.
pub(super) const CELLS_DEAL: &[u8] = include_bytes!("../../spirv/cells_deal.comp.spv");
/// Slices of members for the cells.
pub(super) const CELLS_SCAN: &[u8] = include_bytes!("../../spirv/cells_scan.comp.spv");
/// Members into their slices.
pub(super) const CELLS_SCATTER: &[u8] = include_bytes!("../../spirv/cells_scatter.comp.spv");
/// Twin: `renormalise` in `cpu/cells/mod.rs`.
pub(super) const CELLS_DEPTHS: &[u8] = include_bytes!("../../spirv/cells_depths.comp.spv");
/// Twin: `model/cells/depths.rs`.
pub(super) const CELLS_SPREAD: &[u8] = include_bytes!("../../spirv/cells_spread.comp.spv");
/// Slices in the order of the flies.
pub(super) const CELLS_SORT: &[u8] = include_bytes!("../../spirv/cells_sort.comp.spv");

/// Twin: `cpu/cells/cell.rs` with `cpu/cells/translucent.rs`.
pub(super) const CELLS_GLAZED: Twofold = twofold!("cells_glazed.comp");
/// Twin: `refresh` in `cpu/cells/translucent.rs`.
pub(super) const CELLS_FITNESS: &[u8] = include_bytes!("../../spirv/cells_fitness.comp.spv");

/// A module as the words that Vulkan reads; the bytes in the binary may lie at any address.
pub(super) fn words(module: &[u8]) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(module)
}
