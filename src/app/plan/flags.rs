//! The flags of a command line that a plan hands on to the commands in its scripts, as they were typed.

use std::ffi::OsString;

use clap::parser::ValueSource;
use clap::{ArgAction, CommandFactory};

use crate::app::cli::Cli;
use crate::error::{Error, Result};

/// The flags of the command `name` in the command line `typed`, as `--flag=value`; neither arguments without a flag nor those
/// in `kept`.
///
/// # Errors
/// [`Error::Usage`] if a value is no text: a script could not say it.
pub(super) fn typed(typed: &[OsString], name: &str, kept: &[&str]) -> Result<Vec<String>> {
    let mut cli = Cli::command();
    let matches = cli.try_get_matches_from_mut(typed).ok();
    let matches = matches.as_ref().and_then(|matches| matches.subcommand_matches(name));
    let (Some(matches), Some(command)) = (matches, cli.find_subcommand(name)) else {
        return Err(Error::Internal(format!("{name} was typed as another command")));
    };
    let mut flags = Vec::new();
    for arg in command.get_arguments() {
        let (id, Some(long)) = (arg.get_id().as_str(), arg.get_long()) else { continue };
        if kept.contains(&long) || matches.value_source(id) != Some(ValueSource::CommandLine) {
            continue;
        }
        if matches!(arg.get_action(), ArgAction::SetTrue) {
            flags.push(format!("--{long}"));
            continue;
        }
        for value in matches.get_raw(id).into_iter().flatten() {
            let value = value.to_str().ok_or_else(|| {
                let value = value.to_string_lossy();
                Error::Usage(format!("--{long}: a script can only say text in UTF-8, and {value} is not; rename it"))
            })?;
            flags.push(format!("--{long}={value}"));
        }
    }
    Ok(flags)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_handed_on_as_typed_and_nothing_else_is() {
        let line = "smalti plan photos -o out --shards 3 -n 2k --mask disc,flower --no-rotation -q --palette=it's.gpl";
        let line: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        let mut flags = typed(&line, "plan", &["output", "shards"]).expect("all is text");
        flags.sort();
        let expected = ["--mask=disc", "--mask=flower", "--no-rotation", "--palette=it's.gpl", "--quiet", "--tiles=2k"];
        assert_eq!(flags, expected);
        assert!(typed(&line, "batch", &[]).is_err(), "it is a plan");
    }
}
