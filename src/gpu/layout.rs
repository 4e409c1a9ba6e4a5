//! The bytes that cross to shaders. `tests/suite/layout.rs` compares every offset here with the compiled modules.

use bytemuck::{Pod, Zeroable};

pub use crate::model::Tile;

/// `Lane` of `glsl/shared/lane.glsl`: where one picture lies in the buffers that all lanes share.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct LaneRecord {
    /// Index of the lane's first fly in the tile and marginal-fitness buffers.
    pub first_fly: u32,
    /// Layer of the lane's square in the mask array.
    pub first_mask: u32,
    /// Packed background colour.
    pub background: u32,
    /// Index of the lane's SAE in the sums.
    pub sum: u32,
}

/// `WorkItem` of `glsl/shared/block.glsl`: one block of pixels and its list of tiles, or a piece of that list.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct WorkItem {
    /// Index of the block's lane.
    pub lane: u32,
    /// Index of the block's first pixel in the layers.
    pub first_pixel: u32,
    /// Left column of the block in px.
    pub x: i32,
    /// Top row of the block in px.
    pub y: i32,
    /// Index of the list's first entry.
    pub first_entry: u32,
    /// Length of the list.
    pub entry_count: u32,
    /// Any of the `FLAG_` constants.
    pub flags: u32,
    /// Makes the size a multiple of 16.
    pub padding: u32,
}

/// The block has no old sums to take off.
pub const FLAG_FRESH: u32 = 1;
/// The first tiles of the list were looked at by an earlier dispatch.
pub const FLAG_CONTINUED: u32 = 2;
/// A later dispatch looks at the rest of the list.
pub const FLAG_UNFINISHED: u32 = 4;

/// `Push` of `glsl/evaluate.comp`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct EvaluatePush {
    /// Number of work items.
    pub item_count: u32,
}

/// `Push` of `glsl/re_render.comp`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct ReRenderPush {
    /// Number of work items.
    pub item_count: u32,
    /// The fly that is left out, and the number of its sum.
    pub left_out_fly: u32,
}

/// `StackItem` of `glsl/translucent.comp`: one block of pixels and its list of tiles, or a piece of the work on it.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct StackItem {
    /// Index of the block's lane.
    pub lane: u32,
    /// Index of the block's first pixel in the layers.
    pub first_pixel: u32,
    /// Left column of the block in px.
    pub x: i32,
    /// Top row of the block in px.
    pub y: i32,
    /// Index of the first entry that is collected.
    pub first_entry: u32,
    /// How many entries are collected.
    pub entry_count: u32,
    /// Place of the first of them in the block's list.
    pub first_slot: u32,
    /// [`FLAG_CONTINUED`], [`FLAG_UNFINISHED`] or both.
    pub flags: u32,
    /// Rank of the first layer that is left out.
    pub first_rank: u32,
    /// Rank after the last layer that is left out; equal to the first while layers are still collected.
    pub end_rank: u32,
    /// Index of the block's first word of scratch.
    pub scratch: u32,
    /// Index of the part of the list's first fly.
    pub first_part: u32,
    /// Index of the block's error among the parts.
    pub error: u32,
}

/// `Push` of `glsl/translucent.comp`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TranslucentPush {
    /// Index of the dispatch's first item.
    pub first_item: u32,
    /// Number of its items.
    pub item_count: u32,
}

/// `ComposeItem` of `glsl/compose.comp`: one block of samples and its list of tiles, or a piece of that list.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct ComposeItem {
    /// Left column of the block on the canvas of samples.
    pub x: i32,
    /// Top row of the block.
    pub y: i32,
    /// Index of the list's first entry.
    pub first_entry: u32,
    /// Length of the list.
    pub entry_count: u32,
    /// Index of the block's first colour.
    pub first_sample: u32,
    /// [`FLAG_CONTINUED`], [`FLAG_UNFINISHED`] or both.
    pub flags: u32,
}

/// `Push` of `glsl/compose.comp`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct ComposePush {
    /// Number of work items.
    pub item_count: u32,
    /// Packed background colour.
    pub background: u32,
}

/// `Instance` of `glsl/mosaic.vert`: the transform from the unit square to the canvas.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Instance {
    /// From the tile's centre to the middle of its right side, in px.
    pub axis_u: [f32; 2],
    /// From the tile's centre to the middle of its lower side, in px.
    pub axis_v: [f32; 2],
    /// The tile's centre, in px.
    pub centre: [f32; 2],
    /// Index of the fly, and of its tile.
    pub fly: u32,
    /// Depth, below 2^24; 0 is nearest. Of two at the same depth, the one that is drawn first is nearer.
    pub rank: u32,
}

/// `Push` of `glsl/mosaic.vert` and `glsl/mosaic.frag`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct MosaicPush {
    /// Left column and top row of the patch on the canvas, in px.
    pub origin: [i32; 2],
    /// 2 divided by the patch's width and height in px.
    pub pixel_size: [f32; 2],
    /// Layer of the square in the mask array.
    pub first_mask: u32,
    /// Packed colour of the grout, if there is any.
    pub grout: u32,
}
