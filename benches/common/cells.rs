//! The `cells` search as benches start it: pictures from files, the course of a style, and rounds until a budget is
//! spent.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use smalti::Recipe;
use smalti::cpu::CpuPainter;
use smalti::evolve::cells::ROUNDS_PER_EPOCH;
use smalti::model::cells::{Course, Search};
use smalti::model::tile::unpack;
use smalti::model::{Canvas, Grout, MaskSet, Mosaic, Painter, Population, Target};
use smalti::photo::{self, Photo, ReadOptions};

/// Names of the development pictures, in the order of the tables.
pub const PICTURES: [&str; 5] = ["star", "yin_yang", "hats", "parrots", "woman"];

/// A picture fitted to `long_side_px`.
pub fn read(path: &Path, long_side_px: u32) -> Arc<Target> {
    let reading = ReadOptions { long_side_px: Some(long_side_px), ..ReadOptions::default() };
    let loaded = photo::read(path, &reading).unwrap_or_else(|error| panic!("{error}"));
    let Photo { width_px, height_px, pixels } = loaded.photo;
    Arc::new(Target::new(width_px, height_px, pixels).expect("a picture that was read has a valid size"))
}

/// The development pictures of a folder, by name; those that are not there are left out.
pub fn pictures(folder: &Path) -> Vec<(&'static str, PathBuf)> {
    let paths = PICTURES.map(|name| (name, folder.join(format!("{name}.png"))));
    paths.into_iter().filter(|(_, path)| path.is_file()).collect()
}

/// The search that a style makes of a picture by seed 0: what `smalti evolve --style` would search by.
pub fn course(target: &Arc<Target>, style: &str, fly_count: usize, candidates: u32) -> Course {
    let recipe = Recipe::named(style).expect("it is a style").tiles(fly_count as u64).candidates(candidates.into());
    smalti::studio::work(target, &recipe).expect("the recipe fits any picture").course
}

/// What a search has come to, as the evaluator of the CPU draws it.
pub fn draw(search: &mut dyn Search) -> Mosaic {
    let flies = search.read_back().expect("the search works").flies;
    let Course { rules, target, masks, .. } = search.course();
    let grout = (rules.grout > 0).then(|| Grout { width: rules.grout, color: unpack(rules.grout_color) });
    let population = Population {
        width_px: target.width_px(),
        height_px: target.height_px(),
        background: unpack(rules.background).into(),
        grout,
        masks: MaskSet::clone(masks),
        flies,
    };
    let canvas = Canvas::evaluation(population.width_px, population.height_px);
    CpuPainter.draw(&population, &canvas, 1).expect("the CPU draws anything")
}

/// Makes rounds until the budget of evaluated children is spent, or until the objective is at most `enough`. The driver
/// of searches checks both only after each epoch. This checks after each round, since with eight candidates an epoch
/// takes a tenth of the budget.
pub fn search_until(search: &mut dyn Search, evals: u64, enough: Option<i64>) {
    let is_done = |search: &dyn Search| {
        let standing = search.standing();
        standing.evals >= evals || enough.is_some_and(|enough| standing.objective <= enough)
    };
    while !is_done(search) {
        search.advance(1).expect("the search works");
        if search.standing().rounds.is_multiple_of(ROUNDS_PER_EPOCH) {
            search.renormalise().expect("the search works");
        }
    }
}
