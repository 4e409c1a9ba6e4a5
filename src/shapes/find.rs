//! Finding a template by what the user typed: the name of a built-in one, or a path.

use std::path::Path;

use super::built_in::BuiltIn;
use super::read::read;
use super::template::Template;
use crate::error::{Error, Result};

impl Template {
    /// The built-in template called `name_or_path`, or the template in the file at that path. To read a file that has
    /// the name of a built-in template, write `./NAME`.
    ///
    /// # Errors
    /// [`Error::Input`] as from [`read`]. If the file does not exist, the message lists the built-in names.
    pub fn find(name_or_path: &Path) -> Result<Self> {
        let shape = BuiltIn::ALL.into_iter().find(|shape| Path::new(shape.name()) == name_or_path);
        if let Some(shape) = shape {
            return Ok(shape.template());
        }
        if !name_or_path.exists() {
            let names = BuiltIn::ALL.map(BuiltIn::name).join(", ");
            return Err(Error::input(
                name_or_path,
                format!("there is no such mask; name one of {names}, or a picture or SVG file"),
            ));
        }
        read(name_or_path)
    }
}
