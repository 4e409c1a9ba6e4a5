//! The work on one picture: it is read and checked, then evolved and drawn. The command decides what is written, and
//! where.

use std::time::{Duration, Instant};

use super::curve::Curve;
use super::options::PictureOptions;
use super::replay::Replay;
use super::row::Row;
use super::watch::{Watch, Watchers};
use crate::cli::files::destination::{self, Destination};
use crate::cli::files::outputs;
use crate::cli::terminal::progress::Progress;
use crate::cli::terminal::{self, Verbosity, milliseconds};
use crate::cli::trace::TraceInstruments;
use crate::error::{Error, Result};
use crate::evolve::{Ended, Ending};
use crate::model::{Canvas, Painter};
use crate::studio::{self, Device, Drawn, Job, Outlook, Picture, Provenance, Provenances, finish};

/// A picture that is ready to be evolved.
#[derive(Debug)]
pub(crate) struct Prepared {
    /// What the picture is called in traces and reports.
    pub id: String,
    pub job: Job,
    pub provenances: Provenances,
    /// The picture, if a script is followed.
    picture: Option<Picture>,
    /// How long it took to read.
    pub load_time: Duration,
}

/// An evolution that is over, whether it worked or failed.
pub(crate) struct Evolution {
    pub took: Duration,
    /// Whether the CPU searched in the place of the device.
    pub is_stand_in: bool,
    pub outcome: Result<Evolved>,
}

/// The result of an evolution, drawn.
pub(crate) struct Evolved {
    pub ending: Ending,
    /// Signal-to-noise ratio against the target; none for a perfect likeness.
    pub psnr_db: Option<f64>,
    /// The best population.
    pub drawn: Drawn,
    /// The curve of the evolution, if it was asked for.
    pub curve: Option<Curve>,
}

/// What is kept of the course of an evolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    Curve,
    Nothing,
}

impl Prepared {
    /// Reads the picture.
    ///
    /// # Errors
    /// As [`Job::load`].
    pub fn load(options: &PictureOptions, id: &str) -> Result<Self> {
        let began = Instant::now();
        let _span = options.tracer.span("load").tell("picture", id);
        let decoding = options.tracer.span("decode");
        let (job, picture, told) = match &options.replay {
            None => (Job::load(&options.input, &options.settings)?, None, None),
            Some(replay) => {
                let (picture, Outlook { job, provenances }) = replay.outlook(&options.input)?;
                (job, Some(picture), Some(provenances))
            }
        };
        drop(decoding);
        let load_time = began.elapsed();
        let resized_px = options.resized_px(job.target.width_px(), job.target.height_px());
        let provenances = match told {
            Some(told) => Provenances { picture: told.picture.resized(resized_px), ..told },
            None => Provenances::new(&options.settings, &job, resized_px),
        };
        Ok(Self { id: id.to_owned(), job, provenances, picture, load_time })
    }

    /// The provenance of an output.
    pub fn of_output(&self, output: &Destination) -> &Provenance {
        if output.is_picture() { &self.provenances.picture } else { &self.provenances.population }
    }

    /// The provenance in the row of the result: that of the pictures if there are any, else that of the population.
    pub fn of_row(&self, options: &PictureOptions) -> &Provenance {
        let has_picture = options.outputs.iter().any(Destination::is_picture);
        if has_picture { &self.provenances.picture } else { &self.provenances.population }
    }

    /// Checks what depends on the picture's size; returns about how many bytes the work needs.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if the scheme does not fit the number of tiles; [`crate::Error::Usage`] if a format
    /// cannot hold the picture.
    pub fn check(&self, options: &PictureOptions) -> Result<u64> {
        self.job.check()?;
        let (width_px, height_px) = (self.job.target.width_px(), self.job.target.height_px());
        let written = options.output_long_side_px.map(|long| Canvas::scaled(width_px, height_px, long));
        let written_px = written.map_or((width_px, height_px), |canvas| (canvas.width_px, canvas.height_px));
        destination::check_fits_formats(&options.outputs, written_px)?;
        let written_pixel_count = u64::from(written_px.0) * u64::from(written_px.1);
        Ok(self.job.memory_bytes(written_pixel_count * destination::memory_weight(&options.outputs)))
    }

    /// Evolves the picture and draws its best population.
    pub fn evolve(
        &self,
        options: &PictureOptions,
        device: &Device,
        watchers: &mut Watchers<'_>,
        keep: Keep,
    ) -> Evolution {
        let _span = options.tracer.span("evolve").tell("picture", self.id.as_str());
        if let (Some(replay), Some(picture)) = (&options.replay, &self.picture) {
            return self.follow(replay, picture, device, (options, watchers));
        }
        let progress = Progress::new(options.progress, options.verbosity);
        let mut watch = Watch::begin(watchers, &options.settings, progress, self.job.evals_planned());
        let mut curve = (keep == Keep::Curve).then(|| Curve::new(self.job.evals_planned()));
        let mut course = options.tracer.course();
        let mut instruments = TraceInstruments::new(&options.tracer);
        let observers = &mut (&mut (&mut watch, &mut curve), &mut course);
        let evolved = studio::evolve(&self.job, device, observers, &mut instruments);
        let took = watch.finish();
        let stand_in = instruments.stand_in();
        say_stand_in(options, stand_in);
        let draw = |ended| Ok(Evolved { curve, ..self.draw_on(options, ended, device)? });
        Evolution { took, is_stand_in: stand_in.is_some(), outcome: evolved.and_then(draw) }
    }

    /// Follows a script, and draws its result. A signal leaves nothing: what the script says is whole, or nothing.
    fn follow(
        &self,
        replay: &Replay,
        picture: &Picture,
        device: &Device,
        (options, watchers): (&PictureOptions, &mut Watchers<'_>),
    ) -> Evolution {
        let progress = Progress::new(options.progress, options.verbosity);
        let mut watch = Watch::begin(watchers, &options.settings, progress, replay.evals_planned(&self.job));
        let followed = replay.follow(picture, device, &mut |session| watch.goes_on(|| session.stage_in_all()));
        let took = watch.finish();
        let mut is_stand_in = false;
        let ended = followed.and_then(|session| {
            let mut session = session.ok_or(Error::Interrupted)?;
            is_stand_in = session.stand_in().is_some();
            say_stand_in(options, session.stand_in());
            session.ended()
        });
        let outcome = ended.and_then(|ended| self.draw_on(options, ended, device));
        Evolution { took, is_stand_in, outcome }
    }

    /// Draws the result of an evolution on a device.
    fn draw_on(&self, options: &PictureOptions, ended: Ended, device: &Device) -> Result<Evolved> {
        let mut painter = options.tracer.painter(device.open_painter()?);
        let evolved = self.draw(options, ended, &mut *painter)?;
        drop(painter);
        device.check_validation()?;
        Ok(evolved)
    }

    /// Draws the result of an evolution.
    ///
    /// # Errors
    /// If the device fails, or if the mosaic is not what was scored.
    pub fn draw(&self, options: &PictureOptions, ended: Ended, painter: &mut dyn Painter) -> Result<Evolved> {
        let mut finished = finish(&self.job, ended, painter, options.output_long_side_px)?;
        let progress = Progress::new(options.progress, options.verbosity);
        outputs::draw(&mut finished.drawn, painter, destination::pieces(&options.outputs), progress)?;
        Ok(Evolved { ending: finished.ending, psnr_db: finished.psnr_db, drawn: finished.drawn, curve: None })
    }
}

/// Says that the CPU searched in the place of the device, if it did.
fn say_stand_in(options: &PictureOptions, reason: Option<&str>) {
    if let Some(reason) = reason.filter(|_| options.verbosity > Verbosity::Quiet) {
        terminal::say(&format!("smalti: searching on the CPU, since {reason}"));
    }
}

impl Row {
    /// Notes what is known about a picture once it has been read.
    pub fn note_prepared(&mut self, prepared: &Prepared, options: &PictureOptions) {
        self.load_ms = milliseconds(prepared.load_time);
        self.tiles = Some(prepared.job.fly_count);
        self.key = Some(prepared.of_row(options).key().to_owned());
    }

    /// Notes what an evolution took and what it led to, which is returned.
    ///
    /// # Errors
    /// If it failed.
    pub fn note_evolution(&mut self, Evolution { took, is_stand_in, outcome }: Evolution) -> Result<Evolved> {
        self.evolve_ms = milliseconds(took);
        if is_stand_in {
            self.device = Some("CPU".to_owned());
        }
        outcome.inspect(|evolved| self.note_evolved(evolved))
    }

    /// Notes the result of an evolution.
    pub fn note_evolved(&mut self, evolved: &Evolved) {
        self.note_population(&evolved.drawn.population);
        self.note_ending(&evolved.ending);
        self.psnr = evolved.psnr_db;
    }
}
