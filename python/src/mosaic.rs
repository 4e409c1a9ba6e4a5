//! A finished mosaic.

use std::path::PathBuf;

use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray1, PyArray3};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::device::{self, Device};
use crate::failure::exception;

/// A finished mosaic, and the device that was named to make it; `smalti.Mosaic` is around it.
#[pyclass(frozen, module = "smalti._smalti")]
pub(crate) struct Mosaic(pub smalti::Mosaic, pub Option<Py<Device>>);

#[pymethods]
impl Mosaic {
    #[getter]
    fn sae(&self) -> u64 {
        self.0.sae()
    }

    #[getter]
    fn objective(&self) -> i64 {
        self.0.objective()
    }

    #[getter]
    fn psnr(&self) -> f64 {
        self.0.psnr_db().unwrap_or(f64::INFINITY)
    }

    #[getter]
    fn evals(&self) -> u64 {
        self.0.evals()
    }

    #[getter]
    fn births(&self) -> u64 {
        self.0.births()
    }

    #[getter]
    fn stop_reason(&self) -> &str {
        self.0.stop_reason().word()
    }

    #[getter]
    fn key(&self) -> &str {
        self.0.key()
    }

    /// Width and height in px of the evolved picture.
    #[getter]
    fn size_px(&self) -> (u32, u32) {
        let population = self.0.population();
        (population.width_px, population.height_px)
    }

    /// The pixels, height x width x 3 or 4.
    fn pixels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let image = py.detach(|| self.0.image()).map_err(|error| exception(&error))?;
        let (bytes, channels) = match image.alpha {
            Some(_) => (image.rgba8(), 4),
            None => (image.rgb8().to_vec(), 3),
        };
        let shape = (image.height_px as usize, image.width_px as usize, channels);
        let pixels =
            Array3::from_shape_vec(shape, bytes).map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok(pixels.into_pyarray(py))
    }

    /// The same tiles drawn at another size.
    fn resized(&self, py: Python<'_>, long_side_px: u32) -> PyResult<Self> {
        let device = self.1.as_ref().map(|device| &device.get().0);
        let drawn = py.detach(|| self.0.resized(long_side_px, device::or_usual(device)?));
        let device = self.1.as_ref().map(|device| device.clone_ref(py));
        drawn.map(|drawn| Self(drawn, device)).map_err(|error| exception(&error))
    }

    /// Writes a file, whose ending tells the format.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.0.save(&path)).map_err(|error| exception(&error))
    }

    fn svg<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.0.svg()).map_err(|error| exception(&error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.0.png()).map_err(|error| exception(&error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// The population as a file of numpy.
    fn npz<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.0.npz()).map_err(|error| exception(&error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// A column for each number of a tile.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let tiles: Vec<smalti::Tile> = self.0.tiles().collect();
        let columns = PyDict::new(py);
        let reals = |of: &dyn Fn(&smalti::Tile) -> f32| PyArray1::from_iter(py, tiles.iter().map(of));
        columns.set_item("x", reals(&|tile| tile.center_px().0))?;
        columns.set_item("y", reals(&|tile| tile.center_px().1))?;
        columns.set_item("width", reals(&|tile| tile.size_px().0))?;
        columns.set_item("height", reals(&|tile| tile.size_px().1))?;
        columns.set_item("angle", reals(&|tile| tile.angle_deg()))?;
        columns.set_item("depth", reals(&|tile| tile.depth()))?;
        for (place, name) in ["r", "g", "b"].into_iter().enumerate() {
            columns.set_item(name, PyArray1::from_iter(py, tiles.iter().map(|tile| tile.rgb()[place])))?;
        }
        columns.set_item("mask", PyArray1::from_iter(py, tiles.iter().map(smalti::Tile::mask)))?;
        let fitness = tiles.iter().map(|tile| tile.fitness().unwrap_or_default());
        columns.set_item("fitness", PyArray1::from_iter(py, fitness))?;
        let index = tiles.iter().map(|tile| tile.index() as u64);
        columns.set_item("index", PyArray1::from_iter(py, index))?;
        Ok(columns)
    }
}
