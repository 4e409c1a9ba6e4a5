//! The stages and accesses of each kind of work: the table that every barrier comes from.
//!
//! A scope has the same stages before and after a barrier, so barriers chain: what a first pass wrote is visible to a
//! third one even if the second one did not touch it.

use ash::vk;

/// A kind of work, as seen by the barrier before or after it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scope {
    /// Everything that the queue did before: earlier submissions, and the uploads at the start of this one.
    Earlier,
    /// Copies and fills.
    Transfer,
    /// Compute shaders.
    Compute,
    /// Drawing: vertex and fragment shaders, colour and depth attachments.
    Graphics,
    /// The CPU reading mapped memory after the fence.
    HostRead,
}

impl Scope {
    fn stages(self) -> vk::PipelineStageFlags2 {
        match self {
            Self::Earlier => vk::PipelineStageFlags2::ALL_COMMANDS,
            Self::Transfer => vk::PipelineStageFlags2::ALL_TRANSFER,
            Self::Compute => vk::PipelineStageFlags2::COMPUTE_SHADER,
            Self::Graphics => {
                vk::PipelineStageFlags2::VERTEX_SHADER
                    | vk::PipelineStageFlags2::FRAGMENT_SHADER
                    | vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS
                    | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS
                    | vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT
            }
            Self::HostRead => vk::PipelineStageFlags2::HOST,
        }
    }

    fn writes(self) -> vk::AccessFlags2 {
        match self {
            Self::Earlier => vk::AccessFlags2::MEMORY_WRITE,
            Self::Transfer => vk::AccessFlags2::TRANSFER_WRITE,
            Self::Compute => vk::AccessFlags2::SHADER_STORAGE_WRITE,
            Self::Graphics => {
                vk::AccessFlags2::COLOR_ATTACHMENT_WRITE | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE
            }
            Self::HostRead => vk::AccessFlags2::NONE,
        }
    }

    fn reads(self) -> vk::AccessFlags2 {
        match self {
            Self::Earlier => vk::AccessFlags2::MEMORY_READ,
            Self::Transfer => vk::AccessFlags2::TRANSFER_READ,
            Self::Compute => vk::AccessFlags2::SHADER_STORAGE_READ | vk::AccessFlags2::SHADER_SAMPLED_READ,
            Self::Graphics => {
                vk::AccessFlags2::SHADER_STORAGE_READ
                    | vk::AccessFlags2::SHADER_SAMPLED_READ
                    | vk::AccessFlags2::COLOR_ATTACHMENT_READ
                    | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ
            }
            Self::HostRead => vk::AccessFlags2::HOST_READ,
        }
    }
}

/// The barrier that lets `next` start after `previous`, whose writes are then visible and whose reads are over.
pub(super) fn barrier(previous: Scope, next: Scope) -> vk::MemoryBarrier2<'static> {
    vk::MemoryBarrier2::default()
        .src_stage_mask(previous.stages())
        .src_access_mask(previous.writes())
        .dst_stage_mask(next.stages())
        .dst_access_mask(next.reads() | next.writes())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Scope; 5] = [Scope::Earlier, Scope::Transfer, Scope::Compute, Scope::Graphics, Scope::HostRead];

    #[test]
    fn two_barriers_in_a_row_chain_through_the_scope_between_them() {
        for before in ALL {
            for between in ALL {
                for after in ALL {
                    let first = barrier(before, between);
                    let second = barrier(between, after);
                    assert!(
                        second.src_stage_mask.contains(first.dst_stage_mask),
                        "{before:?} to {between:?} to {after:?} has a gap"
                    );
                }
            }
        }
    }

    #[test]
    fn the_writes_of_a_pass_are_visible_to_the_reads_and_the_writes_of_the_next() {
        let barrier = barrier(Scope::Compute, Scope::Transfer);
        assert_eq!(barrier.src_stage_mask, vk::PipelineStageFlags2::COMPUTE_SHADER);
        assert_eq!(barrier.src_access_mask, vk::AccessFlags2::SHADER_STORAGE_WRITE);
        assert_eq!(barrier.dst_stage_mask, vk::PipelineStageFlags2::ALL_TRANSFER);
        assert_eq!(barrier.dst_access_mask, vk::AccessFlags2::TRANSFER_READ | vk::AccessFlags2::TRANSFER_WRITE);
    }

    #[test]
    fn drawing_waits_for_and_shows_its_attachments_and_what_its_shaders_read() {
        let (before, after) = (barrier(Scope::Earlier, Scope::Graphics), barrier(Scope::Graphics, Scope::Transfer));
        for (stage, read, write) in [
            (
                vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
                vk::AccessFlags2::COLOR_ATTACHMENT_READ,
                vk::AccessFlags2::COLOR_ATTACHMENT_WRITE,
            ),
            (
                vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS,
                vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ,
                vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE,
            ),
            (
                vk::PipelineStageFlags2::VERTEX_SHADER | vk::PipelineStageFlags2::FRAGMENT_SHADER,
                vk::AccessFlags2::SHADER_STORAGE_READ | vk::AccessFlags2::SHADER_SAMPLED_READ,
                vk::AccessFlags2::NONE,
            ),
        ] {
            assert!(before.dst_stage_mask.contains(stage) && after.src_stage_mask.contains(stage), "{stage:?}");
            assert!(before.dst_access_mask.contains(read | write), "{read:?} {write:?}");
            assert!(after.src_access_mask.contains(write), "{write:?}");
        }
    }

    #[test]
    fn a_barrier_makes_no_reads_available_and_the_host_waits_for_writes_only() {
        for scope in ALL {
            assert_eq!(barrier(scope, Scope::HostRead).dst_access_mask, vk::AccessFlags2::HOST_READ);
            assert!(!barrier(scope, Scope::Compute).src_access_mask.intersects(scope.reads()), "{scope:?}");
        }
    }
}
