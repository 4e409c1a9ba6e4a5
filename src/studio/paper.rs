//! The parameters of the paper's scheme: from a recipe, and in the key.

use serde_json::{Map, Value, json};

use super::hex::hexadecimal;
use super::parameters::{contradiction, wrong};
use super::presets::PaperPreset;
use super::recipe::Recipe;
use crate::error::Result;
use crate::evolve::scheme::{ONE_Q16, PAPER_BIRTHS};
use crate::evolve::{ColorMode, ColorRule, OnDry, PaperScheme};
use crate::model::operators::Rotation;

/// The scheme of a recipe, but for its masks and its palette.
///
/// # Errors
/// [`crate::Error::Parameter`] if parameters contradict each other.
pub(super) fn paper_scheme(recipe: &Recipe) -> Result<PaperScheme> {
    let (choices, numbers) = (&recipe.choices, &recipe.numbers);
    let preset = choices.paper_preset;
    let restarts = numbers.restarts.unwrap_or(preset.map_or(0, |preset| u64::from(preset.restarts()))) as u32;
    let mitosis = numbers.mitosis.unwrap_or(0) as u32;
    if mitosis > restarts {
        return Err(wrong("mitosis", mitosis, format!("tiles split at restarts; make `restarts` at least {mitosis}")));
    }
    let new_blood_q16 = probability_q16(numbers.new_blood.unwrap_or(0.0));
    let tile_scale_q16 = (numbers.tile_scale.unwrap_or(1.0) * f64::from(ONE_Q16)).round() as u32;
    if tile_scale_q16 != ONE_Q16 && choices.init.is_some() && new_blood_q16 == 0 {
        return Err(contradiction(
            "tile_scale",
            "changes only random tiles, and `init` gives others; drop one of them",
        ));
    }
    Ok(PaperScheme {
        seed: numbers.seed.unwrap_or(0),
        births: numbers.births.unwrap_or(preset.map_or(PAPER_BIRTHS, PaperPreset::births)),
        restarts,
        cool_q16: cool_q16(numbers.cool.unwrap_or(1.0), restarts)?,
        on_dry: choices.on_dry.unwrap_or_default(),
        patience: numbers.patience,
        target_sae: numbers.target_sae,
        batch_births: numbers.batch_births.unwrap_or(1) as u32,
        mutation_q16: probability_q16(numbers.p_mutation.unwrap_or(1.0)),
        crossover_q16: probability_q16(numbers.p_crossover.unwrap_or(0.0)),
        new_blood_q16,
        mitosis,
        rotation: if choices.no_rotation { Rotation::None } else { Rotation::Free },
        tile_scale_q16,
        masks: Vec::new(),
        color: ColorRule { mode: choices.color_mode.unwrap_or(ColorMode::Evolved), palette: None },
    })
}

/// The factor of the mutation steps at each restart.
fn cool_q16(cool: f64, restarts: u32) -> Result<u32> {
    let cool_q16 = (cool * f64::from(ONE_Q16)).round() as u32;
    if cool_q16 < ONE_Q16 && restarts == 0 {
        return Err(contradiction("cool", "changes only the runs after the first; add `restarts`"));
    }
    Ok(cool_q16)
}

/// A probability in 1/65536; one that is neither 0 nor 1 stays so.
pub(super) fn probability_q16(probability: f64) -> u32 {
    let rounded = (probability * f64::from(ONE_Q16)).round() as u32;
    let is_certain = probability == 0.0 || probability == 1.0;
    if is_certain { rounded } else { rounded.clamp(1, ONE_Q16 - 1) }
}

/// Checks the scheme against the number of tiles.
///
/// # Errors
/// [`crate::Error::Parameter`].
pub(super) fn check_fly_count(scheme: &PaperScheme, fly_count: usize) -> Result<()> {
    if fly_count >> scheme.mitosis == 0 {
        let needed = 1_u64 << scheme.mitosis;
        return Err(wrong("mitosis", scheme.mitosis, format!("needs at least {needed} tiles, not {fly_count}")));
    }
    let living = scheme.living(0, fly_count);
    if scheme.batch_births as usize > living {
        let first = if scheme.mitosis > 0 { "first " } else { "" };
        let reason = format!("must be at most the {first}number of tiles, {living}");
        return Err(wrong("batch_births", scheme.batch_births, reason));
    }
    Ok(())
}

/// What decides the result of a scheme. What was not always there is told only if it differs from its default, so that
/// the keys of commands without these options stay as they were.
pub(super) fn decisive(scheme: &PaperScheme) -> Map<String, Value> {
    let usual = PaperScheme::default();
    let mut told = Map::new();
    let mut tell = |name: &str, value: Value, is_usual: bool| {
        if !is_usual {
            told.insert(name.to_owned(), value);
        }
    };
    tell("scheme", json!("paper"), false);
    tell("seed", json!(scheme.seed), false);
    tell("births_per_run", json!(scheme.births), false);
    tell("batch_births", json!(scheme.batch_births), false);
    tell("restarts", json!(scheme.restarts), false);
    tell("cool_q16", json!(scheme.cool_q16), false);
    tell("on_dry", json!(on_dry_name(scheme.on_dry)), false);
    tell("patience", json!(scheme.patience), false);
    tell("target_sae", json!(scheme.target_sae), false);
    tell("p_mutation_q16", json!(scheme.mutation_q16), scheme.mutation_q16 == usual.mutation_q16);
    tell("p_crossover_q16", json!(scheme.crossover_q16), scheme.crossover_q16 == usual.crossover_q16);
    tell("new_blood_q16", json!(scheme.new_blood_q16), scheme.new_blood_q16 == usual.new_blood_q16);
    tell("mitosis", json!(scheme.mitosis), scheme.mitosis == usual.mitosis);
    tell("rotation", json!(false), scheme.rotation == usual.rotation);
    tell("tile_scale_q16", json!(scheme.tile_scale_q16), scheme.tile_scale_q16 == usual.tile_scale_q16);
    tell("mask_layers", json!(scheme.masks), scheme.masks == usual.masks);
    tell("color_mode", json!(color_mode_name(scheme.color.mode)), scheme.color.mode == usual.color.mode);
    let palette =
        scheme.color.palette.as_ref().map(|palette| palette.colors().iter().map(|color| hexadecimal(color)).collect());
    tell("palette", json!(palette.as_ref().map(|colors: &Vec<String>| colors)), palette.is_none());
    told
}

/// The parameters that differ from their defaults, for people; masks and palette are told elsewhere.
pub(super) fn told(scheme: &PaperScheme) -> Vec<String> {
    let usual = PaperScheme::default();
    let share = |q16: u32| {
        format!("{:.4}", f64::from(q16) / f64::from(ONE_Q16)).trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    let parts = [
        (scheme.cool_q16 != usual.cool_q16, format!("steps x{} at each restart", share(scheme.cool_q16))),
        (scheme.color.mode != usual.color.mode, format!("colours by {}", color_mode_name(scheme.color.mode))),
        (scheme.mutation_q16 != usual.mutation_q16, format!("mutation {}", share(scheme.mutation_q16))),
        (scheme.crossover_q16 != usual.crossover_q16, format!("crossover {}", share(scheme.crossover_q16))),
        (scheme.new_blood_q16 != usual.new_blood_q16, format!("new blood {}", share(scheme.new_blood_q16))),
        (scheme.mitosis != usual.mitosis, format!("mitosis {}", scheme.mitosis)),
        (scheme.rotation != usual.rotation, "no rotation".to_owned()),
        (scheme.tile_scale_q16 != usual.tile_scale_q16, format!("tile scale {}", share(scheme.tile_scale_q16))),
    ];
    parts.into_iter().filter(|(differs, _)| *differs).map(|(_, part)| part).collect()
}

pub(super) fn on_dry_name(on_dry: OnDry) -> &'static str {
    match on_dry {
        OnDry::Fallback => "fallback",
        OnDry::Restart => "restart",
        OnDry::Stop => "stop",
    }
}

pub(super) fn color_mode_name(mode: ColorMode) -> &'static str {
    match mode {
        ColorMode::Evolved => "evolved",
        ColorMode::Pick => "pick",
        ColorMode::Mean => "mean",
        ColorMode::Median => "median",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evolve::Palette;

    #[test]
    fn probabilities_keep_their_ends_and_nothing_else_reaches_them() {
        assert_eq!([0.0, 1e-9, 0.5, 0.999_999_9, 1.0].map(probability_q16), [0, 1, 32_768, 65_535, 65_536]);
        let is_refused = |wrong| Recipe::paper().new_blood(wrong).check().is_err();
        assert!([-0.1, 1.1, f64::NAN].into_iter().all(is_refused));
    }

    #[test]
    fn of_later_parameters_only_what_differs_from_its_default_is_in_the_key() {
        let usual = decisive(&PaperScheme::default());
        let palette = Palette::new([[0, 255, 16]]).ok();
        let scheme = PaperScheme {
            crossover_q16: 7,
            masks: vec![vec![1], vec![2, 3]],
            color: ColorRule { mode: ColorMode::Pick, palette },
            ..PaperScheme::default()
        };
        let mut told = decisive(&scheme);
        told.retain(|name, _| !usual.contains_key(name));
        let told = Value::Object(told);
        let wanted = json!({
            "p_crossover_q16": 7, "mask_layers": [[1], [2, 3]], "color_mode": "pick", "palette": ["00ff10"]
        });
        assert_eq!(told, wanted);
    }
}
