//! Packages beside the project have lock files of their own. What they share with it must be of the same version, since
//! another version of a decoder or encoder may give other bytes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The versions of each package in a lock file.
fn versions(lock: &str) -> BTreeMap<String, BTreeSet<String>> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(lock)).expect("it is committed");
    let lock: toml::Table = text.parse().expect("cargo wrote it");
    let mut versions = BTreeMap::<String, BTreeSet<String>>::new();
    for package in lock["package"].as_array().expect("packages") {
        let word = |name: &str| package[name].as_str().expect("text").to_owned();
        versions.entry(word("name")).or_default().insert(word("version"));
    }
    versions
}

#[test]
fn packages_beside_the_project_are_locked_to_its_versions() {
    let project = versions("Cargo.lock");
    for beside in ["fuzz/Cargo.lock", "python/Cargo.lock"] {
        let others = versions(beside);
        assert!(others.contains_key("smalti"), "{beside} is of a package that uses the library");
        for (name, versions) in others {
            let Some(known) = project.get(&name) else { continue };
            assert!(
                versions.is_subset(known),
                "{beside} has {name} {versions:?}, and Cargo.lock {known:?}; copy Cargo.lock there, and run cargo metadata"
            );
        }
    }
}
