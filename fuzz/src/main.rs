//! The driver: gives the targets damaged files, in an order that a seed decides, and keeps those that find a fault.
//!
//! A fault is a panic that smalti does not turn into a refusal, an input that takes more than five seconds or much
//! memory, or a file that is left behind. One input runs at a time. It lies in the folder of what is kept while it runs, so that it is
//! still there if the whole process dies.

mod corpus;
mod options;
mod watch;

use std::collections::HashSet;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use corpus::Corpus;
use options::Options;
use smalti_fuzz::scratch;
use smalti_fuzz::targets::Target;
use watch::Watch;

/// An input that takes longer hangs.
const LONGEST: Duration = Duration::from_secs(5);
/// Inputs are so small, and so are the pictures in them, that none has a reason to take more memory.
const PEAK_MAX_MIB: u64 = 400;
/// Inputs of a target in a row, before the next one has its turn.
const ROUND: u64 = 50;

/// What became of the inputs of a target.
#[derive(Default)]
struct Tally {
    inputs: u64,
    accepted: u64,
    longest: Duration,
    longest_index: u64,
}

struct Driver {
    options: Options,
    watch: Watch,
    /// The faults that were told already, each by its place.
    faults: HashSet<String>,
}

fn main() -> ExitCode {
    match Options::parse(std::env::args().skip(1)).and_then(drive) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(sentence) => {
            eprintln!("smalti-fuzz: {sentence}");
            ExitCode::from(2)
        }
    }
}

/// Drives all targets; how many faults were found.
fn drive(options: Options) -> Result<usize, String> {
    let begun = Instant::now();
    fs::create_dir_all(&options.kept).map_err(|error| format!("{}: {error}", options.kept.display()))?;
    let corpora = options.targets.iter().map(|target| Corpus::of(target)).collect::<Result<Vec<_>, _>>()?;
    let mut tallies: Vec<Tally> = options.targets.iter().map(|_| Tally::default()).collect();
    let is_over = |options: &Options| options.time.is_some_and(|time| begun.elapsed() >= time);
    let mut driver = Driver { options, watch: Watch::begin(LONGEST, hung), faults: HashSet::new() };
    let mut first = driver.options.first;
    let last = first.saturating_add(driver.options.inputs);
    while first < last && !is_over(&driver.options) {
        let end = last.min(first + ROUND);
        for (place, corpus) in corpora.iter().enumerate() {
            let target = driver.options.targets[place];
            for index in first..end {
                driver.give(target, corpus, index, &mut tallies[place])?;
                if is_over(&driver.options) {
                    break;
                }
            }
        }
        first = end;
    }
    scratch::remove();
    tell(&driver, &tallies, begun.elapsed());
    Ok(driver.faults.len())
}

impl Driver {
    /// Gives a target its input with this index.
    fn give(&mut self, target: &Target, corpus: &Corpus, index: u64, tally: &mut Tally) -> Result<(), String> {
        let input = corpus.input(target, self.options.seed, index);
        let running = self.options.kept.join(format!("{}-{}-{index}", target.name, self.options.seed));
        let unwritable = |error| format!("{}: {error}", running.display());
        fs::write(&running, &input).map_err(unwritable)?;
        self.watch.start(running.clone());
        let accepted = catch_unwind(AssertUnwindSafe(|| (target.read)(&input)));
        let (took, panic) = self.watch.stop();
        tally.inputs += 1;
        tally.accepted += u64::from(matches!(accepted, Ok(true)));
        if took > tally.longest {
            (tally.longest, tally.longest_index) = (took, index);
        }
        let left_over = scratch::left_over();
        let peak_mib = peak_mib().filter(|&mib| mib > PEAK_MAX_MIB);
        if peak_mib.is_some() {
            // The next one begins at what is taken then (proc_pid_clear_refs(5)).
            let _ = fs::write("/proc/self/clear_refs", "5");
        }
        // A panic leaves the file that the target itself has put there.
        let fault = match panic {
            Some(told) => Some(format!("panics at {told}")),
            None if !left_over.is_empty() => Some(format!("leaves {}", left_over.join(", "))),
            None => peak_mib.map(|_| format!("takes more than {PEAK_MAX_MIB} MiB of memory in {}", target.name)),
        };
        if !left_over.is_empty() {
            scratch::clean();
        }
        match fault {
            Some(fault) if self.faults.insert(fault.clone()) => {
                println!("{}: {fault}", running.display());
                Ok(())
            }
            _ => fs::remove_file(&running).map_err(unwritable),
        }
    }
}

/// Ends the program, since the thread of an input that hangs cannot be ended alone.
fn hung(input: &Path) -> ! {
    scratch::remove();
    println!("smalti-fuzz: {}: takes more than {} s; give it to its target again", input.display(), LONGEST.as_secs());
    std::process::exit(1)
}

/// A line for each target, and one for all.
fn tell(driver: &Driver, tallies: &[Tally], took: Duration) {
    for (target, tally) in driver.options.targets.iter().zip(tallies) {
        let percent = 100 * tally.accepted / tally.inputs.max(1);
        let Tally { inputs, longest, longest_index, .. } = tally;
        println!(
            "{:<10}{inputs:>8} inputs, {percent:>3} % accepted, at most {:>5} ms (input {longest_index})",
            target.name,
            longest.as_millis()
        );
    }
    let inputs: u64 = tallies.iter().map(|tally| tally.inputs).sum();
    let (seed, peak) = (driver.options.seed, peak_mib().map_or(String::new(), |mib| format!(", {mib} MiB at most")));
    let found = match driver.faults.len() {
        0 => "no fault".to_owned(),
        count => format!("{count} faults; their inputs are in {}", driver.options.kept.display()),
    };
    println!("smalti-fuzz: {inputs} inputs of seed {seed} in {:.0} s{peak}: {found}", took.as_secs_f64());
}

/// The most memory that this process has had, where the system tells it.
fn peak_mib() -> Option<u64> {
    let status = fs::read_to_string(PathBuf::from("/proc/self/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches(" kB").parse::<u64>().ok()? >> 10)
}
