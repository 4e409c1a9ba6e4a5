//! What the user sees and sends at the terminal: lines on stderr, data on stdout, progress, and signals.

pub(crate) mod advice;
pub(crate) mod aside;
pub(crate) mod interrupt;
pub(crate) mod progress;
mod shown;
pub(crate) mod words;

pub(crate) use shown::shown;

use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use serde::Serialize;

use crate::error::{Error, Result, in_words};

/// How much to say on stderr.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Verbosity {
    Quiet,
    Normal,
    Verbose,
}

/// Milliseconds with three decimals.
pub(crate) fn milliseconds(duration: Duration) -> f64 {
    duration.as_micros() as f64 / 1e3
}

/// Prints a value as one line of JSON to stdout.
pub(crate) fn print_json(value: &impl Serialize) -> Result<()> {
    let mut line = serde_json::to_vec(value).map_err(|error| Error::Internal(format!("no JSON: {error}")))?;
    line.push(b'\n');
    write_stdout(&line)
}

/// Writes text to stdout; if that is a terminal, with its control characters spelt out. If the reader stops reading,
/// that is no failure: it has what it wants.
pub(crate) fn write_stdout(bytes: &[u8]) -> Result<()> {
    let written = match std::str::from_utf8(bytes) {
        Ok(text) if io::stdout().is_terminal() => write_whole(shown::lines_shown(text).as_bytes()),
        _ => write_whole(bytes),
    };
    match written {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::output(Path::new("stdout"), format!("cannot be written, since {}", in_words(&error))))
        }
        _ => Ok(()),
    }
}

/// Writes a whole picture to stdout. If the reader stops reading, that is a failure: it has no picture.
pub(crate) fn write_picture_to_stdout(bytes: &[u8]) -> Result<()> {
    write_whole(bytes).map_err(|error| {
        let reason = match error.kind() {
            io::ErrorKind::BrokenPipe => {
                "its reader went away before it had the picture; name a file instead".to_owned()
            }
            _ => format!("cannot be written, since {}; name a file instead", in_words(&error)),
        };
        Error::output(Path::new("stdout"), reason)
    })
}

fn write_whole(bytes: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(bytes)?;
    out.flush()
}

/// Prints a line to stderr, with control characters spelt out. A failure is ignored, since there is nowhere to report
/// it.
pub(crate) fn say(line: &str) {
    let _ = writeln!(io::stderr(), "{}", shown(line));
}

/// As [`say`]; whether there is still somebody who may read it.
fn say_to_reader(line: &str) -> bool {
    let said = writeln!(io::stderr(), "{}", shown(line));
    said.map_err(|error| error.kind()) != Err(io::ErrorKind::BrokenPipe)
}

/// The exit code for an outcome. A failure is printed.
pub(crate) fn exit_code(done: Result<()>) -> ExitCode {
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            error(&advice::sentence(&failure));
            ExitCode::from(advice::exit_code(&failure))
        }
    }
}

/// Prints a failure and ends the process, from wherever it is.
#[cfg(feature = "view")]
pub(crate) fn end_process(failure: &Error) -> ! {
    error(&advice::sentence(failure));
    // Nothing is tidied up, since other threads are at work.
    signal_hook::low_level::exit(advice::exit_code(failure).into())
}

/// Prints a failure.
pub(crate) fn error(sentence: &str) {
    say(&format!("smalti: {sentence}"));
}

/// The name of this machine.
pub(crate) fn host_name() -> Option<String> {
    let variable = if cfg!(windows) { "COMPUTERNAME" } else { "HOSTNAME" };
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").or_else(|_| std::env::var(variable));
    name.ok().map(|name| name.trim().to_owned()).filter(|name| !name.is_empty())
}
