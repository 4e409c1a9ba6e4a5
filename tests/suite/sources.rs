//! The sources of the crate as text, for tests that hold its structure.

use std::fs;
use std::path::{Path, PathBuf};

pub struct Source {
    /// Relative to the project, for messages.
    pub path: PathBuf,
    /// The module of the crate root that the file belongs to: `vk` for `src/vk/scope.rs`.
    pub module: String,
    /// The path of the file's own module: `vk`, `scope` for `src/vk/scope.rs`.
    pub modules: Vec<String>,
    pub text: String,
}

pub fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut sources = Vec::new();
    let mut folders = vec![root.join("src")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
            let path = entry.expect("the folder can be read").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                let path = path.strip_prefix(root).expect("sources lie in the project").to_owned();
                sources.push(source(path, text));
            }
        }
    }
    sources.sort_by(|a, b| a.path.cmp(&b.path));
    sources
}

pub fn source(path: PathBuf, text: String) -> Source {
    let stems = path.iter().skip(1).map(|part| part.to_string_lossy().trim_end_matches(".rs").to_owned());
    let modules: Vec<String> = stems.filter(|stem| stem != "mod").collect();
    Source { module: modules[0].clone(), modules, path, text }
}

/// The code of a line, without its comment.
pub fn code(line: &str) -> &str {
    line.split("//").next().unwrap_or_default()
}

pub fn is_word_char(char: char) -> bool {
    char.is_alphanumeric() || char == '_'
}

/// Byte positions after each `word` in `text`, where it is not a part of a longer word.
pub fn ends_of<'a>(text: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    text.match_indices(word).filter_map(move |(start, _)| {
        let end = start + word.len();
        let is_start = !text[..start].ends_with(is_word_char);
        let is_end = !word.ends_with(is_word_char) || !text[end..].starts_with(is_word_char);
        (is_start && is_end).then_some(end)
    })
}
