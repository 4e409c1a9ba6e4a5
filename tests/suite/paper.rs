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

/// The path that a browser makes of a relative address.
fn file_at(url: &str) -> String {
    assert!(!url.contains(['?', '#', ' ', '"']), "{url} ends or breaks early");
    let mut parts = url.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        bytes.push(u8::from_str_radix(&part[..2], 16).expect("two hexadecimal digits"));
        bytes.extend(part[2..].bytes());
    }
    String::from_utf8(bytes).expect("names are UTF-8")
}

/// Fails unless everything that the page shows lies beside it; returns the page.
fn check_page(workshop: &Workshop, name: &str) -> String {
    let page = String::from_utf8(workshop.read(name)).expect("pages are UTF-8");
    assert!(page.starts_with("<!DOCTYPE html>"), "{page}");
    assert!(!page.contains("@import") && !page.contains("url("), "a page needs no other style");
    let folder = workshop.path(name).parent().map(Path::to_owned).expect("it lies in a folder");
    for file in files_of(&page).iter().map(|url| file_at(url)) {
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
    check_targets(&workshop);
    let unknowns = String::from_utf8(workshop.read("out/table2.csv")).expect("CSV is UTF-8");
    assert!(unknowns.contains(",2500,22500,") && unknowns.contains(",5000,45000,"), "{unknowns}");
    let fig9 = check_page(&workshop, "out/fig9.html");
    assert!(fig9.contains("GIMP is not installed"), "the page says what is missing");
}

/// Fails unless every SAE of figure 4 is that between two files in the folder.
fn check_targets(workshop: &Workshop) {
    let table = String::from_utf8(workshop.read("out/fig4.csv")).expect("CSV is UTF-8");
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|head| *head == name).expect("there is such a column");
    for row in rows.iter().skip(1).filter(|row| row[0].starts_with("paper-")) {
        let mosaic = workshop.pixels(&format!("out/fig4/{}/{}.png", row[0], row[1]));
        let target = workshop.pixels(&format!("out/{}", row[column("target")]));
        let sae: u64 = mosaic.iter().zip(target.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        assert_eq!(row[column("SAE")], sae.to_string(), "{row:?}");
    }
}

#[test]
fn a_scheme_of_figure_4_is_what_its_preset_makes_of_a_large_picture() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("photos")).expect("the folder is created");
    workshop.paint("photos/large.png", 600, 540);
    assert_done(&workshop.run("paper fig4 --images photos -o out --births 20 --quiet"));
    for preset in ["paper-1", "paper-2", "paper-8", "paper-11"] {
        assert_done(
            &workshop.run(&format!("evolve photos/large.png --preset {preset} --births 20 -o {preset}.png -q")),
        );
        let name = format!("out/fig4/{preset}/large.png");
        assert!(workshop.pixels(&name) == workshop.pixels(&format!("{preset}.png")), "{preset}");
    }
}

#[test]
fn the_runs_of_figure_5_are_those_of_shorter_evolutions() {
    let workshop = workshop();
    assert_done(&workshop.run("paper fig5 --images photos -o out --births 60 --quiet"));
    for (name, cool) in [("plain", "1"), ("cool", "0.5")] {
        for restarts in [0, 2, 4] {
            let cool = if restarts == 0 { String::new() } else { format!("--cool {cool}") };
            let rest = format!("--births 60 --restarts {restarts} {cool} -o whole.png --force --quiet");
            assert_done(&workshop.run(&format!("evolve photos/one.png --preset paper-1 {rest}")));
            let run = workshop.pixels(&format!("out/fig5/one-{name}-{restarts}.png"));
            assert!(run == workshop.pixels("whole.png"), "{name} {restarts}");
        }
    }
}

#[test]
fn any_name_of_a_picture_leads_to_its_files() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("photos")).expect("the folder is created");
    workshop.paint("photos/we ird#1?50%.png", 20, 20);
    assert_done(&workshop.run("paper fig3 --images photos -o out --quiet"));
    let page = check_page(&workshop, "out/fig3.html");
    assert!(page.contains("we%20ird%231%3F50%25-256.png"), "{page}");
}

#[test]
fn a_folder_in_which_a_figure_failed_may_be_used_again() {
    let workshop = workshop();
    // A folder where a picture should be.
    std::fs::create_dir_all(workshop.path("out/fig3/two-512.png/x")).expect("the folder is created");
    let ran = workshop.run("paper fig3 --images photos -o out --force --quiet");
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert!(check_page(&workshop, "out/fig3.html").contains("Not finished"));
    std::fs::remove_dir_all(workshop.path("out/fig3/two-512.png")).expect("the folder is removed");
    assert_done(&workshop.run("paper fig3 --images photos -o out --quiet"));
    assert!(!check_page(&workshop, "out/fig3.html").contains("Not finished"));
}

/// A program `gimp` that runs `script` where it should paint, in a folder that stands first in the path.
#[cfg(unix)]
fn fake_gimp(workshop: &Workshop, script: &str) -> String {
    use std::os::unix::fs::PermissionsExt;
    std::fs::create_dir_all(workshop.path("bin")).expect("the folder is created");
    let script = format!("#!/bin/sh\n[ \"$1\" = --version ] && exit 0\n{script}\n");
    workshop.write("bin/gimp", script.as_bytes());
    let permissions = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(workshop.path("bin/gimp"), permissions).expect("it is made a program");
    format!("{}:/usr/bin:/bin", workshop.path("bin").display())
}

#[cfg(unix)]
#[test]
fn what_gimp_paints_changes_its_own_table_only() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("photos")).expect("the folder is created");
    workshop.paint("photos/one.png", 40, 30);
    image::RgbImage::new(40, 30).save(workshop.path("second.png")).expect("the picture is written");
    image::RgbImage::from_pixel(40, 30, image::Rgb([255; 3])).save(workshop.path("first.png")).expect("it is written");
    for name in ["first", "second"] {
        let path = fake_gimp(&workshop, &format!("cp '{}' out.png", workshop.path(&format!("{name}.png")).display()));
        let mut command = workshop.command(&format!("paper fig6 --images photos -o {name} --births 20 --quiet"));
        let output = command.env("PATH", path).output().expect("the program starts");
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(check_page(&workshop, &format!("{name}/fig6.html")).contains("draws lots of its own"));
    }
    assert_eq!(workshop.read("first/fig6.csv"), workshop.read("second/fig6.csv"));
    assert_ne!(workshop.read("first/fig6-gimp.csv"), workshop.read("second/fig6-gimp.csv"));
}

#[cfg(unix)]
#[test]
fn a_gimp_that_fails_is_told_on_the_page_as_no_fault_of_ours() {
    let workshop = workshop();
    let path = fake_gimp(&workshop, "exit 1");
    let mut command = workshop.command("paper fig6 --images photos -o out --births 20 --quiet");
    let output = command.env("PATH", path).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let page = check_page(&workshop, "out/fig6.html");
    assert!(page.contains("GIMP did not paint: it wrote no picture") && !page.contains("report it"), "{page}");
    assert!(!workshop.path("out/fig6-gimp.csv").exists(), "there is nothing in it");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_gimp_and_the_figure() {
    let workshop = workshop();
    let pids = workshop.path("pids");
    let path = fake_gimp(&workshop, &format!("echo $$ >> '{}'\nexec sleep 100", pids.display()));
    let mut command = workshop.command("paper fig6 --images photos -o out --births 20 --quiet");
    let child = command.env("PATH", path).spawn().expect("the program starts");
    let began = std::time::Instant::now();
    while !pids.is_file() && began.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    crate::cli_interrupts::send("INT", &child);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(75), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(began.elapsed().as_secs() < 90, "nobody waits for GIMP");
    for pid in std::fs::read_to_string(&pids).expect("it was written").lines() {
        let alive = std::process::Command::new("sh").args(["-c", &format!("kill -0 {pid}")]).output();
        assert!(!alive.expect("sh starts").status.success(), "{pid} still runs");
    }
    assert!(check_page(&workshop, "out/fig6.html").contains("Not finished"));
    assert_done(&workshop.run("paper table1 -o out --quiet"));
}

#[test]
fn ctrl_c_ends_a_figure_without_an_evolution_too() {
    let workshop = workshop();
    let mut child = workshop.command("paper fig7 -o out --quiet").spawn().expect("the program starts");
    let began = std::time::Instant::now();
    while !workshop.path("out/fig7").is_dir() && began.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    crate::cli_interrupts::send("INT", &child);
    assert_eq!(child.wait().expect("it ends").code(), Some(75));
    let folder = std::fs::read_dir(workshop.path("out/fig7")).expect("it can be listed");
    assert!(folder.flatten().all(|entry| !entry.file_name().to_string_lossy().contains("partial")));
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
    for folder in ["twins", "narrow"] {
        std::fs::create_dir(workshop.path(folder)).expect("the folder is created");
    }
    workshop.paint("twins/x.png", 20, 20);
    workshop.paint("twins/X.bmp", 20, 20);
    workshop.paint("narrow/stripe.png", 600, 12);
    for (line, told) in [
        ("paper fig4 -o out", "--images"),
        ("paper fig4 --images missing -o out", "missing"),
        ("paper fig4 --images empty -o out", "has no pictures"),
        ("paper fig4 --images photos -o out", "broken.jpg"),
        ("paper fig4 --images twins -o out", "twins/X.bmp and twins/x.png would write the same files"),
        ("paper fig4 --images narrow -o out", "narrow/stripe.png: has 256x5 px"),
        ("paper table1 -o photo.png", "photo.png is a file; name a folder"),
        ("gallery photo.png -o photo.png", "photo.png is a file; name a folder"),
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
    assert_done(&workshop.run("gallery narrow/stripe.png -o gallery --births 0 --quiet"));
}

#[test]
fn the_gallery_shows_every_shader_with_every_mask() {
    let workshop = Workshop::new();
    assert_done(&workshop.run("gallery photo.png -o gallery --births 5 --quiet"));
    let page = String::from_utf8(workshop.read("gallery/README.md")).expect("it is UTF-8");
    for mask in ["square", "border", "lines", "flower", "disc", "triangle", "hexagon", "brush"] {
        assert!(page.contains(&format!("| `{mask}` |")), "{mask}");
    }
    let mut sheets = std::collections::BTreeSet::new();
    for shader in ["flat", "template", "outline", "emboss", "soft", "hollow", "negative", "fade", "wash"] {
        assert!(page.contains(&format!("]({shader}.jpg)")), "{shader}");
        let sheet = workshop.pixels(&format!("gallery/{shader}.jpg"));
        assert_eq!(sheet.dimensions(), (8 * 264 + 8, 264 + 8));
        let is_colored = |pixel: &image::Rgb<u8>| pixel.0.iter().any(|channel| channel.abs_diff(128) > 40);
        let mut cells = std::collections::BTreeSet::new();
        for mask in 0..8 {
            // The picture is 40x30 px, evolved as it is and drawn 256 px wide.
            let cell = image::imageops::crop_imm(&sheet, 8 + mask * 264, 8 + 32, 256, 192).to_image();
            let colored = cell.pixels().filter(|pixel| is_colored(pixel)).count();
            assert!(colored > cell.pixels().len() / 2, "{shader} {mask}: {colored}");
            cells.insert(cell.into_raw());
        }
        // Without shading a square with an edge is a square.
        assert!(cells.len() >= 7, "{shader} shows masks as {} different pictures", cells.len());
        assert!(sheets.insert(sheet.into_raw()), "{shader} looks like another shader");
    }
    assert_done(&workshop.run("gallery photo.png -o gallery --births 0 --quiet"));
    std::fs::create_dir(workshop.path("mine")).expect("the folder is created");
    workshop.write("mine/flat.jpg", b"mine");
    let ran = workshop.run("gallery photo.png -o mine --births 0");
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
    assert_eq!(workshop.read("mine/flat.jpg"), b"mine");
}
