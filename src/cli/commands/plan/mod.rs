//! `smalti plan`: cuts a batch into shards, and writes the scripts that run them on a cluster.

mod estimate;
mod files;
mod flags;
mod scripts;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::{ArgGroup, Args};

use self::scripts::Plan;
use crate::cli::args::typed::Typed;
use crate::cli::files::destination::{Destination, Overwrite};
use crate::cli::files::places::{self, Inputs};
use crate::cli::list::shard::{self, SHARD_COUNT_MAX};
use crate::cli::list::{self, BatchArgs, Item, ManifestRow};
use crate::cli::terminal::{self, Verbosity, words};
use crate::cli::trace::Tracer;
use crate::cli::values::{self, in_range};
use crate::error::{Error, Result, in_words};
use crate::studio::quoted;

/// A shard with less work than this, in seconds, costs a cluster too much compared with its work.
const SHARD_MIN_S: f64 = 60.0;
/// How many task numbers Slurm allows, unless its MaxArraySize differs.
const SLURM_ARRAY_MAX: u32 = 1_000;
/// Flags whose effect is already in the shard manifests, or that the scripts add themselves.
const KEPT_FLAGS: [&str; 15] = [
    // The flags from its file are among the tokens already.
    "config",
    "manifest",
    "recursive",
    "shard",
    "output",
    "format",
    "name",
    "results",
    "dry-run",
    "into",
    "shards",
    "per-shard",
    "minutes",
    "picture-time",
    "force",
];

/// Clap would write one line that is wider than a terminal.
const USAGE: &str = "smalti plan [OPTIONS] -o DIR --shards N|--per-shard N|--minutes M [IN]...";

const AFTER_HELP: &str = "\
A plan is a folder with a list of all pictures (manifest.jsonl), one list for each shard (shard-0001.jsonl and so on), and \
scripts that run the shards: submit.slurm, kubernetes.yaml and parallel.sh. The flags of smalti batch may be given here; the scripts \
hand them on. docs/cluster.md explains more.

Examples:
  smalti plan photos -o mosaics --shards 16 --style mosaic
  smalti plan --manifest work.jsonl -o mosaics --minutes 30 --picture-time 4s --into plan
  sbatch --gres=gpu:1 --time=1:00:00 plan/submit.slurm
  smalti merge mosaics -o all.jsonl --manifest plan/manifest.jsonl";

#[derive(Clone, Debug, Args)]
#[command(after_long_help = AFTER_HELP, override_usage = USAGE)]
#[command(group = ArgGroup::new("cut").required(true).args(["shards", "per_shard", "minutes"]))]
pub(crate) struct PlanArgs {
    /// Folder for the plan; made if it is not there
    #[arg(long, value_name = "FOLDER", default_value = "plan", help_heading = "Plan")]
    pub into: PathBuf,
    /// Cut the batch into this many shards
    #[arg(long, value_name = "N", value_parser = values::count, help_heading = "Plan")]
    pub shards: Option<u64>,
    /// Cut the batch into shards of about this many pictures
    #[arg(long, value_name = "ITEMS", value_parser = values::count, help_heading = "Plan")]
    pub per_shard: Option<u64>,
    /// Cut the batch into shards of about this many minutes of work
    #[arg(long, value_name = "M", value_parser = values::number, help_heading = "Plan")]
    pub minutes: Option<f64>,
    /// How long one picture takes on the cluster, such as 4s [default: measured here on a few]
    #[arg(long, value_name = "TIME", value_parser = values::duration, help_heading = "Plan")]
    pub picture_time: Option<Duration>,
    /// Replace files in the folder of the plan that no plan wrote, or that were changed since
    #[arg(long, help_heading = "Plan")]
    pub force: bool,
    #[command(flatten)]
    pub batch: BatchArgs,
}

/// Writes the plan; returns the exit code of the process.
pub(crate) fn plan(args: &PlanArgs, typed: &Typed) -> ExitCode {
    terminal::exit_code(write(args, typed))
}

fn write(args: &PlanArgs, typed: &Typed) -> Result<()> {
    refuse_flags(&args.batch)?;
    let items = list::find(&args.batch, typed)?;
    let rows: Vec<&ManifestRow> = items.iter().map(|item| &item.row).collect();
    let groups: Vec<Option<&str>> = rows.iter().map(|row| row.group.as_deref()).collect();
    let picture_s = picture_s(args, &items);
    let shard_count = shard_count(args, items.len(), picture_s)?.min(shard::unit_count(&groups));
    let mut flags = flags::of(typed, "plan", &KEPT_FLAGS)?;
    let folder = places::place_of(&args.batch.output);
    let is_outside = |output: &Destination| !places::place_of(&output.path).starts_with(&folder);
    if !args.batch.allow_outside && items.iter().flat_map(|item| &item.outputs).any(is_outside) {
        // `--name` leads there, which is the user's own word; in the shards it has become rows of a manifest.
        flags.push("--allow-outside".to_owned());
    }
    let plan = Plan {
        work_folder: work_folder()?,
        folder: text(&args.into)?,
        output_folder: text(&args.batch.output)?,
        flags,
        item_count: items.len(),
        shard_count,
    };
    let overwrite = if args.force { Overwrite::Force } else { Overwrite::Refuse };
    let shards = shard::divide(&groups, shard_count);
    let largest = shards.iter().map(Vec::len).max().unwrap_or(0);
    let mut files = BTreeMap::from([
        ("manifest.jsonl".to_owned(), manifest(&rows)?),
        ("submit.slurm".to_owned(), plan.slurm()),
        ("kubernetes.yaml".to_owned(), plan.kubernetes()),
        ("parallel.sh".to_owned(), plan.parallel()),
    ]);
    for (index, numbers) in (1..).zip(shards) {
        let rows: Vec<&ManifestRow> = numbers.into_iter().map(|number| rows[number]).collect();
        files.insert(plan.shard_name(index), manifest(&rows)?);
    }
    if !args.batch.dry_run {
        let inputs = Inputs::new(items.iter().flat_map(Item::files_read).chain(args.batch.manifest.as_deref()));
        let written: Vec<PathBuf> = files::all_names(&files).map(|name| args.into.join(name)).collect();
        inputs.refuse(written.iter().map(PathBuf::as_path))?;
        files::write(&args.into, &files, overwrite)?;
    }
    if args.batch.messages.verbosity() > Verbosity::Quiet {
        tell(args, &plan, largest, picture_s);
    }
    Ok(())
}

/// Refuses flags of `smalti batch` that the plan itself decides.
fn refuse_flags(batch: &BatchArgs) -> Result<()> {
    let given = [
        ("--shard", batch.shard.is_some()),
        ("--results", batch.results.is_some()),
        ("--trace", batch.trace.is_some()),
    ];
    given.into_iter().find(|(_, is_given)| *is_given).map_or(Ok(()), |(flag, _)| {
        Err(Error::Usage(format!("{flag}: each shard has its own; drop the flag, or give it to smalti batch")))
    })
}

/// Seconds that a picture takes: as the user said, or else as estimated.
fn picture_s(args: &PlanArgs, items: &[Item]) -> Option<f64> {
    let said = args.picture_time.map(|time| time.as_secs_f64());
    said.or_else(|| estimate::picture_s(items.len(), |number| items[number].options(&Tracer::default())))
}

/// How many shards the user wants.
fn shard_count(args: &PlanArgs, item_count: usize, picture_s: Option<f64>) -> Result<u32> {
    let most = u64::from(SHARD_COUNT_MAX);
    let in_shards_of = |items: u64| (item_count as u64).div_ceil(items);
    let count = match (args.shards, args.per_shard, args.minutes) {
        (Some(count), ..) => in_range("--shards", count, 1..=most)?,
        (_, Some(items), _) => in_shards_of(in_range("--per-shard", items, 1..=u64::MAX)?),
        (.., Some(minutes)) if minutes > 0.0 && minutes.is_finite() => {
            let sentence = "--minutes: none of the pictures that were looked at can be read; give --picture-time";
            let picture_s = picture_s.ok_or_else(|| Error::Usage(sentence.to_owned()))?;
            in_shards_of(((minutes * 60.0 / picture_s.max(1e-3)) as u64).max(1))
        }
        (.., minutes) => {
            return Err(Error::Usage(format!("--minutes {}: must be more than 0", minutes.unwrap_or_default())));
        }
    };
    let too_many = |_| Error::Usage(format!("{count} shards are more than {most}; make them larger"));
    u32::try_from(count).ok().filter(|&count| u64::from(count) <= most).ok_or(()).map_err(too_many)
}

/// The rows as the text of a manifest.
fn manifest(rows: &[&ManifestRow]) -> Result<String> {
    let mut text = String::new();
    for row in rows {
        // This fails for paths that are not text, which JSON cannot hold.
        let line = serde_json::to_string(row).map_err(|error| {
            Error::Usage(format!(
                "{}: a manifest cannot hold this name ({error}); rename the file",
                row.input.display()
            ))
        })?;
        text.push_str(&line);
        text.push('\n');
    }
    Ok(text)
}

fn work_folder() -> Result<String> {
    let folder = std::env::current_dir().map_err(|error| {
        Error::Usage(format!("the current folder cannot be read, since {}; change to another one", in_words(&error)))
    })?;
    text(&folder)
}

/// The path as text, which a script needs.
fn text(path: &Path) -> Result<String> {
    let text = path.to_str().filter(|text| !text.contains(['"', '\\']) && scripts::can_hold(text));
    let text = text.ok_or_else(|| {
        let sentence = "a script can only contain names in UTF-8 without control characters, line breaks, double quotes or \
                        backslashes; rename it";
        Error::input(path, sentence)
    })?;
    // It would be taken for a flag.
    Ok(if text.starts_with('-') { format!("./{text}") } else { text.to_owned() })
}

/// Says what was planned, how long it will take, and how to run it.
fn tell(args: &PlanArgs, plan: &Plan, largest: usize, picture_s: Option<f64>) {
    let count = plan.shard_count;
    terminal::say(&format!(
        "{} in {} of at most {largest}",
        words::counted(plan.item_count as u64, "picture"),
        words::counted(count.into(), "shard")
    ));
    if let Some(picture_s) = picture_s {
        let shard_s = picture_s * plan.item_count as f64 / f64::from(count);
        let source =
            if args.picture_time.is_some() { "as you say" } else { "guessed for two processors; say --picture-time" };
        terminal::say(&format!("about {} a shard, {} a picture ({source})", spoken(shard_s), spoken(picture_s)));
        if count > 1 && shard_s < SHARD_MIN_S {
            terminal::error(
                "a shard is less than a minute of work, and a task costs a cluster about a second: make fewer shards",
            );
        }
    }
    if count > SLURM_ARRAY_MAX {
        terminal::error(&format!(
            "Slurm allows {SLURM_ARRAY_MAX} tasks an array unless its MaxArraySize says otherwise (scontrol show config)"
        ));
    }
    if args.batch.dry_run {
        return;
    }
    let (folder, output) = (quoted(&plan.folder), quoted(&plan.output_folder));
    terminal::say(&format!("Slurm       sbatch {folder}/submit.slurm"));
    terminal::say(&format!("Kubernetes  kubectl create -f {folder}/kubernetes.yaml, after a look into it"));
    terminal::say(&format!("here        sh {folder}/parallel.sh"));
    terminal::say(&format!("then        smalti merge {output} -o all.jsonl --manifest {folder}/manifest.jsonl"));
}

/// A time as people say it.
fn spoken(seconds: f64) -> String {
    match seconds {
        0.0..10.0 => format!("{seconds:.1} s"),
        10.0..120.0 => format!("{seconds:.0} s"),
        120.0..7200.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}
