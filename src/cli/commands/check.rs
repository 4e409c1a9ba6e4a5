//! `smalti check`: whether a Vulkan device gives what the CPU gives, number by number, on the machine of whoever asks.

use std::process::ExitCode;

use clap::Args;
use indicatif::HumanCount;
use serde::Serialize;

use crate::cli::args::computing::{Computing, ComputingArgs};
use crate::cli::checks::{self, Checked, Outcome};
use crate::cli::terminal::progress::{Progress, ProgressKind};
use crate::cli::terminal::{self, Verbosity, words};
use crate::error::{Error, NoDevice, Result};
use crate::studio::Device;
use crate::vk::Validation;

const AFTER_HELP: &str = "\
Each line of the table is one part of smalti. It is computed on the device and on the CPU, and all numbers must be equal. If one \
line says something else, please report it with what --json prints, and use --device cpu until then. Drawing is skipped where the \
CPU does it, since the device has no graphics. The parts:
  fitness   the two nearest tiles of every pixel, the error, and the marginal fitness of every tile
  paper     the published algorithm, birth by birth
  search    the search in cells: tiles, step sizes, fitness and what lies on every pixel, for each style and for 1, 8 and 64
            candidates a step, with all shapes, with colours of every kind, on a leash, with weights, over transparent pixels
  drawing   the mosaic as evolved, at another size with soft edges, and over nothing
  lanes     several pictures side by side on the device

Exit codes: 0 all checks are equal; 1 some differ or failed; 2 wrong usage; 4 there is no Vulkan device to check.
--json prints one object with schema, schema_version, version, os, architecture, device, driver, equal and checks. Each check has \
name, outcome (equal, different, failed, skipped), detail, numbers, device_ms and cpu_ms.

Examples:
  smalti check
  smalti check --device vulkan          # the best Vulkan device, software included
  smalti check --device 1 --json";

#[derive(Debug, Args)]
#[command(after_long_help = AFTER_HELP)]
pub(crate) struct CheckArgs {
    /// Print JSON to stdout instead of a table
    #[arg(long)]
    pub json: bool,
    /// Let the Vulkan validation layer watch
    #[arg(long, help_heading = "Computing")]
    pub validate: bool,
    #[command(flatten)]
    pub computing: ComputingArgs,
    /// How to show progress on stderr
    #[arg(long, value_enum, value_name = "KIND", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressKind,
    /// Say nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

/// Everything that was checked, as in the JSON.
#[derive(Debug, Serialize)]
struct Report {
    schema: &'static str,
    schema_version: u32,
    version: &'static str,
    os: &'static str,
    architecture: &'static str,
    device: String,
    driver: Option<String>,
    equal: bool,
    checks: Vec<Checked>,
}

/// Checks a device; returns the exit code of the process.
pub(crate) fn check(args: &CheckArgs) -> ExitCode {
    match try_check(args) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => terminal::exit_code(Err(error)),
    }
}

/// Whether the device gives what the CPU gives.
fn try_check(args: &CheckArgs) -> Result<bool> {
    let verbosity = if args.quiet { Verbosity::Quiet } else { Verbosity::Normal };
    let validation = if args.validate { Validation::On } else { Validation::Off };
    let computing = args.computing.check(validation)?;
    computing.start_threads()?;
    let device = the_device_itself(&computing)?;
    let progress = Progress::new(args.progress.unless(args.quiet), verbosity);
    let checks = checks::run_all(&device, progress, || Ok(()))?;
    let report = Report {
        schema: "smalti-check",
        schema_version: 1,
        version: env!("CARGO_PKG_VERSION"),
        os: std::env::consts::OS,
        architecture: std::env::consts::ARCH,
        device: device.label().to_owned(),
        driver: device.driver(),
        equal: !checks.iter().any(|check| check.outcome.is_wrong()),
        checks,
    };
    if args.json {
        terminal::print_json(&report)?;
    } else {
        terminal::write_stdout(table(&report).as_bytes())?;
    }
    device.check_validation()?;
    Ok(report.equal)
}

/// The device, opened so that the CPU never stands in for it.
fn the_device_itself(computing: &Computing) -> Result<Device> {
    let device = computing.select_itself()?;
    let Some(vulkan) = device.vulkan() else {
        let reason = device.stand_in_reason().map_or_else(String::new, |reason| format!(", since {reason}"));
        let why = format!(
            "the CPU is what devices are compared with, and there is no other to check{reason}; smalti works without \
             one, and smalti check --device vulkan takes software Vulkan, too"
        );
        return Err(Error::NoSuitableDevice { why: NoDevice::Other(why) });
    };
    if device.is_asked_for() {
        return Ok(device);
    }
    let name = format!("uuid:{}", vulkan.info().uuid);
    drop(device);
    computing.of(name.parse()?).select_itself()
}

/// The report for people.
fn table(report: &Report) -> String {
    let driver = report.driver.as_deref().unwrap_or_default();
    let mut text = format!("smalti {} on {} ({driver})\n", report.version, report.device);
    let made = report.checks.iter().filter(|check| check.outcome != Outcome::Skipped).count();
    let width = report.checks.iter().map(|check| check.name.len()).max().unwrap_or_default();
    for Checked { name, outcome, detail, device_ms, cpu_ms, .. } in &report.checks {
        let told = match outcome {
            Outcome::Equal => "equal",
            Outcome::Different => "DIFFERENT",
            Outcome::Failed => "FAILED",
            Outcome::Skipped => "skipped",
        };
        text += &match outcome {
            Outcome::Skipped => format!("{name:<width$}  {told}\n"),
            _ => format!("{name:<width$}  {told:<9}  {device_ms:>7.0} ms, on the CPU {cpu_ms:>6.0} ms\n"),
        };
        detail.iter().for_each(|detail| text += &format!("  {detail}\n"));
    }
    let numbers: usize = report.checks.iter().map(|check| check.numbers).sum();
    let wrong = report.checks.iter().filter(|check| check.outcome.is_wrong()).count();
    let all = words::counted(made as u64, "check");
    text + &if wrong == 0 {
        format!(
            "{all}, {} numbers: all are equal, so this device makes the same mosaics as the CPU\n",
            HumanCount(numbers as u64)
        )
    } else {
        format!(
            "{wrong} of {all} did not come out equal, so use --device cpu for now; please report this with what smalti \
             check --json and smalti devices --json print\n"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(outcome: Outcome, detail: Option<&str>) -> Checked {
        let detail = detail.map(str::to_owned);
        Checked { name: "search".to_owned(), outcome, detail, numbers: 1_500, device_ms: 12.0, cpu_ms: 3.0 }
    }

    fn report(checks: Vec<Checked>) -> Report {
        Report {
            schema: "smalti-check",
            schema_version: 1,
            version: "0.1.0",
            os: "linux",
            architecture: "x86_64",
            device: "card".to_owned(),
            driver: Some("driver 1".to_owned()),
            equal: false,
            checks,
        }
    }

    #[test]
    fn the_table_tells_the_first_difference_and_what_to_report() {
        let detail = "tile 3, angle: 7, and 8 on the CPU";
        let text = table(&report(vec![checked(Outcome::Equal, None), checked(Outcome::Different, Some(detail))]));
        assert!(text.contains(&format!("DIFFERENT       12 ms, on the CPU      3 ms\n  {detail}\n")), "{text}");
        assert!(text.contains("1 of 2 checks did not come out equal") && text.contains("--json"), "{text}");
        let skipped = Checked { numbers: 0, ..checked(Outcome::Skipped, Some("it has no graphics")) };
        let text = table(&report(vec![checked(Outcome::Equal, None), skipped]));
        assert!(text.contains("search  skipped\n  it has no graphics\n"), "{text}");
        assert!(
            text.ends_with("1 check, 1,500 numbers: all are equal, so this device makes the same mosaics as the CPU\n")
        );
    }
}
