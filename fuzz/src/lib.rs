//! Files as a stranger might make them, for everything in smalti that reads files.
//!
//! [`targets`] has a function for each kind of file. libFuzzer calls it by the programs in `fuzz_targets/`, and the
//! driver of this crate calls it with files that [`mutate`] has damaged. Both need a panic, an endless loop or a file
//! that is left behind to find a fault; a refusal is none.

pub mod dice;
pub mod mutate;
pub mod scratch;
pub mod targets;

use std::process::ExitCode;

/// Gives a target the files that the command line names, once more.
#[must_use]
pub fn again(target: fn(&[u8]) -> bool) -> ExitCode {
    let mut status = ExitCode::SUCCESS;
    for path in std::env::args_os().skip(1) {
        match std::fs::read(&path) {
            Ok(bytes) if target(&bytes) => println!("{}: accepted", path.display()),
            Ok(_) => println!("{}: refused", path.display()),
            Err(error) => {
                eprintln!("{}: {error}", path.display());
                status = ExitCode::FAILURE;
            }
        }
    }
    status
}
