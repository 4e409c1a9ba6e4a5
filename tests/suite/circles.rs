//! Modules beside each other import each other in no circle, and the floors of the command line keep their order.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use crate::sources::{Source, code, ends_of, is_word_char, source, sources};

/// The floors of the command line, lowest first.
const FLOORS_OF_CLI: [&[&str]; 8] = [
    &["built_in", "values"],
    &["terminal"],
    &["files"],
    &["trace"],
    &["args"],
    &["checks", "jobs"],
    &["list", "film", "mosaics"],
    &["commands", "config", "help", "hints"],
];

/// Folders whose modules do not import each other at all.
const STRANGERS: [&[&str]; 1] = [&["cli", "commands"]];

/// The text of a file without comments and without its tests.
fn shipped(source: &Source) -> String {
    let lines: Vec<&str> = source.text.lines().map(code).collect();
    let text = lines.join("\n");
    let end = text.find("#[cfg(test)]\nmod tests").unwrap_or(text.len());
    text[..end].to_owned()
}

/// The paths that a `use` tree or an expression names: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn leaves(tree: &str) -> Vec<Vec<String>> {
    let part = |text: &str| text.chars().take_while(|&char| is_word_char(char)).collect::<String>();
    let mut path = Vec::new();
    let mut rest = tree.trim_start();
    loop {
        if let Some(group) = rest.strip_prefix('{') {
            let branches = branches(group).into_iter().flat_map(leaves);
            return branches.map(|branch| [path.clone(), branch].concat()).collect();
        }
        let name = part(rest);
        let after = rest[name.len()..].to_owned();
        path.extend((!name.is_empty()).then_some(name));
        match after.strip_prefix("::") {
            Some(_) => rest = &rest[rest.len() - after.len() + 2..],
            None => return vec![path],
        }
    }
}

/// The branches of a group up to the brace that closes it.
fn branches(group: &str) -> Vec<&str> {
    let (mut depth, mut start, mut found) = (1, 0, Vec::new());
    for (place, char) in group.char_indices() {
        depth = match char {
            '{' => depth + 1,
            '}' => depth - 1,
            _ => depth,
        };
        if depth == 0 || depth == 1 && char == ',' {
            found.push(&group[start..place]);
            start = place + 1;
        }
        if depth == 0 {
            break;
        }
    }
    found.retain(|branch| !branch.trim().is_empty());
    found
}

/// The paths below the crate root that a file names outside its tests, by `crate::`, `self::` or `super::`.
fn named_paths(source: &Source) -> Vec<Vec<String>> {
    let text = shipped(source);
    let own = &source.modules;
    let mut paths = Vec::new();
    for (root, above) in [("crate::", own.len()), ("self::", 0)] {
        for end in ends_of(&text, root).filter(|&end| !text[..end - root.len()].ends_with("super::")) {
            let base = own[..own.len() - above].to_vec();
            paths.extend(leaves(&text[end..]).into_iter().map(|leaf| [base.clone(), leaf].concat()));
        }
    }
    for end in ends_of(&text, "super::") {
        if text[..end - "super::".len()].ends_with("super::") {
            continue;
        }
        for leaf in leaves(&text[end..]) {
            let above = 1 + leaf.iter().take_while(|name| *name == "super").count();
            if let Some(base) = own.len().checked_sub(above) {
                paths.push([&own[..base], &leaf[above - 1..]].concat());
            }
        }
    }
    paths
}

/// Which modules beside each other in `folder` import each other: each with those that it imports, and a file that does
/// so.
fn imports_within(sources: &[Source], folder: &[String]) -> BTreeMap<String, BTreeMap<String, PathBuf>> {
    let known: BTreeSet<&str> = sources
        .iter()
        .filter(|source| source.modules.len() > folder.len() && source.modules.starts_with(folder))
        .map(|source| source.modules[folder.len()].as_str())
        .collect();
    let mut imports: BTreeMap<String, BTreeMap<String, PathBuf>> = BTreeMap::new();
    for source in sources {
        if source.modules.len() <= folder.len() || !source.modules.starts_with(folder) {
            continue;
        }
        let own = &source.modules[folder.len()];
        for path in named_paths(source).into_iter().filter(|path| path.starts_with(folder)) {
            let Some(other) = path.get(folder.len()).filter(|other| *other != own) else { continue };
            if known.contains(other.as_str()) {
                imports.entry(own.clone()).or_default().entry(other.clone()).or_insert(source.path.clone());
            }
        }
    }
    imports
}

/// A circle of imports, if there is one: the modules in their order, the first one again at the end.
fn circle(imports: &BTreeMap<String, BTreeMap<String, PathBuf>>) -> Option<Vec<String>> {
    fn visit(
        at: &str,
        imports: &BTreeMap<String, BTreeMap<String, PathBuf>>,
        way: &mut Vec<String>,
        done: &mut BTreeSet<String>,
    ) -> Option<Vec<String>> {
        if let Some(first) = way.iter().position(|module| module == at) {
            return Some([&way[first..], &[at.to_owned()]].concat());
        }
        if done.contains(at) {
            return None;
        }
        way.push(at.to_owned());
        let found = imports.get(at).into_iter().flatten().find_map(|(other, _)| visit(other, imports, way, done));
        way.pop();
        done.insert(at.to_owned());
        found
    }
    let mut done = BTreeSet::new();
    imports.keys().find_map(|module| visit(module, imports, &mut Vec::new(), &mut done))
}

/// All folders of the crate that have modules in them, as paths of modules; the crate root is the empty one.
fn folders(sources: &[Source]) -> BTreeSet<Vec<String>> {
    sources.iter().flat_map(|source| (0..source.modules.len()).map(|depth| source.modules[..depth].to_vec())).collect()
}

fn owned(path: &[&str]) -> Vec<String> {
    path.iter().map(|&name| name.to_owned()).collect()
}

fn assert_none(complaints: &[String]) {
    assert!(complaints.is_empty(), "\n{}\n", complaints.join("\n"));
}

#[test]
fn no_modules_beside_each_other_import_each_other_in_a_circle() {
    let sources: Vec<Source> = sources().into_iter().filter(|source| source.module != "lib").collect();
    let mut complaints = Vec::new();
    for folder in folders(&sources) {
        let imports = imports_within(&sources, &folder);
        if let Some(circle) = circle(&imports) {
            let steps =
                circle.windows(2).map(|pair| format!("{} ({})", pair[1], imports[&pair[0]][&pair[1]].display()));
            let steps: Vec<String> = steps.collect();
            let place = if folder.is_empty() { "src".to_owned() } else { folder.join("::") };
            complaints.push(format!("{place}: {} imports {}", circle[0], steps.join(", which imports ")));
        }
    }
    assert_none(&complaints);
}

#[test]
fn the_floors_of_the_command_line_import_only_lower_ones_and_commands_do_not_know_each_other() {
    let sources = sources();
    let floor = |module: &str| FLOORS_OF_CLI.iter().position(|modules| modules.contains(&module));
    let mut complaints = Vec::new();
    for (module, others) in imports_within(&sources, &owned(&["cli"])) {
        // The whole command line is above all floors.
        if module == "command_line" {
            continue;
        }
        for (other, path) in others {
            match (floor(&module), floor(&other)) {
                (Some(from), Some(to)) if to < from => {}
                (None, _) => complaints.push(format!("`cli::{module}` is on no floor of tests/suite/layering.rs")),
                _ => complaints.push(format!("{} imports `cli::{other}`, which is not below it", path.display())),
            }
        }
    }
    for folder in STRANGERS {
        for (module, others) in imports_within(&sources, &owned(folder)) {
            let told = others.iter().map(|(other, path)| format!("{}: {module} imports {other}", path.display()));
            complaints.extend(told);
        }
    }
    assert_none(&complaints);
}

#[test]
fn the_test_of_circles_sees_every_way_to_name_a_module() {
    let file = |text: &str| source(PathBuf::from("src/vk/scope.rs"), text.to_owned());
    assert_eq!(
        leaves("a::{b, c::{d as e, self}, *};").iter().map(|path| path.join(" ")).collect::<Vec<_>>(),
        ["a b", "a c d", "a c self", "a"]
    );
    let paths = |text: &str| named_paths(&file(text)).iter().map(|path| path.join(" ")).collect::<Vec<_>>();
    assert_eq!(
        paths("use super::image::Image;\nuse super::{pass, shader::Module};\nuse self::inner::Deep;"),
        ["vk scope inner Deep", "vk image Image", "vk pass", "vk shader Module"]
    );
    assert_eq!(paths("let a = crate::gpu::lane();\n#[cfg(test)]\nmod tests {\n    use crate::cpu;"), ["gpu lane"]);
    let graph = |edges: &[(&str, &str)]| {
        let mut imports: BTreeMap<String, BTreeMap<String, PathBuf>> = BTreeMap::new();
        for (from, to) in edges {
            imports.entry((*from).to_owned()).or_default().insert((*to).to_owned(), PathBuf::new());
        }
        circle(&imports)
    };
    assert_eq!(graph(&[("a", "b"), ("b", "c"), ("a", "c")]), None);
    assert_eq!(graph(&[("a", "b"), ("b", "c"), ("c", "b")]), Some(owned(&["b", "c", "b"])));
}
