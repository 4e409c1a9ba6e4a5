//! Compiles `glsl/` to `spirv/` with shaderc and writes `spirv/MANIFEST`, and before that the part of `glsl/` that
//! follows from tables in Rust.
//!
//! `cargo run --release --features shader-compiler --bin compile-shaders [-- --check]`, from the project's root. With
//! `--check` nothing is written, and a file that would change is an error. The first build takes about 25 CPU minutes
//! and needs cmake, a C++ compiler and Python.

#[path = "shader_manifest.rs"]
mod shader_manifest;

use std::collections::HashSet;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

use shader_manifest::{
    Manifest, Module, OPTIONS, all_modules, compiler_version, flattened_source, module_file, sha256,
};

fn main() -> ExitCode {
    let check = std::env::args().nth(1).as_deref() == Some("--check");
    match compile_all(check) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("compile-shaders: {message}");
            ExitCode::FAILURE
        }
    }
}

fn compile_all(check: bool) -> Result<(), String> {
    settle(check, "glsl/shared/cells_rules.glsl", smalti::gpu::cells::layout::search_rules_glsl().as_bytes())?;
    let mut modules = Vec::new();
    for (stage, flavour, macros) in all_modules() {
        let source = flattened_source(Path::new("glsl"), stage);
        let module = compile(&source, stage, macros)?;
        modules.push(Module {
            stage: stage.to_owned(),
            flavour: flavour.to_owned(),
            source_sha256: sha256(source.as_bytes()),
            module_sha256: sha256(&module),
        });
        settle(check, &format!("spirv/{}", module_file(stage, flavour)), &module)?;
    }
    let manifest =
        Manifest { compiler: compiler_version(Path::new("Cargo.lock"))?, options: OPTIONS.to_owned(), modules };
    let text = serde_json::to_string_pretty(&manifest).map_err(|error| error.to_string())? + "\n";
    settle(check, "spirv/MANIFEST", text.as_bytes())
}

/// Writes a file, or with `check` compares it with what is there.
fn settle(check: bool, path: &str, bytes: &[u8]) -> Result<(), String> {
    let same = fs::read(path).is_ok_and(|old| old == bytes);
    if check && !same {
        return Err(format!("{path} is stale; run compile-shaders without --check"));
    }
    if same { Ok(()) } else { fs::write(path, bytes).map_err(|error| format!("{path}: {error}")) }
}

fn compile(source: &str, stage: &str, macros: &[&str]) -> Result<Vec<u8>, String> {
    let kind = match stage.rsplit('.').next() {
        Some("comp") => shaderc::ShaderKind::Compute,
        Some("vert") => shaderc::ShaderKind::Vertex,
        Some("frag") => shaderc::ShaderKind::Fragment,
        _ => return Err(format!("glsl/{stage}: the extension names no stage")),
    };
    let compiler = shaderc::Compiler::new().map_err(|error| error.to_string())?;
    let mut options = shaderc::CompileOptions::new().map_err(|error| error.to_string())?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_optimization_level(shaderc::OptimizationLevel::Zero);
    options.set_warnings_as_errors();
    macros.iter().for_each(|name| options.add_macro_definition(name, None));
    let artifact =
        compiler.compile_into_spirv(source, kind, stage, "main", Some(&options)).map_err(|error| error.to_string())?;
    Ok(bytemuck::cast_slice(&without_unused_constants(artifact.as_binary())).to_vec())
}

// Operations by the numbers of the SPIR-V specification, section 3.49.
const OP_NAME: u32 = 5;
const OP_CONSTANT: u32 = 43;
const OP_SPEC_CONSTANT: u32 = 50;
const OP_SPEC_CONSTANT_COMPOSITE: u32 = 51;
const OP_SPEC_CONSTANT_OP: u32 = 52;
const OP_DECORATE: u32 = 71;
const WORDS_OF_HEADER: usize = 5;

/// The module without the specialisation constants that nothing uses. The compiler makes a second constant of number 0
/// for a `gl_WorkGroupSize` that is not there, and some compilers of other languages refuse two constants of a number.
fn without_unused_constants(module: &[u32]) -> Vec<u32> {
    let (header, mut rest) = module.split_at(WORDS_OF_HEADER);
    let mut operations = Vec::new();
    while let Some(&first) = rest.first() {
        let (operation, after) = rest.split_at((first >> 16) as usize);
        operations.push(operation);
        rest = after;
    }
    loop {
        let used: HashSet<u32> = operations.iter().flat_map(|operation| ids_used(operation)).copied().collect();
        let is_unused = |id: u32| !used.contains(&id);
        let made: HashSet<u32> = operations.iter().filter_map(|operation| spec_constant(operation)).collect();
        let before = operations.len();
        operations.retain(|operation| match (operation[0] & 0xFFFF, &operation[1..]) {
            (OP_NAME | OP_DECORATE, [id, ..]) => !(made.contains(id) && is_unused(*id)),
            _ => spec_constant(operation).is_none_or(|id| !is_unused(id)),
        });
        if operations.len() == before {
            return [header, &operations.concat()].concat();
        }
    }
}

/// The id of a specialisation constant that is a number, a composite or a result of others.
fn spec_constant(operation: &[u32]) -> Option<u32> {
    (OP_SPEC_CONSTANT..=OP_SPEC_CONSTANT_OP).contains(&(operation[0] & 0xFFFF)).then(|| operation[2])
}

/// The words of an operation that may be ids of others: more than are, never fewer.
fn ids_used(operation: &[u32]) -> &[u32] {
    match operation[0] & 0xFFFF {
        OP_NAME | OP_DECORATE => &[],
        OP_CONSTANT | OP_SPEC_CONSTANT => &operation[1..2],
        OP_SPEC_CONSTANT_COMPOSITE | OP_SPEC_CONSTANT_OP => &operation[3..],
        _ => &operation[1..],
    }
}
