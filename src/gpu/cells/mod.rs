//! The `cells` search on a Vulkan device. Twin: `cpu/cells/`, with the stages `glsl/cells*.comp`.

mod buffers;
mod depths;
mod lane;
pub(super) mod lanes;
pub mod layout;
mod loaded;
mod mark;
mod pass;
mod plan;
pub(super) mod search;
pub(super) mod shape;
mod state;
mod taken_back;
