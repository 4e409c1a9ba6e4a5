//! Command buffers: their pool, their beginning and end, the barriers in them, and running a few of them at once
//! without a recorder.

use std::sync::Arc;

use ash::vk;

use super::handle::Owned;
use super::scope::{self, Scope};
use super::{Device, call_failed, refused};
use crate::error::{Error, Result};

/// Records the barrier between two kinds of work.
pub(super) fn record_barrier(device: &Device, commands: vk::CommandBuffer, previous: Scope, next: Scope) {
    let barriers = [scope::barrier(previous, next)];
    let dependency = vk::DependencyInfo::default().memory_barriers(&barriers);
    // SAFETY: V1, V3, V5.
    unsafe { device.raw().cmd_pipeline_barrier2(commands, &dependency) };
}

/// Creates a command pool whose buffers are reset together.
pub(super) fn create_command_pool(device: &Arc<Device>, name: &str) -> Result<Owned<vk::CommandPool>> {
    let info = vk::CommandPoolCreateInfo::default()
        .flags(vk::CommandPoolCreateFlags::TRANSIENT)
        .queue_family_index(device.queue_family());
    // SAFETY: V1.
    let pool = unsafe { device.raw().create_command_pool(&info, None) }
        .map_err(|result| call_failed(format!("creation of command pool {name}"), result))?;
    Ok(Owned::new(device, pool, name))
}

/// Takes `COUNT` command buffers from a pool, which owns them.
pub(super) fn allocate_command_buffers<const COUNT: usize>(
    pool: &Owned<vk::CommandPool>,
) -> Result<[vk::CommandBuffer; COUNT]> {
    let info = vk::CommandBufferAllocateInfo::default().command_pool(pool.get()).command_buffer_count(COUNT as u32);
    // SAFETY: V1.
    let buffers = unsafe { pool.device().raw().allocate_command_buffers(&info) }
        .map_err(|result| call_failed("vkAllocateCommandBuffers", result))?;
    buffers.try_into().map_err(|_| refused("vkAllocateCommandBuffers", "fewer buffers than asked for"))
}

/// Starts the recording of a command buffer that is submitted once.
pub(super) fn begin_commands(device: &Device, commands: vk::CommandBuffer) -> Result<()> {
    let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
    // SAFETY: V1, V2, V3.
    unsafe { device.raw().begin_command_buffer(commands, &info) }
        .map_err(|result| call_failed("vkBeginCommandBuffer", result))
}

/// Ends the recording of a command buffer.
pub(super) fn end_commands(device: &Device, commands: vk::CommandBuffer) -> Result<()> {
    // SAFETY: V1, V3.
    unsafe { device.raw().end_command_buffer(commands) }.map_err(|result| call_failed("vkEndCommandBuffer", result))
}

/// Records and runs a few commands without a recorder, for preparations that happen once.
pub(super) fn run_once(device: &Arc<Device>, name: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<()> {
    let pool = create_command_pool(device, name)?;
    let [commands] = allocate_command_buffers(&pool)?;
    device.set_name(commands, name);
    begin_commands(device, commands)?;
    record(commands);
    end_commands(device, commands)?;
    let fence = create_fence(device, name)?;
    run_and_wait(device, &[commands], fence.get(), name)
}

/// Creates a fence that nothing was submitted with yet.
pub(super) fn create_fence(device: &Arc<Device>, name: &str) -> Result<Owned<vk::Fence>> {
    // SAFETY: V1.
    let fence = unsafe { device.raw().create_fence(&vk::FenceCreateInfo::default(), None) }
        .map_err(|result| call_failed(format!("creation of the fence of {name}"), result))?;
    Ok(Owned::new(device, fence, name))
}

/// Runs command buffers and waits until they are over, as long as the device has patience. Afterwards nothing that
/// they use is in use, or else the device is given up.
pub(super) fn run_and_wait(
    device: &Arc<Device>,
    commands: &[vk::CommandBuffer],
    fence: vk::Fence,
    last_pass: &str,
) -> Result<()> {
    let infos: Vec<_> =
        commands.iter().map(|&commands| vk::CommandBufferSubmitInfo::default().command_buffer(commands)).collect();
    submit(device, vk::SubmitInfo2::default().command_buffer_infos(&infos), fence, last_pass)?;
    wait_for(device, fence, last_pass)
}

/// Hands work to the queue, which signals the fence when it is over. It has to be waited for by [`wait_for`].
pub(super) fn submit(device: &Arc<Device>, work: vk::SubmitInfo2<'_>, fence: vk::Fence, last_pass: &str) -> Result<()> {
    let failed = |call: &str, result| submission_failed(call, result, last_pass);
    if device.is_given_up() {
        return Err(failed("vkQueueSubmit2", vk::Result::ERROR_DEVICE_LOST));
    }
    let queue = device.queue();
    // SAFETY: V1, V2, V3: the fence is not in use, since every submission is waited for.
    unsafe {
        device.raw().reset_fences(&[fence]).map_err(|result| failed("vkResetFences", result))?;
        device.raw().queue_submit2(*queue, &[work], fence).map_err(|result| failed("vkQueueSubmit2", result))
    }
}

/// Waits until the work with this fence is over, as [`run_and_wait`] does.
pub(super) fn wait_for(device: &Arc<Device>, fence: vk::Fence, last_pass: &str) -> Result<()> {
    let patience = device.patience();
    let most_ns = patience.map_or(u64::MAX, |patience| u64::try_from(patience.as_nanos()).unwrap_or(u64::MAX));
    // SAFETY: V1.
    match unsafe { device.raw().wait_for_fences(&[fence], true, most_ns) } {
        Ok(()) => Ok(()),
        Err(vk::Result::TIMEOUT) => {
            // V2: what the commands use must not be destroyed any more, and nothing can be waited for.
            device.give_up();
            Err(Error::DeviceLost { last_pass: last_pass.to_owned(), waited: patience })
        }
        Err(result) => {
            // V2: the objects that the commands use are dropped next.
            device.wait_idle();
            Err(submission_failed("vkWaitForFences", result, last_pass))
        }
    }
}

/// The error of a failed submission. A lost device and full memory have variants of their own; both name the last pass.
pub(super) fn submission_failed(call: &str, result: vk::Result, last_pass: &str) -> Error {
    match result {
        vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost { last_pass: last_pass.to_owned(), waited: None },
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            Error::OutOfMemory { call: format!("{call} after pass {last_pass}") }
        }
        other => call_failed(format!("{call} after pass {last_pass}"), other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_device_is_told_with_the_last_pass() {
        let lost = submission_failed("vkQueueSubmit2", vk::Result::ERROR_DEVICE_LOST, "evaluate");
        assert!(matches!(&lost, Error::DeviceLost { last_pass, waited: None } if last_pass == "evaluate"));
        let other = submission_failed("vkQueueSubmit2", vk::Result::ERROR_UNKNOWN, "evaluate");
        assert!(other.to_string().contains("vkQueueSubmit2 after pass evaluate"), "{other}");
    }

    #[test]
    fn full_memory_is_told_with_the_last_pass() {
        for result in [vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, vk::Result::ERROR_OUT_OF_HOST_MEMORY] {
            let full = submission_failed("vkWaitForFences", result, "evaluate");
            assert!(matches!(&full, Error::OutOfMemory { call } if call.contains("pass evaluate")), "{full}");
        }
    }
}
