//! The trace of a command: what each thread and each device did when. It is a file of trace events, the JSON that
//! Perfetto and `chrome://tracing` open, and is written during the work.
//!
//! A [`Tracer`] is a handle, and any thread may have a copy of it. Without a file behind it, each use costs a branch.

use std::collections::HashMap;
use std::fmt::Debug;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::ThreadId;
use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};

use crate::error::Result;
use crate::output::PartialFile;

/// After this many events, some 150 MB, only stages are written, since there are few of them.
const EVENTS_MAX: u64 = 1_000_000;
/// Most events of any kind.
const STAGES_MAX: u64 = EVENTS_MAX + 100_000;
/// How our traces begin, which distinguishes them from other files.
pub(crate) const HEAD: &str = "{\"otherData\":{\"writer\":\"smalti ";
/// Number of this program among the processes of a trace. Devices have the numbers after it.
const PROGRAM: u32 = 1;

/// How frequent a kind of event is. This decides what a trace leaves out when it grows too large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weight {
    /// A few for each picture.
    Stage,
    /// Thousands for each picture.
    Frequent,
}

/// Where an event is shown: on a thread of a process, in the words of the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Track {
    process: u32,
    thread: u32,
}

/// Writes a trace, or nothing at all.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tracer {
    shared: Option<Arc<Shared>>,
}

#[derive(Debug)]
struct Shared {
    /// Time 0 of the trace.
    origin: Instant,
    log: Mutex<Log>,
}

/// The file and its state.
#[derive(Debug)]
struct Log {
    /// `None` once the trace is finished.
    file: Option<(PartialFile, BufWriter<File>)>,
    failure: Option<io::Error>,
    events: u64,
    left_out: u64,
    threads: HashMap<ThreadId, u32>,
    devices: u32,
    clocks: Map<String, Value>,
}

impl Tracer {
    /// A tracer whose file grows beside `path`, and gets that name once it is finished.
    ///
    /// # Errors
    /// [`crate::Error::Output`] if nothing can be written there.
    pub(crate) fn begin(path: &Path) -> Result<Self> {
        let partial = PartialFile::create(path)?;
        let mut writer = BufWriter::new(partial.writer()?);
        let head = format!("{HEAD}{}\"}},\"displayTimeUnit\":\"ms\",\"traceEvents\":[\n", env!("CARGO_PKG_VERSION"));
        let name = json!({"name": "process_name", "ph": "M", "pid": PROGRAM, "args": {"name": "smalti"}});
        write!(writer, "{head}{name}").map_err(|error| partial.failure(&error))?;
        let log = Log {
            file: Some((partial, writer)),
            failure: None,
            events: 1,
            left_out: 0,
            threads: HashMap::new(),
            devices: 0,
            clocks: Map::new(),
        };
        Ok(Self { shared: Some(Arc::new(Shared { origin: Instant::now(), log: Mutex::new(log) })) })
    }

    /// Whether there is a trace.
    pub(crate) fn is_on(&self) -> bool {
        self.shared.is_some()
    }

    /// Time since the trace began.
    pub(crate) fn now(&self) -> Duration {
        self.shared.as_ref().map_or(Duration::ZERO, |shared| shared.origin.elapsed())
    }

    /// A stage of this thread's work, from now until the span is dropped.
    pub(crate) fn span(&self, name: &'static str) -> Span<'_> {
        self.weighed_span(name, Weight::Stage)
    }

    /// As [`Tracer::span`], for steps that come by the thousand.
    pub(crate) fn frequent_span(&self, name: &'static str) -> Span<'_> {
        self.weighed_span(name, Weight::Frequent)
    }

    fn weighed_span(&self, name: &'static str, weight: Weight) -> Span<'_> {
        Span { tracer: self, name, weight, began: self.now(), told: Map::new() }
    }

    /// Something that this thread did between these times since the trace began. It must not overlap other spans of the
    /// thread, except by enclosing them.
    pub(crate) fn note(&self, name: &str, weight: Weight, times: Range<Duration>, told: Map<String, Value>) {
        let Some(mut log) = self.log() else { return };
        let track = log.track();
        let ns = times.end.saturating_sub(times.start).as_nanos() as u64;
        log.span(track, name, weight, Times { start_ns: times.start.as_nanos() as i64, ns }, told);
    }

    /// As [`Tracer::note`], for a pass of a device.
    pub(crate) fn note_pass(&self, track: Track, name: &str, times: Times, told: Map<String, Value>) {
        if let Some(mut log) = self.log() {
            log.span(track, name, Weight::Frequent, times, told);
        }
    }

    /// Sets a value that is shown as a curve.
    pub(crate) fn counter(&self, name: &str, value: f64) {
        let ts = self.now().as_nanos() as i64;
        let Some(mut log) = self.log() else { return };
        let told = Map::from_iter([(name.to_owned(), value.into())]);
        let track = Track { process: PROGRAM, thread: 0 };
        log.event(Weight::Frequent, &Event { name, phase: "C", track, ts, rest: String::new(), told });
    }

    /// A track for a device with this name.
    pub(crate) fn device_track(&self, name: &str) -> Option<Track> {
        let mut log = self.log()?;
        log.devices += 1;
        let track = Track { process: PROGRAM + log.devices, thread: 1 };
        log.name("process_name", track, &format!("GPU: {name}"));
        log.name("thread_name", track, "queue");
        Some(track)
    }

    /// Records how the clock of a device compares with that of the trace. `device` is its track.
    pub(crate) fn tell_clock(&self, device: Track, told: Value) {
        if let Some(mut log) = self.log() {
            log.clocks.insert(device.process.to_string(), told);
        }
    }

    /// Ends the trace and gives the file its name; returns the number of events. Later events are lost.
    ///
    /// # Errors
    /// [`crate::Error::Output`] if the trace could not be written.
    pub(crate) fn finish(&self) -> Result<u64> {
        let Some(mut log) = self.log() else { return Ok(0) };
        let Some((partial, mut writer)) = log.file.take() else { return Ok(log.events) };
        let told = json!({"events": log.events, "events_left_out": log.left_out, "clocks": log.clocks});
        let failure = log.failure.take();
        let written = failure.map_or(Ok(()), Err).and_then(|()| writeln!(writer, "\n],\"smalti\":{told}}}"));
        written.and_then(|()| writer.flush()).map_err(|error| partial.failure(&error))?;
        drop(writer);
        partial.commit().map(|()| log.events)
    }

    /// Ends the trace without a file, even if other threads still hold it.
    pub(crate) fn discard(&self) {
        if let Some(mut log) = self.log() {
            log.file = None;
        }
    }

    fn log(&self) -> Option<MutexGuard<'_, Log>> {
        Some(self.shared.as_ref()?.log.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// When something happened, and how long it took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Times {
    /// Nanoseconds since the trace began; negative before.
    pub start_ns: i64,
    pub ns: u64,
}

/// An event in the words of the format.
struct Event<'a> {
    name: &'a str,
    phase: &'static str,
    track: Track,
    /// Nanoseconds since the trace began.
    ts: i64,
    /// Fields of this kind of event, each with a comma before it.
    rest: String,
    told: Map<String, Value>,
}

impl Log {
    /// The track of this thread.
    fn track(&mut self) -> Track {
        let thread = std::thread::current();
        let next = self.threads.len() as u32 + 1;
        let known = *self.threads.entry(thread.id()).or_insert(next);
        let track = Track { process: PROGRAM, thread: known };
        if known == next {
            let name = thread.name().map_or_else(|| format!("thread {known}"), str::to_owned);
            self.name("thread_name", track, &name);
        }
        track
    }

    fn name(&mut self, what: &'static str, track: Track, name: &str) {
        let told = Map::from_iter([("name".to_owned(), name.into())]);
        self.event(Weight::Stage, &Event { name: what, phase: "M", track, ts: 0, rest: String::new(), told });
    }

    fn span(&mut self, track: Track, name: &str, weight: Weight, times: Times, told: Map<String, Value>) {
        let rest = format!(",\"dur\":{}", microseconds(times.ns as i64));
        self.event(weight, &Event { name, phase: "X", track, ts: times.start_ns, rest, told });
    }

    /// Writes an event unless there are too many.
    fn event(&mut self, weight: Weight, event: &Event<'_>) {
        let most = if weight == Weight::Stage { STAGES_MAX } else { EVENTS_MAX };
        if self.events >= most {
            if self.left_out == 0 {
                let name = "the trace is full: only stages follow";
                let rest = ",\"s\":\"g\"".to_owned();
                self.write(&Event { name, phase: "i", rest, told: Map::new(), ..*event });
            }
            self.left_out += 1;
            return;
        }
        self.write(event);
    }

    fn write(&mut self, Event { name, phase, track, ts, rest, told }: &Event<'_>) {
        let (Some((_, writer)), None) = (&mut self.file, &self.failure) else { return };
        let Track { process, thread } = track;
        let (name, ts) = (Value::from(*name), microseconds(*ts));
        let mut write = || {
            write!(
                writer,
                ",\n{{\"name\":{name},\"ph\":\"{phase}\",\"pid\":{process},\"tid\":{thread},\"ts\":{ts}{rest}"
            )?;
            if !told.is_empty() {
                write!(writer, ",\"args\":{}", json!(told))?;
            }
            writer.write_all(b"}")
        };
        self.failure = write().err();
        self.events += 1;
    }
}

/// Nanoseconds as the format wants them: as microseconds, with all digits.
fn microseconds(ns: i64) -> String {
    let sign = if ns < 0 { "-" } else { "" };
    format!("{sign}{}.{:03}", ns.unsigned_abs() / 1_000, ns.unsigned_abs() % 1_000)
}

/// A stage of a thread's work. It ends when this is dropped.
#[must_use]
#[derive(Debug)]
pub(crate) struct Span<'a> {
    tracer: &'a Tracer,
    name: &'static str,
    weight: Weight,
    began: Duration,
    told: Map<String, Value>,
}

impl Span<'_> {
    /// Adds a detail, such as the picture that the stage works on.
    pub(crate) fn tell(mut self, key: &str, value: impl Into<Value>) -> Self {
        if self.tracer.is_on() {
            self.told.insert(key.to_owned(), value.into());
        }
        self
    }
}

impl Drop for Span<'_> {
    fn drop(&mut self) {
        if self.tracer.is_on() {
            let told = std::mem::take(&mut self.told);
            self.tracer.note(self.name, self.weight, self.began..self.tracer.now(), told);
        }
    }
}
