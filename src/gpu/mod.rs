//! The passes on top of `vk`: evaluation and drawing of flies on a Vulkan device.
//!
//! Each pass has a shader of the same stem in `glsl/` and a twin of the same stem in `cpu/`, and gives the same bits.

pub mod cells;
mod compose;
mod evaluate;
mod evaluator;
mod lane;
mod lane_buffers;
pub mod layout;
mod live;
mod mosaic;
mod pace;
mod painter;
mod pools;
mod re_render;
mod shaders;
mod submission;
mod translucent;
mod work;

pub use cells::lanes::VulkanLanes;
pub use cells::search::VulkanSearch;
pub use cells::shape::{CellForm, CellShape};
pub use evaluate::KernelShape;
pub use evaluator::GpuEvaluator;
pub use live::{LiveMosaic, LiveView, Upload};
pub use painter::GpuPainter;
