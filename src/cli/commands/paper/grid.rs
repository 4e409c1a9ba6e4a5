//! Figures 3 and 4: the random start, and the grid of pictures and schemes.

use rayon::prelude::*;

use super::page::{Cell, Content, FigureTable, Page, PictureTable};
use super::pictures::{Picture, photo_of, plain_grid};
use super::workbench::{LIKENESS, Tiles, Workbench, cell, heads, likeness, spread_told};
use crate::cli::mosaics::{Made, score};
use crate::error::Result;
use crate::metrics::Score;
use crate::model::Canvas;
use crate::photo::Photo;
use crate::studio::{PaperPreset, Shaders, default_fly_count};

/// Side in px of a picture in the contact sheet of figure 4.
const SHEET_CELL_PX: u32 = 256;

/// Figure 3: the population that evolution begins with.
pub(super) fn fig3(bench: &Workbench<'_>) -> Result<Page> {
    let sizes = [PaperPreset::paper(1), PaperPreset::paper(3)];
    let mut rows = Vec::new();
    let mut figures = FigureTable { head: heads(&["picture", "size", "flies"]), ..FigureTable::default() };
    figures.head.extend(heads(&LIKENESS));
    for preset in sizes {
        let mut cells = Vec::new();
        for picture in &bench.pictures {
            let recipe = bench.recipe(picture, preset, &Tiles::default())?;
            let first = recipe.first();
            let photo = bench.workshop.draw(&first, &Canvas::evaluation(first.width_px, first.height_px), 1)?;
            let score = score(&recipe.target, &photo)?;
            let file = format!("fig3/{}-{}.png", picture.name, preset.side_px);
            bench.folder.write_picture(&file, &photo)?;
            cells.push(cell(&file, &score));
            let size = format!("{}x{}", recipe.target.width_px(), recipe.target.height_px());
            figures
                .rows
                .push([vec![picture.name.clone(), size, recipe.fly_count.to_string()], likeness(&score)].concat());
        }
        rows.push((format!("{} px", preset.side_px), cells));
    }
    let mut page = Page::new(
        "Figure 3: the random start",
        "Before the first birth every fly has a random place, depth, colour and angle; its sides are those of Eq. 1.",
    );
    page.push("First populations", Content::Pictures(PictureTable { head: bench.picture_names(), rows }));
    page.push("Likeness to the target", Content::Figures(bench.write_table("fig3.csv", figures)?));
    Ok(page)
}

/// Figure 4: originals in row 0, schemes in rows, pictures in columns.
pub(super) fn fig4(bench: &Workbench<'_>) -> Result<Page> {
    let presets: Vec<PaperPreset> = PaperPreset::all().collect();
    let recipes = bench.recipes_of_all(|picture| {
        presets.iter().map(|preset| bench.recipe(picture, *preset, &Tiles::default())).collect()
    })?;
    let evolved = bench.workshop.evolve(&recipes)?;
    let scores = bench.workshop.scores(&recipes, &evolved)?;
    let scheme_count = presets.len();
    let row = |scheme: usize| (0..bench.pictures.len()).map(move |picture| picture * scheme_count + scheme);

    let originals = bench.pictures.iter().map(|picture| picture.target(SHEET_CELL_PX, None).map(|t| photo_of(&t)));
    let originals: Vec<Photo> = originals.collect::<Result<_>>()?;
    let names = bench.picture_names();
    let (original_files, mosaic_files) = (
        names.iter().zip(&originals).map(|(name, photo)| (format!("fig4/original/{name}.png"), photo)),
        evolved.iter().enumerate().map(|(k, made)| {
            let (name, scheme) = (&names[k / scheme_count], presets[k % scheme_count].name());
            (format!("fig4/{scheme}/{name}.png"), &made.photo)
        }),
    );
    bench.write_pictures(&original_files.chain(mosaic_files).collect::<Vec<_>>())?;

    let mut rows = vec![("original".to_owned(), names.iter().map(|name| original_cell("fig4", name)).collect())];
    for (scheme, preset) in presets.iter().enumerate() {
        let cells =
            row(scheme).zip(&names).map(|(k, name)| cell(&format!("fig4/{}/{name}.png", preset.name()), &scores[k]));
        rows.push((describe(*preset), cells.collect()));
    }
    let mut sheet_rows = vec![originals.iter().map(Some).collect::<Vec<_>>()];
    sheet_rows.extend((0..presets.len()).map(|scheme| row(scheme).map(|k| Some(&evolved[k].photo)).collect()));
    bench.folder.write_picture("fig4/sheet.png", &crate::cli::files::sheet::sheet(&sheet_rows, SHEET_CELL_PX)?)?;

    let mut page = Page::new(
        "Figure 4: the 12 schemes",
        "Each column is a picture, each row a scheme of Table 1; row 0 has the originals. The figures are against the picture \
         that was evolved towards, which stands under Targets.",
    );
    page.push("Mosaics", Content::Pictures(PictureTable { head: names, rows }));
    page.push("Targets", Content::Pictures(targets(bench, &presets[..TARGET_KINDS])?));
    let table = fig4_figures(bench, &presets, &evolved, &scores)?;
    page.push("Likeness", Content::Figures(bench.write_table("fig4.csv", table)?));
    Ok(page)
}

/// Schemes 1 to 4 have every size with every number of colours.
const TARGET_KINDS: usize = 4;

/// The file of the target that `preset` has for the picture `name`.
fn target_file(preset: PaperPreset, name: &str) -> String {
    let colors = preset.color_count.map(|count| format!("-{count}")).unwrap_or_default();
    format!("fig4/target-{}{colors}/{name}.png", preset.side_px)
}

/// Writes the targets of the presets; returns them in one row per preset.
fn targets(bench: &Workbench<'_>, presets: &[PaperPreset]) -> Result<PictureTable> {
    let row = |&preset: &PaperPreset| -> Result<(String, Vec<Cell>)> {
        let cell = |picture: &Picture| {
            let file = target_file(preset, &picture.name);
            let target = picture.target(preset.side_px, preset.color_count)?;
            bench.folder.write_picture(&file, &photo_of(&target))?;
            Ok(Cell::Picture { file, caption: picture.name.clone() })
        };
        let cells = bench.pictures.iter().map(cell).collect::<Result<_>>()?;
        Ok((format!("{} px, {}", preset.side_px, colors_told(preset)), cells))
    };
    Ok(PictureTable { head: bench.picture_names(), rows: presets.iter().map(row).collect::<Result<_>>()? })
}

/// The cell of an original.
pub(super) fn original_cell(figure: &str, name: &str) -> Cell {
    Cell::Picture { file: format!("{figure}/original/{name}.png"), caption: name.to_owned() }
}

fn describe(preset: PaperPreset) -> String {
    let colors = colors_told(preset);
    let shaders = match preset.shaders {
        Shaders::One => "rectangles",
        Shaders::Two => "complex shapes in both runs",
        Shaders::OneThenTwo => "rectangles, then complex shapes",
    };
    format!("{}: {} px, {colors}, {shaders}", preset.name(), preset.side_px)
}

fn colors_told(preset: PaperPreset) -> String {
    preset.color_count.map_or("full colour".to_owned(), |count| format!("{count} colours"))
}

/// The likeness for each scheme and picture, beside that of a plain grid with as many tiles.
fn fig4_figures(
    bench: &Workbench<'_>,
    presets: &[PaperPreset],
    evolved: &[Made],
    scores: &[Score],
) -> Result<FigureTable> {
    let mut table = FigureTable { head: heads(&["scheme", "picture"]), ..FigureTable::default() };
    table.head.extend(heads(&LIKENESS));
    table.head.extend(heads(&["SAE to the full-colour picture", "births", "Clark-Evans index", "target"]));
    for (k, (evolved, likeness_of)) in evolved.iter().zip(scores).enumerate() {
        let (picture, preset) = (&bench.pictures[k / presets.len()], presets[k % presets.len()]);
        let full = picture.target(preset.side_px, None)?;
        let to_full = if preset.color_count.is_some() { score(&full, &evolved.photo)? } else { *likeness_of };
        let mut row = vec![preset.name(), picture.name.clone()];
        row.extend(likeness(likeness_of));
        row.extend([to_full.difference.sae().to_string(), evolved.births.to_string(), spread_told(&evolved.spread)]);
        row.push(target_file(preset, &picture.name));
        table.rows.push(row);
    }
    let sizes = [PaperPreset::paper(1), PaperPreset::paper(3)];
    let grids: Vec<(PaperPreset, &Picture)> =
        sizes.iter().flat_map(|&preset| bench.pictures.iter().map(move |picture| (preset, picture))).collect();
    let rows: Vec<Result<Vec<String>>> = grids
        .par_iter()
        .map(|&(preset, picture)| {
            bench.interrupt.check()?;
            let side_px = preset.side_px;
            let (cell_count, score) = grid_score(picture, side_px)?;
            let mut row = vec![format!("plain grid of {cell_count}, {side_px} px"), picture.name.clone()];
            row.extend(likeness(&score));
            row.extend([score.difference.sae().to_string(), "0".to_owned(), "none".to_owned()]);
            row.push(target_file(preset, &picture.name));
            Ok(row)
        })
        .collect();
    for row in rows {
        table.rows.push(row?);
    }
    Ok(table)
}

/// The likeness of a plain grid that has as many cells as the preset of that size has flies.
fn grid_score(picture: &Picture, side_px: u32) -> Result<(usize, Score)> {
    let target = picture.target(side_px, None)?;
    let fly_count = default_fly_count(target.width_px(), target.height_px());
    Ok((fly_count, score(&target, &plain_grid(&target, fly_count))?))
}
