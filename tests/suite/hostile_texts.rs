//! Presets, palettes, flags and rows that are larger than anybody writes them.

use std::fs;
use std::io::Write;

use crate::cli_refusals::refused;
use crate::files::archives::Members;
use crate::hostile_files::assert_quiet;
use crate::workshop::Workshop;

#[test]
fn too_many_masks_are_refused_before_any_is_read() {
    let workshop = Workshop::new();
    let named = |count: usize, mask: &str| format!("masks = [{}]\n", vec![format!("\"{mask}\""); count].join(","));
    workshop.write("many.toml", named(256, "none.png").as_bytes());
    refused(
        &workshop,
        "evolve photo.png -o o.png --preset many.toml",
        2,
        "many.toml: names 256 masks, and at most 255",
    );
    let flags = "--mask disc ".repeat(256);
    refused(&workshop, &format!("evolve photo.png -o o.png {flags}"), 2, "256 masks are named, and at most 255");
    workshop.write("few.toml", named(255, "disc").as_bytes());
    let ran = workshop.run("evolve photo.png -o o.png -n 8 --evals 500 --preset few.toml");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
}

#[test]
fn a_mask_that_is_named_twice_keeps_its_weight_in_the_papers_mix() {
    let workshop = Workshop::new();
    let row = |masks: &str| workshop.evolve_to_row(&format!("-o o.npz --force --mask {masks}"));
    let worn = |masks: &str| {
        row(masks);
        let bytes = Members::of(&workshop.read("o.npz"));
        bytes.content("mask.npy").chunks_exact(2).rev().take(60).filter(|mask| mask[0] == 1).count()
    };
    let (once, thrice) = (worn("disc,flower"), worn("disc,flower,disc,disc"));
    assert!(thrice > once, "{thrice} of 60 tiles are discs, and {once} if each mask is named once");
}

#[test]
fn a_text_without_an_end_is_refused_for_its_size() {
    let workshop = Workshop::new();
    let large = vec![b'#'; (1 << 20) + 1];
    for name in ["large.toml", "large.gpl"] {
        workshop.write(name, &large);
    }
    let mut rows = fs::File::create(workshop.path("rows.jsonl")).unwrap();
    rows.write_all(&vec![b'{'; 3 << 20]).unwrap();
    for (line, words) in [
        ("evolve photo.png -o o.png --config large.toml", "large.toml: has more than 1 MiB, the limit for a file of"),
        ("evolve photo.png -o o.png --preset large.toml", "large.toml: has more than 1 MiB, the limit for a preset"),
        ("evolve photo.png -o o.png --palette large.gpl", "large.gpl: has more than 1 MiB, the limit for a palette"),
        ("evolve photo.png -o o.png --config /dev/zero", "/dev/zero: has more than 1 MiB"),
        ("evolve photo.png -o o.png --palette /dev/zero", "/dev/zero: has more than 1 MiB"),
        ("merge rows.jsonl -o o.jsonl", "rows.jsonl: holds no rows of results"),
        ("merge /dev/zero -o o.jsonl", "/dev/zero: "),
    ] {
        assert_quiet(&refused(&workshop, line, 2, words));
    }
}
