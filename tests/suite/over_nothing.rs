//! What mosaics over nothing are: every style, shader and blend over every kind of transparency, and animations of them.

use std::io::Cursor;

use image::{AnimationDecoder, Frame, Rgba, RgbaImage};
use smalti::cpu::CpuPainter;
use smalti::evolve::style::Style;
use smalti::model::{Canvas, Mosaic as Drawn, Painter};
use smalti::{Blend, Device, Error, Mosaic, Picture, Recipe, Shader, archive};

use crate::workshop::Workshop;

const WIDTH: u32 = 26;
const HEIGHT: u32 = 21;

/// How transparent a picture is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Opaque,
    CutOut,
    SoftEdge,
    AllClear,
}

/// A disc of colours, in front of what the kind says.
fn pixels(kind: Kind) -> Vec<[u8; 4]> {
    let place = |index: u32| (index % WIDTH, index / WIDTH);
    (0..WIDTH * HEIGHT)
        .map(|index| {
            let (x, y) = place(index);
            let beyond = (f64::from(x) - 12.0).hypot(f64::from(y) - 10.0) - 8.0;
            let alpha = match kind {
                Kind::Opaque => 255.0,
                Kind::CutOut if beyond > 0.0 => 0.0,
                Kind::CutOut => 255.0,
                Kind::SoftEdge => (255.0 - 60.0 * beyond.max(0.0)).max(0.0),
                Kind::AllClear => 9.0,
            };
            [(x * 9) as u8, 255 - (y * 11) as u8, (x * y % 256) as u8, alpha as u8]
        })
        .collect()
}

fn picture(kind: Kind) -> Picture {
    Picture::from_rgba8(WIDTH, HEIGHT, pixels(kind).as_flattened()).expect("the size is right")
}

fn make(recipe: &Recipe, kind: Kind, device: &Device) -> Result<Mosaic, Error> {
    recipe.make(&picture(kind), device, |_| true)
}

/// How far a mosaic over black is from the colours that a picture keeps.
fn sae_over_black(mosaic: &Mosaic, kind: Kind) -> u64 {
    let shown = mosaic.image().expect("it has pixels").rgba8();
    let pairs = shown.as_chunks::<4>().0.iter().zip(pixels(kind));
    let error = |(&[r, g, b, a], wanted): (&[u8; 4], [u8; 4])| {
        let over_black = [r, g, b].map(|channel| ((u32::from(channel) * u32::from(a) + 127) / 255) as u8);
        over_black.iter().zip(wanted).map(|(&shown, wanted)| u64::from(shown.abs_diff(wanted))).sum::<u64>()
    };
    pairs.filter(|(_, wanted)| wanted[3] >= 128).map(error).sum()
}

/// All styles with all shaders and blends, by name.
fn looks() -> Vec<(String, Recipe)> {
    let mut looks = Vec::new();
    for style in Style::NAMES {
        for shader in Shader::ALL {
            for blend in [Blend::Opaque, Blend::Translucent] {
                let recipe = Recipe::named(style).expect("it is a style");
                let recipe = recipe.shader(shader).blend(blend).tiles(14).evals(600).seed(3);
                looks.push((format!("{style}, {shader:?}, {blend:?}"), recipe));
            }
        }
    }
    looks
}

#[test]
fn every_look_of_every_kind_of_transparency_is_what_was_scored_over_black() {
    let (mut made, mut translucent) = (0, 0);
    for (name, recipe) in looks() {
        for kind in [Kind::Opaque, Kind::CutOut, Kind::SoftEdge, Kind::AllClear] {
            match make(&recipe, kind, &Device::cpu()) {
                Ok(mosaic) => {
                    assert_ne!(kind, Kind::AllClear, "{name}: nothing is left of the picture");
                    assert_eq!(mosaic.is_transparent(), kind != Kind::Opaque, "{name}, {kind:?}");
                    assert_eq!(sae_over_black(&mosaic, kind), mosaic.sae(), "{name}, {kind:?}");
                    let alphas = mosaic.image().expect("it has pixels").rgba8();
                    translucent += alphas.iter().skip(3).step_by(4).filter(|&&alpha| !matches!(alpha, 0 | 255)).count();
                    made += 1;
                }
                Err(Error::Parameter { name: refused, .. }) if kind == Kind::AllClear && refused == "picture" => {}
                Err(error) => panic!("{name}, {kind:?}: {error}"),
            }
        }
    }
    assert_eq!(made, looks().len() * 3);
    assert!(translucent > 1_000, "only {translucent} pixels are translucent");
}

#[test]
fn mosaics_over_nothing_have_the_same_bytes_on_vulkan() {
    let device = Device::named("name:llvmpipe").expect("the tests need lavapipe");
    for (name, recipe) in looks() {
        let [cpu, vulkan] =
            [&Device::cpu(), &device].map(|device| make(&recipe, Kind::CutOut, device).expect("it can be made"));
        assert!(cpu.png().expect("it has pixels") == vulkan.png().expect("it has pixels"), "{name}");
        assert_eq!((cpu.sae(), cpu.objective()), (vulkan.sae(), vulkan.objective()), "{name}");
    }
}

/// A workshop with a picture of this kind, and the snapshots of its evolution in the folder `run`.
fn with_run(kind: Kind, style: &str) -> (Workshop, Vec<Drawn>) {
    let workshop = Workshop::new();
    let mut picture = RgbaImage::new(WIDTH, HEIGHT);
    picture.pixels_mut().zip(pixels(kind)).for_each(|(pixel, color)| *pixel = Rgba(color));
    picture.save(workshop.path("cut.png")).expect("it can be written");
    let line = format!("evolve cut.png -o a.png --style {style} -n 14 --evals 900 --save-run run --save-every 60");
    let ran = workshop.run(&line);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    let names = std::fs::read_dir(workshop.path("run")).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = names.filter(|path| path.extension().is_some_and(|ending| ending == "npz")).collect();
    paths.sort();
    let drawn = paths.iter().map(|path| {
        let population = archive::read(path).unwrap().population;
        CpuPainter.draw(&population, &Canvas::evaluation(WIDTH, HEIGHT), 1).unwrap()
    });
    (workshop, drawn.collect())
}

fn frames<'a>(decoder: impl AnimationDecoder<'a>) -> Vec<Frame> {
    decoder.into_frames().collect_frames().unwrap()
}

fn check_frames(frames: &[Frame], drawn: &[Drawn], expected: impl Fn([u8; 3], u8) -> Option<[u8; 4]>, name: &str) {
    assert_eq!(frames.len(), drawn.len(), "{name}");
    let mut clearer = 0;
    for (number, (frame, drawn)) in frames.iter().zip(drawn).enumerate() {
        let alpha = drawn.alpha.as_ref().expect("nothing lies behind it");
        for (place, found) in frame.buffer().pixels().enumerate() {
            let color = (drawn.pixels[place], alpha[place]);
            match expected(color.0, color.1) {
                Some(pixel) => assert_eq!(found.0, pixel, "{name}, frame {number}, pixel {place}"),
                None => assert_eq!(found[3], 255, "{name}, frame {number}, pixel {place}"),
            }
            let before = number.checked_sub(1).map(|before| frames[before].buffer().as_raw()[4 * place + 3]);
            clearer += u32::from(before.is_some_and(|before| found[3] < before));
        }
    }
    assert!(clearer > 0, "{name}: no pixel became clearer again, so that was not tried");
}

#[test]
fn animations_of_a_cut_out_are_transparent_where_its_mosaic_is() {
    for style in ["free", "spray"] {
        let (workshop, drawn) = with_run(Kind::CutOut, style);
        let ran = workshop.run("timelapse run -o a.apng -o a.gif --spacing snapshots");
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        let apng = image::codecs::png::PngDecoder::new(Cursor::new(workshop.read("a.apng"))).unwrap();
        let exactly = |[r, g, b]: [u8; 3], a: u8| Some([r, g, b, a]);
        check_frames(&frames(apng.apng().unwrap()), &drawn, exactly, &format!("{style} as APNG"));
        let gif = image::codecs::gif::GifDecoder::new(Cursor::new(workshop.read("a.gif"))).unwrap();
        let all_or_nothing = |_, a: u8| (a < 128).then_some([0; 4]);
        check_frames(&frames(gif), &drawn, all_or_nothing, &format!("{style} as GIF"));
        let ran = workshop.run("timelapse run -o b.apng --background white");
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        let apng = image::codecs::png::PngDecoder::new(Cursor::new(workshop.read("b.apng"))).unwrap();
        for frame in frames(apng.apng().unwrap()) {
            assert!(frame.buffer().pixels().all(|pixel| pixel[3] == 255), "{style} over white");
        }
    }
}

#[test]
fn a_video_of_a_cut_out_is_over_black_and_says_so() {
    let (workshop, _) = with_run(Kind::CutOut, "free");
    let ran = workshop.run("timelapse run -o a.mp4 -o a.gif");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(ran.stderr.contains("a.mp4 cannot be transparent, so the mosaic is shown over black"), "{}", ran.stderr);
    assert!(!ran.stderr.contains("a.gif cannot"), "{}", ran.stderr);
}

#[test]
fn a_background_of_none_leaves_clear_what_no_tile_covers_and_changes_no_tile() {
    let workshop = Workshop::new();
    for scheme in ["-n 40 --evals 900", "--style spray -n 40 --evals 900", "--scheme paper -n 20 --births 200"] {
        let outputs = |name: &str| format!("-o {name}.png -o {name}.svg -o {name}.npz --json -q --force {scheme}");
        let row = |name: &str, background: &str| {
            let ran = workshop.run(&format!("evolve photo.png {} --background {background}", outputs(name)));
            assert_eq!(ran.code, Some(0), "{scheme}: {}", ran.stderr);
            serde_json::from_slice::<serde_json::Value>(&ran.stdout).expect("a row is JSON")
        };
        let (black, none) = (row("black", "black"), row("none", "none"));
        assert_eq!((&black["sae"], &black["evals"]), (&none["sae"], &none["evals"]), "{scheme}");
        assert_ne!(black["key"], none["key"], "{scheme}: other bytes have another key");
        let [black, none] =
            ["black.png", "none.png"].map(|name| image::open(workshop.path(name)).unwrap().into_rgba8());
        let mut clear = 0;
        for (over, alone) in black.pixels().zip(none.pixels()) {
            let [r, g, b, a] = alone.0;
            let over_black = [r, g, b].map(|channel| ((u32::from(channel) * u32::from(a) + 127) / 255) as u8);
            assert_eq!([over[0], over[1], over[2], over[3]], [over_black[0], over_black[1], over_black[2], 255]);
            clear += u32::from(a < 255);
        }
        assert!(clear > 0, "{scheme}: every pixel is covered whole, so nothing was tried");
        let flies = ["black.npz", "none.npz"].map(|name| archive::read(&workshop.path(name)).unwrap().population.flies);
        assert_eq!(flies[0], flies[1], "{scheme}");
        let [black, none] = ["black.svg", "none.svg"].map(|name| String::from_utf8(workshop.read(name)).unwrap());
        assert!(black.lines().count() > none.lines().count(), "{scheme}: the SVG has a background");
        let ran = workshop.run("render black.npz -o drawn.png --background none --force");
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        assert!(workshop.read("drawn.png").len() > 100);
        let drawn = image::open(workshop.path("drawn.png")).unwrap().into_rgba8();
        let clear_drawn = drawn.pixels().filter(|pixel| pixel[3] < 255).count();
        assert_eq!(clear_drawn as u32, clear, "{scheme}: drawn again");
    }
    let ran = workshop.run("evolve photo.png -o x.png --background nothing");
    assert!(ran.code == Some(2) && ran.stderr.contains("expected none, or a colour such as red"), "{}", ran.stderr);
}
