//! Figure 5: restarts, and the curve of global fitness.

use super::page::{Cell, Content, FigureTable, Page, PictureTable};
use super::workbench::{LIKENESS, Tiles, Workbench, cell, heads, likeness, spread_told};
use crate::cli::mosaics::{Made, PaperRecipe, score};
use crate::error::Result;
use crate::evolve::Spread;
use crate::metrics::Score;
use crate::model::{Canvas, Population};
use crate::photo::Photo;
use crate::plot::{Mark, Plot, Scale, Series};
use crate::studio::PaperPreset;

/// Runs after the first.
const RESTARTS: u32 = 4;
/// The ways to restart: a name for files, a label, and the factor of the mutation steps in 1/65536.
const COOLINGS: [(&str, &str, u32); 2] =
    [("plain", "same steps, as in the paper", 1 << 16), ("cool", "steps halved at each restart", 1 << 15)];

/// Figure 5: what restarts do.
pub(super) fn fig5(bench: &Workbench<'_>) -> Result<Page> {
    let recipes = bench.recipes_of_all(|picture| {
        let plain = bench.recipe(picture, PaperPreset::paper(1), &Tiles::default())?;
        let restarted = |cool_q16: u32| {
            let mut recipe: PaperRecipe = plain.clone();
            recipe.scheme.restarts = RESTARTS;
            recipe.scheme.cool_q16 = cool_q16;
            recipe
        };
        Ok(COOLINGS.iter().map(|&(_, _, cool_q16)| restarted(cool_q16)).collect())
    })?;
    let evolved = bench.workshop.evolve(&recipes)?;
    let stops = recipes.iter().zip(&evolved).map(|(recipe, made)| stops(bench, recipe, made));
    let stops = stops.collect::<Result<Vec<_>>>()?;

    let mut page = Page::new(
        "Figure 5: restarts",
        "Each run starts from the best population so far. The paper restarts with the same mutation steps; --cool shrinks them, \
         and the error of a run levels off with its step size.",
    );
    let mut table = FigureTable { head: heads(&["picture", "restarts", "after run"]), ..FigureTable::default() };
    table.head.extend(heads(&LIKENESS));
    table.head.extend(heads(&["births", "Clark-Evans index"]));
    for (number, picture) in bench.pictures.iter().enumerate() {
        let mut rows = Vec::new();
        for (cooling, (stem, told, _)) in COOLINGS.iter().enumerate() {
            let mut cells: Vec<Cell> = Vec::new();
            for (run, stop) in stops[number * COOLINGS.len() + cooling].iter().enumerate() {
                let file = format!("fig5/{}-{stem}-{run}.png", picture.name);
                bench.folder.write_picture(&file, &stop.photo)?;
                cells.push(cell(&file, &stop.score));
                let mut row = vec![picture.name.clone(), (*told).to_owned(), (run + 1).to_string()];
                row.extend(likeness(&stop.score));
                row.extend([stop.births.to_string(), spread_told(&stop.spread)]);
                table.rows.push(row);
            }
            rows.push(((*told).to_owned(), cells));
        }
        let whole = &evolved[number * COOLINGS.len()..][..COOLINGS.len()];
        let svg = curve_plot(bench, &picture.name, whole)?;
        bench.folder.write(&format!("fig5/{}.svg", picture.name), svg.as_bytes())?;
        bench.folder.write(&format!("fig5/{}.csv", picture.name), &curve_table(whole).to_csv())?;
        let head = (1..=RESTARTS + 1).map(|run| format!("after run {run}")).collect();
        page.push(&picture.name, Content::Pictures(PictureTable { head, rows }));
        page.push(&format!("Global fitness of {} over births", picture.name), Content::Plot(svg));
    }
    page.push("Likeness", Content::Figures(bench.write_table("fig5.csv", table)?));
    Ok(page)
}

/// The best population after a run.
struct Stop {
    photo: Photo,
    score: Score,
    /// Of all runs so far.
    births: u64,
    spread: Spread,
}

/// The population after each run of an evolution.
fn stops(bench: &Workbench<'_>, recipe: &PaperRecipe, made: &Made) -> Result<Vec<Stop>> {
    let stop = |population: &Population, births: u64| {
        let (width_px, height_px) = (population.width_px, population.height_px);
        let photo = bench.workshop.draw(population, &Canvas::evaluation(width_px, height_px), 1)?;
        let spread = Spread::of(&population.flies, width_px, height_px);
        Ok(Stop { score: score(&recipe.target, &photo)?, photo, births, spread })
    };
    let ends = made.runs.iter().map(|end| (&end.population, end.births));
    ends.chain([(&made.population, made.births)]).map(|(population, births)| stop(population, births)).collect()
}

/// The curves of both ways to restart, with a line at each restart.
fn curve_plot(bench: &Workbench<'_>, name: &str, evolved: &[Made]) -> Result<String> {
    let series = COOLINGS.iter().zip(evolved).map(|((_, told, _), made)| Series {
        label: (*told).to_owned(),
        points: made.curve.iter().map(|point| (point.births as f64, point.sae as f64)).collect(),
    });
    let marks = (1..=RESTARTS)
        .map(|restart| Mark { x: (u64::from(restart) * bench.births) as f64, label: format!("restart {restart}") });
    let series: Vec<Series> = series.collect();
    let plot = Plot {
        title: name.to_owned(),
        x_label: "births".to_owned(),
        y_label: "SAE of the population".to_owned(),
        y_scale: Scale::fitting(series.iter().flat_map(|series| series.points.iter().map(|&(_, sae)| sae))),
        series,
        marks: marks.collect(),
    };
    plot.svg()
}

fn curve_table(evolved: &[Made]) -> FigureTable {
    let rows = COOLINGS.iter().zip(evolved).flat_map(|((stem, ..), made)| {
        made.curve.iter().map(|point| {
            let figures = [u64::from(point.run), point.births, point.sae, point.lowered as u64];
            [vec![(*stem).to_owned()], figures.map(|figure| figure.to_string()).to_vec()].concat()
        })
    });
    FigureTable { head: heads(&["restarts", "run", "births", "sae", "best_sae"]), rows: rows.collect(), file: None }
}
