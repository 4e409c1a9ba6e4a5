//! `smalti view` as a person uses it: a real window on a display without a screen, drawn by software Vulkan under the
//! validation layer, used by mouse and keyboard. With SMALTI_KEEP_SCREENSHOTS the pictures of docs/window.md are written.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use image::RgbImage;

use crate::display::Display;
use crate::workshop::Workshop;

/// Where the parts of the window lie, in px from its upper left corner, at its first size.
const STAGE: [u32; 4] = [296, 30, 1_180, 652];
const MIDDLE: (u32, u32) = (738, 341);
const TILES: (u32, u32) = (173, 101);
const PAINT: (u32, u32) = (97, 71);
const SAVE_PATH: (u32, u32) = (484, 141);
const SAVE_FILE: (u32, u32) = (459, 235);

/// The program with its window.
struct Viewer {
    process: Child,
    display: Display,
    window: String,
    /// Where the window lies on the display.
    corner: (u32, u32),
    workshop: Workshop,
}

impl Viewer {
    fn open(picture: &str, flags: &str) -> Self {
        let (workshop, display) = (Workshop::new(), Display::start(1_400, 1_000).manage());
        std::fs::copy(Path::new("tests/photos").join(picture), workshop.path(picture)).expect("the photo is copied");
        let mut process = workshop
            .command(&format!("view {picture} --validate {flags}"))
            .env("DISPLAY", display.name())
            .env("XDG_CONFIG_HOME", workshop.path("configuration"))
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("DBUS_SESSION_BUS_ADDRESS")
            .stdout(Stdio::null())
            .spawn()
            .expect("the program starts");
        let window = display.window("- smalti", || {
            let Some(status) = process.try_wait().expect("it can be asked") else { return true };
            let mut said = String::new();
            let stderr = process.stderr.as_mut().expect("it is piped");
            stderr.read_to_string(&mut said).expect("messages are UTF-8");
            panic!("the program ended with {status} before its window came: {said}");
        });
        let told = || {
            let told = Command::new("xwininfo").args(["-id", &window, "-display", display.name()]).output();
            String::from_utf8_lossy(&told.expect("xwininfo runs").stdout).into_owned()
        };
        // It has a number before it is on the screen and has its place.
        let began = Instant::now();
        while !told().contains("IsViewable") {
            assert!(began.elapsed() < Duration::from_secs(120), "the window is never shown");
            std::thread::sleep(Duration::from_millis(50));
        }
        std::thread::sleep(Duration::from_millis(500));
        let place = told();
        let number = |name: &str| -> u32 {
            let line = place.lines().find(|line| line.contains(name)).expect("xwininfo tells it");
            line.rsplit(' ').next().and_then(|word| word.parse().ok()).expect("it is a number")
        };
        let corner = (number("Absolute upper-left X"), number("Absolute upper-left Y"));
        display.act(&format!("windowfocus {window}"));
        Self { process, display, window, corner, workshop }
    }

    fn at(&self, (x, y): (u32, u32)) -> (u32, u32) {
        (self.corner.0 + x, self.corner.1 + y)
    }

    fn click(&self, place: (u32, u32)) {
        let (x, y) = self.at(place);
        self.display.act(&format!("mousemove {x} {y} sleep 0.3 click 1 sleep 0.3"));
    }

    fn drag(&self, from: (u32, u32), to: (u32, u32)) {
        let ((x, y), (to_x, to_y)) = (self.at(from), self.at(to));
        let half = ((x + to_x) / 2, (y + to_y) / 2);
        self.display.act(&format!(
            "mousemove {x} {y} sleep 0.3 mousedown 1 sleep 0.2 mousemove {} {} sleep 0.2 mousemove {to_x} {to_y} sleep \
             0.3 mouseup 1 sleep 0.3",
            half.0, half.1
        ));
    }

    fn key(&self, keys: &str) {
        self.display.act(&format!("key {keys} sleep 0.4"));
    }

    fn type_text(&self, text: &str) {
        self.display.act(&format!("key ctrl+a sleep 0.2 type --delay 40 {text}"));
    }

    /// The stage, once it is as it should be.
    fn stage(&self, what: &str, mut is_so: impl FnMut(&RgbImage) -> bool) -> RgbImage {
        let picture = self.workshop.path("screen.png");
        let (x, y) = self.corner;
        let cut = |seen: &RgbImage, [left, top, right, bottom]: [u32; 4]| {
            image::imageops::crop_imm(seen, x + left, y + top, right - left, bottom - top).to_image()
        };
        let seen = self.display.until(&picture, what, |seen| is_so(&cut(seen, STAGE)));
        cut(&seen, STAGE)
    }

    /// Keeps the picture of the window for the docs, if that is asked for.
    fn keep(&self, name: &str) {
        if std::env::var_os("SMALTI_KEEP_SCREENSHOTS").is_none() {
            return;
        }
        let picture = self.workshop.path("kept.png");
        crate::display::photograph(self.display.name(), &picture);
        let seen = image::open(&picture).expect("import writes a picture").to_rgb8();
        let (x, y) = self.corner;
        let window = image::imageops::crop_imm(&seen, x, y, 1_180, 780).to_image();
        let small = image::imageops::resize(&window, 885, 585, image::imageops::FilterType::Lanczos3);
        let folder = PathBuf::from("docs/window");
        std::fs::create_dir_all(&folder).expect("the folder can be made");
        let file = std::fs::File::create(folder.join(name)).expect("it can be written");
        let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(file, 86);
        small.write_with_encoder(encoder).expect("it is written");
    }

    /// Closes the window as its button does; the exit code and what was said.
    fn close(&mut self) -> (Option<i32>, String) {
        self.display.act(&format!("windowfocus {} sleep 0.3 key alt+F4", self.window));
        self.end()
    }

    /// The exit code and what was said, once the program has ended.
    fn end(&mut self) -> (Option<i32>, String) {
        let began = Instant::now();
        while self.process.try_wait().expect("it can be asked").is_none() {
            assert!(began.elapsed() < Duration::from_secs(60), "the window does not close");
            std::thread::sleep(Duration::from_millis(50));
        }
        let mut told = String::new();
        let said = self.process.stderr.as_mut().expect("it is piped");
        said.read_to_string(&mut told).expect("messages are UTF-8");
        (self.process.wait().expect("it ended").code(), told)
    }
}

/// Colours that are told apart, of every fourth pixel.
fn colors(stage: &RgbImage) -> usize {
    let pixels = stage.pixels().step_by(4).map(|pixel| pixel.0.map(|channel| channel >> 4));
    pixels.collect::<std::collections::BTreeSet<_>>().len()
}

/// Share of the pixels that differ clearly.
fn difference(one: &RgbImage, other: &RgbImage) -> f64 {
    let differ = one.pixels().zip(other.pixels()).filter(|(one, other)| {
        one.0.iter().zip(other.0).map(|(&one, other)| u32::from(one.abs_diff(other))).sum::<u32>() > 60
    });
    differ.count() as f64 / f64::from(one.width() * one.height())
}

#[test]
fn a_picture_is_opened_steered_looked_at_painted_on_saved_and_made_again() {
    let mut viewer = Viewer::open("woman.jpg", "--device cpu");
    let first = viewer.stage("a mosaic", |stage| colors(stage) > 60);
    viewer.keep("mosaic.jpg");

    // Fewer tiles: the picture begins anew.
    viewer.click(TILES);
    viewer.type_text("300");
    viewer.key("Return");
    let few = viewer.stage("fewer tiles", |stage| difference(stage, &first) > 0.1);
    viewer.click(PAINT);
    let painted = viewer.stage("strokes", |stage| difference(stage, &few) > 0.1);

    let (x, y) = viewer.at(MIDDLE);
    viewer.display.act(&format!("mousemove {x} {y} sleep 0.2 click 4 sleep 0.2 click 4 sleep 0.2 click 4 sleep 0.5"));
    let near = viewer.stage("the mosaic from nearer", |stage| difference(stage, &painted) > 0.1);
    viewer.keep("tile.jpg");
    viewer.key("f");
    viewer.key("d");
    let divided = viewer.stage("the photo beside the mosaic", |stage| difference(stage, &near) > 0.1);
    viewer.keep("divider.jpg");
    viewer.drag(MIDDLE, (MIDDLE.0 + 160, MIDDLE.1));
    viewer.stage("more of the photo", |stage| difference(stage, &divided) > 0.01);
    viewer.key("e");
    viewer.stage("where both differ", |stage| difference(stage, &divided) > 0.2);
    viewer.keep("error.jpg");
    viewer.key("t");

    viewer.key("b");
    viewer.drag((MIDDLE.0 - 80, MIDDLE.1 - 40), (MIDDLE.0 + 80, MIDDLE.1 + 40));
    let is_tint = |pixel: &image::Rgb<u8>| pixel.0[0] > 150 && pixel.0[1] > 90 && pixel.0[2] < 110;
    viewer.stage("what was painted", |stage| stage.pixels().filter(|pixel| is_tint(pixel)).count() > 2_000);
    viewer.keep("weights.jpg");
    viewer.key("b");

    let saved = viewer.workshop.path("saved.png");
    viewer.key("ctrl+s");
    viewer.click(SAVE_PATH);
    viewer.type_text(&saved.display().to_string());
    viewer.click(SAVE_FILE);
    let steps = viewer.workshop.path("saved.png.steps.json");
    let began = Instant::now();
    while !(saved.exists() && steps.exists()) {
        assert!(began.elapsed() < Duration::from_secs(120), "nothing was saved");
        std::thread::sleep(Duration::from_millis(100));
    }
    let again = viewer.workshop.run("evolve woman.jpg --replay saved.png.steps.json -o again.png");
    assert_eq!(again.code, Some(0), "{}", again.stderr);
    assert!(viewer.workshop.read("again.png") == viewer.workshop.read("saved.png"), "the command makes the same bytes");
    let script: serde_json::Value = serde_json::from_slice(&std::fs::read(&steps).expect("it is there")).expect("JSON");
    let kept = script["steps"].as_array().expect("it has steps").last().expect("one at least")["recipe"].clone();
    assert_eq!((&kept["style"], &kept["tiles"]), (&"paint".into(), &300.into()), "what was asked for in the end");
    assert!(kept["weight"].is_string(), "what was painted is carried along");

    let (code, told) = viewer.close();
    assert_eq!((code, told.as_str()), (Some(0), ""), "validation is silent, and nothing failed");
    let remembered: serde_json::Value =
        serde_json::from_slice(&viewer.workshop.read("configuration/smalti/window.json")).expect("it is JSON");
    assert_eq!(remembered["size"], serde_json::json!([1_180.0, 780.0]), "the window opens so again");
}

#[test]
fn a_pasted_picture_is_evolved_and_its_tiles_are_saved_if_the_display_goes() {
    let mut viewer = Viewer::open("woman.jpg", "--device cpu");
    // A key that is pressed before the window listens is lost.
    viewer.stage("a mosaic", |stage| colors(stage) > 60);
    viewer.display.copy_png(Path::new("tests/photos/parrots.png"));
    viewer.key("ctrl+v");
    let process = &mut viewer.process;
    viewer.display.window("pasted picture - smalti", || process.try_wait().expect("it can be asked").is_none());
    viewer.key("p");
    let photo = viewer.stage("the photo", |stage| colors(stage) > 60);
    viewer.key("t");
    viewer.stage("its mosaic", |stage| difference(stage, &photo) > 0.02);
    viewer.display.lose();
    let (code, told) = viewer.end();
    assert_eq!(code, Some(4), "{told}");
    assert_eq!(told, "smalti: the display of the window is gone; the tiles were saved as mosaic-rescued.npz\n");
    let drawn = viewer.workshop.run("render mosaic-rescued.npz -o drawn.png");
    assert_eq!(drawn.code, Some(0), "{}", drawn.stderr);
}

#[test]
fn without_a_display_there_is_one_sentence_and_exit_code_4() {
    let workshop = Workshop::new();
    let mut command = workshop.command("view photo.png");
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(name);
    }
    let output = command.output().expect("the program starts");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), told.trim_end().lines().count()), (Some(4), 1), "{told}");
    assert!(told.contains("there is no display for a window"), "{told}");
}
