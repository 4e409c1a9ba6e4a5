//! The compiled shaders, as committed in `spirv/`: one module per stage, and further ones of those that hardware wants
//! otherwise (`tools/shader_manifest.rs`).

use crate::vk::{DeviceInfo, DeviceKind};

/// A stage that is compiled in several ways. All give the same bytes.
pub(super) struct Flavours {
    software: &'static [u8],
    hardware: &'static [u8],
    /// For drivers without subgroup operations.
    plain: &'static [u8],
}

impl Flavours {
    /// The module for a device.
    pub fn for_device(&self, info: &DeviceInfo) -> &'static [u8] {
        match (info.has_subgroup_arithmetic(), info.kind) {
            (false, _) => self.plain,
            (true, DeviceKind::Cpu) => self.software,
            (true, _) => self.hardware,
        }
    }
}

macro_rules! module {
    ($file:expr) => {
        include_bytes!(concat!("../../spirv/", $file, ".spv"))
    };
}

/// Two ways: with subgroup operations and without.
macro_rules! twofold {
    ($stage:literal) => {
        Flavours { software: module!($stage), hardware: module!($stage), plain: module!(concat!($stage, ".plain")) }
    };
}

/// Three ways.
macro_rules! threefold {
    ($stage:literal) => {
        Flavours {
            software: module!($stage),
            hardware: module!(concat!($stage, ".hardware")),
            plain: module!(concat!($stage, ".plain")),
        }
    };
}

/// Twin: `cpu/evaluate.rs`.
pub(super) const EVALUATE: Flavours = twofold!("evaluate.comp");
/// What only tests and benches compare with.
pub(super) const RE_RENDER: Flavours = twofold!("re_render.comp");
/// Twin: `cpu/mosaic.rs`.
pub(super) const MOSAIC_VERTEX: &[u8] = include_bytes!("../../spirv/mosaic.vert.spv");
/// Twin: `cpu/mosaic.rs`.
pub(super) const MOSAIC_FRAGMENT: &[u8] = include_bytes!("../../spirv/mosaic.frag.spv");

/// Twin: `cpu/translucent.rs`.
pub(super) const TRANSLUCENT: Flavours = twofold!("translucent.comp");

/// Twin: `cpu/mosaic.rs`.
pub(super) const COMPOSE: &[u8] = include_bytes!("../../spirv/compose.comp.spv");

/// Twin: `cpu/cells/cell.rs`.
pub(super) const CELLS: Flavours = threefold!("cells.comp");
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
pub(super) const CELLS_GLAZED: Flavours = threefold!("cells_glazed.comp");
/// Twin: `refresh` in `cpu/cells/translucent.rs`.
pub(super) const CELLS_FITNESS: &[u8] = include_bytes!("../../spirv/cells_fitness.comp.spv");

/// A module as the words that Vulkan reads; the bytes in the binary may lie at any address.
pub(super) fn words(module: &[u8]) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(module)
}
