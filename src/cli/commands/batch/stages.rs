//! The forms of a picture at each stage of a batch, and what all threads share.

use std::sync::Arc;
use std::sync::mpsc::{Sender, SyncSender};

use rayon::ThreadPool;

use super::earlier::Earlier;
use super::gate::{Gate, Permit};
use super::orphans::Orphans;
use super::schedule::Schedule;
use crate::cli::args::computing::OnDeviceLost;
use crate::cli::files::destination::Destination;
use crate::cli::jobs::options::PictureOptions;
use crate::cli::jobs::prepared::{Evolved, Keep, Prepared};
use crate::cli::jobs::row::Row;
use crate::cli::jobs::watch::Watchers;
use crate::cli::list::shard::Shard;
use crate::cli::list::{IoThreads, Item, OnExists};
use crate::cli::terminal::aside::unless_it_panics;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::trace::Tracer;
use crate::error::Error;
use crate::evolve::Ending;
use crate::output;
use crate::studio::{Device, Drawn};

/// A device that evolves pictures, and how it evolves several at the same time.
pub(super) struct Worker {
    pub device: Device,
    pub in_flight: InFlight,
}

/// How several pictures evolve at the same time.
pub(super) enum InFlight {
    /// Each picture has its own pool of threads. In a common pool, a thread that waits for others might begin
    /// another whole picture.
    Pools(Vec<ThreadPool>),
    /// As lanes of the device, at most this many.
    Lanes(usize),
}

/// What all threads of a batch share.
pub(super) struct Pipeline<'a> {
    pub items: &'a [Item],
    pub workers: &'a [Worker],
    /// How many threads read, and how many save.
    pub io_threads: IoThreads,
    pub on_exists: OnExists,
    /// What earlier rows tell of results.
    pub earlier: &'a Earlier,
    pub shard: Option<Shard>,
    pub schedule: &'a Schedule,
    pub gate: &'a Gate,
    pub on_device_lost: OnDeviceLost,
    pub interrupt: &'a Interrupt,
    /// Records what all threads do.
    pub tracer: &'a Tracer,
}

/// What threads report: a row for every picture that was not interrupted, and further messages.
pub(super) enum Report {
    Row(Box<Row>),
    /// A result of other options was replaced.
    Replaced,
    Warning(String),
    /// A failure that all further pictures would share.
    Fatal(Error),
}

/// The work on a picture.
pub(super) struct Work<'a> {
    pub options: PictureOptions,
    pub prepared: Prepared,
    pub to_write: Vec<Destination>,
    /// Whether a result of other options is replaced.
    pub replaces: bool,
    /// The memory that it may use until it is saved.
    pub permit: Permit<'a>,
}

/// A picture that waits to be evolved.
pub(super) struct Ready<'a> {
    pub item: &'a Item,
    pub work: Work<'a>,
    pub row: Row,
}

/// A picture that waits to be saved.
pub(super) struct Done<'a> {
    pub ready: Ready<'a>,
    pub ending: Ending,
    pub drawn: Drawn,
}

/// Where a thread that evolves sends what becomes of its pictures.
#[derive(Clone)]
pub(super) struct Outlets<'a> {
    pub done: SyncSender<Done<'a>>,
    pub reports: Sender<Report>,
    /// Pictures of devices that were lost.
    pub orphans: Arc<Orphans<Ready<'a>>>,
}

impl<'a> Pipeline<'a> {
    /// The row of a picture whose work begins.
    pub(super) fn row(&self, item: &Item) -> Row {
        let mut row = Row::new(&item.input, item.seed(), item.scheme());
        row.id.clone_from(&item.id);
        row.shard = self.shard.map(|shard| shard.to_string());
        row
    }

    /// Evolves a picture to its end, on the threads of a pool if there is one. If the device is lost, the picture comes
    /// back.
    pub(super) fn evolve_one(
        &self,
        device: &Device,
        pool: Option<&ThreadPool>,
        mut picture: Ready<'a>,
        outlets: &Outlets<'a>,
    ) -> Option<(Ready<'a>, Error)> {
        let Ready { work: Work { options, prepared, .. }, row, .. } = &mut picture;
        row.device = Some(device.label().to_owned());
        let evolve = || {
            let mut watchers = Watchers { interrupt: self.interrupt, recorder: None };
            prepared.evolve(options, device, &mut watchers, Keep::Nothing)
        };
        let evolution = unless_it_panics(|| {
            Ok(match pool {
                Some(pool) => pool.install(evolve),
                None => evolve(),
            })
        });
        match evolution.and_then(|evolution| row.note_evolution(evolution)) {
            // An interrupted picture leaves no files.
            Ok(Evolved { ending, .. }) if !ending.is_complete() => self.schedule.end(),
            Ok(Evolved { ending, drawn, .. }) => drop(outlets.done.send(Done { ready: picture, ending, drawn })),
            Err(error @ Error::DeviceLost { .. }) => return Some((picture, error)),
            Err(error) => self.fail(picture.row, error, &outlets.reports),
        }
        None
    }

    /// Reports that a picture failed, and whether all others would fail, too.
    pub(super) fn fail(&self, mut row: Row, error: Error, reports: &Sender<Report>) {
        row.note_failure(&error);
        row.output.clear();
        let is_fatal = matches!(error, Error::DeviceLost { .. }) || output::is_disk_full(&error);
        if is_fatal {
            let _ = reports.send(Report::Fatal(error));
        }
        tell(reports, row);
    }
}

/// Reports the row of a picture. The send cannot fail: the receiver listens until the last sender is gone.
pub(super) fn tell(reports: &Sender<Report>, mut row: Row) {
    row.note_end();
    let _ = reports.send(Report::Row(Box::new(row)));
}
