//! All integration tests, in one binary, so that it links once.

#![allow(missing_docs, reason = "test names are sentences; only code that others call needs docs")]
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test that it is in")]

mod batch;
mod batch_places;
mod batch_resume;
mod bench;
mod canary;
mod cells;
mod cells_vulkan;
mod check;
mod circles;
mod cli;
mod cli_cells;
mod cli_interrupts;
mod cli_refusals;
mod cli_scheme;
mod compute_only;
mod determinism;
#[cfg(all(unix, feature = "view"))]
mod display;
mod exactness;
mod files;
mod front_door;
mod front_door_bounds;
mod glazed_vulkan;
mod grout;
mod guides;
mod hints;
mod hostile_files;
mod hostile_names;
mod hostile_scripts;
mod hostile_svgs;
mod hostile_texts;
mod labels;
mod lanes_vulkan;
mod layering;
mod layout;
mod live;
mod locks;
mod looks;
mod machines;
#[cfg(unix)]
mod manual;
mod modules;
mod over_nothing;
mod paper;
mod paper_lanes;
mod places;
#[cfg(unix)]
mod plugins;
#[cfg(unix)]
mod printed_commands;
mod reference;
mod render;
mod replay;
mod scenarios;
mod schemes;
mod score;
#[cfg(all(unix, feature = "view"))]
mod screen;
#[path = "../../tools/shader_manifest.rs"]
mod shader_manifest;
mod shaders_fresh;
mod shaped_devices;
mod shapes;
mod shards;
mod show;
mod snapshots;
mod sources;
mod spirv;
mod styles_vulkan;
mod timelapse;
mod trace;
mod translucent_search;
mod transparency;
mod video;
mod vulkan;
mod vulkan_failures;
#[cfg(all(unix, feature = "view"))]
mod window;
mod within_a_round;
mod workshop;
