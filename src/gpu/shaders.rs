//! The compiled shaders, one module per stage, as committed in `spirv/`.

/// Twin: `cpu/evaluate.rs`.
pub(super) const EVALUATE: &[u8] = include_bytes!("../../spirv/evaluate.comp.spv");
/// Twin: `cpu/mosaic.rs`.
pub(super) const MOSAIC_VERTEX: &[u8] = include_bytes!("../../spirv/mosaic.vert.spv");
/// Twin: `cpu/mosaic.rs`.
pub(super) const MOSAIC_FRAGMENT: &[u8] = include_bytes!("../../spirv/mosaic.frag.spv");

/// Twin: `cpu/translucent.rs`.
pub(super) const TRANSLUCENT: &[u8] = include_bytes!("../../spirv/translucent.comp.spv");

/// Twin: `cpu/mosaic.rs`.
pub(super) const COMPOSE: &[u8] = include_bytes!("../../spirv/compose.comp.spv");

/// A module as the words that Vulkan reads; the bytes in the binary may lie at any address.
pub(super) fn words(module: &[u8]) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(module)
}
