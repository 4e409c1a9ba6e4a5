//! Every style gives the same bytes on the CPU and on a Vulkan device, through the program.

use crate::workshop::Workshop;

#[test]
fn the_outputs_of_every_style_are_the_same_bytes_on_the_cpu_and_on_vulkan() {
    let workshop = Workshop::new();
    workshop.paint("picture.png", 72, 60);
    for (style, evals) in [("free", "6k"), ("mosaic", "5k"), ("paint", "4k"), ("spray", "2k")] {
        let evolve = |device: &str, name: &str| {
            let flags = format!("-n 60 --candidates 2 --evals {evals} --style {style} --device {device}");
            let ran = workshop.run(&format!("evolve picture.png -o {style}-{name}.png -o {style}-{name}.npz {flags}"));
            assert_eq!(ran.code, Some(0), "{style} on {device}: {}", ran.stderr);
            [workshop.read(&format!("{style}-{name}.png")), workshop.read(&format!("{style}-{name}.npz"))]
        };
        assert!(evolve("cpu", "cpu") == evolve("name:llvmpipe", "vulkan"), "{style} differs");
    }
}
