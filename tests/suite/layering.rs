//! The layers of `src/`: who may import whom, and which modules may do what the others may not.

use std::path::PathBuf;

use crate::sources::{Source, code, ends_of, is_word_char, source, sources};

/// The modules of the crate, lowest level first. A module imports only modules of lower levels.
const LEVELS: [&[&str]; 9] = [
    &["error", "guard", "memory"],
    &["photo", "output", "model", "metrics", "plot", "threads"],
    &["archive", "evolve", "guide", "shapes", "cpu", "vk", "vector", "openraster"],
    &["gpu"],
    &["engine"],
    &["studio"],
    &["view"],
    &["cli"],
    &["main"],
];

/// Imports of lower levels that are wrong all the same.
const FORBIDDEN: [(&str, &[&str], &str); 1] =
    [("engine", &["cpu", "gpu", "vk"], "the engine knows evaluators by their trait, so that it names no backend")];

/// Words that only some modules may say.
const RESERVED: [(&[&str], &[&str], &str); 5] = [
    (&["unsafe"], &["vk"], "only `vk` is unsafe; give it a safe function"),
    (
        &["println!", "eprintln!", "print!", "eprint!", "stdout", "stderr"],
        &["cli", "main"],
        "only `cli` prints; return a value or an error",
    ),
    (&["std::env", "env::"], &["cli", "main", "view"], "only `cli` and `view` read the environment; take an option"),
    (
        &["thread::spawn", "scope.spawn", "thread::Builder", "ThreadPoolBuilder"],
        &["threads"],
        "only `threads` starts threads, since it minds that the system may refuse",
    ),
    (
        &["Instant", "SystemTime"],
        &["cli", "main", "view", "vk"],
        "only `cli` and `view` read the clock, and `vk` to time a submission; take a duration or a stop reason",
    ),
];

/// Longer than this and a file is two files.
const LINES_MAX: usize = 450;

/// As `max_width` in rustfmt.toml, which leaves comments alone.
const COLUMNS_MAX: usize = 120;

/// The names at the start of `tree`, what follows `crate::`: one, or each of `{a, b::c, d::{e, f}}`.
fn first_names(tree: &str) -> Vec<String> {
    let name = |text: &str| text.trim_start().chars().take_while(|&char| is_word_char(char)).collect();
    let Some(group) = tree.strip_prefix('{') else { return vec![name(tree)] };
    let mut names = Vec::new();
    let (mut depth, mut start) = (1, 0);
    for (place, char) in group.char_indices() {
        match char {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 || (depth == 1 && char == ',') {
            names.push(name(&group[start..place]));
            start = place + 1;
        }
        if depth == 0 {
            break;
        }
    }
    names.retain(|name: &String| !name.is_empty());
    names
}

/// Modules of the crate root that a file names, each with its line. The binary names them through the library.
fn imports(source: &Source) -> Vec<(usize, String)> {
    let lines: Vec<&str> = source.text.lines().map(code).collect();
    let text = lines.join("\n");
    let mut imports = Vec::new();
    for root in ["crate::", "smalti::"] {
        for end in ends_of(&text, root) {
            let line = 1 + text[..end].matches('\n').count();
            imports.extend(first_names(&text[end..]).into_iter().map(|name| (line, name)));
        }
    }
    imports
}

/// Lines that reach the crate root by `super::`, where [`imports`] would not see what they name.
fn escapes(source: &Source) -> Vec<usize> {
    let mut depth = source.modules.len();
    let mut escapes = Vec::new();
    for (line, text) in (1..).zip(source.text.lines().map(code)) {
        // A module of tests inside the file; clippy lets nothing follow it.
        depth += usize::from(text.trim_start().starts_with("mod ") && text.trim_end().ends_with('{'));
        if text.contains(&"super::".repeat(depth)) {
            escapes.push(line);
        }
    }
    escapes
}

fn level(module: &str) -> Option<usize> {
    LEVELS.iter().position(|modules| modules.contains(&module))
}

/// Why `from` must not import `to`, if so.
fn objection(from: &str, to: &str) -> Option<String> {
    if from == to {
        return None;
    }
    let Some(to_level) = level(to) else {
        return Some(format!("`{to}` is in no layer; name the module that defines it"));
    };
    let from_level = level(from)?;
    if to_level >= from_level {
        return Some(format!(
            "`{from}` is on level {from_level} and `{to}` on level {to_level}; only lower levels may be"
        ));
    }
    let (_, _, why) = FORBIDDEN.iter().find(|(module, others, _)| *module == from && others.contains(&to))?;
    Some((*why).to_owned())
}

fn assert_none(complaints: &[String]) {
    assert!(complaints.is_empty(), "\n{}\n", complaints.join("\n"));
}

#[test]
fn every_module_imports_only_modules_of_lower_levels() {
    let mut complaints = Vec::new();
    // The crate root declares all modules and re-exports what it likes.
    for source in sources().iter().filter(|source| source.module != "lib") {
        let path = source.path.display();
        if level(&source.module).is_none() {
            complaints.push(format!("{path}: `{}` is in no layer of tests/suite/layering.rs", source.module));
        }
        for (line, name) in imports(source) {
            let why = objection(&source.module, &name);
            complaints.extend(why.map(|why| format!("{path}:{line} imports `{name}`: {why}")));
        }
        let escapes = escapes(source).into_iter();
        complaints.extend(escapes.map(|line| format!("{path}:{line} leaves its module by `super`: say `crate::`")));
    }
    assert_none(&complaints);
}

#[test]
fn only_the_modules_that_are_named_do_what_the_others_may_not() {
    let mut complaints = Vec::new();
    for source in sources() {
        for (words, modules, why) in RESERVED {
            if modules.contains(&source.module.as_str()) {
                continue;
            }
            for (line, text) in (1..).zip(source.text.lines().map(code)) {
                let said = words.iter().find(|word| ends_of(text, word).next().is_some());
                complaints.extend(said.map(|word| format!("{}:{line} says `{word}`: {why}", source.path.display())));
            }
        }
    }
    assert_none(&complaints);
}

#[test]
fn only_the_command_line_and_the_window_name_flags() {
    let names_a_flag = |line: &str| {
        line.match_indices("--").any(|(at, _)| line[at + 2..].starts_with(|c: char| c.is_ascii_lowercase()))
    };
    let mut complaints = Vec::new();
    for source in sources().into_iter().filter(|source| !["cli", "main", "view"].contains(&source.module.as_str())) {
        for (line, text) in (1..).zip(source.text.lines().map(code)).filter(|(_, text)| names_a_flag(text)) {
            let path = source.path.display();
            complaints
                .push(format!("{path}:{line} names a flag: `{}`; cli/terminal/advice.rs adds the flags", text.trim()));
        }
    }
    assert_none(&complaints);
}

#[test]
fn no_source_file_is_too_long_to_read_at_once() {
    let long = sources().into_iter().map(|source| (source.path, source.text.lines().count()));
    let complaints: Vec<String> = long
        .filter(|(_, lines)| *lines > LINES_MAX)
        .map(|(path, lines)| format!("{} has {lines} lines, more than {LINES_MAX}; split it by topic", path.display()))
        .collect();
    assert_none(&complaints);
}

#[test]
fn no_comment_is_wider_than_the_code() {
    let is_wide = |line: &&str| line.trim_start().starts_with("//") && line.chars().count() > COLUMNS_MAX;
    let mut complaints = Vec::new();
    for source in sources() {
        for line in source.text.lines().filter(is_wide) {
            complaints.push(format!("{}: `{line}` is wider than {COLUMNS_MAX} columns", source.path.display()));
        }
    }
    assert_none(&complaints);
}

#[test]
fn the_test_of_layers_sees_every_way_to_name_a_module() {
    let file = |text: &str| source(PathBuf::from("src/vk/scope.rs"), text.to_owned());
    let names = |text: &str| imports(&file(text)).into_iter().map(|(_, name)| name).collect::<Vec<_>>();
    assert_eq!(names("use crate::model::{Fly, Tile};"), ["model"]);
    assert_eq!(
        names("pub(crate) use crate::{\n    error::{Error, Result}, // not gpu\n    model,\n};"),
        ["error", "model"]
    );
    assert_eq!(names("let lane: smalti::cpu::Lane = crate::gpu::lane();"), ["gpu", "cpu"]);
    assert_eq!(names("//! See [`crate::gpu`].\nuse other_crate::engine;"), [""; 0]);

    assert_eq!(file("").module, "vk");
    assert_eq!(escapes(&file("use super::image;\nuse super::super::model;")), [2]);
    assert_eq!(escapes(&file("mod tests {\n    use super::super::image;\n    use super::super::super::model;")), [3]);

    assert!(objection("vk", "error").is_none() && objection("vk", "vk").is_none() && objection("gpu", "vk").is_none());
    for (from, to) in [
        ("vk", "cpu"),
        ("model", "photo"),
        ("error", "model"),
        ("engine", "gpu"),
        ("engine", "studio"),
        ("studio", "cli"),
    ] {
        assert!(objection(from, to).is_some(), "{from} may import {to}");
    }
}
