//! The plug-in of GIMP 2.10 is a program of its own: GIMP's tool compiles it for the GIMP that is there.

use std::io;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::cli::files::child;
use crate::error::{Error, Result, in_words};

/// GIMP's own tool for it.
const TOOL: &str = "gimptool-2.0";

/// The plug-in, compiled of its sources, of which `smalti.c` is the main one.
///
/// # Errors
/// [`Error::Output`] if the tool is missing, or with what the compiler said.
pub(super) fn for_gimp2(sources: &[(&str, &[u8])]) -> Result<Vec<u8>> {
    let failure = |reason: String| Error::output(Path::new("the plug-in of GIMP 2.10"), reason);
    let in_folder = |error: io::Error| failure(format!("cannot be compiled, since {}", in_words(&error)));
    let folder = tempfile::tempdir().map_err(in_folder)?;
    for (name, source) in sources {
        std::fs::write(folder.path().join(name), source).map_err(in_folder)?;
    }
    let mut command = Command::new(TOOL);
    command.args(["--build", "smalti.c"]).current_dir(folder.path()).env("CFLAGS", "-O2").stdin(Stdio::null());
    let ran = child::in_its_own_group(&mut command).output().map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => failure(format!(
            "is compiled by {TOOL}, which is missing; install libgimp2.0-dev and gcc (Debian, Ubuntu), gimp-devel-tools \
             (Fedora), or what has it elsewhere"
        )),
        _ => failure(format!("cannot be compiled: {TOOL} cannot be started, since {}", in_words(&error))),
    })?;
    // The tool succeeds even where the compiler fails.
    let built = folder.path().join(if cfg!(windows) { "smalti.exe" } else { "smalti" });
    std::fs::read(built).map_err(|_| {
        let said = String::from_utf8_lossy(&ran.stderr);
        let complaint = said.lines().find(|line| line.contains("error")).or_else(|| said.lines().last());
        failure(format!("cannot be compiled by {TOOL}: {}", complaint.unwrap_or("it gave no reason")))
    })
}
