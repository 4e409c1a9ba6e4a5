//! The flag `--preset`: a scheme of the paper, a style, or the user's own file.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::evolve::style::Style;
use crate::studio::PaperPreset;

/// The value of `--preset`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PresetChoice {
    /// A scheme of the paper.
    Paper(PaperPreset),
    /// A style.
    Style(String),
    /// The user's own file.
    File(PathBuf),
}

impl fmt::Display for PresetChoice {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Paper(preset) => write!(out, "{}", preset.name()),
            Self::Style(name) => write!(out, "{name}"),
            Self::File(path) => write!(out, "{}", path.display()),
        }
    }
}

/// The names of all styles, for people.
pub(crate) fn style_names() -> String {
    Style::NAMES.join(", ")
}

/// Reads the name of a style; the error lists all names.
pub(crate) fn parse_style(name: &str) -> Result<String, String> {
    let name = name.trim().to_ascii_lowercase();
    let known = Style::named(&name).map(|_| name);
    known.ok_or_else(|| format!("there is no such style; there are {}", style_names()))
}

/// Reads the name of a preset; the error lists all names.
pub(crate) fn parse(name: &str) -> Result<PresetChoice, String> {
    let word = name.trim().to_ascii_lowercase();
    if let Some(preset) = PaperPreset::named(&word) {
        return Ok(PresetChoice::Paper(preset));
    }
    if Style::named(&word).is_some() {
        return Ok(PresetChoice::Style(word));
    }
    if Path::new(name).extension().is_some_and(|extension| extension == "toml") {
        return Ok(PresetChoice::File(name.into()));
    }
    let styles = style_names();
    Err(format!("there is no such preset; there are paper-1 to paper-12, {styles}, and files that end in .toml"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_is_a_scheme_of_the_paper_a_style_or_a_file() {
        assert_eq!(parse("mosaic"), Ok(PresetChoice::Style("mosaic".to_owned())));
        assert_eq!(parse(" Mosaic"), Ok(PresetChoice::Style("mosaic".to_owned())));
        assert_eq!(parse("Paper-3"), Ok(PresetChoice::Paper(PaperPreset::paper(3))));
        assert_eq!(parse("my/own.toml"), Ok(PresetChoice::File("my/own.toml".into())));
        assert_eq!(parse("paper-3"), Ok(PresetChoice::Paper(PaperPreset::paper(3))));
        assert!(parse("toml").is_err() && parse_style("toml").is_err());
    }
}
