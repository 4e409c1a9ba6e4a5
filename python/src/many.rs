//! Many pictures at once: a thread of ours makes them, and Python takes them as they end.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator};
use smalti::{Error, Recipe, make_all};

use crate::device::{self, Device};
use crate::evolve::{ENDING_MAX, Source, Wanted};
use crate::failure::exception;
use crate::mosaic::Mosaic;

/// Time between two looks for a signal.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);
/// Time between two looks whether the work has ended.
const BETWEEN_CHECKS: Duration = Duration::from_millis(5);
/// How long an end waits for an iterator that gives no next picture, such as one that reads an empty queue.
const READING_MAX: Duration = Duration::from_secs(1);
/// Mosaics that are finished and not taken yet, at most.
const WAITING_MAX: usize = 16;

/// What became of a picture, by its number.
type Made = (usize, Result<smalti::Mosaic, PyErr>);

/// Mosaics as they end: an iterator of their numbers with what became of them.
#[pyclass(frozen, weakref, module = "smalti._smalti")]
pub(crate) struct Many {
    made: Mutex<Option<Receiver<Made>>>,
    worker: Mutex<Option<JoinHandle<PyResult<()>>>>,
    is_over: Arc<AtomicBool>,
    /// Whether a signal came while Python waited.
    is_interrupted: AtomicBool,
    /// Whether the iterator of Python is asked for a picture.
    is_reading: Arc<AtomicBool>,
    device: Option<Py<Device>>,
}

/// Begins to make mosaics of the pictures that `pictures` gives, a path or an array each.
#[pyfunction]
#[pyo3(signature = (pictures, words, device=None))]
pub(crate) fn evolve_many(
    py: Python<'_>,
    pictures: &Bound<'_, PyIterator>,
    words: &Bound<'_, PyDict>,
    device: Option<&Bound<'_, Device>>,
) -> PyResult<Many> {
    let wanted = Wanted::of(words)?;
    let device = device.map(|device| device.clone().unbind());
    let is_over = Arc::new(AtomicBool::new(false));
    let is_reading = Arc::new(AtomicBool::new(false));
    let (sender, made) = sync_channel(WAITING_MAX);
    let worker = Worker {
        pictures: Pictures {
            pictures: pictures.clone().unbind(),
            wanted,
            count: 0,
            is_reading: Arc::clone(&is_reading),
            refused: Arc::default(),
            raised: Arc::default(),
        },
        device: device.as_ref().map(|device| device.clone_ref(py)),
        is_over: Arc::clone(&is_over),
        sender,
    };
    let started = std::thread::Builder::new().name("smalti".to_owned()).spawn(move || worker.work());
    let worker = started.map_err(|error| PyRuntimeError::new_err(format!("no thread can be started: {error}")))?;
    Ok(Many {
        made: Mutex::new(Some(made)),
        worker: Mutex::new(Some(worker)),
        is_over,
        is_interrupted: AtomicBool::new(false),
        is_reading,
        device,
    })
}

#[pymethods]
impl Many {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    /// The next one that ends: its number, and a mosaic or an exception.
    fn __next__(&self, py: Python<'_>) -> PyResult<Option<(usize, Py<PyAny>)>> {
        loop {
            let next = py.detach(|| {
                let made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
                made.as_ref().map_or(Err(RecvTimeoutError::Disconnected), |made| made.recv_timeout(BETWEEN_LOOKS))
            });
            match next {
                Ok((number, Ok(mosaic))) => {
                    let device = self.device.as_ref().map(|device| device.clone_ref(py));
                    return Ok(Some((number, Py::new(py, Mosaic(mosaic, device))?.into_any())));
                }
                Ok((number, Err(raised))) => return Ok(Some((number, raised.into_value(py).into_any()))),
                Err(RecvTimeoutError::Timeout) => py.check_signals().inspect_err(|_| {
                    self.is_interrupted.store(true, Ordering::Relaxed);
                })?,
                Err(RecvTimeoutError::Disconnected) => return self.close(py).map(|()| None),
            }
        }
    }

    /// Ends the work, and waits until it has ended. It does not wait long after a signal, or for an iterator that gives
    /// no next picture.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.is_over.store(true, Ordering::Relaxed);
        // Without a receiver nobody waits to hand something over.
        py.detach(|| drop(self.made.lock().unwrap_or_else(PoisonError::into_inner).take()));
        let Some(worker) = self.worker.lock().unwrap_or_else(PoisonError::into_inner).take() else { return Ok(()) };
        let (closed, mut read_since) = (Instant::now(), None);
        while !worker.is_finished() {
            py.detach(|| std::thread::sleep(BETWEEN_CHECKS));
            py.check_signals()?;
            if self.is_interrupted.load(Ordering::Relaxed) && closed.elapsed() > ENDING_MAX {
                return Ok(());
            }
            if !self.is_reading.load(Ordering::Relaxed) {
                read_since = None;
            } else if read_since.get_or_insert_with(Instant::now).elapsed() > READING_MAX {
                return Ok(());
            }
        }
        let panicked = |_| Err(PyRuntimeError::new_err("a thread of smalti has panicked"));
        worker.join().unwrap_or_else(panicked)
    }
}

impl Drop for Many {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}

/// The thread that makes them.
struct Worker {
    pictures: Pictures,
    device: Option<Py<Device>>,
    is_over: Arc<AtomicBool>,
    sender: SyncSender<Made>,
}

impl Worker {
    fn work(self) -> PyResult<()> {
        let Self { pictures, device, is_over, sender } = self;
        let (refused, raised) = (Arc::clone(&pictures.refused), Arc::clone(&pictures.raised));
        let named = device.as_ref().map(|device| &device.get().0);
        let hand_over = |number: usize, made: Result<smalti::Mosaic, Error>| {
            let reason = refused.lock().unwrap_or_else(PoisonError::into_inner).remove(&number);
            let made = made.map_err(|error| reason.unwrap_or_else(|| exception(&error)));
            sender.send((number, made)).is_ok()
        };
        let goes_on = || !is_over.load(Ordering::Relaxed);
        let ended = device::or_usual(named).and_then(|device| make_all(device, pictures, goes_on, hand_over));
        match raised.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(raised) => Err(raised),
            None => ended.map_err(|error| exception(&error)),
        }
    }
}

/// The pictures, read as they are needed.
struct Pictures {
    pictures: Py<PyIterator>,
    wanted: Wanted,
    count: usize,
    is_reading: Arc<AtomicBool>,
    /// Why pictures were refused that are none, by their number.
    refused: Arc<Mutex<HashMap<usize, PyErr>>>,
    /// What the iterator of Python raised.
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Iterator for Pictures {
    type Item = Result<(smalti::Picture, Recipe), Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.is_reading.store(true, Ordering::Relaxed);
        // An interpreter that is about to end gives nothing more.
        let source = Python::try_attach(|py| {
            let next = self.pictures.bind(py).clone().next()?;
            match next {
                Ok(picture) => Some(Source::of(&picture)),
                Err(raised) => {
                    *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
                    None
                }
            }
        });
        self.is_reading.store(false, Ordering::Relaxed);
        let source = source??;
        let number = self.count;
        self.count += 1;
        Some(match source {
            Ok(source) => source.open(self.wanted.is_lenient).map(|picture| (picture, self.wanted.recipe.clone())),
            Err(reason) => {
                self.refused.lock().unwrap_or_else(PoisonError::into_inner).insert(number, reason);
                Err(Error::Internal("it is no picture".to_owned()))
            }
        })
    }
}
