//! Every byte that crosses to a shader lies where the shader reads it: the Rust types against the committed modules.

use std::fs;
use std::mem::offset_of;
use std::path::Path;

use smalti::gpu::cells::layout::{CellRecord, CellsPush, FlyRecord, SearchHeader, SearchRules, search_rules_numbers};
use smalti::gpu::layout::{
    ComposeItem, ComposePush, EvaluatePush, Instance, LaneRecord, MosaicPush, ReRenderPush, StackItem, Tile,
    TranslucentPush, WorkItem,
};

use crate::shader_manifest::STAGES;
use crate::spirv::{Member, MemoryStruct, memory_structs};

/// A Rust type, and the struct as which some stages read its bytes.
struct Twin {
    rust: &'static str,
    glsl: &'static str,
    stages: &'static [&'static str],
    place: Place,
    size_bytes: usize,
    /// The fields in Rust's order, each under the name of its member in GLSL.
    fields: Vec<Member>,
}

#[derive(Clone, Copy)]
enum Place {
    /// Element of an array in a storage buffer.
    Array,
    PushConstants,
}

/// Rust types that lie in memory as a GLSL type does.
trait Kind {
    const GLSL: &'static str;
}

impl Kind for u32 {
    const GLSL: &'static str = "uint";
}

impl Kind for i32 {
    const GLSL: &'static str = "int";
}

impl Kind for [i32; 2] {
    const GLSL: &'static str = "ivec2";
}

impl Kind for [f32; 2] {
    const GLSL: &'static str = "vec2";
}

fn kind_of<T, F: Kind>(_field: impl Fn(&T) -> &F) -> String {
    F::GLSL.to_owned()
}

/// The stages of a search.
const CELLS: [&str; 9] = [
    "cells.comp",
    "cells_deal.comp",
    "cells_depths.comp",
    "cells_fitness.comp",
    "cells_glazed.comp",
    "cells_scan.comp",
    "cells_scatter.comp",
    "cells_sort.comp",
    "cells_spread.comp",
];

/// `Type = "Struct" in place of stages, { field = "member", ... }`.
macro_rules! twin {
    ($type:ident = $glsl:literal in $place:ident of $stages:expr, { $($field:ident = $member:literal),+ }) => {{
        // Names every field: one that the table misses does not compile.
        let _ = |$type { $($field: _),+ }: $type| ();
        Twin {
            rust: stringify!($type),
            glsl: $glsl,
            stages: &$stages,
            place: Place::$place,
            size_bytes: size_of::<$type>(),
            fields: vec![$(Member {
                name: $member.to_owned(),
                offset: offset_of!($type, $field) as u32,
                kind: kind_of(|value: &$type| &value.$field),
            }),+],
        }
    }};
}

/// What the tables of the rules say.
fn search_rules() -> Twin {
    let field = |(name, offset, kind): (String, u32, &str)| Member { name, offset, kind: kind.to_owned() };
    Twin {
        rust: "SearchRules",
        glsl: "SearchRules",
        stages: &CELLS,
        place: Place::Array,
        size_bytes: size_of::<SearchRules>(),
        fields: search_rules_numbers().into_iter().map(field).collect(),
    }
}

fn twins() -> Vec<Twin> {
    vec![
        twin!(Tile = "Tile" in Array of ["compose.comp", "evaluate.comp", "mosaic.vert", "re_render.comp", "translucent.comp"], {
            x0 = "x0", y0 = "y0", x1 = "x1", y1 = "y1", u0 = "u0", v0 = "v0", cos = "cos_step", sin = "sin_step",
            w = "w", h = "h", color = "color", mask = "mask", w_inverse = "w_inverse", h_inverse = "h_inverse",
            ring = "ring"
        }),
        twin!(LaneRecord = "Lane" in Array of ["evaluate.comp", "re_render.comp", "translucent.comp"], {
            first_fly = "first_fly", first_mask = "first_mask", background = "background", sum = "sum"
        }),
        twin!(WorkItem = "WorkItem" in Array of ["evaluate.comp", "re_render.comp"], {
            lane = "lane", first_pixel = "first_pixel", x = "x", y = "y", first_entry = "first_entry",
            entry_count = "entry_count", flags = "flags", padding = "padding"
        }),
        twin!(StackItem = "StackItem" in Array of ["translucent.comp"], {
            lane = "lane", first_pixel = "first_pixel", x = "x", y = "y", first_entry = "first_entry",
            entry_count = "entry_count", first_slot = "first_slot", flags = "flags", first_rank = "first_rank",
            end_rank = "end_rank", scratch = "scratch", first_part = "first_part", error = "error"
        }),
        twin!(ComposeItem = "ComposeItem" in Array of ["compose.comp"], {
            x = "x", y = "y", first_entry = "first_entry", entry_count = "entry_count", first_sample = "first_sample",
            flags = "flags"
        }),
        twin!(Instance = "Instance" in Array of ["mosaic.vert"], {
            axis_u = "axis_u", axis_v = "axis_v", centre = "centre", fly = "fly", rank = "rank"
        }),
        twin!(FlyRecord = "Fly" in Array of CELLS, {
            x = "x", y = "y", z = "z", rg = "rg", ba = "ba", w = "w", h = "h", form = "form"
        }),
        search_rules(),
        twin!(SearchHeader = "Header" in Array of CELLS, {
            round = "round", wanted = "wanted", pending = "pending", is_fresh = "is_fresh", overrun = "overrun",
            evals_low = "evals_low", evals_high = "evals_high", births_low = "births_low",
            births_high = "births_high", accepted_low = "accepted_low", accepted_high = "accepted_high",
            change_low = "change_low", change_high = "change_high", iterations = "iterations", under_way = "under_way"
        }),
        twin!(CellRecord = "CellRecord" in Array of CELLS, {
            first = "first", count = "count", step = "step", dealt = "dealt", filled = "filled"
        }),
        twin!(CellsPush = "Push" in PushConstants of CELLS, {
            first_lane = "first_lane", budget = "budget", first_cell = "first_cell"
        }),
        twin!(EvaluatePush = "Push" in PushConstants of ["evaluate.comp"], {
            item_count = "item_count"
        }),
        twin!(ReRenderPush = "Push" in PushConstants of ["re_render.comp"], {
            item_count = "item_count", left_out_fly = "left_out_fly"
        }),
        twin!(TranslucentPush = "Push" in PushConstants of ["translucent.comp"], {
            first_item = "first_item", item_count = "item_count"
        }),
        twin!(ComposePush = "Push" in PushConstants of ["compose.comp"], {
            item_count = "item_count", background = "background"
        }),
        twin!(MosaicPush = "Push" in PushConstants of ["mosaic.vert", "mosaic.frag"], {
            origin = "origin", pixel_size = "pixel_size", first_mask = "first_mask", grout = "grout"
        }),
    ]
}

fn structs_of(stage: &str) -> Vec<MemoryStruct> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("spirv/{stage}.spv"));
    memory_structs(&fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}

/// The size that a shader gives the struct: the stride of its array, or for push constants where the last member ends.
fn size_bytes(found: &MemoryStruct, place: Place) -> Option<usize> {
    match place {
        Place::Array => found.array_stride.map(|stride| stride as usize),
        Place::PushConstants => found.members.last().map(|last| {
            let components = last.kind.split_once("vec").map_or(1, |(_, count)| count.parse().expect("vec2 to vec4"));
            last.offset as usize + 4 * components
        }),
    }
}

#[test]
fn every_field_lies_where_the_shaders_read_it() {
    for twin in twins() {
        for stage in twin.stages {
            let place = format!("{} of gpu::layout and {} of glsl/{stage}", twin.rust, twin.glsl);
            let structs = structs_of(stage);
            let found: Vec<_> = structs.iter().filter(|found| found.name == twin.glsl).collect();
            let [found] = found[..] else { panic!("{place}: the module has {} such structs in memory", found.len()) };
            for (member, field) in found.members.iter().zip(&twin.fields) {
                assert_eq!(member, field, "{place} differ; left is the shader's, right is Rust's");
            }
            assert_eq!(found.members.len(), twin.fields.len(), "{place}: one has more members");
            assert_eq!(size_bytes(found, twin.place), Some(twin.size_bytes), "{place}: size in bytes");
        }
    }
}

/// A buffer itself, such as `Tiles { Tile tiles[]; }`, has no Rust type; its elements do.
fn is_buffer(found: &MemoryStruct) -> bool {
    matches!(&found.members[..], [only] if only.kind.ends_with("[]"))
}

#[test]
fn every_struct_that_a_shader_reads_from_memory_is_compared() {
    for stage in STAGES {
        for found in structs_of(stage).iter().filter(|found| !is_buffer(found)) {
            let compared = twins().iter().any(|twin| twin.glsl == found.name && twin.stages.contains(&stage));
            assert!(compared, "{} of glsl/{stage} has no type in the table of tests/suite/layout.rs", found.name);
        }
    }
}
