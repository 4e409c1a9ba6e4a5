//! The 12 schemes of the paper (Table 1).

use crate::evolve::scheme::PAPER_BIRTHS;

/// How many tile shapes a scheme uses, and when (Table 1, "shaders").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shaders {
    /// Uniform rectangles, in one run.
    One,
    /// Complex shapes in two runs, the second begun from the first one's best population.
    Two,
    /// Uniform rectangles in the first run, complex shapes in the second.
    OneThenTwo,
}

/// One row of Table 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PaperPreset {
    /// From 1 to 12.
    pub number: u32,
    /// Longer side of the picture in px.
    pub side_px: u32,
    /// Colours that the target is reduced to; `None` is full colour.
    pub color_count: Option<usize>,
    pub shaders: Shaders,
}

impl PaperPreset {
    /// Colours of the even schemes.
    const FEW_COLORS: usize = 60;

    /// All schemes, in the order of the paper.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        (1..=12).map(Self::paper)
    }

    /// Scheme `number`, from 1 to 12.
    pub(crate) fn paper(number: u32) -> Self {
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
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::all().find(|preset| preset.name() == name)
    }

    /// `paper-1` to `paper-12`.
    pub(crate) fn name(self) -> String {
        format!("paper-{}", self.number)
    }

    /// Births of each run (Table 2).
    pub(crate) fn births(self) -> u64 {
        PAPER_BIRTHS
    }

    /// Runs after the first.
    pub(crate) fn restarts(self) -> u32 {
        u32::from(self.shaders != Shaders::One)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_presets_are_the_rows_of_table_1() {
        let rows: Vec<_> = PaperPreset::all().map(|p| (p.side_px, p.color_count.is_some(), p.shaders)).collect();
        for (group, shaders) in rows.chunks(4).zip([Shaders::One, Shaders::Two, Shaders::OneThenTwo]) {
            let expected = [(256, false, shaders), (256, true, shaders), (512, false, shaders), (512, true, shaders)];
            assert_eq!(group, expected);
        }
        assert_eq!(PaperPreset::named("paper-12").map(|p| p.number), Some(12));
        assert!(["paper-13", "paper-0", "paper-01"].iter().all(|name| PaperPreset::named(name).is_none()));
    }
}
