//! What the driver is asked for.

use std::path::PathBuf;
use std::time::Duration;

use smalti_fuzz::targets::{TARGETS, Target};

pub const USAGE: &str =
    "smalti-fuzz [--inputs N] [--first N] [--minutes N] [--seed N] [--target NAME].. [--kept FOLDER]";
/// Inputs of a target, if nothing else is asked for.
const INPUTS: u64 = 500;

pub struct Options {
    /// The first input of each target; it and the seed decide the input.
    pub first: u64,
    /// Inputs of each target, unless the time is up before.
    pub inputs: u64,
    pub time: Option<Duration>,
    pub seed: u64,
    pub targets: Vec<&'static Target>,
    /// Where inputs are kept that found a fault.
    pub kept: PathBuf,
}

impl Options {
    pub fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, String> {
        let (mut first, mut inputs, mut minutes, mut seed, mut targets) = (0, None, None, 1, Vec::new());
        let mut kept = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/artifacts"));
        while let Some(word) = words.next() {
            let value = words.next().ok_or_else(|| format!("{word} needs a value; {USAGE}"))?;
            let number = || value.parse::<u64>().map_err(|_| format!("{word} {value} is no whole number; {USAGE}"));
            match word.as_str() {
                "--inputs" => inputs = Some(number()?),
                "--first" => first = number()?,
                "--minutes" => minutes = Some(number()?),
                "--seed" => seed = number()?,
                "--kept" => kept = PathBuf::from(value),
                "--target" => {
                    let found = TARGETS.iter().find(|target| target.name == value);
                    let names = || TARGETS.map(|target| target.name).join(", ");
                    targets.push(found.ok_or_else(|| format!("there is no target {value}; there are {}", names()))?);
                }
                _ => return Err(format!("{word} is no option; {USAGE}")),
            }
        }
        if targets.is_empty() {
            targets.extend(&TARGETS);
        }
        let time = minutes.map(|minutes| Duration::from_secs(60 * minutes));
        let inputs = inputs.unwrap_or(if time.is_some() { u64::MAX } else { INPUTS });
        Ok(Self { first, inputs, time, seed, targets, kept })
    }
}
