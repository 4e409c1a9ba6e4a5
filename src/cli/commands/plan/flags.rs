//! The flags that a plan passes on to the commands in its scripts, as they were typed.

use clap::ArgAction;
use clap::parser::ValueSource;

use super::scripts;
use crate::cli::args::typed::Typed;
use crate::error::{Error, Result};

/// The typed flags of the command `name` as `--flag=value`, without positional arguments and without those in `kept`.
///
/// # Errors
/// [`Error::Usage`] if a value is not text, which no script could contain.
pub(super) fn of(typed: &Typed, name: &str, kept: &[&str]) -> Result<Vec<String>> {
    let mut definition = typed.definition.clone();
    definition.build();
    // Unlike `subcommand_matches`, this does not panic if no command has this name.
    let matches = typed.matches.subcommand().filter(|(known, _)| *known == name).map(|(_, matches)| matches);
    let command = definition.find_subcommand(name);
    let (Some(matches), Some(command)) = (matches, command) else {
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
                Error::Usage(format!("--{long}: a script can only contain UTF-8 text, and {value} is not; rename it"))
            })?;
            if !scripts::can_hold(value) {
                return Err(Error::Usage(format!(
                    "--{long}: a script can only contain text without control characters and line breaks; rename {value:?}"
                )));
            }
            flags.push(format!("--{long}={value}"));
        }
    }
    Ok(flags)
}

#[cfg(test)]
mod tests {
    use std::ffi::OsString;

    use clap::{Args, Command};

    use super::*;
    use crate::cli::list::BatchArgs;

    #[test]
    fn flags_are_handed_on_as_typed_and_nothing_else_is() {
        let line =
            "smalti plan photos -o out --in-flight 3 -n 2k --mask disc,flower --no-rotation -q --palette=it's.gpl";
        let tokens: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        let definition = Command::new("smalti").subcommand(BatchArgs::augment_args(Command::new("plan")));
        let matches = definition.clone().try_get_matches_from(&tokens).expect("the line is right");
        let typed = Typed { tokens, matches, definition };
        let mut flags = of(&typed, "plan", &["output", "in-flight"]).expect("all is text");
        flags.sort();
        let expected = ["--mask=disc", "--mask=flower", "--no-rotation", "--palette=it's.gpl", "--quiet", "--tiles=2k"];
        assert_eq!(flags, expected);
        assert!(of(&typed, "batch", &[]).is_err(), "it is a plan");
    }
}
