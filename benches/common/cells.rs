//! The `cells` search as benches start it: pictures from files, the course of a style, and rounds until a budget is spent.

use std::num::NonZeroU8;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use smalti::cpu::CpuEvaluator;
use smalti::evolve::cells::ROUNDS_PER_EPOCH;
use smalti::evolve::style::{Ground, GuideKind, Style};
use smalti::guide::{self, Flow};
use smalti::model::cells::{Course, Search};
use smalti::model::operators::tile_side;
use smalti::model::tile::unpack;
use smalti::model::{Blend, Canvas, Evaluator, Grout, Guide, MaskSet, Mosaic, Population, Target};
use smalti::photo::{self, Photo, ReadOptions};
use smalti::shapes::{Outfit, Shader, Template, Wardrobe};

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

/// The mean colour of a target.
fn mean_color(target: &Target) -> [u8; 3] {
    let count = target.pixels().len() as u64;
    std::array::from_fn(|channel| {
        let sum: u64 = target.pixels().iter().map(|pixel| u64::from(pixel[channel])).sum();
        ((sum + count / 2) / count) as u8
    })
}

/// The guide that a style asks for.
pub fn guide(target: &Target, style: &Style, side: u32) -> Guide {
    match style.guide {
        GuideKind::Edges => guide::sharp(target),
        GuideKind::Flow { smoothing_q8, size_strength_q8 } => {
            let smoothing = (side * smoothing_q8) >> 8;
            guide::flowing(target, &Flow { tile_side: side, smoothing, size_strength_q8, weights: None })
        }
    }
}

/// The course of a style by seed 0 on its own ground, in the style's own masks, with grout in the picture's mean colour.
pub fn course(target: &Arc<Target>, style: &Style, fly_count: usize, candidates: u32) -> Course {
    let side = tile_side(target.width_px(), target.height_px(), fly_count);
    let mean = mean_color(target);
    let background = if style.ground == Ground::Black { [0; 3] } else { mean };
    let mut rules = style.rules(0, (side, fly_count), background, mean);
    rules.candidates = candidates;
    let guide = Arc::new(guide(target, style, side));
    let mut masks = MaskSet::default();
    if !style.masks.is_empty() {
        let template = |name: &String| Template::find(Path::new(name)).expect("styles name built-in masks");
        let outfit = |name| Outfit { template: template(name), shader: Shader::Template };
        let outfits: Vec<Outfit> = style.masks.iter().map(outfit).collect();
        let wardrobe = Wardrobe::new(&outfits, Blend::Opaque, NonZeroU8::MAX).expect("built-in masks cover something");
        rules.mask_first = u32::from(wardrobe.layers[0]);
        rules.mask_count = wardrobe.layers.len() as u32;
        masks = wardrobe.masks;
    }
    Course { rules, target: Arc::clone(target), guide, masks: Arc::new(masks), fly_count }
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
    CpuEvaluator::new(Vec::new()).draw(&population, &canvas, 1).expect("the CPU draws anything")
}

/// Makes rounds until so many children were evaluated, or until the objective is at most `enough`. As the driver of searches
/// does, but looks at both after every round: with eight candidates an epoch is a tenth of the budget.
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
