//! Raw Vulkan: instance, device, memory, pipelines and the recording of work, without a display; and the screen of a
//! window. Knows no fly and no picture.
//!
//! Everything public in this module is safe to use. `unsafe` stays inside and cites these invariants.
//!
//! - **V1 alive.** Every wrapper holds its parent ([`Instance`], [`Device`]) by `Arc` and lists its fields in drop
//!   order, so a parent outlives its children. A pointer handed to Vulkan points to something that lives until the call
//!   returns. Objects of different devices never meet: each works with the device that made it, and a window has one of
//!   its own. A surface holds its window.
//! - **V2 idle.** Nothing that the device may still use is destroyed: a [`Recorder`] keeps what its commands name until
//!   their fence has been waited for, and a failed wait is followed by a wait for the idle queue. A device that does
//!   not answer is given up: nothing of it is destroyed, recorded or submitted any more. A `Screen` waits for each of
//!   its frames, and for the idle queue before a swapchain goes.
//! - **V3 recording.** `&mut Recorder` is the only way to record; a pass borrows it and ends in `Drop`. A `Screen`
//!   records its frames, behind `&mut`, too. The queue is behind a lock.
//! - **V4 layout.** Bytes that cross to a shader are plain data laid out by the caller and checked here for length;
//!   SPIR-V is the output of a compiler, validated before it is committed.
//! - **V5 sync.** One global memory barrier per pass boundary, from the table in `scope`. Images stay in `GENERAL`.
//!   Only those of a swapchain do not: each frame moves its image to be drawn into, and then to be presented. The
//!   textures of the interface are in the layouts of its renderer.

#![allow(unsafe_code, reason = "the only module that talks to Vulkan; its invariants are stated above")]

mod abilities;
mod buffer;
mod choose;
mod commands;
mod descriptor;
mod device;
mod handle;
mod image;
mod instance;
mod loader;
mod memory;
mod messages;
mod observe;
mod pass;
mod physical;
mod pipeline;
mod pipeline_layout;
mod recorder;
mod scope;
#[cfg(feature = "view")]
mod screen;
mod submit;
mod timer;
mod transfer;

pub use buffer::{Buffer, BufferUse, Residence};
pub use choose::{Choice, DeviceRequest, choose};
pub use descriptor::{Binding, BindingGroup};
pub use device::{Device, DeviceOptions, Staging};
pub use image::{Image, ImageFormat, ImageShape};
pub use instance::{Instance, InstanceOptions, Validation};
pub use messages::ValidationLog;
pub use observe::{ClockMethod, Submission, SubmissionObserver};
pub use pass::{ClearColor, ColorTarget, ComputePass, RenderPass, RenderTargets, TransferPass};
pub use physical::{DeviceInfo, DeviceKind, DeviceLimits, NEEDED_LIMITS, NeededLimit};
pub use pipeline::{ComputePipeline, ComputeShader, DepthTest, GraphicsPipeline, GraphicsShaders};
pub use pipeline_layout::{BindingKind, PipelineLayout};
pub use recorder::Recorder;
#[cfg(feature = "view")]
pub use screen::{Painted, Screen, when_display_is_gone};
pub use timer::{PassTime, Timing};
pub use transfer::ReadTicket;

use crate::error::Error;

/// The error for a failed Vulkan call that has no more specific error.
fn call_failed(call: impl Into<String>, result: ash::vk::Result) -> Error {
    refused(call, result.to_string())
}

/// The error for something that is refused without a Vulkan call.
fn refused(call: impl Into<String>, reason: impl Into<String>) -> Error {
    Error::Vulkan { call: call.into(), reason: reason.into() }
}

/// Locks `mutex` even if another thread panicked while it held the lock: data behind our locks is valid at any time.
fn lock<T>(mutex: &std::sync::Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
