//! Figures 7 and 8: the templates of tiles, and how shaders, sides and angles change a mosaic.

use super::page::{Cell, Content, FigureTable, Page, PictureTable};
use super::workbench::{LIKENESS, Tiles, Workbench, cell, heads, likeness};
use crate::cli::mosaics::PaperRecipe;
use crate::error::Result;
use crate::model::mask::{COVERAGE_THRESHOLD, MASK_SIDE, Texel, shaded};
use crate::model::operators::Rotation;
use crate::model::tile::{pack, unpack};
use crate::model::{Mask, Rgb};
use crate::photo::Photo;
use crate::shapes::{BuiltIn, Shader};
use crate::studio::PaperPreset;

/// Colour of the tiles in the samples, and of the ground under them.
const TILE: Rgb = [217, 154, 91];
const GROUND: Rgb = [70, 74, 80];

/// Figure 7: every template under every shader.
pub(super) fn fig7(bench: &Workbench<'_>) -> Result<Page> {
    let mut rows = Vec::new();
    for shader in Shader::ALL {
        let mut cells = Vec::new();
        for shape in BuiltIn::ALL {
            let file = format!("fig7/{}-{}.png", shape.name(), shader.name());
            bench.folder.write_picture(&file, &sample(&shader.mask(&shape.template())))?;
            cells.push(Cell::Picture { file, caption: format!("{} {}", shape.name(), shader.name()) });
        }
        rows.push((shader.name().to_owned(), cells));
    }
    let mut page = Page::new(
        "Figure 7: the templates",
        "A tile's shape is a template: its intensity drives what the tile covers and how bright it is there. Columns are the \
         templates, rows the shaders; left opaque, right translucent.",
    );
    let head = BuiltIn::ALL.iter().map(|shape| shape.name().to_owned()).collect();
    page.push("Templates and shaders", Content::Pictures(PictureTable { head, rows }));
    let told = |name: &str, description: &str| format!("{name}: {description}.");
    page.push(
        "Templates",
        Content::Text(BuiltIn::ALL.iter().map(|shape| told(shape.name(), shape.description())).collect()),
    );
    page.push(
        "Shaders",
        Content::Text(Shader::ALL.iter().map(|shader| told(shader.name(), shader.description())).collect()),
    );
    Ok(page)
}

/// A tile that wears `mask` on a dark ground, once opaque and beside it translucent.
fn sample(mask: &Mask) -> Photo {
    let lit = |texel: Texel| unpack(shaded(pack(TILE), u32::from(texel.shade)));
    let opaque = |texel: Texel| if texel.coverage >= COVERAGE_THRESHOLD { lit(texel) } else { GROUND };
    let translucent = |texel: Texel| {
        let color = lit(texel);
        let mix = |k: usize| {
            let parts = u32::from(color[k]) * u32::from(texel.coverage)
                + u32::from(GROUND[k]) * u32::from(255 - texel.coverage);
            ((parts + 127) / 255) as u8
        };
        [mix(0), mix(1), mix(2)]
    };
    let pixels = mask
        .texels()
        .chunks_exact(MASK_SIDE)
        .flat_map(|row| row.iter().map(|&texel| opaque(texel)).chain(row.iter().map(|&texel| translucent(texel))))
        .collect();
    Photo { width_px: 2 * MASK_SIDE as u32, height_px: MASK_SIDE as u32, pixels }
}

/// A row of figure 8: its name, and how it changes the recipe.
struct Variant {
    label: &'static str,
    tiles: Tiles,
    change: fn(&mut PaperRecipe),
}

/// The rows of figure 8.
fn variants() -> [Variant; 6] {
    let tiles = |mask, shader| Tiles { mask: Some(mask), shader: Some(shader), opacity: None };
    let same: fn(&mut PaperRecipe) = |_| {};
    [
        Variant { label: "8a: flower, its own shading", tiles: tiles("flower", Shader::Template), change: same },
        Variant { label: "8b: the same mask embossed", tiles: tiles("flower", Shader::Emboss), change: same },
        Variant {
            label: "8c: four times the sides of Eq. 1",
            tiles: tiles("flower", Shader::Template),
            change: |recipe| recipe.scheme.tile_scale_q16 = 4 << 16,
        },
        Variant {
            label: "8d: rotation ignored",
            tiles: tiles("square", Shader::Template),
            change: |recipe| recipe.scheme.rotation = Rotation::None,
        },
        Variant { label: "8e: square with an edge", tiles: tiles("border", Shader::Template), change: same },
        Variant { label: "8f: hexagon with an outline", tiles: tiles("hexagon", Shader::Outline), change: same },
    ]
}

/// Figure 8: different looks of one picture.
pub(super) fn fig8(bench: &Workbench<'_>) -> Result<Page> {
    let variants = variants();
    let preset = PaperPreset::paper(7);
    let recipes = bench.recipes_of_all(|picture| {
        let recipe = |variant: &Variant| {
            let mut recipe = bench.recipe(picture, preset, &variant.tiles)?;
            (variant.change)(&mut recipe);
            Ok(recipe)
        };
        variants.iter().map(recipe).collect()
    })?;
    let evolved = bench.workshop.evolve(&recipes)?;
    let scores = bench.workshop.scores(&recipes, &evolved)?;
    let mut rows = Vec::new();
    let mut table = FigureTable { head: heads(&["look", "picture"]), ..FigureTable::default() };
    table.head.extend(heads(&LIKENESS));
    for (number, variant) in variants.iter().enumerate() {
        let mut cells = Vec::new();
        for (place, picture) in bench.pictures.iter().enumerate() {
            let (made, score) = (&evolved[place * variants.len() + number], &scores[place * variants.len() + number]);
            let file = format!("fig8/{}-{}.png", &variant.label[..2], picture.name);
            bench.folder.write_picture(&file, &made.photo)?;
            cells.push(cell(&file, score));
            table.rows.push([vec![variant.label.to_owned(), picture.name.clone()], likeness(score)].concat());
        }
        rows.push((variant.label.to_owned(), cells));
    }
    let mut page = Page::new(
        "Figure 8: looks",
        "One mask under two shaders (8a, 8b), tiles much larger than Eq. 1 asks for (8c), rotation ignored (8d), and masks \
         with an edge (8e, 8f). Two runs each, 512 px.",
    );
    page.push("Mosaics", Content::Pictures(PictureTable { head: bench.picture_names(), rows }));
    page.push("Likeness", Content::Figures(bench.write_table("fig8.csv", table)?));
    Ok(page)
}
