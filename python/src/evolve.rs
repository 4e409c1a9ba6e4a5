//! The one call that does the work.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::{PyBaseException, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use smalti::{Error, Mask, OnDry, Recipe, WrittenRecipe};

use crate::device::{self, Device};
use crate::failure::exception;
use crate::mosaic::Mosaic;
use crate::picture;

/// Time between two calls of `progress`: about ten a second.
const BETWEEN_CALLS: Duration = Duration::from_millis(100);
/// Time between two looks for a signal.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// How long an interrupted call waits for its work to end. A round of a large picture may take longer, and then ends
/// by itself.
pub(crate) const ENDING_MAX: Duration = Duration::from_millis(100);

/// Evolves a picture: a path, or an array of bytes. `words` are the flags of `smalti evolve`.
///
/// The work has a thread of its own, so that a signal is heard at any time, whatever the work is at.
#[pyfunction]
#[pyo3(signature = (picture, words, device=None, progress=None))]
pub(crate) fn evolve(
    py: Python<'_>,
    picture: &Bound<'_, PyAny>,
    words: &Bound<'_, PyDict>,
    device: Option<&Bound<'_, Device>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Mosaic> {
    let source = Source::of(picture)?;
    let wanted = Wanted::of(words)?;
    let device = device.map(|device| device.clone().unbind());
    let watch = Arc::new(Watch::default());
    let (sender, made) = channel();
    let work = {
        let (watch, device, is_watched) =
            (Arc::clone(&watch), device.as_ref().map(|one| one.clone_ref(py)), progress.is_some());
        move || {
            let named = device.as_ref().map(|device| &device.get().0);
            let mut told = Instant::now();
            let made = source.open(wanted.is_lenient).and_then(|picture| {
                wanted.recipe.make(&picture, device::or_usual(named)?, |standing| {
                    if is_watched && told.elapsed() >= BETWEEN_CALLS {
                        told = Instant::now();
                        watch.tell((standing.share(), standing.objective()));
                    }
                    !watch.is_over.load(Ordering::Relaxed)
                })
            });
            // Nobody may wait for it any more.
            let _ = sender.send(made);
        }
    };
    let started = std::thread::Builder::new().name("smalti".to_owned()).spawn(work);
    started.map_err(|error| PyRuntimeError::new_err(format!("no thread can be started: {error}")))?;
    // A receiver is for one thread, and Python is let go while this one waits.
    let made = Mutex::new(made);
    let wait = |time| py.detach(|| made.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(time));
    loop {
        match wait(BETWEEN_LOOKS) {
            Ok(made) => return Ok(Mosaic(made.map_err(|error| exception(&error))?, device)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("a thread of smalti has panicked"));
            }
        }
        if let Err(raised) = watch.look(py, progress.as_ref()) {
            watch.is_over.store(true, Ordering::Relaxed);
            let _ = wait(ENDING_MAX);
            return Err(raised);
        }
    }
}

/// What the thread that works and the one that waits tell each other.
#[derive(Default)]
struct Watch {
    /// Whether the work is to end.
    is_over: AtomicBool,
    /// How far it is, and its error, unless that was fetched.
    standing: Mutex<Option<(f64, i64)>>,
}

impl Watch {
    fn tell(&self, standing: (f64, i64)) {
        *self.standing.lock().unwrap_or_else(PoisonError::into_inner) = Some(standing);
    }

    /// Looks for signals, and tells Python how far the work is where that is new. Fails with what Python raised.
    fn look(&self, py: Python<'_>, progress: Option<&Py<PyAny>>) -> PyResult<()> {
        py.check_signals()?;
        let standing = self.standing.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let (Some(progress), Some(standing)) = (progress, standing) {
            let answer = progress.call1(py, standing)?;
            // A function without a result goes on.
            if !answer.is_none(py) && !answer.bind(py).is_truthy()? {
                self.is_over.store(true, Ordering::Relaxed);
            }
        }
        Ok(())
    }
}

/// Where a picture comes from.
pub(crate) enum Source {
    File(PathBuf),
    Pixels(smalti::Picture),
}

impl Source {
    /// What `smalti/__init__.py` hands over: an array, a path, or why it is neither.
    pub(crate) fn of(picture: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(array) = picture.extract::<PyReadonlyArray3<'_, u8>>() {
            return picture::of_array(&array).map(Self::Pixels);
        }
        if picture.is_instance_of::<PyBaseException>() {
            return Err(PyErr::from_value(picture.clone()));
        }
        picture.extract::<PathBuf>().map(Self::File)
    }

    pub(crate) fn open(self, is_lenient: bool) -> Result<smalti::Picture, Error> {
        match self {
            Self::File(path) if is_lenient => smalti::Picture::open_lenient(path),
            Self::File(path) => smalti::Picture::open(path),
            Self::Pixels(picture) => Ok(picture),
        }
    }
}

/// Takes words one after the other; what is left at the end is no flag.
struct Words<'a, 'py>(&'a Bound<'py, PyDict>, Vec<&'static str>);

impl<'py> Words<'_, 'py> {
    fn any(&mut self, name: &'static str) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.1.push(name);
        Ok(self.0.get_item(name)?.filter(|value| !value.is_none()))
    }

    fn take<T: for<'a> FromPyObject<'a, 'py>>(&mut self, name: &'static str) -> PyResult<Option<T>> {
        let Some(value) = self.any(name)? else { return Ok(None) };
        value.extract::<T>().map(Some).map_err(|_| {
            let shown = value.repr().map_or_else(|_| "this".to_owned(), |shown| shown.to_string());
            PyValueError::new_err(format!("{name}: {shown} has a wrong type or is out of range"))
        })
    }

    /// Refuses what no flag is named.
    fn end(self) -> PyResult<()> {
        for name in self.0.keys() {
            let name: String = name.extract()?;
            if !self.1.contains(&name.as_str()) {
                let known = self.1.join(", ");
                return Err(PyValueError::new_err(format!("there is no {name}; there are {known}")));
            }
        }
        Ok(())
    }
}

/// What the words ask for.
pub(crate) struct Wanted {
    pub(crate) recipe: Recipe,
    /// Whether to take what is there of a file that is cut short.
    pub(crate) is_lenient: bool,
}

impl Wanted {
    /// The meaning of the words.
    ///
    /// # Errors
    /// About the first that is unknown, of a wrong type or out of range.
    pub(crate) fn of(words: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut words = Words(words, Vec::new());
        let preset = words.any("preset")?.map(|preset| of_preset(&preset)).transpose()?;
        let scheme_of_preset = preset.as_ref().map(|preset| preset.scheme_chosen().to_string());
        let written = WrittenRecipe {
            style: words.take("style")?,
            tiles: words.take("tiles")?,
            size: words.take("size")?,
            seed: words.take("seed")?,
            evals: words.take("evals")?,
            candidates: words.take("candidates")?,
            patience: words.take("patience")?,
            target_sae: words.take("target_sae")?,
            colors: words.take("colors")?,
            color_mode: words.take("color_mode")?,
            background: words.take("background")?,
            shader: words.take("shader")?,
            blend: words.take("blend")?,
            opacity: words.take("opacity")?,
            grout: words.take("grout")?,
            grout_width: words.take("grout_width")?,
            scheme: words.take("scheme")?.or(scheme_of_preset),
            births: words.take("births")?,
            restarts: words.take("restarts")?,
            ..WrittenRecipe::default()
        };
        let further = Further::of(&mut words)?;
        let is_lenient = words.take("lenient")?.unwrap_or(false);
        words.end()?;
        let recipe = further.added_to(written.recipe().map_err(|error| exception(&error))?)?;
        let recipe = if is_lenient { recipe.lenient() } else { recipe };
        Ok(Self { recipe: recipe.set(preset.as_ref(), Recipe::over), is_lenient })
    }
}

/// A style, a scheme of the paper, or a file of the user's own.
fn of_preset(preset: &Bound<'_, PyAny>) -> PyResult<Recipe> {
    let path: PathBuf = preset.extract()?;
    let is_file = path.extension().is_some_and(|ending| ending == "toml");
    let read = if is_file { Recipe::from_preset_file(&path) } else { Recipe::named(&path.to_string_lossy()) };
    read.map_err(|error| exception(&error))
}

/// What a written recipe does not hold, or only as text.
struct Further<'py> {
    palette: Option<Bound<'py, PyAny>>,
    masks: Option<Bound<'py, PyAny>>,
    restart_masks: Option<Bound<'py, PyAny>>,
    weight: Option<Bound<'py, PyAny>>,
    init: Option<Bound<'py, PyAny>>,
    on_dry: Option<String>,
    no_rotation: Option<bool>,
    cool: Option<f64>,
    p_mutation: Option<f64>,
    p_crossover: Option<f64>,
    new_blood: Option<f64>,
    tile_scale: Option<f64>,
    batch_births: Option<u64>,
    mitosis: Option<u64>,
}

impl<'py> Further<'py> {
    fn of(words: &mut Words<'_, 'py>) -> PyResult<Self> {
        Ok(Self {
            palette: words.any("palette")?,
            masks: words.any("mask")?,
            restart_masks: words.any("restart_mask")?,
            weight: words.any("weight")?,
            init: words.any("init")?,
            on_dry: words.take("on_dry")?,
            no_rotation: words.take("no_rotation")?,
            cool: words.take("cool")?,
            p_mutation: words.take("p_mutation")?,
            p_crossover: words.take("p_crossover")?,
            new_blood: words.take("new_blood")?,
            tile_scale: words.take("tile_scale")?,
            batch_births: words.take("batch_births")?,
            mitosis: words.take("mitosis")?,
        })
    }

    fn added_to(self, recipe: Recipe) -> PyResult<Recipe> {
        let mut recipe = recipe
            .set(self.cool, Recipe::cool)
            .set(self.p_mutation, Recipe::p_mutation)
            .set(self.p_crossover, Recipe::p_crossover)
            .set(self.new_blood, Recipe::new_blood)
            .set(self.tile_scale, Recipe::tile_scale)
            .set(self.batch_births, Recipe::batch_births)
            .set(self.mitosis, Recipe::mitosis)
            .set(self.on_dry.as_deref().map(on_dry).transpose()?, Recipe::on_dry);
        if self.no_rotation == Some(true) {
            recipe = recipe.no_rotation();
        }
        if let Some(palette) = self.palette {
            recipe = match palette.extract::<Vec<[u8; 3]>>() {
                Ok(colors) => recipe.palette(&colors),
                Err(_) => recipe.palette_file(palette.extract::<PathBuf>()?),
            };
        }
        if let Some(masks) = self.masks {
            recipe = recipe.masks(all_masks(&masks)?);
        }
        if let Some(masks) = self.restart_masks {
            recipe = recipe.restart_masks(all_masks(&masks)?);
        }
        if let Some(weight) = self.weight {
            recipe = match weight.extract::<PyReadonlyArray2<'_, u8>>() {
                Ok(map) => recipe.weight_encoded(picture::map_of_array(&map)?),
                Err(_) => recipe.weight_file(weight.extract::<PathBuf>()?),
            };
        }
        if let Some(init) = self.init {
            recipe = match init.cast::<Mosaic>() {
                Ok(mosaic) => recipe.init(mosaic.get().0.population().clone()),
                Err(_) => recipe.init_file(init.extract::<PathBuf>()?),
            };
        }
        Ok(recipe)
    }
}

fn on_dry(word: &str) -> PyResult<OnDry> {
    Ok(match word {
        "fallback" => OnDry::Fallback,
        "restart" => OnDry::Restart,
        "stop" => OnDry::Stop,
        _ => {
            return Err(PyValueError::new_err(format!(
                "on_dry: there is no {word}; there are fallback, restart, stop"
            )));
        }
    })
}

/// One mask, or a mix.
fn all_masks(masks: &Bound<'_, PyAny>) -> PyResult<Vec<Mask>> {
    let is_one = masks.is_instance_of::<PyString>() || masks.is_instance_of::<PyBytes>();
    if is_one || !masks.hasattr("__iter__")? {
        return Ok(vec![mask(masks)?]);
    }
    masks.try_iter()?.map(|one| mask(&one?)).collect()
}

/// The name of a shape, a path, or the bytes of a file.
fn mask(one: &Bound<'_, PyAny>) -> PyResult<Mask> {
    let made = if let Ok(bytes) = one.cast::<PyBytes>() {
        Mask::from_encoded(bytes.as_bytes())
    } else {
        let path: PathBuf = one.extract()?;
        // Names of shapes have no ending.
        let is_name = one.is_instance_of::<PyString>() && path.extension().is_none();
        if is_name { Mask::named(&path.to_string_lossy()) } else { Mask::from_file(path) }
    };
    made.map_err(|error| exception(&error))
}
