//! The paper's presets, figures and tables, and the gallery, run as a person would.

use std::path::Path;

use crate::workshop::{Ran, Workshop};

/// A workshop with two small pictures in the folder `photos`.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("photos")).expect("the folder is created");
    workshop.paint("photos/one.png", 40, 30);
    workshop.paint("photos/two.png", 24, 36);
    workshop
}

fn assert_done(ran: &Ran) {
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
}

/// Every file that a page shows or links to, as it stands in the page.
fn files_of(page: &str) -> Vec<String> {
    let values = |name: &str| {
        let parts: Vec<String> = page.split(&format!("{name}=\"")).skip(1).map(str::to_owned).collect();
        parts.into_iter().filter_map(|part| part.split('"').next().map(str::to_owned))
    };
    values("src").chain(values("href")).collect()
}

/// Fails unless everything that the page shows lies beside it; returns the page.
fn check_page(workshop: &Workshop, name: &str) -> String {
    let page = String::from_utf8(workshop.read(name)).expect("pages are UTF-8");
    assert!(page.starts_with("<!DOCTYPE html>"), "{page}");
    assert!(!page.contains("@import") && !page.contains("url("), "a page needs no other style");
    let folder = workshop.path(name).parent().map(Path::to_owned).expect("it lies in a folder");
    for file in files_of(&page) {
        assert!(folder.join(&file).is_file(), "{name} shows {file}, which is not beside it");
    }
    page
}

#[test]
fn every_preset_gives_the_same_bytes_on_the_cpu_and_on_vulkan() {
    let workshop = Workshop::new();
    for number in 1..=12 {
        for device in ["cpu", "name:llvmpipe"] {
            let name = device.trim_start_matches("name:");
            let line = format!(
                "evolve photo.png --preset paper-{number} --births 90 --batch-births 10 -o {name}.png -o {name}.npz \
                 --device {device} --force --quiet"
            );
            assert_done(&workshop.run(&line));
        }
        assert_eq!(workshop.read("cpu.png"), workshop.read("llvmpipe.png"), "paper-{number}");
        assert_eq!(workshop.read("cpu.npz"), workshop.read("llvmpipe.npz"), "paper-{number}");
    }
}

#[test]
fn options_change_parts_of_a_preset() {
    let workshop = Workshop::new();
    let row = workshop.evolve_to_row("--preset paper-9 -o preset.png");
    assert_eq!((&row["restarts"], &row["births"]), (&1.into(), &600.into()));
    let row = workshop.evolve_to_row("--preset paper-9 --restarts 2 --restart-mask disc -o other.png");
    assert_eq!((&row["restarts"], &row["births"]), (&2.into(), &900.into()));
    assert_ne!(workshop.read("preset.png"), workshop.read("other.png"));
    let ran = workshop.run("evolve photo.png --preset paper-13 -o x.png");
    assert_eq!(ran.code, Some(2));
    assert!(ran.stderr.contains("paper-1 to paper-12"), "{}", ran.stderr);
}

#[test]
fn every_figure_and_table_is_a_page_with_its_files_beside_it() {
    let workshop = workshop();
    let mut command = workshop.command("paper all --images photos -o out --births 30 --quiet");
    // Without a PATH there is no GIMP, here as in most places.
    let output = command.env("PATH", "").output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let index = check_page(&workshop, "out/index.html");
    let names = ["fig3", "fig4", "fig5", "fig6", "fig7", "fig8", "fig9", "table1", "table2"];
    for name in names {
        assert!(index.contains(&format!("{name}.html")), "{name} is missing in the index");
        check_page(&workshop, &format!("out/{name}.html"));
    }
    let rows = |name: &str| String::from_utf8(workshop.read(name)).expect("CSV is UTF-8").lines().count() - 1;
    assert_eq!(rows("out/table1.csv"), 12);
    assert_eq!(rows("out/fig4.csv"), 2 * 12 + 2 * 2, "twelve schemes and two grids on two pictures");
    assert_eq!(rows("out/fig5.csv"), 2 * 2 * 5, "five runs with and without cooling");
    let unknowns = String::from_utf8(workshop.read("out/table2.csv")).expect("CSV is UTF-8");
    assert!(unknowns.contains(",2500,22500,") && unknowns.contains(",5000,45000,"), "{unknowns}");
    let fig9 = check_page(&workshop, "out/fig9.html");
    assert!(fig9.contains("GIMP is not installed"), "the page says what is missing");
}

#[test]
fn a_figure_is_the_same_whatever_computes_it() {
    let workshop = workshop();
    assert_done(&workshop.run("paper fig8 --images photos -o cpu --births 40 --threads 1 --quiet"));
    assert_done(&workshop.run("paper fig8 --images photos -o gpu --births 40 --device name:llvmpipe --quiet"));
    for file in ["fig8.html", "fig8.csv", "fig8/8b-one.png", "fig8/8f-two.png"] {
        assert_eq!(workshop.read(&format!("cpu/{file}")), workshop.read(&format!("gpu/{file}")), "{file}");
    }
}

#[test]
fn figures_refuse_what_they_cannot_use_and_touch_no_foreign_folder() {
    let workshop = workshop();
    std::fs::create_dir(workshop.path("empty")).expect("the folder is created");
    workshop.write("photos/broken.jpg", b"no picture");
    for (line, told) in [
        ("paper fig4 -o out", "--images"),
        ("paper fig4 --images missing -o out", "missing"),
        ("paper fig4 --images empty -o out", "has no pictures"),
        ("paper fig4 --images photos -o out", "broken.jpg"),
        ("paper table1 -o photos", "photos holds files that smalti paper did not write"),
        ("paper fig10 -o out", "fig10"),
    ] {
        let ran = workshop.run(line);
        assert_eq!(ran.code, Some(2), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(told) && ran.stderr.lines().count() == 1, "{line}: {}", ran.stderr);
    }
    assert!(!workshop.path("out").exists(), "nothing is written before everything is known to be right");
    assert_done(&workshop.run("paper table1 -o photos --force --quiet"));
    assert!(workshop.path("photos/one.png").is_file());
    assert_done(&workshop.run("paper table2 -o photos --quiet"));
}

#[test]
fn the_gallery_shows_every_shader_with_every_mask() {
    let workshop = Workshop::new();
    assert_done(&workshop.run("gallery photo.png -o gallery --births 5 --quiet"));
    let page = String::from_utf8(workshop.read("gallery/README.md")).expect("it is UTF-8");
    for mask in ["square", "border", "lines", "flower", "disc", "triangle", "hexagon", "brush"] {
        assert!(page.contains(&format!("| `{mask}` |")), "{mask}");
    }
    for shader in ["flat", "template", "outline", "emboss", "soft", "hollow", "negative", "fade", "wash"] {
        assert!(page.contains(&format!("]({shader}.jpg)")), "{shader}");
        assert_eq!(workshop.pixels(&format!("gallery/{shader}.jpg")).dimensions(), (8 * 264 + 8, 264 + 8));
    }
    assert_done(&workshop.run("gallery photo.png -o gallery --births 0 --quiet"));
    std::fs::create_dir(workshop.path("mine")).expect("the folder is created");
    workshop.write("mine/flat.jpg", b"mine");
    let ran = workshop.run("gallery photo.png -o mine --births 0");
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    assert_eq!(workshop.read("mine/flat.jpg"), b"mine");
}
