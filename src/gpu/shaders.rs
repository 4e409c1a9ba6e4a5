//! The compiled shaders, one module per stage, as committed in `spirv/`.

/// Twin: `cpu/evaluate.rs`.
pub(super) const EVALUATE: &[u8] = include_bytes!("../../spirv/evaluate.comp.spv");
/// What only tests and benches compare with.
pub(super) const RE_RENDER: &[u8] = include_bytes!("../../spirv/re_render.comp.spv");
/// Twin: `cpu/mosaic.rs`.
pub(super) const MOSAIC_VERTEX: &[u8] = include_bytes!("../../spirv/mosaic.vert.spv");
/// Twin: `cpu/mosaic.rs`.
pub(super) const MOSAIC_FRAGMENT: &[u8] = include_bytes!("../../spirv/mosaic.frag.spv");

/// Twin: `cpu/translucent.rs`.
pub(super) const TRANSLUCENT: &[u8] = include_bytes!("../../spirv/translucent.comp.spv");

/// Twin: `cpu/mosaic.rs`.
pub(super) const COMPOSE: &[u8] = include_bytes!("../../spirv/compose.comp.spv");

/// Twin: `cpu/cells/cell.rs`.
pub(super) const CELLS: &[u8] = include_bytes!("../../spirv/cells.comp.spv");
/// Twin: `deal` in `cpu/cells/mod.rs`.
pub(super) const CELLS_DEAL: &[u8] = include_bytes!("../../spirv/cells_deal.comp.spv");
/// Slices of members for the cells.
pub(super) const CELLS_SCAN: &[u8] = include_bytes!("../../spirv/cells_scan.comp.spv");
/// Members into their slices.
pub(super) const CELLS_SCATTER: &[u8] = include_bytes!("../../spirv/cells_scatter.comp.spv");
/// Twin: `renormalise` in `cpu/cells/mod.rs`.
pub(super) const CELLS_DEPTHS: &[u8] = include_bytes!("../../spirv/cells_depths.comp.spv");
/// Slices in the order of the flies.
pub(super) const CELLS_SORT: &[u8] = include_bytes!("../../spirv/cells_sort.comp.spv");

/// Twin: `cpu/cells/cell.rs` with `cpu/cells/translucent.rs`.
pub(super) const CELLS_GLAZED: &[u8] = include_bytes!("../../spirv/cells_glazed.comp.spv");
/// Twin: `refresh` in `cpu/cells/translucent.rs`.
pub(super) const CELLS_FITNESS: &[u8] = include_bytes!("../../spirv/cells_fitness.comp.spv");

/// A module as the words that Vulkan reads; the bytes in the binary may lie at any address.
pub(super) fn words(module: &[u8]) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(module)
}
