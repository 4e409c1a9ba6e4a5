//! What every figure uses: pictures, recipes by preset, and the files of the page.

use std::sync::Arc;

use rayon::prelude::*;

use super::folder::Folder;
use super::page::{Cell, FigureTable};
use super::pictures::Picture;
use crate::cli::mosaics::{PaperRecipe, Workshop};
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::Result;
use crate::evolve::{PaperScheme, Spread};
use crate::metrics::Score;
use crate::photo::Photo;
use crate::shapes::Shader;
use crate::studio::{Dress, Look, LookChoices, Mask, PaperPreset, default_fly_count};

/// Everything that making a figure needs.
pub(super) struct Workbench<'a> {
    pub workshop: &'a Workshop<'a>,
    pub pictures: Vec<Picture>,
    pub folder: Folder<'a>,
    pub interrupt: &'a Interrupt,
    /// Births of each run.
    pub births: u64,
    pub seed: u64,
}

/// Changes of a recipe's tiles, compared with those of its preset.
#[derive(Clone, Debug, Default)]
pub(super) struct Tiles {
    /// Name of a mask.
    pub mask: Option<&'static str>,
    pub shader: Option<Shader>,
    /// Below 1 the tiles are translucent.
    pub opacity: Option<f64>,
}

impl Workbench<'_> {
    /// The recipe of `picture` for one of the paper's schemes, with the changes of `tiles`.
    pub(super) fn recipe(&self, picture: &Picture, preset: PaperPreset, tiles: &Tiles) -> Result<PaperRecipe> {
        let target = picture.target(preset.side_px, preset.color_count)?;
        let choices = LookChoices {
            masks: tiles.mask.map(Mask::named_or_file).into_iter().collect(),
            shader: tiles.shader,
            opacity: tiles.opacity,
            ..LookChoices::default()
        };
        let Dress { masks, layers_by_run } = Look::new(&choices, &[], Some(preset))?.dress()?;
        let scheme = PaperScheme {
            seed: self.seed,
            births: self.births,
            restarts: preset.restarts(),
            masks: layers_by_run,
            ..PaperScheme::default()
        };
        let fly_count = default_fly_count(target.width_px(), target.height_px());
        Ok(PaperRecipe { fly_count, target, masks: Arc::new(masks), scheme })
    }

    /// The recipes of every picture, picture by picture.
    pub(super) fn recipes_of_all(
        &self,
        mut make: impl FnMut(&Picture) -> Result<Vec<PaperRecipe>>,
    ) -> Result<Vec<PaperRecipe>> {
        Ok(self.pictures.iter().map(&mut make).collect::<Result<Vec<_>>>()?.concat())
    }

    /// Writes pictures; `name` is a path in the folder.
    pub(super) fn write_pictures(&self, pictures: &[(String, &Photo)]) -> Result<()> {
        pictures.par_iter().try_for_each(|(name, photo)| self.folder.write_picture(name, photo))
    }

    /// The names of the pictures.
    pub(super) fn picture_names(&self) -> Vec<String> {
        self.pictures.iter().map(|picture| picture.name.clone()).collect()
    }

    /// Writes a table as CSV and returns it for the page.
    pub(super) fn write_table(&self, name: &str, table: FigureTable) -> Result<FigureTable> {
        self.folder.write(name, &table.to_csv())?;
        Ok(FigureTable { file: Some(name.to_owned()), ..table })
    }
}

/// A cell that shows a file with its likeness.
pub(super) fn cell(file: &str, score: &Score) -> Cell {
    let psnr = score.difference.psnr_db().map_or("equal".to_owned(), |db| format!("{db:.2} dB"));
    Cell::Picture { file: file.to_owned(), caption: format!("{psnr}, SSIM {:.3}", score.ssim) }
}

/// The heads of [`likeness`].
pub(super) const LIKENESS: [&str; 6] = ["SAE", "mean error", "PSNR dB", "SSIM", "edge F1", "GMSD"];

/// The figures of a likeness, as tables show them.
pub(super) fn likeness(score: &Score) -> Vec<String> {
    let psnr = score.difference.psnr_db().map_or("inf".to_owned(), |db| format!("{db:.4}"));
    vec![
        score.difference.sae().to_string(),
        format!("{:.4}", score.difference.mae()),
        psnr,
        format!("{:.4}", score.ssim),
        format!("{:.4}", score.edges.f1()),
        format!("{:.4}", score.gradients.deviation),
    ]
}

/// The spread of a population, as tables show it.
pub(super) fn spread_told(spread: &Spread) -> String {
    spread.clark_evans.map_or("none".to_owned(), |index| format!("{index:.3}"))
}

/// Heads of a table, as owned strings.
pub(super) fn heads(words: &[&str]) -> Vec<String> {
    words.iter().map(|&word| word.to_owned()).collect()
}
