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

/// Another way to compile some stages.
pub struct Flavour {
    /// Part of the names of its modules: `spirv/evaluate.comp.plain.spv`. The first way has none.
    pub name: &'static str,
    /// What is defined.
    pub macros: &'static [&'static str],
    /// The stages in which it makes a difference.
    pub stages: &'static [&'static str],
}

/// All further ways: for hardware, and for hardware without subgroup operations.
pub const FLAVOURS: [Flavour; 2] = [
    Flavour { name: "hardware", macros: &["HARDWARE"], stages: &["cells.comp", "cells_glazed.comp"] },
    Flavour {
        name: "plain",
        macros: &["HARDWARE", "NO_SUBGROUPS"],
        stages: &["cells.comp", "cells_glazed.comp", "evaluate.comp", "re_render.comp", "translucent.comp"],
    },
];

/// All modules: stage, name of the flavour, and what is defined.
pub fn all_modules() -> Vec<(&'static str, &'static str, &'static [&'static str])> {
    let further = FLAVOURS.iter().flat_map(|flavour| {
        let Flavour { name, macros, stages } = *flavour;
        stages.iter().map(move |stage| (*stage, name, macros))
    });
    let first = STAGES.into_iter().map(|stage| (stage, "", &[] as &'static [&'static str]));
    first.chain(further).collect()
}

/// The file of a module in `spirv/`.
pub fn module_file(stage: &str, flavour: &str) -> String {
    if flavour.is_empty() { format!("{stage}.spv") } else { format!("{stage}.{flavour}.spv") }
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
    /// Name of its flavour; empty for the first one.
    pub flavour: String,
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
