//! The committed SPIR-V is what its sources compile to. No compiler is needed: a manifest ties both by their hashes.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use smalti::gpu::cells::layout::search_rules_glsl;

use crate::shader_manifest::{
    FLAVOURS, Manifest, OPTIONS, STAGES, all_modules, compiler_version, flattened_source, module_file, sha256,
};

const RECOMPILE: &str = "run `cargo run --release --features shader-compiler --bin compile-shaders` and commit spirv/";

/// Compiles the shaders of the tests with Debian's `glslc`, and notes what came from what.
const RECOMPILE_OF_TESTS: &str = "in tests/golden/vk run \
    `for s in *.comp *.vert *.frag; do glslc --target-env=vulkan1.3 $s -o $s.spv; done && sha256sum *.* > SHA256SUMS`";

fn project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn read(path: &str) -> Vec<u8> {
    fs::read(project(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn manifest() -> Manifest {
    serde_json::from_slice(&read("spirv/MANIFEST")).unwrap_or_else(|error| panic!("spirv/MANIFEST: {error}"))
}

/// Names of the files in a folder, without its sub-folders.
fn files_in(folder: &str) -> BTreeSet<String> {
    let entries = fs::read_dir(project(folder)).unwrap_or_else(|error| panic!("{folder}: {error}"));
    let files = entries.map(|entry| entry.expect("the folder can be read")).filter(|entry| entry.path().is_file());
    files.map(|entry| entry.file_name().into_string().expect("file names are UTF-8")).collect()
}

#[test]
fn every_module_is_the_one_compiled_from_its_source_and_includes() {
    for module in manifest().modules {
        let stage = &module.stage;
        let file = module_file(stage, &module.flavour);
        let source = flattened_source(&project("glsl"), stage);
        assert_eq!(
            sha256(source.as_bytes()),
            module.source_sha256,
            "glsl/{stage} or a file that it includes changed after spirv/{file} was compiled; {RECOMPILE}"
        );
        assert_eq!(
            sha256(&read(&format!("spirv/{file}"))),
            module.module_sha256,
            "spirv/{file} is not the module of spirv/MANIFEST; {RECOMPILE}"
        );
    }
}

#[test]
fn every_stage_that_asks_for_a_macro_is_compiled_with_it_and_no_other_stage() {
    for macro_name in ["HARDWARE", "NO_SUBGROUPS"] {
        let asked = format!("#ifdef {macro_name}");
        for stage in STAGES {
            let asks = flattened_source(&project("glsl"), stage).contains(&asked);
            // What only this macro changes needs a flavour of its own.
            let is_given = FLAVOURS.iter().any(|flavour| {
                flavour.stages.contains(&stage) && flavour.macros.last().is_some_and(|last| *last == macro_name)
            });
            assert!(
                asks == is_given || stage.starts_with("cells_") && macro_name == "HARDWARE",
                "glsl/{stage}: {asked}"
            );
        }
    }
}

#[test]
fn the_rules_of_the_shaders_are_those_of_the_tables() {
    let glsl = String::from_utf8(read("glsl/shared/cells_rules.glsl")).expect("the source is text");
    assert_eq!(glsl, search_rules_glsl(), "the tables of the rules changed; {RECOMPILE}, and glsl/ with it");
}

#[test]
fn the_modules_were_compiled_with_the_options_and_the_compiler_of_this_commit() {
    let manifest = manifest();
    assert_eq!(manifest.options, OPTIONS, "the options changed; {RECOMPILE}");
    let compiler = compiler_version(&project("Cargo.lock")).expect("the compiler is locked");
    assert_eq!(manifest.compiler, compiler, "the compiler in Cargo.lock changed; {RECOMPILE}");
}

#[test]
fn sources_and_modules_are_exactly_those_of_the_manifest() {
    let compiled: Vec<(String, String)> =
        manifest().modules.into_iter().map(|module| (module.stage, module.flavour)).collect();
    let listed: Vec<(String, String)> =
        all_modules().into_iter().map(|(stage, flavour, _)| (stage.to_owned(), flavour.to_owned())).collect();
    assert_eq!(compiled, listed, "spirv/MANIFEST does not list the modules of tools/shader_manifest.rs; {RECOMPILE}");
    let sources: BTreeSet<String> = compiled.iter().map(|(stage, _)| stage.clone()).collect();
    assert_eq!(files_in("glsl"), sources, "a file in glsl/ is a stage and stands in STAGES; what is shared is below");
    let modules = compiled.iter().map(|(stage, flavour)| module_file(stage, flavour));
    let files: BTreeSet<String> = modules.chain(["MANIFEST".to_owned()]).collect();
    assert_eq!(files_in("spirv"), files, "spirv/ holds the modules of the manifest and nothing else; {RECOMPILE}");
}

#[test]
fn the_shaders_of_the_tests_are_the_ones_compiled_from_their_sources() {
    let text = String::from_utf8(read("tests/golden/vk/SHA256SUMS")).expect("the sums are text");
    let sums: BTreeMap<String, String> = text
        .lines()
        .filter_map(|line| line.split_once("  "))
        .map(|(sum, file)| (file.to_owned(), sum.to_owned()))
        .collect();
    let mut files = files_in("tests/golden/vk");
    files.remove("SHA256SUMS");
    assert!(
        sums.keys().eq(&files),
        "tests/golden/vk/SHA256SUMS does not list the files beside it; {RECOMPILE_OF_TESTS}"
    );
    for (file, sum) in sums {
        let now = sha256(&read(&format!("tests/golden/vk/{file}")));
        assert_eq!(now, sum, "tests/golden/vk/{file} is not the file of SHA256SUMS; {RECOMPILE_OF_TESTS}");
    }
}
