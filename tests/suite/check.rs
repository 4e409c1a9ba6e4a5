//! `smalti check` on software Vulkan.

use serde_json::Value;

use crate::cli_refusals::refused;
use crate::workshop::Workshop;

#[test]
fn software_vulkan_is_equal_to_the_cpu_in_every_check_and_the_validation_layer_is_silent() {
    let workshop = Workshop::new();
    let ran = workshop.run("check --device vulkan --validate --json -q");
    let report = ran.row();
    let checks = report["checks"].as_array().unwrap();
    let unequal: Vec<&Value> = checks.iter().filter(|check| check["outcome"] != "equal").collect();
    assert_eq!((ran.code, report["equal"].as_bool(), unequal), (Some(0), Some(true), vec![]), "{}", ran.stderr);
    assert_eq!(report["schema"], "smalti-check");
    for name in ["fitness, translucent", "paper", "search, mosaic, 64 a step", "search, spray, over nothing", "lanes"] {
        let check = checks.iter().find(|check| check["name"] == name).unwrap_or_else(|| panic!("{name} is missing"));
        assert!(check["numbers"].as_u64() > Some(2_000), "{check}");
    }
    assert!(ran.stderr.is_empty(), "{}", ran.stderr);
}

#[test]
fn the_cpu_is_not_compared_with_itself() {
    let workshop = Workshop::new();
    refused(&workshop, "check --device cpu", 4, "the CPU is what devices are compared with");
    refused(&workshop, "check", 4, "smalti check --device vulkan takes software Vulkan, too");
}
