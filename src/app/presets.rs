//! Presets: the 12 schemes of the paper (Table 1) and the styles of the `cells` scheme by name, and files of one's own.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::evolve::scheme::PAPER_BIRTHS;
use crate::evolve::style::Style;

/// How many tile shapes a scheme uses, and when (Table 1, "shaders").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shaders {
    /// Uniform rectangles, in one run.
    One,
    /// Complex shapes in two runs, the second begun from the first one's best population.
    Two,
    /// Uniform rectangles in the first run, complex shapes in the second.
    OneThenTwo,
}

/// One row of Table 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Preset {
    /// From 1 to 12.
    pub number: u32,
    /// Longer side of the picture in px.
    pub side_px: u32,
    /// Colours that the target is reduced to; `None` is full colour.
    pub color_count: Option<usize>,
    pub shaders: Shaders,
}

impl Preset {
    /// Colours of the even schemes.
    const FEW_COLORS: usize = 60;

    /// All schemes, in the order of the paper.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        (1..=12).map(Self::paper)
    }

    /// Scheme `number`, from 1 to 12.
    pub(super) fn paper(number: u32) -> Self {
        Self {
            number,
            side_px: if (number - 1) % 4 < 2 { 256 } else { 512 },
            color_count: number.is_multiple_of(2).then_some(Self::FEW_COLORS),
            shaders: match (number - 1) / 4 {
                0 => Shaders::One,
                1 => Shaders::Two,
                _ => Shaders::OneThenTwo,
            },
        }
    }

    /// The preset of this name.
    pub(super) fn named(name: &str) -> Option<Self> {
        Self::all().find(|preset| preset.name() == name)
    }

    /// `paper-1` to `paper-12`.
    pub(super) fn name(self) -> String {
        format!("paper-{}", self.number)
    }

    /// Births of each run (Table 2).
    pub(super) fn births(self) -> u64 {
        PAPER_BIRTHS
    }

    /// Runs after the first.
    pub(super) fn restarts(self) -> u32 {
        u32::from(self.shaders != Shaders::One)
    }
}

/// What was named by `--preset`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum PresetChoice {
    /// A scheme of the paper.
    Paper(Preset),
    /// A style.
    Style(String),
    /// A file of the user's.
    File(PathBuf),
}

impl PresetChoice {
    /// The scheme of the paper, if it is one.
    pub(super) fn paper(&self) -> Option<Preset> {
        if let Self::Paper(preset) = self { Some(*preset) } else { None }
    }
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
pub(super) fn style_names() -> String {
    Style::NAMES.join(", ")
}

/// Reads the name of a style; a refusal says which there are.
pub(super) fn parse_style(name: &str) -> Result<String, String> {
    let known = Style::named(name).map(|_| name.to_owned());
    known.ok_or_else(|| format!("there is no such style; there are {}", style_names()))
}

/// Reads the name of a preset; a refusal says which there are.
pub(super) fn parse(name: &str) -> Result<PresetChoice, String> {
    if let Some(preset) = Preset::named(name) {
        return Ok(PresetChoice::Paper(preset));
    }
    if Style::named(name).is_some() {
        return Ok(PresetChoice::Style(name.to_owned()));
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
    fn the_presets_are_the_rows_of_table_1() {
        let rows: Vec<_> = Preset::all().map(|p| (p.side_px, p.color_count.is_some(), p.shaders)).collect();
        for (group, shaders) in rows.chunks(4).zip([Shaders::One, Shaders::Two, Shaders::OneThenTwo]) {
            let expected = [(256, false, shaders), (256, true, shaders), (512, false, shaders), (512, true, shaders)];
            assert_eq!(group, expected);
        }
        assert_eq!(Preset::named("paper-12").map(|p| p.number), Some(12));
        assert!(parse("paper-13").is_err() && parse("paper-0").is_err() && parse("paper-01").is_err());
    }

    #[test]
    fn a_preset_is_a_scheme_of_the_paper_a_style_or_a_file() {
        assert_eq!(parse("mosaic"), Ok(PresetChoice::Style("mosaic".to_owned())));
        assert_eq!(parse("my/own.toml"), Ok(PresetChoice::File("my/own.toml".into())));
        assert_eq!(parse("paper-3").map(|preset| preset.paper()), Ok(Some(Preset::paper(3))));
        assert!(parse("toml").is_err() && parse_style("toml").is_err());
    }
}
