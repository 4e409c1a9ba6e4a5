//! smalti for Python. What Python programmers see is written in `smalti/__init__.py`; here is what it is made of.

mod device;
mod evolve;
mod failure;
mod many;
mod mosaic;
mod picture;

use pyo3::prelude::*;

#[pymodule]
mod _smalti {
    #[pymodule_export]
    use super::device::Device;
    #[pymodule_export]
    use super::evolve::evolve;
    #[pymodule_export]
    use super::many::{Many, evolve_many};
    #[pymodule_export]
    use super::mosaic::Mosaic;
}
