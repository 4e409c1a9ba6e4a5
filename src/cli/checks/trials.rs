//! What is computed on a device and on the CPU: small, and of every kind.

use std::sync::Arc;

use super::numbers::Part;
use crate::cli::built_in;
use crate::cpu::cells::CpuSearch;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::evolve::cells::{self, Budget};
use crate::evolve::evolution::random_population;
use crate::evolve::style::Style;
use crate::evolve::{ColorMode, Ended, Evolution, PaperScheme, Undisturbed};
use crate::model::cells::{Course, Search};
use crate::model::{Backdrop, Blend, Canvas, Change, Fly, Population, Scene, Target};
use crate::shapes::{BuiltIn, Shader};
use crate::studio::{self, Device, Mask, Mosaic, OpenedSearch, Picture, Recipe, make_all};

/// The picture is cut from one with sides of so many px.
const SIDE_PX: u32 = 256;
/// Size in px, of which neither side is a multiple of a block's.
const SIZE_PX: [u32; 2] = [203, 131];
const TILES: u64 = 200;
/// Evals of a search.
const EVALS: u64 = 6_000;
/// Candidates a step.
const CANDIDATES: [u64; 3] = [1, 8, 64];
/// How far a tile may move, in 1/64 px.
const LEASH: u32 = 200;
/// Births of the published algorithm.
const BIRTHS: u64 = 600;
/// Pictures that share the device.
const LANES: usize = 6;

type Work = Box<dyn Fn(&Device) -> Result<Vec<Part>>>;

/// One check.
pub(super) struct Trial {
    pub name: String,
    /// Whether the device's share of it is to draw with graphics. For a device without, the CPU does that.
    pub needs_graphics: bool,
    work: Work,
}

impl Trial {
    fn new(name: impl Into<String>, work: impl Fn(&Device) -> Result<Vec<Part>> + 'static) -> Self {
        Self { name: name.into(), needs_graphics: false, work: Box::new(work) }
    }

    /// Computes everything on a device.
    pub(super) fn run(&self, device: &Device) -> Result<Vec<Part>> {
        (self.work)(device)
    }
}

/// All checks.
///
/// # Errors
/// If the CPU fails.
pub(super) fn all() -> Result<Vec<Trial>> {
    let target = Arc::new(built_in::picture(SIDE_PX, SIZE_PX)?);
    let mut trials = fitness(&target)?;
    trials.extend(papers(&target)?);
    trials.extend(searches(&target)?);
    trials.extend(drawings(&target)?);
    trials.push(Trial::new("lanes", lanes));
    Ok(trials)
}

/// The recipe of a style for the picture.
fn recipe(style: &str) -> Result<Recipe> {
    Ok(Recipe::named(style)?.tiles(TILES).seed(5))
}

/// All tile shapes that are built in.
fn all_shapes() -> Result<Vec<Mask>> {
    BuiltIn::ALL.iter().map(|shape| Mask::named(shape.name())).collect()
}

/// Random flies that wear all masks in turn.
fn dressed_flies(layer_count: usize, seed: u64) -> Vec<Fly> {
    let mut flies = random_population(SIZE_PX[0], SIZE_PX[1], TILES as usize, seed);
    (0..).zip(&mut flies).for_each(|(index, fly)| fly.mask = (index % layer_count) as u16);
    flies
}

/// A scene of the picture whose tiles have the looks of a style and all shapes.
fn scene(target: &Arc<Target>, style: &str) -> Result<Scene> {
    let recipe = recipe(style)?.masks(all_shapes()?).shader(Shader::Emboss);
    let course = studio::work(target, &recipe)?.course;
    Ok(Scene { target: Arc::clone(target), masks: course.masks, background: [9, 80, 160], fly_count: TILES as usize })
}

/// Whole populations, and then some of their flies replaced.
fn fitness(target: &Arc<Target>) -> Result<Vec<Trial>> {
    let trial = |(name, style)| {
        let scene = scene(target, style)?;
        Ok(Trial::new(name, move |device: &Device| {
            let layer_count = scene.masks.layers().len();
            let mut evaluator = device.open_evaluator(vec![scene.clone()])?;
            evaluator.load(&[(0, &dressed_flies(layer_count, 1))])?;
            let mut parts = Part::evaluation(&evaluator.evaluation(0)).to_vec();
            parts.push(Part::layers(&evaluator.read_back_layers(0)?));
            let others = dressed_flies(layer_count, 2);
            let change = |index: u32| Change { lane: 0, index, fly: others[index as usize] };
            for first in [3_u32, 90, 170] {
                let changes: Vec<Change> = (first..first + 17).map(change).collect();
                evaluator.replace(&changes)?;
                parts.extend(Part::evaluation(&evaluator.evaluation(0)));
            }
            parts.push(Part::layers(&evaluator.read_back_layers(0)?));
            Ok(parts)
        }))
    };
    [("fitness, opaque", "mosaic"), ("fitness, translucent", "spray")].into_iter().map(trial).collect()
}

/// The published algorithm, one birth at a time and in batches.
fn papers(target: &Arc<Target>) -> Result<Vec<Trial>> {
    let trial = |(name, style, batch_births)| {
        let scene = scene(target, style)?;
        Ok(Trial::new(name, move |device: &Device| {
            let scheme = PaperScheme { births: BIRTHS, batch_births, ..PaperScheme::default() };
            let flies = dressed_flies(scene.masks.layers().len(), 3);
            let evolution = Evolution::new(scheme, 0, SIZE_PX[0], SIZE_PX[1], flies);
            let mut engine = Engine::new(device.open_evaluator(vec![scene.clone()])?, vec![evolution]);
            engine.run(&mut Undisturbed)?;
            let Ended { ending, flies, fitness } = engine.ended(0)?;
            let counts = [ending.sae as i64, ending.births() as i64];
            Ok(vec![
                Part::new("evolution", &["SAE", "births"], counts),
                Part::flies(&flies),
                Part::new("tile", &["marginal fitness"], fitness),
            ])
        }))
    };
    [("paper", "mosaic", 1), ("paper, translucent, in batches", "spray", 8)].into_iter().map(trial).collect()
}

/// Searches of all styles and numbers of candidates, and of all that changes how pixels count.
fn searches(target: &Arc<Target>) -> Result<Vec<Trial>> {
    let mut trials = Vec::new();
    for style in Style::NAMES {
        for candidates in CANDIDATES {
            let work = studio::work(target, &recipe(style)?.candidates(candidates))?;
            trials.push(search(format!("search, {style}, {candidates} a step"), work));
        }
    }
    for style in ["mosaic", "spray"] {
        let masked = recipe(style)?.masks(all_shapes()?);
        trials.push(search(format!("search, {style}, all shapes"), studio::work(target, &masked)?));
        for (name, mode) in [("mean", ColorMode::Mean), ("picked", ColorMode::Pick), ("evolved", ColorMode::Evolved)] {
            let colored = recipe(style)?.color_mode(mode);
            trials.push(search(format!("search, {style}, {name} colours"), studio::work(target, &colored)?));
        }
        trials.push(leashed(target, style)?);
    }
    let pixel_count = target.pixels().len();
    let weights = (0..pixel_count).map(|pixel| (pixel % 16 + 1) as u8).collect();
    let weighed = Arc::new(Target::clone(target).with_weights(weights)?);
    trials.push(search("search, free, with weights", studio::work(&weighed, &recipe("free")?)?));
    let is_clear = |pixel: usize| {
        let (x, y) = (pixel as u32 % SIZE_PX[0], pixel as u32 / SIZE_PX[0]);
        x.abs_diff(SIZE_PX[0] / 2).pow(2) + y.abs_diff(SIZE_PX[1] / 2).pow(2) > 60 * 60
    };
    let cut_out = Arc::new(Target::clone(target).with_transparent((0..pixel_count).map(is_clear).collect())?);
    for style in ["mosaic", "spray"] {
        let work = studio::work(&cut_out, &recipe(style)?)?;
        trials.push(search(format!("search, {style}, over nothing"), work));
    }
    Ok(trials)
}

fn search(name: impl Into<String>, studio::Work { course, .. }: studio::Work) -> Trial {
    search_from(name, course, None)
}

/// A search that goes on from tiles of another seed, each of which stays near its place, as in a video.
fn leashed(target: &Arc<Target>, style: &str) -> Result<Trial> {
    let mut before = CpuSearch::new(studio::work(target, &recipe(style)?.seed(6))?.course);
    before.advance(1)?;
    before.renormalise()?;
    let mut course = studio::work(target, &recipe(style)?)?.course;
    course.rules.leash = LEASH;
    Ok(search_from(format!("search, {style}, on a leash"), course, Some(before.read_back()?.flies)))
}

fn search_from(name: impl Into<String>, course: Course, first: Option<Vec<Fly>>) -> Trial {
    Trial::new(name, move |device| {
        let OpenedSearch { mut search, stand_in } = device.open_search(course.clone())?;
        if let Some(reason) = stand_in {
            return Err(Error::Internal(format!("the CPU stood in, since {reason}")));
        }
        let budget = Budget { evals: EVALS, target_sae: None, patience: None };
        cells::run(&mut *search, first.as_deref(), &budget, &mut Undisturbed)?;
        everything(&mut *search)
    })
}

/// All that can be read back of a search.
fn everything(search: &mut dyn Search) -> Result<Vec<Part>> {
    let mut parts = vec![Part::standing(search.standing())];
    parts.extend(Part::state(&search.read_back()?));
    parts.push(Part::stacks(&search.read_back_stacks()?));
    parts.push(Part::new("search", &["SAE"], [search.sae()? as i64]));
    Ok(parts)
}

/// Drawings of opaque and of translucent tiles.
fn drawings(target: &Arc<Target>) -> Result<Vec<Trial>> {
    let [width_px, height_px] = SIZE_PX;
    let as_evolved = (Canvas::evaluation(width_px, height_px), 1);
    let larger = (Canvas::scaled(width_px, height_px, 777), 2);
    let mut trials = Vec::new();
    for (name, style) in [("opaque", "mosaic"), ("translucent", "spray")] {
        let stage = studio::work(target, &recipe(style)?.masks(all_shapes()?).shader(Shader::Emboss))?.stage;
        let needs_graphics = stage.masks.blend() == Blend::Opaque;
        let flies = dressed_flies(stage.masks.layers().len(), 4);
        let over_color = Population { flies, ..stage };
        let over_nothing = Population { background: Backdrop::Transparent, ..over_color.clone() };
        let trial = Trial::new(format!("drawing, {name}"), move |device| {
            let mut painter = device.open_painter()?;
            let mut parts = Vec::new();
            for population in [&over_color, &over_nothing] {
                for (canvas, supersampling) in [&as_evolved, &larger] {
                    parts.push(Part::mosaic(&painter.draw(population, canvas, *supersampling)?));
                }
            }
            Ok(parts)
        });
        trials.push(Trial { needs_graphics, ..trial });
    }
    Ok(trials)
}

/// Pictures of several kinds and sizes side by side.
fn lanes(device: &Device) -> Result<Vec<Part>> {
    let task = |lane: usize| {
        let style = Style::NAMES[lane % Style::NAMES.len()];
        let [width_px, height_px] = [40 + 9 * lane as u32, 64 - 5 * lane as u32];
        let target = built_in::picture(96, [width_px, height_px])?;
        let picture = Picture::from_rgb8(width_px, height_px, target.pixels().as_flattened())?;
        Ok((picture, Recipe::named(style)?.tiles(60).seed(lane as u64).evals(2_000)))
    };
    let mut made: Vec<Option<Result<Vec<Part>>>> = (0..LANES).map(|_| None).collect();
    let keep = |lane: usize, mosaic: Result<Mosaic>| {
        made[lane] = Some(mosaic.map(|mosaic| {
            let counts = [mosaic.sae() as i64, mosaic.evals() as i64, mosaic.births() as i64];
            vec![Part::new("picture", &["SAE", "evals", "births"], counts), Part::flies(&mosaic.population().flies)]
        }));
        true
    };
    make_all(device, (0..LANES).map(task), || true, keep)?;
    let missing = || Err(Error::Internal("a picture is missing".to_owned()));
    let parts: Vec<Vec<Part>> = made.into_iter().map(|made| made.unwrap_or_else(missing)).collect::<Result<_>>()?;
    Ok(parts.into_iter().flatten().collect())
}
