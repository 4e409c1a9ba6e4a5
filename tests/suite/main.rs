//! All integration tests, in one binary.

mod canary;
mod vulkan;
