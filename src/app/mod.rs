//! Everything that a person touches: the command line, its messages and its exit codes.
//!
//! Only this module prints, reads the clock, the environment, or paths given by the user. Failures end as one sentence
//! on stderr; stdout carries data only.

mod advice;
mod batch;
mod bench;
mod cells;
mod child;
mod cli;
mod computing;
mod config;
mod curve;
mod curve_file;
mod destination;
mod device;
mod devices;
mod film;
mod flicker;
mod gallery;
mod inputs;
mod inside;
mod interrupt;
mod job;
mod look;
mod manual;
mod memory;
mod merge;
mod options;
mod outputs;
mod paper;
mod picture;
mod pipelines;
mod plan;
mod prepared;
mod presets;
mod progress;
mod provenance;
mod recorder;
mod render;
mod report;
mod result;
mod run;
mod scheme;
mod score;
mod shard;
mod sheet;
mod snapshots;
mod study;
mod timelapse;
mod values;
mod video;
mod watch;

use std::process::ExitCode;

pub use cli::Cli;

/// Does what the command line asks for; the exit code of the process.
#[must_use]
pub fn run(cli: &Cli) -> ExitCode {
    match &cli.command {
        cli::Command::Evolve(args) => run::evolve(args),
        cli::Command::Batch(args) => batch::make(args, cli),
        cli::Command::Render(args) => render::render(args),
        cli::Command::Timelapse(args) => timelapse::make(args),
        cli::Command::Devices(args) => devices::list(args),
        cli::Command::Paper(args) => paper::make(args),
        cli::Command::Gallery(args) => gallery::make(args),
        cli::Command::Score(args) => score::score(args),
        cli::Command::Plan(args) => plan::plan(args, cli),
        cli::Command::Merge(args) => merge::merge(args),
        cli::Command::Video(args) => video::make(args),
        cli::Command::Bench(args) => bench::bench(args),
        cli::Command::Completions(args) => manual::completions(args),
        cli::Command::Man(args) => manual::man(args),
    }
}
