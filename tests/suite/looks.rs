//! Masks, shaders, blending, few colours and palettes on the command line.

use std::collections::BTreeSet;

use crate::workshop::Workshop;

/// Evolves with `flags` on the CPU and on software Vulkan; returns the pixels, which must be the same in all files.
fn evolve_on_both(workshop: &Workshop, flags: &str) -> image::RgbImage {
    workshop.evolve(&format!("{flags} -o cpu.png --force --save-target target.png"));
    workshop.evolve(&format!("{flags} -o gpu.png --force --device name:llvmpipe --batch-births 1"));
    assert_eq!(workshop.read("cpu.png"), workshop.read("gpu.png"), "{flags}");
    workshop.pixels("cpu.png")
}

#[test]
fn every_mask_and_every_shader_gives_the_same_bytes_on_the_cpu_and_on_vulkan() {
    let workshop = Workshop::new();
    let masks = ["square", "border", "lines", "flower", "disc", "triangle", "hexagon", "brush", "flower,disc"];
    let shaders = ["flat", "template", "outline", "emboss", "soft", "hollow", "negative", "fade", "wash"];
    let mut seen = BTreeSet::new();
    for (mask, shader) in masks.iter().zip(shaders) {
        for blend in ["", "--blend translucent", "--opacity 0.5"] {
            let pixels = evolve_on_both(&workshop, &format!("--mask {mask} --shader {shader} {blend}"));
            seen.insert(pixels.into_raw());
        }
    }
    // Squares and borders are opaque everywhere, so blending them at full opacity changes nothing. Soft, fade and wash
    // blend unless they are told not to.
    assert_eq!(seen.len(), masks.len() * 3 - 2 - 3);
}

#[test]
fn the_reported_sae_is_that_of_the_picture_whatever_the_tiles() {
    let workshop = Workshop::new();
    for flags in [
        "--mask brush --blend translucent",
        "--mask flower --colors 7",
        "--mask disc --shader soft --opacity 0.4",
        "--mask square --restarts 1 --restart-mask border,lines",
    ] {
        let row = workshop.evolve_to_row(&format!("{flags} -o x.png --save-target t.png --force"));
        let (made, wanted) = (workshop.pixels("x.png"), workshop.pixels("t.png"));
        let sae: u64 = made.iter().zip(wanted.iter()).map(|(&a, &b)| u64::from(a.abs_diff(b))).sum();
        assert_eq!(row["sae"], sae, "{flags}");
    }
}

#[test]
fn masks_of_the_users_own_are_worn() {
    let workshop = Workshop::new();
    let svg = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10"><path d="M0 10L5 0L10 10z"/></svg>"#;
    workshop.write("tent.svg", svg.as_bytes());
    image::GrayImage::from_fn(30, 30, |i, _| image::Luma([if i < 15 { 255 } else { 0 }]))
        .save(workshop.path("half.png"))
        .expect("the picture is written");
    let tent = evolve_on_both(&workshop, "--mask tent.svg");
    let half = evolve_on_both(&workshop, "--mask half.png");
    let plain = evolve_on_both(&workshop, "");
    assert!(tent != half && half != plain && tent != plain);
}

#[test]
fn few_colours_are_those_of_the_target_and_a_palette_holds_the_tiles_too() {
    let workshop = Workshop::new();
    workshop.evolve("--colors 6 -o few.png --save-target target.png");
    let colors = |name: &str| workshop.pixels(name).pixels().map(|pixel| pixel.0).collect::<BTreeSet<_>>();
    assert!((2..=6).contains(&colors("target.png").len()), "{:?}", colors("target.png"));
    assert!(colors("few.png").len() > 6, "the tiles' colours evolve freely");

    workshop.write("three.hex", b"ff0000\n00ff00\n#000000\n");
    let palette = BTreeSet::from([[255, 0, 0], [0, 255, 0], [0, 0, 0]]);
    workshop.evolve("--palette three.hex -o held.png --save-target target.png --force");
    assert!(colors("target.png").is_subset(&palette) && colors("held.png").is_subset(&palette));
}

#[test]
fn picture_and_tiles_take_the_same_colour_of_a_palette() {
    let spread = |k: u32| [(k * 37 % 256) as u8, (k * 101 % 256) as u8, (k * 59 % 256) as u8];
    let colors: Vec<[u8; 3]> = (0..40).map(spread).collect();
    let pixels: Vec<[u8; 3]> = (0..4_096).map(|k| spread(k * 7 + k / 256)).collect();
    let mut photo = smalti::photo::Photo { width_px: 64, height_px: 64, pixels: pixels.clone() };
    smalti::photo::reduce(&mut photo, &colors);
    let palette = smalti::evolve::Palette::new(colors).expect("there are colours");
    assert!(pixels.iter().zip(&photo.pixels).all(|(&pixel, &reduced)| palette.nearest(pixel) == reduced));
}

#[test]
fn looks_that_make_no_sense_are_refused_in_one_sentence() {
    let workshop = Workshop::new();
    workshop.write("empty.hex", b"\n; nothing\n");
    workshop.write("words.hex", b"ff0000\nreddish\n");
    workshop.write("broken.svg", b"<svg");
    image::GrayImage::new(8, 8).save(workshop.path("black.png")).expect("the picture is written");
    for (flags, told) in [
        ("--mask star", "there is no such mask"),
        ("--mask broken.svg", "broken.svg"),
        ("--mask black.png", "black.png"),
        ("--shader glossy", "glossy"),
        ("--opacity 0", "--opacity 0"),
        ("--opacity nan", "--opacity NaN"),
        ("--opacity 30%", "expected a number such as 0.5"),
        ("--seed -1", "see smalti evolve --help"),
        ("--opacity 0.5 --blend opaque", "--blend"),
        ("--restart-mask disc", "--restarts"),
        ("--colors 0", "1 to 256"),
        ("--colors 6 --palette empty.hex", "cannot be used with"),
        ("--palette empty.hex", "empty palette"),
        ("--palette words.hex", "line 2"),
        ("--palette missing.gpl", "no such file"),
    ] {
        let ran = workshop.run(&format!("evolve photo.png --scheme paper -o x.png {flags}"));
        assert_eq!(ran.code, Some(2), "{flags}: {}", ran.stderr);
        assert!(ran.stderr.contains(told) && ran.stderr.lines().count() == 1, "{flags}: {}", ran.stderr);
        assert!(!workshop.files().contains("x.png"), "{flags}");
    }
}

/// The masks that the flies of a population file wear, and how many it has.
fn worn(workshop: &Workshop, name: &str) -> (BTreeSet<u16>, usize) {
    let archive = smalti::archive::read(&workshop.path(name)).expect("it is a population");
    let worn = archive.population.flies.iter().map(|fly| fly.mask).collect();
    (worn, archive.population.masks.layers().len())
}

#[test]
fn a_population_keeps_its_masks_until_it_is_told_to_change() {
    let workshop = Workshop::new();
    workshop.evolve("--mask disc -o disc.npz");
    let go_on =
        |flags: &str| workshop.run(&format!("evolve photo.png --scheme paper --init disc.npz --births 40 {flags}"));
    assert_eq!(go_on("-o kept.npz").code, Some(0));
    assert_eq!(worn(&workshop, "kept.npz"), (BTreeSet::from([1]), 2));
    let later = "--restarts 1 --restart-mask flower,square";
    assert_eq!(go_on(&format!("{later} -o later.npz")).code, Some(0));
    assert_eq!(worn(&workshop, "later.npz"), (BTreeSet::from([0, 2]), 3), "disc, then flower and square");
    assert_eq!(go_on("--mask square -o square.npz").code, Some(0));
    assert_eq!(worn(&workshop, "square.npz").0, BTreeSet::from([0]));
    for flags in ["--shader emboss", "--opacity 0.5", "--blend translucent --restarts 1 --restart-mask flower"] {
        let ran = go_on(&format!("{flags} -o x.npz"));
        assert_eq!(ran.code, Some(2), "{flags}: {}", ran.stderr);
        assert!(ran.stderr.contains("keeps its masks"), "{flags}: {}", ran.stderr);
    }
}

#[test]
fn a_shader_shades_the_masks_that_are_named_and_the_rectangles_of_the_first_run_stay_plain() {
    let workshop = Workshop::new();
    workshop.evolve("--preset paper-9 --shader emboss -o first.npz");
    assert_eq!(worn(&workshop, "first.npz").1, 2, "the square and the embossed flower");
    workshop.evolve("--shader emboss -o embossed.npz");
    assert_eq!(worn(&workshop, "embossed.npz"), (BTreeSet::from([1]), 2));
}

#[test]
fn a_dry_run_and_the_summary_say_what_was_asked_for() {
    let workshop = Workshop::new();
    let flags = "--mask disc --shader soft --opacity 0.5 --colors 9 --color-mode mean --p-crossover 0.25 -o x.png";
    for ran in [workshop.evolve(&format!("{flags} --dry-run")), workshop.evolve(&format!("{flags} -v"))] {
        for told in ["disc, shader soft, translucent, opacity 0.50", "9 colours", "colours by mean", "crossover 0.25"] {
            assert!(ran.stderr.contains(told), "{told}: {}", ran.stderr);
        }
    }
}
