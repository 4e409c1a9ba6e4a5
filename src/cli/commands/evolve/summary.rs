//! What `smalti evolve` prints about a picture: the plan of a dry run, or the summary at the end.

use indicatif::{BinaryBytes, HumanCount};

use crate::cli::jobs::options::PictureOptions;
use crate::cli::jobs::row::{Row, Status};
use crate::cli::terminal::{self, Verbosity};
use crate::studio::{Job, SchemeSettings};

/// The summary of a finished evolution.
pub(super) fn print_summary(row: &Row, options: &PictureOptions, job: &Job) {
    let count = |value: u64| HumanCount(value).to_string();
    let sae = row.sae.unwrap_or_default();
    let mean_error = sae as f64 / (job.target.pixels().len() as f64 * 3.0);
    let psnr = row.psnr.map_or("infinite PSNR".to_owned(), |db| format!("PSNR {db:.2} dB"));
    let seconds = row.evolve_ms / 1e3;
    let psnr_line = format!("SAE {}, mean error {mean_error:.2} of 255 per channel, {psnr}", count(sae));
    terminal::say(&format!("{}, {} tiles", size_line(options, job), count(job.fly_count as u64)));
    let per_s = |value: u64| count((value as f64 / seconds.max(1e-6)) as u64);
    let device = row.device.as_deref().unwrap_or_default();
    match job.scheme {
        SchemeSettings::Paper(_) => {
            terminal::say(&psnr_line);
            terminal::say(&format!(
                "{} births ({} by the fallback), {} restarts, {seconds:.2} s, {} births/s on {device}",
                count(row.births),
                count(row.fallback_kills),
                count(u64::from(row.restarts)),
                per_s(row.births),
            ));
        }
        SchemeSettings::Cells(_) => {
            let objective = row.objective.filter(|&objective| u64::try_from(objective) != Ok(sae));
            let objective =
                objective.map_or(String::new(), |objective| format!(", objective {}", count(objective.unsigned_abs())));
            terminal::say(&format!("{psnr_line}{objective}"));
            terminal::say(&format!(
                "{} evals, {} births, {seconds:.2} s, {} evals/s on {device}",
                count(row.evals),
                count(row.births),
                per_s(row.evals),
            ));
        }
    }
    let warming_up = match row.living.filter(|_| row.is_warming_up) {
        Some(living) if Some(living) != row.tiles => {
            format!(" before the last split or change of masks, with {} tiles alive", count(living as u64))
        }
        Some(_) => " before the last change of masks".to_owned(),
        None => String::new(),
    };
    terminal::say(&format!("seed {}, stopped by {}{warming_up}", row.seed, row.stop.as_deref().unwrap_or_default()));
    if options.verbosity == Verbosity::Verbose {
        terminal::say(&format!("read in {:.0} ms, encoded and written in {:.0} ms", row.load_ms, row.save_ms));
        terminal::say(&format!("SHA-256 of the input {}", job.input_sha256));
        terminal::say(&format!("key of the result {}", row.key.as_deref().unwrap_or_default()));
    }
    if let Some(look) = look_line(options, job) {
        terminal::say(&look);
    }
    let partial = if row.status == Status::Partial {
        " (partial; the same command starts over, and --init goes on from a .npz)"
    } else {
        ""
    };
    let written = if row.output.is_empty() { "nothing".to_owned() } else { row.output.join(", ") };
    terminal::say(&format!("wrote {written}{partial}"));
}

/// The text of a dry run.
pub(super) fn print_plan(row: &Row, options: &PictureOptions, job: &Job, memory_bytes: u64) {
    let begin = options.settings.init_file().map(|path| path.display().to_string());
    terminal::say(&size_line(options, job));
    let fly_count = HumanCount(job.fly_count as u64);
    match &job.scheme {
        SchemeSettings::Paper(scheme) => {
            terminal::say(&format!("tiles      {fly_count} from {}", begin.as_deref().unwrap_or("random")));
            terminal::say(&format!(
                "births     {} in each of {} runs, {} at a time, scheme paper, seed {}",
                HumanCount(scheme.births),
                u64::from(scheme.restarts) + 1,
                scheme.batch_births,
                row.seed
            ));
        }
        SchemeSettings::Cells(cells) => {
            terminal::say(&format!("tiles      {fly_count} from {}", begin.as_deref().unwrap_or("none")));
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
