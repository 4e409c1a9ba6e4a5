//! Errors of the library as exceptions of Python, with the same sentence.

use pyo3::PyErr;
use pyo3::exceptions::{PyMemoryError, PyOSError, PyRuntimeError, PyValueError};
use smalti::Error;

/// The exception for an error: `OSError` about files, `MemoryError`, `RuntimeError` about devices, else `ValueError`.
pub(crate) fn exception(error: &Error) -> PyErr {
    let sentence = error.to_string();
    match error {
        Error::Input { .. } | Error::Output { .. } => PyOSError::new_err(sentence),
        Error::OutOfMemory { .. } | Error::OutOfDeviceMemory { .. } => PyMemoryError::new_err(sentence),
        Error::NoSuitableDevice { .. } | Error::DeviceLost { .. } | Error::Vulkan { .. } | Error::Threads { .. } => {
            PyRuntimeError::new_err(sentence)
        }
        _ => PyValueError::new_err(sentence),
    }
}
