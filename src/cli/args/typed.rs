//! The command line token by token, for commands that read its flags a second time: with the flags of a manifest's row,
//! or to write them into a script.

use std::ffi::OsString;

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};

use super::picture::PictureArgs;
use crate::error::{Error, Result};

/// A command line.
#[derive(Clone, Debug, Default)]
pub(crate) struct Typed {
    /// First the name of the program, then what was typed, then what the file of `--config` added.
    pub tokens: Vec<OsString>,
    /// What clap made of them.
    pub matches: ArgMatches,
    /// The definition that clap parsed them with.
    pub definition: Command,
}

impl Typed {
    /// Whether the argument with this id is among the tokens, rather than set by the environment or left at its
    /// default.
    pub(crate) fn has(&self, id: &str) -> bool {
        let of_command = self.matches.subcommand().map(|(_, matches)| matches);
        of_command.is_some_and(|matches| {
            matches.ids().any(|known| known == id) && matches.value_source(id) == Some(ValueSource::CommandLine)
        })
    }

    /// The flags that decide a picture, as if `flags` had been typed as well. Each of them overrides the same flag of
    /// the command line.
    ///
    /// # Errors
    /// [`Error::Usage`] if one of `flags` does not decide a picture, or is wrong.
    pub(crate) fn picture_with(&self, flags: &[String]) -> Result<PictureArgs> {
        let known = PictureArgs::augment_args(Command::new("picture"));
        let is_known = |name: &str| known.get_arguments().any(|argument| argument.get_long() == Some(name));
        let names: Vec<&str> =
            flags.iter().filter_map(|flag| flag.trim_start_matches("--").split('=').next()).collect();
        if let Some(name) = names.iter().find(|name| !is_known(name)) {
            return Err(Error::Usage(format!(
                "params: {name} is no flag that decides a picture; see smalti evolve --help"
            )));
        }
        // Clap would add the row's values of a repeatable flag to the typed ones, so the typed ones are dropped.
        let lists = known.get_arguments().filter(|argument| matches!(argument.get_action(), ArgAction::Append));
        let replaced: Vec<&str> = lists.filter_map(Arg::get_long).filter(|name| names.contains(name)).collect();
        let end = self.tokens.iter().position(|token| token == "--").unwrap_or(self.tokens.len());
        let (before, after) = self.tokens.split_at(end);
        let tokens = without(before, &replaced).chain(flags.iter().map(OsString::from)).chain(after.iter().cloned());
        // If a flag comes twice, the last one counts.
        let command = ["batch", "plan"].into_iter().fold(self.definition.clone(), |cli, name| {
            cli.mut_subcommand(name, |command| command.args_override_self(true))
        });
        let wrong = |error: clap::Error| Error::Usage(one_sentence(&error.to_string(), "smalti batch"));
        let matches = command.try_get_matches_from(tokens).map_err(wrong)?;
        let missing = || Error::Internal("a batch was typed without a command".to_owned());
        let (_, of_command) = matches.subcommand().ok_or_else(missing)?;
        PictureArgs::from_arg_matches(of_command).map_err(wrong)
    }
}

/// The tokens without these flags and their values.
fn without<'a>(tokens: &'a [OsString], flags: &'a [&str]) -> impl Iterator<Item = OsString> + 'a {
    let mut is_value = false;
    tokens
        .iter()
        .filter(move |token| {
            let text = token.to_string_lossy();
            let name = text.strip_prefix("--").filter(|_| !is_value);
            let is_left_out =
                is_value || name.is_some_and(|name| flags.iter().any(|flag| name.split('=').next() == Some(flag)));
            is_value = !is_value && is_left_out && !text.contains('=');
            !is_left_out
        })
        .cloned()
}

/// The first paragraphs of clap's message on one line, without the usage that follows.
pub(crate) fn one_sentence(message: &str, command: &str) -> String {
    let told = message.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:"));
    let told: Vec<String> = told
        .filter(|line| !line.is_empty() && !line.starts_with("For more information"))
        // Nothing here takes a value that begins with a minus.
        .filter(|line| !line.starts_with("tip: to pass '-"))
        .map(|line| line.strip_prefix("tip: ").map_or_else(|| line.to_owned(), |tip| format!("({tip})")))
        .collect();
    let told = told.join(" ");
    format!("{}; see {command} --help", told.strip_prefix("error: ").unwrap_or(&told))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flag_is_left_out_with_its_value_however_it_was_written() {
        let tokens = ["batch", "--mask", "disc", "in", "--mask=a,b", "--masks", "--restart-mask", "--mask"];
        let tokens = tokens.map(OsString::from);
        let left: Vec<OsString> = without(&tokens, &["mask"]).collect();
        assert_eq!(left, ["batch", "in", "--masks", "--restart-mask"]);
        assert_eq!(without(&tokens, &[]).count(), tokens.len());
    }

    #[test]
    fn a_message_of_clap_becomes_one_sentence() {
        let message = "error: unexpected argument '--sed' found\n\n  tip: a similar argument exists: '--seed'\n\n\
                       Usage: smalti evolve <IN>\n\nFor more information, try '--help'.\n";
        let sentence =
            "unexpected argument '--sed' found (a similar argument exists: '--seed'); see smalti evolve --help";
        assert_eq!(one_sentence(message, "smalti evolve"), sentence);
    }
}
