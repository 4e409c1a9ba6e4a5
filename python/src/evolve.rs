//! The one call that does the work.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::{PyBaseException, PyValueError};
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
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// Evolves a picture: a path, or an array of bytes. `words` are the flags of `smalti evolve`.
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
    let Wanted { recipe, is_lenient } = Wanted::of(words)?;
    let named = device.map(|device| &device.get().0);
    let mut watch = Watch::new(progress);
    let made = py.detach(|| -> Result<smalti::Mosaic, Error> {
        let picture = source.open(is_lenient)?;
        recipe.make(&picture, device::or_usual(named)?, |standing| watch.goes_on(standing))
    });
    match watch.raised {
        Some(raised) => Err(raised),
        None => {
            let made = made.map_err(|error| exception(&error))?;
            Ok(Mosaic(made, device.map(|device| device.clone().unbind())))
        }
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

/// Tells how far the work is, and looks for signals; the work itself knows nothing of Python.
struct Watch {
    progress: Option<Py<PyAny>>,
    called: Instant,
    looked: Instant,
    raised: Option<PyErr>,
}

impl Watch {
    fn new(progress: Option<Py<PyAny>>) -> Self {
        let now = Instant::now();
        Self { progress, called: now, looked: now, raised: None }
    }

    fn goes_on(&mut self, standing: &mut smalti::Progress<'_, '_>) -> bool {
        let now = Instant::now();
        if now.duration_since(self.looked) < BETWEEN_LOOKS {
            return true;
        }
        self.looked = now;
        let is_due = self.progress.is_some() && now.duration_since(self.called) >= BETWEEN_CALLS;
        let answer = Python::attach(|py| {
            py.check_signals()?;
            let Some(progress) = self.progress.as_ref().filter(|_| is_due) else { return Ok(true) };
            let answer = progress.call1(py, (standing.share(), standing.objective()))?;
            // A function without a result goes on.
            Ok(answer.is_none(py) || answer.bind(py).is_truthy()?)
        });
        if is_due {
            self.called = Instant::now();
        }
        answer.unwrap_or_else(|raised| {
            self.raised = Some(raised);
            false
        })
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
