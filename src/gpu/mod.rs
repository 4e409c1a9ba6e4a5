//! The passes on top of `vk`: evaluation and drawing of flies on a Vulkan device.
//!
//! Each pass has a shader of the same stem in `glsl/` and a twin of the same stem in `cpu/`, and gives the same bits.

pub mod cells_layout;
mod cells_pass;
mod cells_search;
mod cells_state;
mod compose_pass;
mod evaluate_pass;
mod evaluator;
mod lane_buffers;
pub mod layout;
mod mosaic_pass;
mod re_render;
mod shaders;
mod slots;
mod submission;
mod translucent_pass;

pub use cells_pass::{CellForm, CellShape};
pub use cells_search::VulkanSearch;
pub use evaluate_pass::KernelShape;
pub use evaluator::GpuEvaluator;
