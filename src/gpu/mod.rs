//! The passes on top of `vk`: evaluation and drawing of flies on a Vulkan device.
//!
//! Each pass has a shader of the same stem in `glsl/` and a twin of the same stem in `cpu/`, and gives the same bits.

mod cells_lanes;
pub mod cells_layout;
mod cells_pass;
mod cells_pools;
mod cells_search;
mod cells_shape;
mod cells_state;
mod compose_pass;
mod evaluate_pass;
mod evaluator;
mod lane_buffers;
pub mod layout;
mod mosaic_pass;
mod re_render;
mod shaders;
mod slices;
mod submission;
mod translucent_pass;

pub use cells_lanes::VulkanLanes;
pub use cells_search::VulkanSearch;
pub use cells_shape::{CellForm, CellShape};
pub use evaluate_pass::KernelShape;
pub use evaluator::GpuEvaluator;
