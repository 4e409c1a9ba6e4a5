//! The parameters of the paper's scheme: as typed, checked, and in the key.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::options::in_range;
use super::picture::PictureArgs;
use super::presets::Preset;
use super::{provenance, values};
use crate::error::{Error, Result};
use crate::evolve::scheme::{MITOSIS_MAX, ONE_Q16, PAPER_BIRTHS};
use crate::evolve::{ColorMode, ColorRule, OnDry, PaperScheme};
use crate::model::operators::Rotation;
use crate::model::population::FLY_COUNT_MAX;

/// Most restarts of one evolution.
const RESTARTS_MAX: u64 = 1_000_000;
/// Least factor of the mutation steps: it is kept in 65,536ths and must not become 0.
const COOL_MIN: f64 = 0.00001;

/// Least and greatest factor of the first sides.
const TILE_SCALES: std::ops::RangeInclusive<f64> = 0.1..=100.0;

/// The flags that only the paper's scheme has.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Evolution with --scheme paper")]
pub(super) struct PaperSchemeArgs {
    /// Births of each run (suffixes k, M) [default: 40k]
    #[arg(long, value_name = "B", value_parser = values::count)]
    pub births: Option<u64>,
    /// Births evaluated together, 1 to N; more is faster on a GPU, 1 is the published algorithm [default: 1]
    #[arg(long, value_name = "K", value_parser = values::count)]
    pub batch_births: Option<u64>,
    /// Further runs, each from the best population so far, 0 to 1,000,000 [default: 0, or as in --preset]
    #[arg(long, value_name = "R", value_parser = values::count)]
    pub restarts: Option<u64>,
    /// Masks that all tiles change to at the first restart [default: none, or as in --preset]
    #[arg(long = "restart-mask", value_name = "NAME|FILE", value_delimiter = ',')]
    pub restart_masks: Vec<PathBuf>,
    /// Factor of all mutation steps at each restart, 0.00001 to 1 [default: 1]
    #[arg(long, value_name = "F", value_parser = values::number)]
    pub cool: Option<f64>,
    /// What to do when no bad tile is found: take the worse of two, begin the next run, or stop [default: fallback]
    #[arg(long, value_enum, value_name = "ACTION")]
    pub on_dry: Option<OnDryName>,
    /// Probability that a child mutates, 0 to 1; otherwise it is a plain copy [default: 1]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub p_mutation: Option<f64>,
    /// Probability that a child is crossed from two good flies, 0 to 1, before it may mutate [default: 0]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub p_crossover: Option<f64>,
    /// Probability that a fresh random fly is born instead of a child, 0 to 1 [default: 0]
    #[arg(long, value_name = "P", value_parser = values::number)]
    pub new_blood: Option<f64>,
    /// Begin with N / 2^M tiles, each of which splits in two at each of the first M restarts, 0 to 20 [default: 0]
    #[arg(long, value_name = "M", value_parser = values::count, conflicts_with = "init")]
    pub mitosis: Option<u64>,
    /// Turn no tile: all angles are 0
    #[arg(long)]
    pub no_rotation: bool,
    /// First sides over those of the paper's Eq. 1, 0.1 to 100 [default: 1]
    #[arg(long, value_name = "S", value_parser = values::number)]
    pub tile_scale: Option<f64>,
}

/// What to do when no bad tile is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum OnDryName {
    Fallback,
    Restart,
    Stop,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(super) enum ColorModeName {
    /// Its genes: inherited and mutated
    Evolved,
    /// The target's pixel nearest to its centre
    Pick,
    /// The mean of the target where the tile shows
    Mean,
    /// The median of the target where the tile shows
    Median,
}

impl ColorModeName {
    fn mode(self) -> ColorMode {
        match self {
            Self::Evolved => ColorMode::Evolved,
            Self::Pick => ColorMode::Pick,
            Self::Mean => ColorMode::Mean,
            Self::Median => ColorMode::Median,
        }
    }
}

impl PaperSchemeArgs {
    /// The first of these flags that was given.
    pub(super) fn given(&self) -> Option<&'static str> {
        let given = [
            ("--births", self.births.is_some()),
            ("--batch-births", self.batch_births.is_some()),
            ("--restarts", self.restarts.is_some()),
            ("--restart-mask", !self.restart_masks.is_empty()),
            ("--cool", self.cool.is_some()),
            ("--on-dry", self.on_dry.is_some()),
            ("--p-mutation", self.p_mutation.is_some()),
            ("--p-crossover", self.p_crossover.is_some()),
            ("--new-blood", self.new_blood.is_some()),
            ("--mitosis", self.mitosis.is_some()),
            ("--no-rotation", self.no_rotation),
            ("--tile-scale", self.tile_scale.is_some()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(flag, _)| flag)
    }
}

/// The scheme that `args` ask for; what they do not tell is as in `preset`.
///
/// # Errors
/// [`Error::Usage`] that names the flag and what it may be.
pub(super) fn paper_scheme(args: &PictureArgs, preset: Option<Preset>) -> Result<PaperScheme> {
    let of_preset = preset.map_or(0, |preset| u64::from(preset.restarts()));
    let restarts = in_range("--restarts", args.paper.restarts.unwrap_or(of_preset), (0, RESTARTS_MAX))? as u32;
    let batch_births = in_range("--batch-births", args.paper.batch_births.unwrap_or(1), (1, FLY_COUNT_MAX as u64))?;
    let patience = args.patience.map(|births| in_range("--patience", births, (1, u64::MAX))).transpose()?;
    let PaperSchemeArgs { mitosis, tile_scale, .. } = args.paper;
    let (mitosis, tile_scale) = (mitosis.unwrap_or(0), tile_scale.unwrap_or(1.0));
    if mitosis > u64::from(MITOSIS_MAX) {
        return Err(Error::Usage(format!("--mitosis {mitosis}: must be 0 to {MITOSIS_MAX}")));
    }
    if mitosis > u64::from(restarts) {
        return Err(Error::Usage(format!(
            "--mitosis {mitosis}: tiles split at restarts; make --restarts at least {mitosis}"
        )));
    }
    let new_blood_q16 = probability_q16("--new-blood", args.paper.new_blood.unwrap_or(0.0))?;
    if !TILE_SCALES.contains(&tile_scale) {
        return Err(Error::Usage(format!("--tile-scale {tile_scale}: must be 0.1 to 100")));
    }
    let tile_scale_q16 = (tile_scale * f64::from(ONE_Q16)).round() as u32;
    if tile_scale_q16 != ONE_Q16 && args.init.is_some() && new_blood_q16 == 0 {
        let sentence = "--tile-scale changes only random tiles, and --init gives others; drop one of them";
        return Err(Error::Usage(sentence.to_owned()));
    }
    let mode = args.color_mode.map_or(ColorMode::Evolved, ColorModeName::mode);
    Ok(PaperScheme {
        seed: args.seed,
        births: args.paper.births.unwrap_or(preset.map_or(PAPER_BIRTHS, Preset::births)),
        restarts,
        cool_q16: cool_q16(args.paper.cool.unwrap_or(1.0), restarts)?,
        on_dry: match args.paper.on_dry {
            None | Some(OnDryName::Fallback) => OnDry::Fallback,
            Some(OnDryName::Restart) => OnDry::Restart,
            Some(OnDryName::Stop) => OnDry::Stop,
        },
        patience,
        target_sae: args.target_sae,
        batch_births: batch_births as u32,
        mutation_q16: probability_q16("--p-mutation", args.paper.p_mutation.unwrap_or(1.0))?,
        crossover_q16: probability_q16("--p-crossover", args.paper.p_crossover.unwrap_or(0.0))?,
        new_blood_q16,
        mitosis: mitosis as u32,
        rotation: if args.paper.no_rotation { Rotation::None } else { Rotation::Free },
        tile_scale_q16,
        masks: Vec::new(),
        color: ColorRule { mode, palette: None },
    })
}

/// The factor of the mutation steps at each restart.
fn cool_q16(cool: f64, restarts: u32) -> Result<u32> {
    if !(COOL_MIN..=1.0).contains(&cool) {
        return Err(Error::Usage(format!("--cool {cool}: must be {COOL_MIN} to 1")));
    }
    let cool_q16 = (cool * f64::from(ONE_Q16)).round() as u32;
    if cool_q16 < ONE_Q16 && restarts == 0 {
        return Err(Error::Usage("--cool changes only the runs after the first; add --restarts".to_owned()));
    }
    Ok(cool_q16)
}

/// A probability in 1/65536; one that is neither 0 nor 1 stays so.
fn probability_q16(flag: &str, probability: f64) -> Result<u32> {
    if !(0.0..=1.0).contains(&probability) {
        return Err(Error::Usage(format!("{flag} {probability}: must be 0 to 1")));
    }
    let rounded = (probability * f64::from(ONE_Q16)).round() as u32;
    let is_certain = probability == 0.0 || probability == 1.0;
    Ok(if is_certain { rounded } else { rounded.clamp(1, ONE_Q16 - 1) })
}

/// Checks the scheme against the number of tiles.
///
/// # Errors
/// [`Error::Usage`] that names the flag and what it may be.
pub(super) fn check_fly_count(scheme: &PaperScheme, fly_count: usize) -> Result<()> {
    if fly_count >> scheme.mitosis == 0 {
        let (mitosis, needed) = (scheme.mitosis, 1_u64 << scheme.mitosis);
        return Err(Error::Usage(format!("--mitosis {mitosis}: needs at least {needed} tiles, not {fly_count}")));
    }
    let (batch_births, living) = (scheme.batch_births as usize, scheme.living(0, fly_count));
    if batch_births > living {
        let first = if scheme.mitosis > 0 { "first " } else { "" };
        return Err(Error::Usage(format!(
            "--batch-births {batch_births}: must be at most the {first}number of tiles, {living}"
        )));
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
    let palette = scheme
        .color
        .palette
        .as_ref()
        .map(|palette| palette.colors().iter().map(|color| provenance::hexadecimal(color)).collect());
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

fn on_dry_name(on_dry: OnDry) -> &'static str {
    match on_dry {
        OnDry::Fallback => "fallback",
        OnDry::Restart => "restart",
        OnDry::Stop => "stop",
    }
}

fn color_mode_name(mode: ColorMode) -> &'static str {
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
        let q16 = |probability| probability_q16("--new-blood", probability).expect("it is a probability");
        assert_eq!([0.0, 1e-9, 0.5, 0.999_999_9, 1.0].map(q16), [0, 1, 32_768, 65_535, 65_536]);
        assert!([-0.1, 1.1, f64::NAN].iter().all(|&wrong| probability_q16("--new-blood", wrong).is_err()));
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
