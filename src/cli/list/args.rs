//! The flags of a batch. A plan passes them on to its shards.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::name::{self, NameTemplate};
use super::shard::{self, ShardChoice};
use crate::cli::args::computing::{ComputingArgs, DevicesArg};
use crate::cli::args::messages::MessageArgs;
use crate::cli::args::picture::PictureArgs;
use crate::cli::values;

/// Most threads that read, and most that save.
const IO_THREADS_MAX: usize = 64;

/// The values of `--on-exists`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OnExists {
    /// Keep outputs that are whole and have the same picture, options and seed; make the others anew
    SkipSame,
    /// Keep whatever is there, without looking into it
    Skip,
    /// Make everything anew
    Overwrite,
    /// Fail
    Error,
}

/// Threads that read, and threads that save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct IoThreads {
    pub load: usize,
    pub save: usize,
}

/// `LOAD:SAVE`, or one number for both.
fn io_threads(text: &str) -> Result<IoThreads, String> {
    let (load, save) = text.split_once(':').unwrap_or((text, text));
    let count = |text: &str| text.parse().ok().filter(|count| (1..=IO_THREADS_MAX).contains(count));
    match (count(load), count(save)) {
        (Some(load), Some(save)) => Ok(IoThreads { load, save }),
        _ => Err(format!("expected LOAD:SAVE, two numbers from 1 to {IO_THREADS_MAX}, such as 2:1")),
    }
}

const EXAMPLES: &str = "\
Examples:
  smalti batch photos -o mosaics
  smalti batch photos --recursive -o mosaics --format png,npz --style mosaic --size 256
  smalti batch 'trip/*.jpg' -o mosaics --name '{stem}-{seed}.{ext}' --seed 7
  smalti batch --manifest work.jsonl -o mosaics --shard 2/8
  find . -name '*.jpg' | jq -R '{input: .}' -c | smalti batch --manifest - -o mosaics

If a batch was interrupted, killed, or failed, run the same command again: it makes only what is missing or damaged.

A line of a manifest is an object such as {\"input\": \"a.png\"}. It may also have id, output, seed, preset, params (flags without \
their minuses), group and after; docs/batch.md explains them.";

#[derive(Clone, Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct BatchArgs {
    /// Pictures, folders of pictures, and patterns such as 'trip/*.jpg'
    #[arg(value_name = "IN")]
    pub inputs: Vec<PathBuf>,
    /// List of pictures, one JSON object a line; - reads stdin
    #[arg(long, value_name = "FILE")]
    pub manifest: Option<PathBuf>,
    /// Also take the pictures in folders below the named ones
    #[arg(long)]
    pub recursive: bool,
    /// Do only a part of the batch: 3/8 is the third of eight; auto asks the scheduler [default: all]
    ///
    /// auto reads the numbers of a Slurm or Grid Engine array, of an indexed job of Kubernetes, or SHARD_INDEX and
    /// SHARD_COUNT.
    #[arg(long, value_name = "k/n|auto", value_parser = shard::parse)]
    pub shard: Option<ShardChoice>,

    /// Folder for the mosaics; made if it is not there
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    pub output: PathBuf,
    /// What to write of each picture: png jpg webp svg ora npz csv json; several with commas
    #[arg(long = "format", value_name = "EXT", value_delimiter = ',', value_parser = values::ending, default_value = "png", help_heading = "Output")]
    pub formats: Vec<String>,
    /// Names of the outputs, made of {stem} {suffix} {dir} {id} {group} {index} {seed} {ext}
    #[arg(long, value_name = "NAME", value_parser = name::parse, default_value = "{dir}/{stem}.{ext}", help_heading = "Output")]
    pub name: NameTemplate,
    /// Let the manifest name outputs outside of the output folder
    #[arg(long, requires = "manifest", help_heading = "Output")]
    pub allow_outside: bool,
    /// What to do where an output is there already
    #[arg(long, value_enum, value_name = "WHAT", default_value = "skip-same", help_heading = "Output")]
    pub on_exists: OnExists,
    /// Add a line of JSON about every picture to this file [default: results.jsonl in the output folder, or
    /// results.K-of-N.jsonl for a shard]
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub results: Option<PathBuf>,
    /// Only list what would be done; write nothing
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,
    /// Also print the lines of JSON to stdout
    #[arg(long, help_heading = "Output")]
    pub json: bool,

    #[command(flatten)]
    pub picture: PictureArgs,

    /// How many pictures evolve at the same time on a device [default: one for each CPU thread; on a GPU 256, on
    /// software Vulkan 16, or fewer if its memory is full]
    #[arg(long, value_name = "N", value_parser = values::count, help_heading = "Computing")]
    pub in_flight: Option<u64>,
    /// How many threads read pictures, and how many save them, such as 2:1 [default: half the CPU threads each]
    #[arg(long, value_name = "LOAD:SAVE", value_parser = io_threads, help_heading = "Computing")]
    pub io_threads: Option<IoThreads>,
    #[command(flatten)]
    pub devices: DevicesArg,
    #[command(flatten)]
    pub computing: ComputingArgs,
    /// Check every Vulkan call with the validation layer; any message is an error
    #[arg(long, help_heading = "Computing")]
    pub validate: bool,
    /// First check that each device gives what the CPU gives, as smalti check does; end if one does not
    #[arg(long, help_heading = "Computing")]
    pub check: bool,

    /// Write what threads and devices did at what time, to be seen in ui.perfetto.dev; the result stays the same
    #[arg(long, value_name = "FILE", help_heading = "Seeing inside")]
    pub trace: Option<PathBuf>,

    #[command(flatten)]
    pub messages: MessageArgs,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn io_threads_are_two_numbers_or_one_for_both() {
        assert_eq!(io_threads("2:1"), Ok(IoThreads { load: 2, save: 1 }));
        assert_eq!(io_threads("3"), Ok(IoThreads { load: 3, save: 3 }));
        for text in ["", "0:1", "1:", "1:65", "a:b", "-1:1"] {
            assert!(io_threads(text).is_err(), "{text}");
        }
    }
}
