//! Programs that smalti runs: ffmpeg and GIMP.

use std::process::Command;

/// Ctrl-C of a terminal goes to all processes of a group; a child that is ended by us must not be in ours.
#[cfg(unix)]
pub(super) fn in_its_own_group(command: &mut Command) -> &mut Command {
    use std::os::unix::process::CommandExt;
    command.process_group(0)
}

#[cfg(not(unix))]
pub(super) fn in_its_own_group(command: &mut Command) -> &mut Command {
    command
}
