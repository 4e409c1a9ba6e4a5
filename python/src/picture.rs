//! Pictures and maps from arrays, whose shapes `smalti/__init__.py` has checked.

use std::io::Cursor;

use image::{ImageFormat, ImageResult, Luma};
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::failure::exception;

/// The picture in an array of height x width x 3 or 4 bytes.
pub(crate) fn of_array(array: &PyReadonlyArray3<'_, u8>) -> PyResult<smalti::Picture> {
    let &[height, width, channels] = array.shape() else { return Err(PyValueError::new_err("not three axes")) };
    let bytes: Vec<u8> = array.as_array().iter().copied().collect();
    let [width, height] = [width, height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    let picture = match channels {
        3 => smalti::Picture::from_rgb8(width, height, &bytes),
        4 => smalti::Picture::from_rgba8(width, height, &bytes),
        _ => return Err(PyValueError::new_err(format!("picture: has {channels} channels, and needs 3 or 4"))),
    };
    picture.map_err(|error| exception(&error))
}

/// A map of weights as the bytes of a picture, of which a recipe makes a map of its own size.
pub(crate) fn map_of_array(array: &PyReadonlyArray2<'_, u8>) -> PyResult<Vec<u8>> {
    let &[height, width] = array.shape() else { return Err(PyValueError::new_err("not two axes")) };
    let luma: Vec<u8> = array.as_array().iter().copied().collect();
    let encoded = || -> Option<ImageResult<Vec<u8>>> {
        let (width, height) = (u32::try_from(width).ok()?, u32::try_from(height).ok()?);
        let picture = image::ImageBuffer::<Luma<u8>, _>::from_raw(width, height, luma)?;
        let mut bytes = Cursor::new(Vec::new());
        Some(picture.write_to(&mut bytes, ImageFormat::Png).map(|()| bytes.into_inner()))
    };
    let encoded = encoded().ok_or_else(|| PyValueError::new_err("weight: is too large"))?;
    encoded.map_err(|error| PyValueError::new_err(format!("weight: {error}")))
}
