//! What was asked for, in its own words: the parameters of a job that differ from their defaults, under the names of
//! the flags that set them (without the minuses), in one order. Two commands that ask for the same in other words are
//! told alike, where that needs no second picture.

use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::cells::CellsSettings;
use super::decimal::{of_units, shortest};
use super::hashes::population_sha256;
use super::hex::hexadecimal;
use super::job::Job;
use super::look::{Dress, Look, Mask};
use super::paper;
use super::settings::{LONG_SIDE_PX, SchemeSettings, Settings};
use crate::evolve::cells::EVALS_PER_FLY;
use crate::evolve::scheme::ONE_Q16;
use crate::evolve::style::Style;
use crate::evolve::{ColorMode, PaperScheme};
use crate::model::cells::rules::ColorSource;
use crate::model::fly::UNITS_PER_PX;
use crate::model::operators::Rotation;
use crate::model::{Backdrop, Blend};
use crate::photo;
use crate::shapes::Shader;

/// What stands for the bytes of a file whose name decides nothing.
const HASH: &str = "sha256:";

/// The parameter that a finished mosaic may change.
pub(super) const OUTPUT_SIZE: &str = "output-size";

/// Parameters with their values.
type Told = Map<String, Value>;

/// Tells a parameter if there is something to tell.
fn tell(told: &mut Told, name: &str, value: Option<impl Into<Value>>) {
    if let Some(value) = value {
        told.insert(name.to_owned(), value.into());
    }
}

/// The parameters of a job; `resized_px` is the longer side of the pictures, unless it is as evolved.
pub(super) fn asked(settings: &Settings, job: &Job, resized_px: Option<u32>) -> Told {
    let mut told = Told::new();
    let long_side_px = job.target.width_px().max(job.target.height_px());
    tell(&mut told, "size", Some(long_side_px).filter(|&px| u64::from(px) != LONG_SIDE_PX));
    let init = job.init.as_deref().map(|population| HASH.to_owned() + &population_sha256(population));
    tell(&mut told, "tiles", init.is_none().then_some(job.fly_count));
    tell(&mut told, "init", init);
    let weight = job.target.weights().map(|weights| HASH.to_owned() + &hexadecimal(&Sha256::digest(weights)));
    tell(&mut told, "weight", weight);
    tell(&mut told, "colors", job.color_count);
    let palette = job.palette.as_ref().map(|palette| palette.colors().iter().map(|color| hexadecimal(color)).collect());
    tell(&mut told, "palette", palette.map(|colors: Vec<String>| colors));
    tell(
        &mut told,
        "background",
        settings.background.and_then(|background| match background {
            Backdrop::Color(color) => Some(hexadecimal(&color)),
            Backdrop::Transparent => job.is_bare.then(|| "none".to_owned()),
        }),
    );
    tell(&mut told, "lenient", photo::is_in_part(&job.warnings).then_some(true));
    tell(&mut told, "time", settings.time_limit.map(|limit| format!("{}ms", limit.as_millis())));
    tell(&mut told, OUTPUT_SIZE, resized_px);
    tell(&mut told, "seed", Some(job.scheme.seed()));
    match &job.scheme {
        SchemeSettings::Cells(cells) => told.extend(of_cells(settings, job, cells)),
        SchemeSettings::Paper(scheme) => told.extend(of_paper(settings, job, scheme)),
    }
    told
}

fn of_cells(settings: &Settings, job: &Job, cells: &CellsSettings) -> Told {
    let is_translucent = job.masks().blend() == Blend::Translucent;
    let worn = |style: Style| if is_translucent { style.for_translucent_tiles() } else { style };
    let (name, differences) = super::preset_text::of_style(cells.style(), worn);
    let mut told = Told::new();
    if differences.is_empty() {
        tell(&mut told, "style", Some(name).filter(|name| *name != Style::NAMES[0]));
    } else {
        let mut preset = Told::from_iter([("style".to_owned(), name.into())]);
        preset.extend(differences);
        tell(&mut told, "preset", Some(preset));
    }
    let budget = cells.budget(job.fly_count);
    tell(&mut told, "evals", Some(budget.evals).filter(|&evals| evals != EVALS_PER_FLY * job.fly_count as u64));
    tell(&mut told, "target-sae", budget.target_sae);
    tell(&mut told, "patience", budget.patience);
    tell(&mut told, "candidates", Some(cells.candidates()).filter(|&candidates| candidates != 1));
    let usual = if job.palette.is_some() { ColorSource::Pick } else { ColorSource::Median };
    tell(&mut told, "color-mode", (cells.color() != usual).then(|| super::cells::color_name(cells.color())));
    told.extend(grout(job, cells));
    let base = Style::named(name);
    told.extend(look_asked(&settings.look, base.as_ref(), job.dress.as_ref()));
    told
}

/// The grout, if it is not that of the style.
fn grout(job: &Job, cells: &CellsSettings) -> Told {
    let mut told = Told::new();
    let usual = cells.usual_grout(&job.target, job.fly_count);
    match job.grout {
        grout if grout == usual.of_style => {}
        None => tell(&mut told, "grout", Some("none")),
        Some(grout) => {
            let is_auto = usual.if_asked.is_some_and(|usual| usual.color == grout.color);
            tell(&mut told, "grout", Some(if is_auto { "auto".to_owned() } else { hexadecimal(&grout.color) }));
            let width = of_units(grout.width, f64::from(UNITS_PER_PX));
            tell(
                &mut told,
                "grout-width",
                (usual.if_asked.map(|usual| usual.width) != Some(grout.width)).then_some(width),
            );
        }
    }
    told
}

fn of_paper(settings: &Settings, job: &Job, scheme: &PaperScheme) -> Told {
    let usual = PaperScheme::default();
    let mut told = Told::new();
    tell(&mut told, "scheme", Some("paper"));
    let differing = |value: u64, usual: u64| Some(value).filter(|&value| value != usual);
    let share = |q16: u32, usual: u32| (q16 != usual).then(|| of_units(q16, f64::from(ONE_Q16)));
    let probability = |q16: u32, usual: u32| {
        let is_read = |decimal| paper::probability_q16(decimal) == q16;
        (q16 != usual).then(|| shortest(f64::from(q16) / f64::from(ONE_Q16), is_read))
    };
    tell(&mut told, "births", differing(scheme.births, usual.births));
    tell(&mut told, "batch-births", differing(scheme.batch_births.into(), usual.batch_births.into()));
    tell(&mut told, "restarts", differing(scheme.restarts.into(), usual.restarts.into()));
    tell(&mut told, "cool", share(scheme.cool_q16, usual.cool_q16));
    tell(&mut told, "on-dry", (scheme.on_dry != usual.on_dry).then(|| paper::on_dry_name(scheme.on_dry)));
    tell(&mut told, "target-sae", scheme.target_sae);
    tell(&mut told, "patience", scheme.patience);
    tell(&mut told, "p-mutation", probability(scheme.mutation_q16, usual.mutation_q16));
    tell(&mut told, "p-crossover", probability(scheme.crossover_q16, usual.crossover_q16));
    tell(&mut told, "new-blood", probability(scheme.new_blood_q16, usual.new_blood_q16));
    tell(&mut told, "mitosis", differing(scheme.mitosis.into(), usual.mitosis.into()));
    tell(&mut told, "no-rotation", (scheme.rotation == Rotation::None).then_some(true));
    tell(&mut told, "tile-scale", share(scheme.tile_scale_q16, usual.tile_scale_q16));
    let mode = scheme.color.mode;
    tell(&mut told, "color-mode", (mode != ColorMode::Evolved).then(|| paper::color_mode_name(mode)));
    told.extend(look_asked(&settings.look, None, job.dress.as_ref()));
    told
}

/// The masks, and what becomes of them, if that is not as in the style `base`. `dress` is what they became, unless all
/// tiles are plain squares, whatever was asked for.
pub(crate) fn look_asked(look: &Look, base: Option<&Style>, dress: Option<&Dress>) -> Told {
    let mut told = Told::new();
    let Some((choices, restart_masks)) = look.asked(base, dress.is_none()) else { return told };
    let layers = |run: usize| dress.and_then(|dress| dress.layers_by_run.get(run)).map_or(&[][..], |layers| layers);
    tell(&mut told, "mask", names(&choices.masks, dress, layers(0)));
    tell(&mut told, "restart-mask", names(restart_masks, dress, layers(1)));
    tell(&mut told, "shader", choices.shader.map(Shader::name));
    let blend = choices.blend.map(|blend| match blend {
        Blend::Opaque => "opaque",
        Blend::Translucent => "translucent",
    });
    tell(&mut told, "blend", blend);
    tell(&mut told, "opacity", choices.opacity);
    told
}

/// The names of the masks that come with smalti, and hashes of the texels of all others. `layers` are those of `dress`
/// that they became.
fn names(masks: &[Mask], dress: Option<&Dress>, layers: &[u16]) -> Option<Vec<String>> {
    let texels = |place: usize| {
        let layer = layers.get(place).map_or(0, |&layer| usize::from(layer));
        dress.and_then(|dress| dress.masks.layers().get(layer)).map_or(&[][..], |mask| mask.texels())
    };
    let name = |(place, mask): (usize, &Mask)| match mask.built_in() {
        Some(shape) => shape.name().to_owned(),
        None => HASH.to_owned() + &hexadecimal(&Sha256::digest(bytemuck::cast_slice(texels(place)))),
    };
    (!masks.is_empty()).then(|| masks.iter().enumerate().map(name).collect())
}
