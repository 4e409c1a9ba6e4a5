//! `smalti bench`: measures how fast this machine evolves pictures. Prints a table or JSON, or compares with an older
//! result.

mod compare;
mod measure;
mod passes;
mod run;
mod table;
mod workload;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use serde::{Deserialize, Serialize};

use self::compare::Comparison;
use self::measure::Measurement;
use self::run::Bench;
use self::workload::Pictures;
use crate::cli::args::computing::ComputingArgs;
use crate::cli::terminal::progress::{Progress, ProgressKind};
use crate::cli::terminal::{self, Verbosity};
use crate::cli::values;
use crate::error::{Error, Result};
use crate::studio::Device;

/// Default time for a measurement. More time does not change the results.
const TIME_MAX: Duration = Duration::from_secs(3_600);

const AFTER_HELP: &str = "\
Each figure is the median of as many repeats as fit into --time, at least one, after a warm-up:
  full evaluation  layers, marginal fitness of every tile, and SAE of a whole population
  paper            births of the published algorithm, one by one or in batches
  cells            children tried by the search in cells, in the styles free and mosaic
  picture          whole runs at 512 px, from the decoded picture to the drawn mosaic; extrapolated if --time is too short for one
  pass             time of each pass on a Vulkan device, if it has timestamps

--json prints one object with schema, schema_version, version, picture, time_ms, machine and measurements. Each measurement has \
name, unit, value, low, high and repeats.

Examples:
  smalti bench
  smalti bench --device cpu --threads 1 --json > before.json
  smalti bench --device cpu --threads 1 --compare before.json";

#[derive(Debug, Args)]
#[command(after_long_help = AFTER_HELP)]
pub(crate) struct BenchArgs {
    /// Picture to measure with, of 512 px or more on its longer side [default: a built-in one]
    #[arg(long, value_name = "IN")]
    pub input: Option<PathBuf>,
    /// Time for each of about 15 measurements, such as 500ms or 2s
    #[arg(long, value_name = "TIME", value_parser = values::duration, default_value = "1500ms")]
    pub time: Duration,
    /// Print JSON to stdout instead of a table
    #[arg(long)]
    pub json: bool,
    /// Also compare with an older result of --json, and mark what is more than 5 % slower
    #[arg(long, value_name = "OLD.json")]
    pub compare: Option<PathBuf>,
    #[command(flatten)]
    pub computing: ComputingArgs,
    /// How to show progress on stderr
    #[arg(long, value_enum, value_name = "KIND", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressKind,
    /// Say nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

/// Everything that was measured, as in the JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Figures {
    schema: String,
    schema_version: u32,
    /// Version of smalti.
    version: String,
    /// `built-in`, or the SHA-256 of the picture's file.
    picture: String,
    /// Time for each measurement.
    time_ms: u64,
    machine: Machine,
    measurements: Vec<Measurement>,
}

/// The hardware that computed. Without names and paths, which would identify the machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Machine {
    os: String,
    architecture: String,
    cpu_count: usize,
    /// Number of CPU threads used.
    threads: usize,
    device: String,
    /// Name and version of the Vulkan driver; none for the CPU.
    driver: Option<String>,
}

impl Figures {
    const SCHEMA: &str = "smalti-bench";
    const SCHEMA_VERSION: u32 = 1;
}

impl Machine {
    fn new(device: &Device) -> Self {
        Self {
            os: std::env::consts::OS.to_owned(),
            architecture: std::env::consts::ARCH.to_owned(),
            cpu_count: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            threads: rayon::current_num_threads(),
            device: device.label().to_owned(),
            driver: device.driver(),
        }
    }
}

/// Measures; returns the exit code of the process.
pub(crate) fn bench(args: &BenchArgs) -> ExitCode {
    terminal::exit_code(try_bench(args))
}

fn try_bench(args: &BenchArgs) -> Result<()> {
    if args.time.is_zero() || args.time > TIME_MAX {
        let told = args.time.as_secs_f64();
        return Err(Error::Usage(format!("--time {told}s: must be above 0 and at most an hour")));
    }
    let old = args.compare.as_deref().map(compare::read).transpose()?;
    let verbosity = if args.quiet { Verbosity::Quiet } else { Verbosity::Normal };
    let pictures = args.input.as_deref().map_or_else(Pictures::built_in, |path| Pictures::read(path, verbosity))?;
    let device = args.computing.begin(verbosity)?;
    let progress = Progress::new(args.progress.unless(args.quiet), verbosity);
    let measurements = Bench::new(&device, &pictures, args.time, progress).run(verbosity)?;
    let figures = Figures {
        schema: Figures::SCHEMA.to_owned(),
        schema_version: Figures::SCHEMA_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        picture: pictures.name,
        time_ms: args.time.as_millis() as u64,
        machine: Machine::new(&device),
        measurements,
    };
    let comparison = old.as_ref().map(|old| Comparison { old, new: &figures });
    if args.json {
        if let Some(comparison) = comparison {
            comparison.text().lines().for_each(terminal::say);
        }
        return terminal::print_json(&figures);
    }
    terminal::write_stdout(comparison.map_or_else(|| table::table(&figures), |comparison| comparison.text()).as_bytes())
}
