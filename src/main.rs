//! The command line: parse, run, exit code.

use std::process::ExitCode;

use smalti::cli::{self, Cli};

fn main() -> ExitCode {
    Cli::from_command_line().map_or_else(|exit_code| exit_code, |cli| cli::run(&cli))
}
