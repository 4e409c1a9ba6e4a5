//! Programs that smalti runs: ffmpeg and GIMP.

use std::process::Command;

/// A terminal sends Ctrl-C to all processes of a group. We end our children ourselves, so they must not be in our
/// group.
#[cfg(unix)]
pub(crate) fn in_its_own_group(command: &mut Command) -> &mut Command {
    use std::os::unix::process::CommandExt;
    command.process_group(0)
}

#[cfg(not(unix))]
pub(crate) fn in_its_own_group(command: &mut Command) -> &mut Command {
    command
}
