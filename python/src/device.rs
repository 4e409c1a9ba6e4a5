//! What computes.

use std::sync::OnceLock;

use pyo3::prelude::*;

use crate::failure::exception;

/// What computes: opened once, and shared by any number of calls.
#[pyclass(frozen, module = "smalti")]
pub(crate) struct Device(pub smalti::Device);

#[pymethods]
impl Device {
    /// Opens the device of this name; without a name, the fastest that there is.
    #[new]
    #[pyo3(signature = (name=None))]
    fn new(py: Python<'_>, name: Option<&str>) -> PyResult<Self> {
        let opened = py.detach(|| match name {
            None | Some("auto") => smalti::Device::auto(),
            Some("cpu") => Ok(smalti::Device::cpu()),
            Some(name) => smalti::Device::named(name),
        });
        opened.map(Self).map_err(|error| exception(&error))
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        self.0.label()
    }

    /// Whether the processor computes, and no device.
    #[getter]
    fn is_cpu(&self) -> bool {
        self.0.is_cpu()
    }

    fn __repr__(&self) -> String {
        format!("<smalti.Device {:?}>", self.0.label())
    }
}

/// The named device; for calls that name none, one that the first of them opens.
pub(crate) fn or_usual(named: Option<&smalti::Device>) -> Result<&smalti::Device, smalti::Error> {
    static USUAL: OnceLock<smalti::Device> = OnceLock::new();
    if let Some(device) = named.or(USUAL.get()) {
        return Ok(device);
    }
    let opened = smalti::Device::auto()?;
    Ok(USUAL.get_or_init(|| opened))
}
