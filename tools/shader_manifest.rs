//! What ties the committed SPIR-V to its sources: hashes of flattened sources, options and modules.
//!
//! Shared by the tool that compiles and by the test that, without a compiler, fails on stale modules.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// The options that every shader is compiled with. No optimisation: drivers do their own, and names stay readable in
/// captures and in the layout test.
pub const OPTIONS: &str = "target=vulkan1.3 optimization=none warnings=errors";

/// The shader stages, as named in `glsl/`; the module of `evaluate.comp` is `spirv/evaluate.comp.spv`.
pub const STAGES: [&str; 15] = [
    "cells.comp",
    "cells_deal.comp",
    "cells_depths.comp",
    "cells_fitness.comp",
    "cells_glazed.comp",
    "cells_scan.comp",
    "cells_scatter.comp",
    "cells_sort.comp",
    "cells_spread.comp",
    "compose.comp",
    "evaluate.comp",
    "mosaic.frag",
    "mosaic.vert",
    "re_render.comp",
    "translucent.comp",
];

/// The stages that are compiled once more for drivers without subgroup operations: `spirv/evaluate.comp.plain.spv`.
pub const PLAIN_STAGES: [&str; 5] =
    ["cells.comp", "cells_glazed.comp", "evaluate.comp", "re_render.comp", "translucent.comp"];

/// What those are compiled with.
pub const PLAIN_MACRO: &str = "NO_SUBGROUPS";

/// All modules: stage, and whether it is one of the plain ones.
pub fn all_modules() -> impl Iterator<Item = (&'static str, bool)> {
    let plain = PLAIN_STAGES.into_iter().map(|stage| (stage, true));
    STAGES.into_iter().map(|stage| (stage, false)).chain(plain)
}

/// The file of a module in `spirv/`.
pub fn module_file(stage: &str, is_plain: bool) -> String {
    if is_plain { format!("{stage}.plain.spv") } else { format!("{stage}.spv") }
}

/// `spirv/MANIFEST`.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// The compiler that wrote the modules; another version may write other bytes.
    pub compiler: String,
    /// [`OPTIONS`] at the time.
    pub options: String,
    /// One entry per module.
    pub modules: Vec<Module>,
}

/// One compiled module.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Module {
    /// File name in `glsl/`.
    pub stage: String,
    /// Whether it is for drivers without subgroup operations.
    pub is_plain: bool,
    /// SHA-256 of the source with its includes put in place.
    pub source_sha256: String,
    /// SHA-256 of the SPIR-V.
    pub module_sha256: String,
}

/// The source of a stage with each `#include "..."` replaced by the file's text.
pub fn flattened_source(glsl: &Path, stage: &str) -> String {
    let path = glsl.join(stage);
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut flat = String::new();
    for line in text.lines() {
        match line.strip_prefix("#include \"").and_then(|rest| rest.strip_suffix('"')) {
            Some(include) => flat.push_str(&flattened_source(glsl, include)),
            None => flat.push_str(line),
        }
        flat.push('\n');
    }
    flat
}

/// Lower-case hexadecimal SHA-256.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The shaderc crate of the lock file, whose sources the compiler is built from.
pub fn compiler_version(lock: &Path) -> Result<String, String> {
    let text = fs::read_to_string(lock).map_err(|error| format!("{}: {error}", lock.display()))?;
    let version = text.split("name = \"shaderc\"\nversion = \"").nth(1).and_then(|rest| rest.split('"').next());
    version.map(|version| format!("shaderc {version}")).ok_or_else(|| "Cargo.lock names no shaderc".to_owned())
}
