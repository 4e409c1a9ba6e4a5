//! Figures 6 and 9: evolved and picked colours, edges, and the comparison with GIMPressionist.

use rayon::prelude::*;

use super::gimp;
use super::page::{Cell, Content, FigureTable, Page, PictureTable};
use super::pictures::{photo_of, plain_grid};
use super::workbench::{LIKENESS, Tiles, Workbench, cell, heads, likeness};
use crate::cli::mosaics::{Made, score};
use crate::error::{Error, Result};
use crate::evolve::ColorMode;
use crate::metrics::edge_pixels;
use crate::model::{Mask, Target};
use crate::photo::Photo;
use crate::shapes::{BuiltIn, Shader};
use crate::studio::{PaperPreset, default_fly_count};

/// The text in place of GIMPressionist's pictures, if GIMP is not installed.
const NO_GIMP: &str = "GIMP is not installed (program gimp, version 2.10)";

/// A method, with its mosaics of all pictures.
struct Entry {
    /// The name of the method, for people and for files.
    label: String,
    stem: String,
    maker: Maker,
    /// One mosaic for each picture, or why it is missing.
    photos: Vec<Result<Photo, String>>,
}

/// Whether the same command gives the same mosaic again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Maker {
    Smalti,
    /// It uses random numbers that nobody else can seed.
    Gimp,
}

/// The note under GIMPressionist's figures.
const ITS_OWN_LOTS: &str = "GIMPressionist draws lots of its own, so its figures differ a little from one time to the next; \
                            all others on this page are the same every time.";

/// Figure 6: where colours come from, and how edges are kept.
pub(super) fn fig6(bench: &Workbench<'_>) -> Result<Page> {
    const MODES: [(&str, ColorMode); 4] = [
        ("evolved", ColorMode::Evolved),
        ("picked", ColorMode::Pick),
        ("mean", ColorMode::Mean),
        ("median", ColorMode::Median),
    ];
    let preset = PaperPreset::paper(3);
    let recipes = bench.recipes_of_all(|picture| {
        let recipe = |(_, mode): &(_, ColorMode)| {
            let mut recipe = bench.recipe(picture, preset, &Tiles::default())?;
            recipe.scheme.color.mode = *mode;
            Ok(recipe)
        };
        MODES.iter().map(recipe).collect()
    })?;
    let evolved = bench.workshop.evolve(&recipes)?;
    let targets: Vec<&Target> = recipes.iter().step_by(MODES.len()).map(|recipe| &*recipe.target).collect();
    let mut entries: Vec<Entry> = (0..MODES.len())
        .map(|mode| entry_of(format!("colours {}", MODES[mode].0), MODES[mode].0, &evolved, mode, MODES.len()))
        .collect();
    entries.push(grid_entry(&targets));
    entries.push(gimp_entry(bench, "square", &targets, &Mask::square())?);

    let mut page = Page::new(
        "Figure 6: colours evolved or picked, and edges",
        "Colours that evolve beside colours that are picked from the picture at a tile's centre, or are the mean or median of \
         what a tile shows. The paper says that edges are kept, and compares with GIMPressionist. One run of scheme 3 each; the edges are Canny's, and \
         edge F1 says how well they are kept.",
    );
    let (mosaics, tables) = present(bench, "fig6", &targets, &entries)?;
    page.push("Mosaics", Content::Pictures(mosaics));
    page.push("Edges", Content::Pictures(edges(bench, &targets, &entries)?));
    push_likeness(bench, &mut page, "fig6", tables)?;
    Ok(page)
}

/// Figure 9: tile types compared with GIMPressionist, with brushes of the same shapes.
pub(super) fn fig9(bench: &Workbench<'_>) -> Result<Page> {
    let types = [
        ("square", BuiltIn::Square, Shader::Template, None),
        ("lines", BuiltIn::Lines, Shader::Template, None),
        ("flower", BuiltIn::Flower, Shader::Template, None),
        ("spray", BuiltIn::Disc, Shader::Soft, Some(0.8)),
    ];
    let preset = PaperPreset::paper(7);
    let recipes = bench.recipes_of_all(|picture| {
        let recipe = |&(_, shape, shader, opacity): &(_, BuiltIn, Shader, Option<f64>)| {
            bench.recipe(picture, preset, &Tiles { mask: Some(shape.name()), shader: Some(shader), opacity })
        };
        types.iter().map(recipe).collect()
    })?;
    let evolved = bench.workshop.evolve(&recipes)?;
    let targets: Vec<&Target> = recipes.iter().step_by(types.len()).map(|recipe| &*recipe.target).collect();
    let mut entries = Vec::new();
    for (number, (name, shape, shader, _)) in types.iter().enumerate() {
        entries.push(entry_of(format!("smalti, {name}"), name, &evolved, number, types.len()));
        let brush = shader.mask(&shape.template());
        entries.push(gimp_entry(bench, name, &targets, &brush)?);
    }
    entries.push(grid_entry(&targets));
    let mut page = Page::new(
        "Figure 9: tile types beside GIMPressionist",
        "Mosaics, stripes, flowers and spray paint: two runs at 512 px each, beside GIMPressionist with a brush of the same \
         shape and as many strokes. The plain grid of mean colours is the least that a mosaic should beat.",
    );
    let (mosaics, tables) = present(bench, "fig9", &targets, &entries)?;
    page.push("Mosaics", Content::Pictures(mosaics));
    push_likeness(bench, &mut page, "fig9", tables)?;
    Ok(page)
}

/// The results of one of several methods, which take turns in `evolved`.
fn entry_of(label: String, stem: &str, evolved: &[Made], way: usize, way_count: usize) -> Entry {
    let photos = evolved.iter().skip(way).step_by(way_count).map(|made| Ok(made.photo.clone())).collect();
    Entry { label, stem: stem.to_owned(), maker: Maker::Smalti, photos }
}

fn grid_entry(targets: &[&Target]) -> Entry {
    let grid = |target: &&Target| plain_grid(target, default_fly_count(target.width_px(), target.height_px()));
    let photos = targets.iter().map(|target| Ok(grid(target))).collect();
    Entry { label: "plain grid of mean colours".to_owned(), stem: "grid".to_owned(), maker: Maker::Smalti, photos }
}

/// GIMPressionist's pictures, with as many strokes as smalti would use tiles.
fn gimp_entry(bench: &Workbench<'_>, brush: &str, targets: &[&Target], mask: &Mask) -> Result<Entry> {
    let paint = |target: &&Target| {
        let stroke_count = default_fly_count(target.width_px(), target.height_px());
        gimp::paint(&photo_of(target), stroke_count, mask, bench.interrupt)
    };
    let photos = if gimp::is_installed() {
        targets.par_iter().map(paint).collect()
    } else {
        vec![Err(NO_GIMP.to_owned()); targets.len()]
    };
    bench.interrupt.check()?;
    let (label, stem) = (format!("GIMPressionist, {brush} brush"), format!("gimp-{brush}"));
    Ok(Entry { label, stem, maker: Maker::Gimp, photos })
}

/// The likeness of smalti's mosaics, and that of GIMPressionist's pictures.
struct Tables {
    smalti: FigureTable,
    gimp: FigureTable,
}

/// Adds the tables to the page, and writes those that have rows.
fn push_likeness(bench: &Workbench<'_>, page: &mut Page, figure: &str, tables: Tables) -> Result<()> {
    let Tables { smalti, gimp } = tables;
    page.push("Likeness", Content::Figures(bench.write_table(&format!("{figure}.csv"), smalti)?));
    if !gimp.rows.is_empty() {
        page.push(
            "Likeness of GIMPressionist",
            Content::Figures(bench.write_table(&format!("{figure}-gimp.csv"), gimp)?),
        );
        page.push("Note", Content::Text(vec![ITS_OWN_LOTS.to_owned()]));
    }
    Ok(())
}

/// Writes the pictures of all entries; returns them in rows under their originals, and their likeness.
fn present(
    bench: &Workbench<'_>,
    figure: &str,
    targets: &[&Target],
    entries: &[Entry],
) -> Result<(PictureTable, Tables)> {
    let names = bench.picture_names();
    let mut originals = Vec::new();
    for (target, name) in targets.iter().zip(&names) {
        bench.folder.write_picture(&format!("{figure}/original/{name}.png"), &photo_of(target))?;
        originals.push(super::grid::original_cell(figure, name));
    }
    let mut rows = vec![("original".to_owned(), originals)];
    let mut table = FigureTable { head: heads(&["made by", "picture"]), ..FigureTable::default() };
    table.head.extend(heads(&LIKENESS));
    let mut tables = Tables { smalti: table.clone(), gimp: table };
    for Entry { label, stem, maker, photos } in entries {
        let table = if *maker == Maker::Gimp { &mut tables.gimp } else { &mut tables.smalti };
        let mut cells = Vec::new();
        for ((photo, target), name) in photos.iter().zip(targets).zip(&names) {
            let photo = match photo {
                Ok(photo) => photo,
                Err(why) => {
                    cells.push(Cell::Missing(why.clone()));
                    continue;
                }
            };
            let likeness_of = score(target, photo)?;
            let file = format!("{figure}/{stem}/{name}.png");
            bench.folder.write_picture(&file, photo)?;
            cells.push(cell(&file, &likeness_of));
            table.rows.push([vec![label.clone(), name.clone()], likeness(&likeness_of)].concat());
        }
        rows.push((label.clone(), cells));
    }
    Ok((PictureTable { head: names, rows }, tables))
}

/// The edges of the originals and of all entries.
fn edges(bench: &Workbench<'_>, targets: &[&Target], entries: &[Entry]) -> Result<PictureTable> {
    let names = bench.picture_names();
    let row = |label: &str, stem: &str, photos: &[Option<&Photo>]| -> Result<(String, Vec<Cell>)> {
        let cell = |(photo, name): (&Option<&Photo>, &String)| {
            let Some(photo) = photo else { return Ok(Cell::Missing(String::new())) };
            let file = format!("fig6/{stem}-edges/{name}.png");
            bench.folder.write_picture(&file, &edge_picture(photo)?)?;
            Ok(Cell::Picture { file, caption: name.clone() })
        };
        Ok((label.to_owned(), photos.iter().zip(&names).map(cell).collect::<Result<_>>()?))
    };
    let originals: Vec<Photo> = targets.iter().map(|target| photo_of(target)).collect();
    let mut rows = vec![row("original", "original", &originals.iter().map(Some).collect::<Vec<_>>())?];
    for Entry { label, stem, photos, .. } in entries {
        rows.push(row(label, stem, &photos.iter().map(|photo| photo.as_ref().ok()).collect::<Vec<_>>())?);
    }
    Ok(PictureTable { head: names, rows })
}

/// Black edges on white.
fn edge_picture(photo: &Photo) -> Result<Photo> {
    let Photo { width_px, height_px, pixels } = photo;
    let picture = crate::metrics::Picture { width_px: *width_px, height_px: *height_px, pixels };
    let edges = edge_pixels(picture).map_err(Error::Usage)?;
    let pixels = edges.into_iter().map(|is_edge| [if is_edge { 0 } else { 255 }; 3]).collect();
    Ok(Photo { width_px: *width_px, height_px: *height_px, pixels })
}
