//! The manifest of a batch: one picture on each line, as JSON.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::{Error, Result};
use crate::studio::{read_text, text_of};

/// Most bytes of a manifest: some five million pictures.
const BYTES_MAX: u64 = 1 << 29;
const WHAT: &str = "a manifest, which has one JSON object on each line";

/// A line of a manifest.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ManifestRow {
    /// The picture, relative to the current folder.
    pub input: PathBuf,
    /// The id of the picture and of its result row.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Where the mosaic goes, relative to the output folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output: Option<Outputs>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// Flags that decide a picture, without their two minuses; `true` for one without a value.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub params: Map<String, Value>,
    /// Pictures of one group stay in one shard.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// The id of a picture of the same group that must be finished first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<String>,
}

/// One output or several.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(untagged)]
pub(crate) enum Outputs {
    One(PathBuf),
    Several(Vec<PathBuf>),
}

impl Outputs {
    /// All outputs.
    pub(crate) fn paths(&self) -> &[PathBuf] {
        match self {
            Self::One(path) => std::slice::from_ref(path),
            Self::Several(paths) => paths,
        }
    }
}

impl ManifestRow {
    /// The parameters of the row as flags of the command line.
    ///
    /// # Errors
    /// A sentence, if a value is not a text, a number, true, false, or a list of these.
    pub(crate) fn flags(&self) -> Result<Vec<String>, String> {
        let mut flags: Vec<String> = self.seed.iter().map(|seed| format!("--seed={seed}")).collect();
        flags.extend(self.preset.iter().map(|preset| format!("--preset={preset}")));
        for (name, value) in &self.params {
            let values = if let Value::Array(values) = value { values.as_slice() } else { std::slice::from_ref(value) };
            for value in values {
                match value {
                    Value::Bool(true) => flags.push(format!("--{name}")),
                    Value::Bool(false) | Value::Null => {}
                    Value::Number(number) => flags.push(format!("--{name}={number}")),
                    Value::String(text) => flags.push(format!("--{name}={text}")),
                    Value::Array(_) | Value::Object(_) => {
                        return Err(format!("params: {name} must be a text, a number, true, or a list of these"));
                    }
                }
            }
        }
        Ok(flags)
    }
}

/// The rows of the manifest at `path`, or of stdin for `-`, each with its line number. Empty lines are skipped.
///
/// # Errors
/// [`Error::Input`] that names the line.
pub(crate) fn read(path: &Path) -> Result<Vec<(usize, ManifestRow)>> {
    let text = text(path)?;
    let lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    let rows = lines.map(|(number, line)| {
        let row = serde_json::from_str(line).map_err(|error| {
            // serde_json got a single line, so its line number is always 1.
            let error = error.to_string();
            let error = error.split(" at line 1 ").next().unwrap_or(&error).to_owned();
            let what = "write one JSON object on each line, such as {\"input\": \"a.png\"}";
            Error::input(path, format!("line {number}: {error}; {what}"))
        })?;
        Ok((number, row))
    });
    rows.collect()
}

fn text(path: &Path) -> Result<String> {
    if path == Path::new("-") {
        text_of(std::io::stdin().lock(), path, WHAT, BYTES_MAX)
    } else {
        read_text(path, WHAT, BYTES_MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> Result<Vec<(usize, ManifestRow)>> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("m.jsonl");
        std::fs::write(&path, text).expect("the folder is ours");
        read(&path)
    }

    #[test]
    fn a_row_needs_an_input_and_its_other_fields_become_flags() {
        let text = "{\"input\": \"a.png\"}\n\n{\"input\": \"b.png\", \"seed\": 7, \"preset\": \"mosaic\", \"output\": [\"b.svg\", \"b.npz\"], \
                    \"params\": {\"tiles\": 500, \"mask\": [\"disc\", \"star\"], \"no-rotation\": true, \"weight\": null}}\n";
        let rows = rows(text).expect("both rows are right");
        assert_eq!(rows.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [1, 3]);
        assert_eq!(rows[0].1.flags(), Ok(Vec::new()));
        let mut flags = rows[1].1.flags().expect("all can be spelt");
        flags.sort();
        let wanted = ["--mask=disc", "--mask=star", "--no-rotation", "--preset=mosaic", "--seed=7", "--tiles=500"];
        assert_eq!(flags, wanted);
        assert_eq!(rows[1].1.output.as_ref().map_or(0, |outputs| outputs.paths().len()), 2);
    }

    #[test]
    fn a_wrong_row_is_named_by_its_line() {
        for (text, told) in [
            ("{\"input\": \"a\"}\n{\"id\": 3}", "line 2: "),
            ("{\"input\": \"a\", \"sed\": 1}", "line 1: unknown field `sed`"),
            ("\n\n[1", "line 3: "),
        ] {
            let refusal = rows(text).expect_err("the row is wrong").to_string();
            assert!(refusal.contains(told), "{refusal}");
        }
        let nested =
            ManifestRow { params: Map::from_iter([("tiles".to_owned(), serde_json::json!({}))]), ..Default::default() };
        assert!(nested.flags().is_err());
    }
}
