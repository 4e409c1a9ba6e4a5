//! What `smalti evolve` prints about a picture: the plan of a dry run, or the summary at the end.

use indicatif::{BinaryBytes, HumanCount};

use crate::cli::jobs::options::PictureOptions;
use crate::cli::jobs::row::{Row, Status};
use crate::cli::terminal::{self, Verbosity, words};
use crate::evolve::StopReason;
use crate::studio::{Job, SchemeSettings};

/// The summary of a finished evolution: one line, and with `--verbose` all figures before it.
pub(super) fn print_summary(row: &Row, options: &PictureOptions, job: &Job) {
    if options.verbosity == Verbosity::Verbose {
        print_figures(row, options, job);
    }
    let tiles = words::counted(job.fly_count as u64, "tile");
    let likeness = row.psnr.map_or("without any error".to_owned(), |db| format!("{db:.1} dB"));
    let stop = row.stop.as_deref().unwrap_or_default();
    let ended = if is_as_planned(stop) { String::new() } else { format!(", ended {}", words::why_ended(stop)) };
    let written = if row.output.is_empty() { "nothing".to_owned() } else { row.output.join(", ") };
    let seconds = row.evolve_ms / 1e3;
    let partial = if row.status == Status::Partial { " (partial)" } else { "" };
    terminal::say(&format!("wrote {written}{partial}: {tiles}, {likeness}, {seconds:.1} s{ended}{}", warming_up(row)));
    if stop == StopReason::Time.word() && row.evals == 0 {
        let so = if options.settings.init_file().is_some() { "nothing has changed" } else { "no tile is laid" };
        terminal::say(&format!(
            "no round was over in that time, so {so} yet; give it a longer --time, or fewer tiles with -n"
        ));
    }
    if row.status == Status::Partial {
        terminal::say("the same command starts over, and --init goes on from a .npz");
    }
}

/// Whether a search that ended so did all that it was to do.
fn is_as_planned(stop: &str) -> bool {
    ["evals", "births"].contains(&stop)
}

/// What an early end left out of a run of the paper's scheme, as a clause.
fn warming_up(row: &Row) -> String {
    match row.living.filter(|_| row.is_warming_up) {
        Some(living) if Some(living) != row.tiles => {
            let living = words::counted(living as u64, "tile");
            format!(" before the last split or change of masks, with {living} alive")
        }
        Some(_) => " before the last change of masks".to_owned(),
        None => String::new(),
    }
}

/// All figures.
fn print_figures(row: &Row, options: &PictureOptions, job: &Job) {
    let count = |value: u64| HumanCount(value).to_string();
    let sae = row.sae.unwrap_or_default();
    let mean_error = sae as f64 / (job.target.pixels().len() as f64 * 3.0);
    let seconds = row.evolve_ms / 1e3;
    let per_s = |value: u64| count((value as f64 / seconds.max(1e-6)) as u64);
    let objective = row.objective.filter(|&objective| u64::try_from(objective) != Ok(sae));
    let objective =
        objective.map_or(String::new(), |objective| format!(", objective {}", count(objective.unsigned_abs())));
    terminal::say(&size_line(options, job));
    terminal::say(&format!("SAE {}, mean error {mean_error:.2} of 255 per channel{objective}", count(sae)));
    let device = row.device.as_deref().unwrap_or_default();
    terminal::say(&match job.scheme {
        SchemeSettings::Paper(_) => format!(
            "{} ({} by the fallback), {}, {} births/s on {device}",
            words::counted(row.births, "birth"),
            count(row.fallback_kills),
            words::counted(row.restarts.into(), "restart"),
            per_s(row.births),
        ),
        SchemeSettings::Cells(_) => format!(
            "{}, {}, {} evals/s on {device}",
            words::counted(row.evals, "eval"),
            words::counted(row.births, "birth"),
            per_s(row.evals),
        ),
    });
    terminal::say(&format!("seed {}, ended {}", row.seed, words::why_ended(row.stop.as_deref().unwrap_or_default())));
    terminal::say(&format!("read in {:.0} ms, encoded and written in {:.0} ms", row.load_ms, row.save_ms));
    terminal::say(&format!("SHA-256 of the input {}", job.input_sha256));
    terminal::say(&format!("key of the result {}", row.key.as_deref().unwrap_or_default()));
    look_line(options, job).iter().for_each(|look| terminal::say(look));
}

/// The text of a dry run.
pub(super) fn print_plan(row: &Row, options: &PictureOptions, job: &Job, memory_bytes: u64) {
    let begin = options.settings.init_file().map(|path| format!("those of {} at first", path.display()));
    terminal::say(&size_line(options, job));
    let fly_count = HumanCount(job.fly_count as u64);
    match &job.scheme {
        SchemeSettings::Paper(scheme) => {
            let begin = begin.unwrap_or_else(|| "at random at first".to_owned());
            terminal::say(&format!("tiles      {fly_count}, {begin}"));
            terminal::say(&format!(
                "births     {} in each of {}, {} at a time, scheme paper, seed {}",
                HumanCount(scheme.births),
                words::counted(u64::from(scheme.restarts) + 1, "run"),
                scheme.batch_births,
                row.seed
            ));
        }
        SchemeSettings::Cells(cells) => {
            let begin = begin.map_or_else(String::new, |begin| format!(", {begin}"));
            terminal::say(&format!("tiles      {fly_count}{begin}"));
            let evals = HumanCount(cells.budget(job.fly_count).evals);
            terminal::say(&format!("evals      {evals}, scheme cells, seed {}", row.seed));
        }
    }
    if let Some(look) = look_line(options, job) {
        terminal::say(&format!("looks      {look}"));
    }
    if let Some(limit) = options.settings.time_limit {
        terminal::say(&format!("time       at most {} s", limit.as_secs_f64()));
    }
    terminal::say(&format!("memory     about {}", BinaryBytes(memory_bytes)));
    terminal::say(&format!("device     {}", row.device.as_deref().unwrap_or_default()));
    terminal::say(&format!("would write {}", row.output.join(", ")));
    terminal::say(&format!("key        {}", row.key.as_deref().unwrap_or_default()));
}

/// How the tiles differ from plain ones in evolved colours, if they do.
fn look_line(options: &PictureOptions, job: &Job) -> Option<String> {
    let mut told = Vec::new();
    if job.dress.is_some() {
        told.push(options.settings.look.describe());
    }
    told.extend(job.color_count.map(|count| format!("{count} colours")));
    told.extend(job.palette.as_ref().map(|palette| format!("palette of {}", palette.colors().len())));
    told.extend(job.told());
    (!told.is_empty()).then(|| told.join("; "))
}

/// The input with its sizes: as read, and as evolved if that is smaller.
fn size_line(options: &PictureOptions, job: &Job) -> String {
    let (width_px, height_px) = job.original_size_px;
    let fitted = (job.target.width_px(), job.target.height_px());
    let reduced =
        if fitted == job.original_size_px { String::new() } else { format!(", reduced to {}x{}", fitted.0, fitted.1) };
    format!("{}: {width_px}x{height_px} px{reduced}", options.input.display())
}
