//! `--config`: flags in a TOML file, for people who would type the same ones again and again.
//!
//! A key is the name of a flag without its dashes. A key at the top applies to every command that has the flag; a key
//! in a table applies to the command that the table is named after. The command line overrides the environment, and the
//! environment overrides the file.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};
use toml::{Table, Value};

use crate::cli::files::places;
use crate::error::{Error, Result};
use crate::studio::{SETTINGS_BYTES_MAX, read_text, toml_mistake};

/// The command line as typed, with the flags that the file of `--config` adds at its end. `whole` defines all commands.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, or has a key that no command knows.
pub(super) fn expand(mut typed: Vec<OsString>, whole: &Command) -> Result<Vec<OsString>> {
    // Mistakes in what was typed are reported later, when it is parsed for good.
    let Ok(matches) = whole.clone().ignore_errors(true).try_get_matches_from(&typed) else { return Ok(typed) };
    let Some((name, of_command)) = matches.subcommand() else { return Ok(typed) };
    let path = matches.try_get_one::<PathBuf>("config").ok().flatten();
    let path = path.or_else(|| of_command.try_get_one("config").ok().flatten());
    let (Some(path), Some(command)) = (path, whole.find_subcommand(name)) else { return Ok(typed) };
    // Read only once, since it may be a pipe.
    let file = File::read(path)?;
    file.check(whole)?;
    let flags = file.flags(command, of_command)?;
    let end = typed.iter().position(|token| token == "--").unwrap_or(typed.len());
    typed.splice(end..end, flags.into_iter().map(OsString::from));
    Ok(typed)
}

/// A file of flags.
struct File<'a> {
    path: &'a Path,
    table: Table,
}

impl<'a> File<'a> {
    fn read(path: &'a Path) -> Result<Self> {
        places::note_flags_read(path);
        let text = read_text(path, "a file of flags", SETTINGS_BYTES_MAX)?;
        let table = text.parse().map_err(|error: toml::de::Error| {
            let mistake = toml_mistake(&text, &error);
            Error::input(path, format!("is not TOML ({mistake}); write lines such as tiles = 4000"))
        })?;
        Ok(Self { path, table })
    }

    /// The flags that the file adds to `command`; `matches` is what was typed.
    fn flags(&self, command: &Command, matches: &ArgMatches) -> Result<Vec<String>> {
        let mut values: BTreeMap<&str, &Value> = BTreeMap::new();
        for (key, value) in &self.table {
            // Other commands' tables, and flags that only other commands have, do not concern this one.
            if !value.is_table() && find(command, key).is_some() {
                values.insert(key, value);
            }
        }
        if let Some(Value::Table(own)) = self.table.get(command.get_name()) {
            for (key, value) in own {
                if find(command, key).is_none() {
                    let name = command.get_name();
                    let reason = format!("[{name}] has {key}, which is not one of its flags; see smalti {name} --help");
                    return Err(Error::input(self.path, reason));
                }
                values.insert(key, value);
            }
        }
        let given = |argument: &Arg| {
            let id = argument.get_id().as_str();
            match matches.value_source(id) {
                Some(ValueSource::CommandLine) => true,
                Some(ValueSource::EnvVariable) => {
                    matches.get_raw(id).into_iter().flatten().any(|value| !value.is_empty())
                }
                _ => false,
            }
        };
        if values.contains_key("devices") {
            values.remove("device");
        }
        let mut flags = Vec::new();
        for (key, value) in values {
            let Some(argument) = find(command, key) else { continue };
            let conflicts = command.get_arg_conflicts_with(argument).into_iter();
            // Clap must not know this conflict: SMALTI_DEVICE beside --devices is allowed.
            let rival = match key {
                "device" => find(command, "devices"),
                "devices" => find(command, "device"),
                _ => None,
            };
            if !given(argument) && !conflicts.chain(rival).any(given) {
                flags.extend(self.spelt(argument, key, value)?);
            }
        }
        Ok(flags)
    }

    /// A key and its value as flags.
    fn spelt(&self, argument: &Arg, key: &str, value: &Value) -> Result<Vec<String>> {
        let takes_value = argument.get_action().takes_values();
        let refuse = |reason: String| Err(Error::input(self.path, reason));
        let values = if let Value::Array(values) = value { values.as_slice() } else { std::slice::from_ref(value) };
        let spell = |value: &Value| match value {
            Value::Boolean(true) if takes_value => refuse(format!("{key} needs a value other than true")),
            Value::Integer(_) | Value::Float(_) | Value::String(_) if !takes_value => {
                refuse(format!("{key} must be true or false"))
            }
            Value::Boolean(true) => Ok(Some(format!("--{key}"))),
            Value::Boolean(false) => Ok(None),
            Value::Integer(number) => Ok(Some(format!("--{key}={number}"))),
            Value::Float(number) => Ok(Some(format!("--{key}={number}"))),
            Value::String(text) => Ok(Some(format!("--{key}={text}"))),
            Value::Datetime(_) | Value::Array(_) | Value::Table(_) => {
                refuse(format!("{key} must be a text, a number, true, false, or a list of these"))
            }
        };
        values.iter().filter_map(|value| spell(value).transpose()).collect()
    }

    /// Refuses a key that no command has. `command` defines all commands.
    fn check(&self, command: &Command) -> Result<()> {
        for (key, value) in &self.table {
            let is_known = match value {
                Value::Table(_) => command.find_subcommand(key).is_some(),
                _ => command.get_subcommands().any(|command| find(command, key).is_some()),
            };
            if !is_known {
                let what =
                    if value.is_table() { format!("[{key}] is no command") } else { format!("{key} is no flag") };
                return Err(Error::input(self.path, format!("{what}; see smalti --help")));
            }
        }
        Ok(())
    }
}

/// The flag of `command` with this name.
fn find<'c>(command: &'c Command, name: &str) -> Option<&'c Arg> {
    command.get_arguments().find(|argument| argument.get_long() == Some(name) && name != "config")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    fn expanded(file: &str, typed: &str) -> Result<String> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("c.toml");
        std::fs::write(&path, file).expect("the folder is ours");
        let mut command = Cli::command();
        command.build();
        let config = path.display().to_string();
        let typed = typed.replace("CONFIG", &config).split(' ').map(OsString::from).collect();
        let tokens = expand(typed, &command)?;
        let tokens: Vec<String> =
            tokens.iter().map(|token| token.to_string_lossy().replace(&config, "CONFIG")).collect();
        Ok(tokens.join(" "))
    }

    #[test]
    fn what_is_typed_goes_before_the_file_and_a_table_before_the_top() {
        let file =
            "tiles = 7\nsize = 64\nstyle = 'mosaic'\n[evolve]\nsize = 32\nmask = ['disc', 'star']\nquiet = true\n";
        let told = expanded(file, "smalti evolve a.png -o b.png --config CONFIG -n 9").expect("it is right");
        let wanted = "smalti evolve a.png -o b.png --config CONFIG -n 9 --mask=disc --mask=star --quiet --size=32 --style=mosaic";
        assert_eq!(told, wanted);
        let told =
            expanded(file, "smalti --config CONFIG evolve -o b.png --preset paint -- a.png").expect("it is right");
        assert!(told.ends_with("--size=32 --tiles=7 -- a.png"), "a preset has a style of its own: {told}");
        assert_eq!(expanded(file, "smalti evolve a.png -o b.png").expect("no file"), "smalti evolve a.png -o b.png");
    }

    #[test]
    fn one_device_in_the_file_gives_way_to_several_that_are_typed_and_the_other_way_round() {
        let batch = "smalti batch in -o out --config CONFIG";
        for (file, typed, wanted) in [
            ("device = 'cpu'", "--devices cpu", ""),
            ("[batch]\ndevices = 'all'", "--device cpu", ""),
            ("device = 'cpu'\n[batch]\ndevices = 'all'", "--recursive", " --devices=all"),
        ] {
            let told = expanded(file, &format!("{batch} {typed}")).expect("it is right");
            assert_eq!(told, format!("{batch} {typed}{wanted}"));
        }
    }

    #[test]
    fn what_no_command_knows_is_refused_by_name() {
        for (file, told) in [
            ("tile = 7", "tile is no flag"),
            ("[evolv]\ntiles = 7", "[evolv] is no command"),
            ("[evolve]\nshard = '1/2'", "[evolve] has shard"),
            ("size = 1979-05-27", "size must be"),
            ("size = ", "is not TOML"),
            ("tiles = true", "c.toml: tiles needs a value"),
            ("quiet = 3", "c.toml: quiet must be true or false"),
        ] {
            let refusal = expanded(file, "smalti evolve a.png -o b.png --config CONFIG").expect_err(file).to_string();
            assert!(refusal.contains(told), "{refusal}");
        }
    }
}
