//! What the compiled shaders ask of a device, read from the modules themselves.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use smalti::vk::NEEDED_LIMITS;

// Operations, decorations and the rest by the numbers of the SPIR-V specification, section 3.
const OP_EXECUTION_MODE: u32 = 16;
const OP_CAPABILITY: u32 = 17;
const OP_VARIABLE: u32 = 59;
const OP_DECORATE: u32 = 71;
const SPEC_ID: u32 = 1;
const BUILT_IN: u32 = 11;
const WORKGROUP_SIZE: u32 = 25;
const LOCAL_SIZE: u32 = 17;
const STORAGE_BUFFER: u32 = 12;
const SHADER: u32 = 1;
const GROUP_NON_UNIFORM: u32 = 61;
const GROUP_NON_UNIFORM_ARITHMETIC: u32 = 63;
const DEMOTE_TO_HELPER_INVOCATION: u32 = 5379;
const WORDS_OF_HEADER: usize = 5;

/// Every module with its name, as operations.
fn modules() -> BTreeMap<String, Vec<Vec<u32>>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv");
    let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let modules = paths.filter(|path| path.extension().is_some_and(|ending| ending == "spv"));
    modules.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), operations(&path))).collect()
}

fn operations(path: &Path) -> Vec<Vec<u32>> {
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&fs::read(path).unwrap());
    let mut rest = &words[WORDS_OF_HEADER..];
    let mut operations = Vec::new();
    while let Some(&first) = rest.first() {
        let (operation, after) = rest.split_at((first >> 16) as usize);
        operations.push([&[first & 0xFFFF], &operation[1..]].concat());
        rest = after;
    }
    operations
}

#[test]
fn no_module_has_two_constants_of_one_number_or_takes_the_size_of_its_workgroup_for_one() {
    for (name, operations) in modules() {
        let mut numbers: Vec<u32> = Vec::new();
        for operation in &operations {
            match operation.as_slice() {
                [OP_DECORATE, _, SPEC_ID, number] => numbers.push(*number),
                [OP_DECORATE, _, BUILT_IN, WORKGROUP_SIZE] => panic!("{name} takes it"),
                _ => {}
            }
        }
        let count = numbers.len();
        numbers.sort_unstable();
        numbers.dedup();
        assert_eq!(numbers.len(), count, "{name}: constants {numbers:?}");
    }
}

#[test]
fn a_device_must_have_what_the_modules_use_and_no_more() {
    let modules = modules();
    let storage_buffers = |operations: &Vec<Vec<u32>>| {
        operations
            .iter()
            .filter(|operation| matches!(operation.as_slice(), [OP_VARIABLE, _, _, STORAGE_BUFFER]))
            .count()
    };
    let invocations = |operations: &Vec<Vec<u32>>| {
        let sizes = operations.iter().filter_map(|operation| match operation.as_slice() {
            [OP_EXECUTION_MODE, _, LOCAL_SIZE, x, y, z] => Some(x * y * z),
            _ => None,
        });
        sizes.max().unwrap_or(1) as usize
    };
    let most = |of: &dyn Fn(&Vec<Vec<u32>>) -> usize| modules.values().map(of).max().unwrap();
    let needed = NEEDED_LIMITS.map(|limit| (limit.name, limit.needed as usize));
    assert_eq!(needed[1], ("invocations in a workgroup", most(&invocations)));
    assert_eq!(needed[0], ("storage buffers per shader stage", most(&storage_buffers)));
}

#[test]
fn no_module_uses_a_capability_that_the_table_in_architecture_does_not_name() {
    for (name, operations) in modules() {
        for operation in &operations {
            let [OP_CAPABILITY, capability] = operation[..] else { continue };
            let is_known = match capability {
                SHADER | GROUP_NON_UNIFORM | GROUP_NON_UNIFORM_ARITHMETIC => true,
                DEMOTE_TO_HELPER_INVOCATION => name == "mosaic.frag.spv",
                _ => false,
            };
            assert!(is_known, "{name} uses capability {capability}; see ARCHITECTURE.md, \"What a device must offer\"");
        }
    }
}
