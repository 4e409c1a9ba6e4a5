//! The one call that does the work.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use smalti::{Error, Mask, Recipe, WrittenRecipe};

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
    let recipe = recipe(words)?;
    let named = device.map(|device| &device.get().0);
    let mut watch = Watch::new(progress);
    let made = py.detach(|| -> Result<smalti::Mosaic, Error> {
        let picture = source.open()?;
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
enum Source {
    File(PathBuf),
    Pixels(smalti::Picture),
}

impl Source {
    fn of(picture: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(array) = picture.extract::<PyReadonlyArray3<'_, u8>>() {
            return picture::of_array(&array).map(Self::Pixels);
        }
        picture.extract::<PathBuf>().map(Self::File)
    }

    fn open(self) -> Result<smalti::Picture, Error> {
        match self {
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

fn recipe(words: &Bound<'_, PyDict>) -> PyResult<Recipe> {
    let mut words = Words(words, Vec::new());
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
        scheme: words.take("scheme")?,
        births: words.take("births")?,
        restarts: words.take("restarts")?,
        ..WrittenRecipe::default()
    };
    let palette = words.any("palette")?;
    let masks = words.any("mask")?;
    let weight = words.any("weight")?;
    let init = words.take::<PathBuf>("init")?;
    let of_paper = [
        words.take::<f64>("cool")?,
        words.take("p_mutation")?,
        words.take("p_crossover")?,
        words.take("new_blood")?,
        words.take("tile_scale")?,
    ];
    let (batch_births, mitosis) = (words.take::<u64>("batch_births")?, words.take::<u64>("mitosis")?);
    words.end()?;
    let [cool, p_mutation, p_crossover, new_blood, tile_scale] = of_paper;
    let mut recipe = written
        .recipe()
        .map_err(|error| exception(&error))?
        .set(init, Recipe::init_file)
        .set(cool, Recipe::cool)
        .set(p_mutation, Recipe::p_mutation)
        .set(p_crossover, Recipe::p_crossover)
        .set(new_blood, Recipe::new_blood)
        .set(tile_scale, Recipe::tile_scale)
        .set(batch_births, Recipe::batch_births)
        .set(mitosis, Recipe::mitosis);
    if let Some(palette) = palette {
        recipe = match palette.extract::<Vec<[u8; 3]>>() {
            Ok(colors) => recipe.palette(&colors),
            Err(_) => recipe.palette_file(palette.extract::<PathBuf>()?),
        };
    }
    if let Some(masks) = masks {
        recipe = recipe.masks(all_masks(&masks)?);
    }
    if let Some(weight) = weight {
        recipe = match weight.extract::<PyReadonlyArray2<'_, u8>>() {
            Ok(map) => recipe.weight_encoded(picture::map_of_array(&map)?),
            Err(_) => recipe.weight_file(weight.extract::<PathBuf>()?),
        };
    }
    Ok(recipe)
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
