//! The parameters of the paper's scheme beyond births, restarts and cooling: as typed, checked, and in the key.

use clap::{Args, ValueEnum};
use serde_json::{Map, Value, json};

use super::job::Job;
use super::options::EvolveOptions;
use super::{provenance, values};
use crate::error::{Error, Result};
use crate::evolve::scheme::{MITOSIS_MAX, ONE_Q16};
use crate::evolve::{ColorMode, PaperScheme};
use crate::model::operators::Rotation;

/// Least and greatest factor of the first sides.
const TILE_SCALES: std::ops::RangeInclusive<f64> = 0.1..=100.0;

#[derive(Debug, Args)]
pub(super) struct SchemeArgs {
    /// Probability that a child mutates, 0 to 1; otherwise it is a plain copy
    #[arg(long, value_name = "P", value_parser = values::number, default_value_t = 1.0, help_heading = "Evolution")]
    pub p_mutation: f64,
    /// Probability that a child is crossed from two good flies, 0 to 1, before it may mutate
    #[arg(long, value_name = "P", value_parser = values::number, default_value_t = 0.0, help_heading = "Evolution")]
    pub p_crossover: f64,
    /// Probability that a fresh random fly is born instead of a child, 0 to 1
    #[arg(long, value_name = "P", value_parser = values::number, default_value_t = 0.0, help_heading = "Evolution")]
    pub new_blood: f64,
    /// Begin with N / 2^M tiles, each of which splits in two at each of the first M restarts, 0 to 20
    #[arg(
        long,
        value_name = "M",
        value_parser = values::count,
        default_value = "0",
        help_heading = "Evolution",
        conflicts_with = "init"
    )]
    pub mitosis: u64,
    /// Where the colour of a new tile comes from
    #[arg(long, value_enum, value_name = "MODE", default_value = "evolved", help_heading = "Evolution")]
    pub color_mode: ColorModeName,
    /// Turn no tile: all angles are 0
    #[arg(long, help_heading = "Evolution")]
    pub no_rotation: bool,
    /// First sides over those of the paper's Eq. 1, 0.1 to 100
    #[arg(long, value_name = "S", value_parser = values::number, default_value_t = 1.0, help_heading = "Evolution")]
    pub tile_scale: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
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

impl SchemeArgs {
    /// `scheme` with these parameters; `has_init` tells whether it begins from a population of the user's.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag and what it may be.
    pub(super) fn apply(&self, scheme: PaperScheme, has_init: bool) -> Result<PaperScheme> {
        let mitosis = self.mitosis;
        if mitosis > u64::from(MITOSIS_MAX) {
            return Err(Error::Usage(format!("--mitosis {mitosis}: must be 0 to {MITOSIS_MAX}")));
        }
        if mitosis > u64::from(scheme.restarts) {
            return Err(Error::Usage(format!(
                "--mitosis {mitosis}: tiles split at restarts; make --restarts at least {mitosis}"
            )));
        }
        let new_blood_q16 = probability_q16("--new-blood", self.new_blood)?;
        if !TILE_SCALES.contains(&self.tile_scale) {
            return Err(Error::Usage(format!("--tile-scale {}: must be 0.1 to 100", self.tile_scale)));
        }
        let tile_scale_q16 = (self.tile_scale * f64::from(ONE_Q16)).round() as u32;
        if tile_scale_q16 != ONE_Q16 && has_init && new_blood_q16 == 0 {
            let sentence = "--tile-scale changes only random tiles, and --init gives others; drop one of them";
            return Err(Error::Usage(sentence.to_owned()));
        }
        let mut scheme = PaperScheme {
            mutation_q16: probability_q16("--p-mutation", self.p_mutation)?,
            crossover_q16: probability_q16("--p-crossover", self.p_crossover)?,
            new_blood_q16,
            mitosis: mitosis as u32,
            rotation: if self.no_rotation { Rotation::None } else { Rotation::Free },
            tile_scale_q16,
            ..scheme
        };
        scheme.color.mode = self.color_mode.mode();
        Ok(scheme)
    }
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
pub(super) fn check_fly_count(options: &EvolveOptions, job: &Job) -> Result<()> {
    let scheme = &options.scheme;
    if job.fly_count >> scheme.mitosis == 0 {
        let (mitosis, needed) = (scheme.mitosis, 1_u64 << scheme.mitosis);
        return Err(Error::Usage(format!("--mitosis {mitosis}: needs at least {needed} tiles, not {}", job.fly_count)));
    }
    let (batch_births, living) = (scheme.batch_births as usize, scheme.living(0, job.fly_count));
    if batch_births > living {
        let first = if scheme.mitosis > 0 { "first " } else { "" };
        return Err(Error::Usage(format!(
            "--batch-births {batch_births}: must be at most the {first}number of tiles, {living}"
        )));
    }
    Ok(())
}

/// What decides the result of a scheme beyond what every key holds: only what differs from its default, so that the keys
/// of commands without these options stay as they were.
pub(super) fn decisive(scheme: &PaperScheme) -> Map<String, Value> {
    let usual = PaperScheme::default();
    let mut told = Map::new();
    let mut tell = |name: &str, value: Value, is_usual: bool| {
        if !is_usual {
            told.insert(name.to_owned(), value);
        }
    };
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
    use crate::evolve::{ColorRule, Palette};

    #[test]
    fn probabilities_keep_their_ends_and_nothing_else_reaches_them() {
        let q16 = |probability| probability_q16("--new-blood", probability).expect("it is a probability");
        assert_eq!([0.0, 1e-9, 0.5, 0.999_999_9, 1.0].map(q16), [0, 1, 32_768, 65_535, 65_536]);
        assert!([-0.1, 1.1, f64::NAN].iter().all(|&wrong| probability_q16("--new-blood", wrong).is_err()));
    }

    #[test]
    fn only_what_differs_from_its_default_is_in_the_key() {
        assert!(decisive(&PaperScheme::default()).is_empty());
        let palette = Palette::new([[0, 255, 16]]).ok();
        let scheme = PaperScheme {
            crossover_q16: 7,
            masks: vec![vec![1], vec![2, 3]],
            color: ColorRule { mode: ColorMode::Pick, palette },
            ..PaperScheme::default()
        };
        let told = Value::Object(decisive(&scheme));
        let wanted = json!({
            "p_crossover_q16": 7, "mask_layers": [[1], [2, 3]], "color_mode": "pick", "palette": ["00ff10"]
        });
        assert_eq!(told, wanted);
    }
}
