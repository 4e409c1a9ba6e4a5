//! `smalti evolve`: from options to written files.

mod options;
mod summary;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

pub(crate) use self::options::EvolveArgs;
use self::options::{EvolveOptions, Files, Mode};
use crate::cli::args::computing;
use crate::cli::files::curve_file::{self, CurveFile, EndedCurve};
use crate::cli::files::destination::{self, Destination};
use crate::cli::files::outputs::{self, EncodedFile};
use crate::cli::files::places::Inputs;
use crate::cli::files::{memory, replacing};
use crate::cli::jobs::options::PictureOptions;
use crate::cli::jobs::prepared::{Evolved, Keep, Prepared};
use crate::cli::jobs::recorder::Recorder;
use crate::cli::jobs::row::{Row, Status};
use crate::cli::jobs::watch::Watchers;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::{self, Verbosity, advice, aside};
use crate::cli::trace::{self, Capture, CaptureRange, TraceArgs};
use crate::error::{Error, Result};
use crate::evolve::Ending;
use crate::model::Rgb;
use crate::photo::{self, Photo};
use crate::studio::{Device, Job, LONG_SIDE_PX, Provenance, picture_metadata, quoted, without_header};

/// Evolves one picture and reports on it; returns the exit code of the process.
pub(crate) fn evolve(args: &EvolveArgs) -> ExitCode {
    let mut row = Row::new(&args.input, args.picture.seed, args.picture.scheme());
    let done = EvolveOptions::new(args).and_then(|options| {
        // A script may ask for others than the flags.
        (row.seed, row.scheme) = (options.picture.seed(), options.picture.scheme().word());
        let run = Run { options, interrupt: Interrupt::listen()?, row: &mut row };
        run.evolve_traced(&args.trace)
    });
    if let Err(error) = &done {
        row.note_failure(error);
        terminal::error(&advice::sentence(error));
    }
    row.note_end();
    let printed = if args.json { row.print() } else { Ok(()) };
    if let Err(error) = &printed {
        terminal::error(&advice::sentence(error));
    }
    match done.and(printed) {
        Ok(()) => ExitCode::from(row.exit_code()),
        Err(error) => ExitCode::from(advice::exit_code(&error)),
    }
}

/// The work that the command was asked for.
struct Run<'r> {
    options: EvolveOptions,
    interrupt: Interrupt,
    /// What is known of the result so far, which a failure leaves as it is.
    row: &'r mut Row,
}

impl Run<'_> {
    /// As [`Run::evolve`], and writes the trace if one was asked for.
    fn evolve_traced(mut self, trace_args: &TraceArgs) -> Result<()> {
        let options = &mut self.options;
        if let (Some(path), Mode::Work) = (&trace_args.trace, options.mode) {
            let taken: Vec<&Path> = options.files_written().chain(options.picture.files_read()).collect();
            options.picture.tracer = trace::begin_trace(path, &taken, options.files.overwrite)?;
        }
        if let failure @ Err(_) = self.evolve(trace_args.capture) {
            self.options.picture.tracer.discard();
            return failure;
        }
        let Self { options: EvolveOptions { picture, .. }, interrupt, row } = self;
        let Some(path) = trace_args.trace.as_ref().filter(|_| picture.tracer.is_on()) else { return Ok(()) };
        let events = interrupt.while_writing(|| picture.tracer.finish())?;
        row.output.push(path.display().to_string());
        if picture.verbosity > Verbosity::Quiet {
            terminal::say(&format!("smalti: {} has {events} events; ui.perfetto.dev shows them", path.display()));
        }
        Ok(())
    }

    /// The work, in order: check, read, evolve and draw, encode and write.
    fn evolve(&mut self, capture: Option<CaptureRange>) -> Result<()> {
        let Self { options, interrupt, row } = self;
        let EvolveOptions { picture, files, mode, computing } = &*options;
        computing.start_threads()?;
        check_input(&picture.input)?;
        check_places(options)?;
        let device = {
            let _span = picture.tracer.span("open device");
            computing.select()?
        };
        trace::trace_device(&picture.tracer, &device);
        let capture = capture.map(|range| trace::begin_capture(range, &device)).transpose()?;
        row.device = Some(device.label().to_owned());

        // Before there is anything to save, a signal ends this at once.
        let load = {
            let (picture, id) = (picture.clone(), row.id.clone());
            move || Prepared::load(&picture, &id)
        };
        let prepared = aside::unless_interrupted(interrupt, load)?;
        row.note_prepared(&prepared, picture);
        let memory_bytes = prepared.check(picture)?;
        memory::check(memory_bytes)?;
        if picture.verbosity > Verbosity::Quiet {
            say_notes(&prepared.job, picture, &device);
        }
        check_replaceable(options, &prepared)?;
        if *mode == Mode::DryRun {
            row.status = Status::Planned;
            let folders = files.save_run.iter().map(|save_run| save_run.folder.as_path());
            row.output = options.files_written().chain(folders).map(|path| path.display().to_string()).collect();
            summary::print_plan(row, picture, &prepared.job, memory_bytes);
            return Ok(());
        }

        let folders = files.save_run.iter().map(|save_run| save_run.path_of(0)).collect::<Vec<_>>();
        destination::sweep_beside(options.files_written().chain(folders.iter().map(PathBuf::as_path)));
        let mut watchers = Watchers { interrupt, recorder: begin_record(files, &prepared)? };
        let keep = if files.curves.is_empty() { Keep::Nothing } else { Keep::Curve };
        let evolved = row.note_evolution(prepared.evolve(picture, &device, &mut watchers, keep))?;
        let began = Instant::now();
        let ending = evolved.ending;
        // What was made before is worth more than nothing.
        if !ending.is_complete() && ending.evals() == 0 {
            return Err(Error::Interrupted);
        }
        let status = if ending.is_complete() { Status::Complete } else { Status::Partial };
        write(options, &prepared, evolved, interrupt, &mut row.output)?;
        // If snapshots could not be written, that is reported after the result has been saved.
        row.output.extend(watchers.recorder.map(|recorder| recorder.outcome(&ending)).transpose()?);
        row.output.extend(capture.map(|capture| end_capture(&capture, picture)).transpose()?);
        row.save_ms = terminal::milliseconds(began.elapsed());
        row.status = status;
        if picture.verbosity > Verbosity::Quiet {
            summary::print_summary(row, picture, &prepared.job);
        }
        Ok(())
    }
}

/// Refuses what cannot be one picture, with the command that takes it.
fn check_input(input: &Path) -> Result<()> {
    let text = input.to_string_lossy();
    let reason = if input.is_dir() {
        format!("is a folder; for all pictures in it write smalti batch {} -o mosaics", quoted(&text))
    } else if text.contains("://") && !input.exists() {
        "is an address, and smalti reads no network; save the picture first, and name its file".to_owned()
    } else {
        return Ok(());
    };
    Err(Error::input(input, reason))
}

/// Checks, before anything is read, that all files can be written, and that none is written twice or is an input.
fn check_places(options: &EvolveOptions) -> Result<()> {
    let inputs = Inputs::new(options.picture.files_read());
    destination::check_writable(options.destinations(), &inputs)?;
    curve_file::check_writable(&options.files.curves, options.destinations(), &inputs)?;
    let mut written = options.files_written();
    options.files.save_run.iter().try_for_each(|save_run| save_run.check_place(&mut written, &inputs))
}

/// Encodes everything, then writes it: pictures and populations first. `paths` gets theirs.
fn write(
    options: &EvolveOptions,
    prepared: &Prepared,
    evolved: Evolved,
    interrupt: &Interrupt,
    paths: &mut Vec<String>,
) -> Result<()> {
    let EvolveOptions { picture, files, .. } = options;
    let Evolved { ending, drawn, curve, .. } = evolved;
    let kept = outputs_to_write(options, prepared, &ending);
    let encoding = picture.tracer.span("encode");
    let mut encoded = outputs::encode(&kept, &drawn, &prepared.provenances.told(&ending), picture.verbosity)?;
    drop(drawn);
    encoded.extend(encode_target(files, &prepared.job, &prepared.provenances.target)?);
    drop(encoding);
    let writing = picture.tracer.span("write");
    let written = outputs::write(&encoded, interrupt, paths);
    let curve_written = curve.map_or(Ok(()), |curve| {
        let key = prepared.provenances.population.key();
        let curves = curves_to_write(options, key, &ending);
        let ended = EndedCurve { curve: &curve, title: &prepared.id, key, ending: &ending };
        curve_file::write(&curves, ended, interrupt, paths)
    });
    drop(writing);
    written.and(curve_written)
}

/// The file of `--save-target`, if it was asked for.
fn encode_target<'a>(files: &'a Files, job: &Job, provenance: &Provenance) -> Result<Option<EncodedFile<'a>>> {
    let Some(destination) = &files.save_target else { return Ok(None) };
    let (width_px, height_px) = (job.target.width_px(), job.target.height_px());
    let metadata = picture_metadata(&provenance.describe(None));
    let pixels = job.target.pixels();
    let bytes = if let Some(transparent) = job.target.transparent() {
        let with_alpha =
            |(&[r, g, b], &is_transparent): (&Rgb, &bool)| if is_transparent { [0; 4] } else { [r, g, b, 255] };
        let pixels: Vec<[u8; 4]> = pixels.iter().zip(transparent).map(with_alpha).collect();
        photo::encode_png_with_alpha(width_px, height_px, &pixels, &metadata)?
    } else {
        photo::encode_png(&Photo { width_px, height_px, pixels: pixels.to_vec() }, &metadata)?
    };
    Ok(Some(EncodedFile { destination, bytes }))
}

/// Says where the capture is; returns its path.
fn end_capture(capture: &Capture, options: &PictureOptions) -> Result<String> {
    let (path, what) = capture.outcome()?;
    if options.verbosity > Verbosity::Quiet {
        terminal::say(&format!("smalti: {} holds {what}; qrenderdoc opens it", path.display()));
    }
    Ok(path.display().to_string())
}

/// Begins to record snapshots, if they were asked for.
fn begin_record(files: &Files, prepared: &Prepared) -> Result<Option<Recorder>> {
    let Some(save_run) = &files.save_run else { return Ok(None) };
    let Prepared { job, provenances, .. } = prepared;
    let told = without_header(provenances.population.describe(None));
    Recorder::begin(save_run, job.evals_planned(), job.population(Vec::new()), told).map(Some)
}

/// Refuses to replace files that this command would not have written.
fn check_replaceable(options: &EvolveOptions, prepared: &Prepared) -> Result<()> {
    let EvolveOptions { picture, files, .. } = options;
    let outputs = picture.outputs.iter().map(|output| (output, prepared.of_output(output).key()));
    let targets = files.save_target.iter().map(|output| (output, prepared.provenances.target.key()));
    outputs.chain(targets).try_for_each(|(output, key)| replacing::check_replaceable(output, key, files.overwrite))?;
    let key = prepared.provenances.population.key();
    files.curves.iter().try_for_each(|file| file.check_replaceable(key, files.overwrite))?;
    files.save_run.iter().try_for_each(|save_run| save_run.check(key, files.overwrite))
}

/// The outputs to write: all except those that hold a better result of the same command.
fn outputs_to_write<'a>(options: &'a EvolveOptions, prepared: &Prepared, ending: &Ending) -> Vec<&'a Destination> {
    let overwrite = options.files.overwrite;
    let (kept, outputs): (Vec<_>, Vec<_>) = options
        .picture
        .outputs
        .iter()
        .partition(|output| replacing::should_keep(output, prepared.of_output(output).key(), ending, overwrite));
    kept.iter().for_each(|output| say_kept(&options.picture, &output.path));
    outputs
}

/// The curve files to write: all except those that hold a better curve of the same command.
fn curves_to_write<'a>(options: &'a EvolveOptions, key: &str, ending: &Ending) -> Vec<&'a CurveFile> {
    let Files { curves, overwrite, .. } = &options.files;
    let (kept, curves): (Vec<_>, Vec<_>) = curves.iter().partition(|file| file.should_keep(key, ending, *overwrite));
    kept.iter().for_each(|file| say_kept(&options.picture, &file.path));
    curves
}

fn say_kept(options: &PictureOptions, path: &Path) {
    if options.verbosity > Verbosity::Quiet {
        let path = path.display();
        terminal::say(&format!("smalti: {path} is kept: the same command got farther when it wrote it"));
    }
}

/// Prints what the user should know before the work begins.
fn say_notes(job: &Job, options: &PictureOptions, device: &Device) {
    for warning in &job.warnings {
        terminal::say(&format!("smalti: {}: {warning}", options.input.display()));
    }
    let longer_px = job.original_size_px.0.max(job.original_size_px.1);
    let asked_px = options.settings.long_side_px;
    let note = options.replay.as_ref().and_then(|replay| replay.note(&options.input, &job.input_sha256));
    note.iter().for_each(|note| terminal::say(&format!("smalti: {note}")));
    if options.replay.is_none() && asked_px > longer_px && u64::from(asked_px) != LONG_SIDE_PX {
        terminal::say(&format!(
            "smalti: --size {asked_px} changes nothing, since the longer side of {} has {longer_px} px; --output-size {asked_px} draws the \
             mosaic larger",
            options.input.display()
        ));
    }
    let flat = options.outputs.iter().find(|output| output.is_flat());
    if let Some(flat) = flat.filter(|_| job.is_bare || job.target.transparent().is_some()) {
        terminal::say(&format!(
            "smalti: {} cannot be transparent: what is transparent in the picture becomes black in it; write a .png or \
             .webp, or choose a --background",
            flat.path.display()
        ));
    }
    computing::say_device(device);
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::cli::files::destination::Overwrite;
    use crate::studio::{Provenances, Recipe, Settings};

    #[test]
    fn the_saved_target_is_clear_where_it_is_transparent_and_tells_its_key() {
        let photo = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/rgb.png");
        let settings = Settings::new(&Recipe::new()).expect("the recipe is right");
        let mut job = Job::load(&photo, &settings).expect("the picture can be read");
        let save_target = Destination::for_target(Path::new("target.png")).ok();
        let files = Files { save_target, curves: Vec::new(), save_run: None, overwrite: Overwrite::Refuse };
        let opaque = job.target.as_ref().clone();
        let mut transparent = vec![false; opaque.pixels().len()];
        transparent[64] = true;
        for plane in [None, Some(&transparent)] {
            let target = plane.map_or(Ok(opaque.clone()), |plane| opaque.clone().with_transparent(plane.clone()));
            job.target = Arc::new(target.expect("the plane fits"));
            let provenance = Provenances::new(&settings, &job, None).target;
            let file = encode_target(&files, &job, &provenance).expect("it can be encoded").expect("it was asked for");
            let told = photo::png_metadata(&file.bytes);
            assert!(told.iter().any(|(_, text)| text.contains(provenance.key())), "{told:?}");
            let written = image::load_from_memory(&file.bytes).expect("it is a picture");
            assert_eq!(written.color().has_alpha(), plane.is_some());
            for (index, (pixel, color)) in written.to_rgba8().pixels().zip(opaque.pixels()).enumerate() {
                let is_clear = plane.is_some_and(|plane| plane[index]);
                let expected = if is_clear { [0; 4] } else { [color[0], color[1], color[2], 255] };
                assert_eq!(pixel.0, expected, "pixel {index}");
            }
        }
    }
}
