//! Records an evolution: snapshots of its best population are encoded and written while it goes on.
//!
//! The number of evals (births in the paper's scheme) decides when a snapshot is taken, never the clock. So the same
//! command leaves the same files on every machine. A separate thread encodes and writes. The evolution copies its
//! flies, and waits if that thread falls behind, so memory stays flat.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use serde_json::{Map, Value, json};

use crate::cli::files::snapshots::SaveRun;
use crate::error::{Error, Result};
use crate::evolve::{Ending, Seen, Stage};
use crate::model::{Fly, Population};
use crate::{archive, output, threads};

/// How many snapshots may wait to be written.
const QUEUE_LENGTH: usize = 2;
/// The first snapshots are a fraction of their evals apart, one divided by this number: the picture changes fastest at
/// the beginning.
const EARLY_SHARE: u64 = 32;
/// The first snapshots are at least a fraction of the later distance apart, one divided by this number.
const EARLY_LEAST_SHARE: u64 = 64;

/// A population that the evolution passed through.
struct Passed {
    evals: u64,
    /// The metadata that only this snapshot has.
    told: Map<String, Value>,
    flies: Vec<Fly>,
}

/// Takes the snapshots of one evolution.
#[derive(Debug)]
pub(crate) struct Recorder {
    save_run: SaveRun,
    /// Evals between two snapshots, except at the beginning.
    every: u64,
    /// Number of evals at which the next one is due.
    due: u64,
    /// Number of evals at the last one.
    last: Option<u64>,
    /// The run that the last generation belonged to.
    run: u32,
    /// The number of evals at every snapshot.
    taken: BTreeSet<u64>,
    /// The key of the evolution.
    key: String,
    queue: Option<SyncSender<Passed>>,
    writer: Option<JoinHandle<Result<()>>>,
    /// The outcome of the thread that writes.
    written: Result<()>,
}

impl Recorder {
    /// Prepares the folder and begins to record. `stage` is the population without its flies, and `told` the metadata
    /// that all snapshots share.
    ///
    /// # Errors
    /// [`Error::Output`] if the folder cannot be made ready.
    pub(crate) fn begin(
        save_run: &SaveRun,
        evals_planned: u64,
        stage: Population,
        told: Map<String, Value>,
    ) -> Result<Self> {
        let key = told.get("key").and_then(Value::as_str).unwrap_or_default().to_owned();
        save_run.prepare(&key)?;
        let (queue, passed) = sync_channel::<Passed>(QUEUE_LENGTH);
        let writing = save_run.clone();
        let writer = threads::spawn("snapshots", move || {
            let (mut population, mut made) = (stage, Vec::new());
            let written = passed.into_iter().try_for_each(|passed| {
                let path = writing.path_of(passed.evals);
                let is_new = !path.exists();
                write(&path, &mut population, &told, passed)?;
                made.extend(is_new.then_some(path));
                Ok(())
            });
            written.map_err(|error| make_room(&writing.folder, &made, error))
        });
        Ok(Self {
            save_run: save_run.clone(),
            every: save_run.evals_between(evals_planned),
            due: 0,
            last: None,
            run: 0,
            taken: BTreeSet::new(),
            key,
            queue: Some(queue),
            writer: Some(writer?),
            written: Ok(()),
        })
    }

    /// Takes a snapshot if one is due, or if a run of the paper's scheme has ended.
    ///
    /// # Errors
    /// If the device fails.
    pub fn note(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        let stage = seen.stage();
        if stage.evals >= self.due || stage.restarts != self.run {
            self.take(seen)?;
            self.due = next_due(stage.evals, self.every);
        }
        self.run = stage.restarts;
        Ok(())
    }

    /// Takes the last snapshot and waits until all are written.
    ///
    /// # Errors
    /// If the device fails.
    pub fn finish(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        // The result of a search has its depths spread, which a snapshot of the same evals may have missed. In the
        // paper's scheme the best population is the same.
        if matches!(seen, Seen::Search(_)) {
            self.last = None;
        }
        let taken = self.take(seen);
        self.close();
        taken
    }

    fn close(&mut self) {
        self.queue = None;
        if let Some(writer) = self.writer.take() {
            let ended = |_| Err(Error::Internal("the thread that writes snapshots ended".to_owned()));
            self.written = writer.join().unwrap_or_else(ended);
        }
    }

    /// The folder, if all snapshots are in it. Call it after [`Recorder::finish`]. After a whole evolution, nothing is
    /// left of the ends of interrupted ones: the folder is as if nothing had disturbed it.
    ///
    /// # Errors
    /// The error of the first snapshot that could not be written.
    pub(crate) fn outcome(self, ending: &Ending) -> Result<String> {
        self.written?;
        if ending.is_complete() {
            self.save_run.keep_only(&self.taken, &self.key)?;
        }
        Ok(self.save_run.folder.display().to_string())
    }

    fn take(&mut self, seen: &mut Seen<'_>) -> Result<()> {
        let Stage { evals, births, error, .. } = seen.stage();
        // A due snapshot may coincide with the end of a run. If the best population begins anew there, the next
        // snapshot keeps it.
        if self.last.replace(evals) == Some(evals) {
            return Ok(());
        }
        self.taken.insert(evals);
        let sae = seen.sae()?;
        let told = match seen {
            Seen::Evolutions(_) => json!({ "births": births, "run": self.run, "sae": sae }),
            Seen::Search(_) => json!({ "evals": evals, "births": births, "objective": error, "sae": sae }),
        };
        self.send(evals, told, seen.best_flies()?);
        Ok(())
    }

    fn send(&mut self, evals: u64, told: Value, flies: Vec<Fly>) {
        let Value::Object(told) = told else { return };
        let passed = Passed { evals, told, flies };
        // The writer ends at its first failure, which is in `outcome`. The evolution goes on, since it is worth more
        // than its snapshots.
        self.queue = self.queue.take().filter(|queue| queue.send(passed).is_ok());
    }
}

/// The number of evals at which the next snapshot is due, after one at `evals`: at every multiple of `every`, and
/// closer together while a 32nd of the evals is less than that.
fn next_due(evals: u64, every: u64) -> u64 {
    let early = (evals / EARLY_SHARE).clamp((every / EARLY_LEAST_SHARE).max(1), every);
    let multiple = (evals / every).saturating_add(1).saturating_mul(every);
    multiple.min(evals.saturating_add(early))
}

/// If the disk is full, removes the snapshots that were `made`, since the result of the evolution needs room, too.
/// Returns `error`, or a better one.
fn make_room(folder: &Path, made: &[PathBuf], error: Error) -> Error {
    if !output::is_disk_full(&error) {
        return error;
    }
    let removed = made.iter().filter(|path| std::fs::remove_file(path).is_ok()).count();
    let reason = format!(
        "the disk is full, and the {removed} new snapshots were removed to leave room for the result; free some space, or \
         name a folder on another disk"
    );
    Error::output(folder, reason)
}

fn write(path: &Path, population: &mut Population, told: &Map<String, Value>, passed: Passed) -> Result<()> {
    let mut told = told.clone();
    told.insert("status".to_owned(), "snapshot".into());
    told.extend(passed.told);
    told.sort_keys();
    population.flies = passed.flies;
    output::write_atomically_soon(path, &archive::encode_snapshot(population, &told)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evolve::evolution::random_population;
    use crate::evolve::{Evolution, PaperScheme};
    use crate::model::MaskSet;

    fn dues(every: u64, births: u64) -> Vec<u64> {
        std::iter::successors(Some(0), |&due| Some(next_due(due, every))).take_while(|&due| due <= births).collect()
    }

    #[test]
    fn snapshots_come_at_every_multiple_and_closer_together_at_the_beginning() {
        let dues = dues(4_000, 400_000);
        assert!((1..=100).all(|k| dues.contains(&(k * 4_000))));
        assert!(dues.windows(2).all(|pair| pair[1] - pair[0] <= (pair[0] / 32).clamp(62, 4_000)));
        assert!(dues.iter().filter(|&&due| due > 128_000).all(|due| due % 4_000 == 0));
        assert!((230..=260).contains(&dues.len()), "{}", dues.len());
    }

    #[test]
    fn few_births_are_all_kept_and_many_do_not_overflow() {
        assert_eq!(dues(1, 5), [0, 1, 2, 3, 4, 5]);
        assert_eq!(next_due(u64::MAX - 1, u64::MAX), u64::MAX);
        assert_eq!(next_due(u64::MAX, 3), u64::MAX);
    }

    #[test]
    fn a_snapshot_that_cannot_be_written_is_told_at_the_end_and_stops_nothing() {
        let workshop = tempfile::tempdir().expect("a temporary folder");
        let folder = workshop.path().join("run");
        let save_run = SaveRun::new(&folder, Some(1)).expect("it is fine");
        let stage = Population {
            width_px: 9,
            height_px: 9,
            background: [0; 3].into(),
            grout: None,
            masks: MaskSet::default(),
            flies: Vec::new(),
        };
        let mut recorder = Recorder::begin(&save_run, 10, stage, Map::new()).expect("the folder is made");
        std::fs::remove_dir(&folder).expect("it is empty");
        let evolution = Evolution::new(PaperScheme::default(), 0, 9, 9, random_population(9, 9, 5, 0));
        let evolutions = [evolution];
        recorder.note(&mut Seen::Evolutions(&evolutions)).expect("there is no device");
        recorder.finish(&mut Seen::Evolutions(&evolutions)).expect("there is no device");
        let sentence = recorder.written.expect_err("there is no folder").to_string();
        assert!(sentence.contains("000000000000.npz: its folder does not exist"), "{sentence}");
    }
}
