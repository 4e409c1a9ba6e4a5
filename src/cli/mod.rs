//! The command line, which lies on top of the library: flags, files, messages and exit codes.
//!
//! ```text
//! command_line   all commands; help: how it is arranged; hints: what is said to wrong ones
//!   commands     one module for each command; they do not know each other
//!     list       pictures of a batch        film     animations        mosaics   many mosaics of the paper
//!       jobs     one picture at work: read, evolved, drawn, and what is told of it; checks: devices against the CPU
//!         args   flags that several commands share, and what they ask of the library
//!           trace    traces and captures
//!             files    outputs, what is in them, and whether they may be replaced
//!               terminal   messages, progress, signals
//!                 values     numbers, times and colours as people type them
//! ```
//!
//! Only this module prints, reads the clock, the environment, or paths given by the user. Failures end as one sentence
//! on stderr; stdout carries data only.

mod args;
mod built_in;
mod checks;
mod command_line;
mod commands;
mod config;
mod files;
mod film;
mod help;
mod hints;
mod jobs;
mod list;
mod mosaics;
mod terminal;
mod trace;
mod values;

pub use command_line::{Cli, run};
