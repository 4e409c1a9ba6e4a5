//! Compiles `glsl/` to `spirv/` with shaderc and writes `spirv/MANIFEST`, and before that the part of `glsl/` that
//! follows from tables in Rust.
//!
//! `cargo run --release --features shader-compiler --bin compile-shaders [-- --check]`, from the project's root. With
//! `--check` nothing is written, and a file that would change is an error. The first build takes about 25 CPU minutes
//! and needs cmake, a C++ compiler and Python.

#[path = "shader_manifest.rs"]
mod shader_manifest;

use std::fs;
use std::path::Path;
use std::process::ExitCode;

use shader_manifest::{Manifest, Module, OPTIONS, STAGES, compiler_version, flattened_source, sha256};

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
    for stage in STAGES {
        let source = flattened_source(Path::new("glsl"), stage);
        let module = compile(&source, stage)?;
        modules.push(Module {
            stage: stage.to_owned(),
            source_sha256: sha256(source.as_bytes()),
            module_sha256: sha256(&module),
        });
        settle(check, &format!("spirv/{stage}.spv"), &module)?;
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

fn compile(source: &str, stage: &str) -> Result<Vec<u8>, String> {
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
    let artifact =
        compiler.compile_into_spirv(source, kind, stage, "main", Some(&options)).map_err(|error| error.to_string())?;
    Ok(artifact.as_binary_u8().to_vec())
}
