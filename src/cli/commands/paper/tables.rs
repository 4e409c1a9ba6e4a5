//! Tables 1 and 2: the schemes and their parameters.

use super::page::{Content, FigureTable, Page};
use super::workbench::{Workbench, heads};
use crate::error::Result;
use crate::studio::{PaperPreset, Shaders, default_fly_count};

/// Genes of a fly: x, y, z, r, g, b, angle, width, height.
const GENES_PER_FLY: usize = 9;

/// Table 1: the 12 schemes.
pub(super) fn table1(bench: &Workbench<'_>) -> Result<Page> {
    let row = |preset: PaperPreset| {
        let side_px = preset.side_px;
        let colors = preset.color_count.map_or("full".to_owned(), |count| count.to_string());
        let (first, second) = match preset.shaders {
            Shaders::One => ("uniform rectangles", "none"),
            Shaders::Two => ("complex shapes", "complex shapes"),
            Shaders::OneThenTwo => ("uniform rectangles", "complex shapes"),
        };
        vec![preset.name(), format!("{side_px}x{side_px}"), colors, first.to_owned(), second.to_owned()]
    };
    let table = FigureTable {
        head: heads(&["scheme", "picture", "colours", "first run", "second run"]),
        rows: PaperPreset::all().map(row).collect(),
        ..FigureTable::default()
    };
    let mut page = Page::new(
        "Table 1: the schemes",
        "Twelve ways to evolve a picture. A second run starts from the best population of the first.",
    );
    page.push("Schemes", Content::Figures(bench.write_table("table1.csv", table)?));
    page.push(
        "Notes",
        Content::Text(vec![
            "60 colours: the picture is reduced to 60 colours before it is evolved. The paper does not name its complex \
             shapes; the presets take the flower with its own shading, and --mask takes any other."
                .to_owned(),
        ]),
    );
    Ok(page)
}

/// Table 2: the parameters.
pub(super) fn table2(bench: &Workbench<'_>) -> Result<Page> {
    let row = |side_px: u32| {
        let fly_count = default_fly_count(side_px, side_px);
        vec![
            format!("{side_px}x{side_px}"),
            fly_count.to_string(),
            (GENES_PER_FLY * fly_count).to_string(),
            PaperPreset::all().next().map_or(0, PaperPreset::births).to_string(),
            "100 %".to_owned(),
            "0 %".to_owned(),
        ]
    };
    let table = FigureTable {
        head: heads(&["picture", "flies N", "unknowns 9N", "generations of a run", "mutation", "crossover"]),
        rows: [256, 512].map(row).to_vec(),
        ..FigureTable::default()
    };
    let mut page = Page::new(
        "Table 2: the parameters",
        "The population is the solution: N flies of nine genes each. A generation is one death and one birth.",
    );
    page.push("Parameters", Content::Figures(bench.write_table("table2.csv", table)?));
    Ok(page)
}
