//! `smalti timelapse`: the frames of its animations, and what it refuses.

use std::io::Cursor;

use image::codecs::gif::GifDecoder;
use image::codecs::png::PngDecoder;
use image::{AnimationDecoder, Frame, RgbImage};
use smalti::archive;
use smalti::cpu::CpuPainter;
use smalti::model::{Canvas, Painter};

use crate::cli_interrupts::send;
use crate::workshop::{Ran, Workshop};

/// A workshop with the snapshots of a small evolution in `run`; returns their paths, too.
fn with_run() -> (Workshop, Vec<String>) {
    let workshop = Workshop::new();
    workshop.evolve("-o a.png --save-run run --save-every 60");
    let names = std::fs::read_dir(workshop.path("run")).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = names.map(|name| format!("run/{}", name.into_string().unwrap())).collect();
    names.sort();
    (workshop, names)
}

fn timelapse(workshop: &Workshop, rest: &str) -> Ran {
    let ran = workshop.run(&format!("timelapse run {rest}"));
    assert_eq!(ran.code, Some(0), "{rest}: {}", ran.stderr);
    ran
}

/// A snapshot as it should be drawn.
fn drawing(workshop: &Workshop, name: &str, canvas: Canvas, supersampling: u32) -> RgbImage {
    let population = archive::read(&workshop.path(name)).unwrap().population;
    let mosaic = CpuPainter.draw(&population, &canvas, supersampling).unwrap();
    RgbImage::from_raw(mosaic.width_px, mosaic.height_px, mosaic.pixels.concat()).unwrap()
}

fn apng_frames(bytes: Vec<u8>) -> Vec<Frame> {
    PngDecoder::new(Cursor::new(bytes)).unwrap().apng().unwrap().into_frames().collect_frames().unwrap()
}

fn gif_frames(bytes: Vec<u8>) -> Vec<Frame> {
    GifDecoder::new(Cursor::new(bytes)).unwrap().into_frames().collect_frames().unwrap()
}

fn rgb(frame: &Frame) -> RgbImage {
    assert!(frame.buffer().pixels().all(|pixel| pixel[3] == 255), "nothing shows through");
    image::DynamicImage::ImageRgba8(frame.buffer().clone()).to_rgb8()
}

fn delays_ms(frames: &[Frame]) -> Vec<u32> {
    frames
        .iter()
        .map(|frame| {
            let (numerator, denominator) = frame.delay().numer_denom_ms();
            numerator / denominator
        })
        .collect()
}

#[test]
fn the_frames_of_an_apng_are_the_drawings_of_the_snapshots() {
    let (workshop, names) = with_run();
    timelapse(&workshop, "-o a.apng --spacing snapshots --fps 25");
    timelapse(&workshop, "-o b.png --spacing snapshots --output-size 61 --hold 2.5");
    for (file, canvas, supersampling, delay_ms, last_ms) in
        [("a.apng", Canvas::evaluation(40, 30), 1, 40, 1500), ("b.png", Canvas::scaled(40, 30, 61), 4, 50, 2500)]
    {
        let frames = apng_frames(workshop.read(file));
        assert_eq!(frames.len(), names.len(), "{file}");
        for (frame, name) in frames.iter().zip(&names) {
            assert!(rgb(frame) == drawing(&workshop, name, canvas, supersampling), "{file}: {name}");
        }
        let delays = delays_ms(&frames);
        let (last, others) = delays.split_last().unwrap();
        assert!(*last == last_ms && others.iter().all(|&delay| delay == delay_ms), "{file}: {delays:?}");
    }
}

#[test]
fn a_gif_has_the_same_frames_in_few_colours_at_the_right_times() {
    let (workshop, names) = with_run();
    timelapse(&workshop, "-o a.gif --spacing snapshots --fps 30 --hold 1");
    let frames = gif_frames(workshop.read("a.gif"));
    assert_eq!(frames.len(), names.len());
    for (frame, name) in frames.iter().zip(&names) {
        let (shown, drawn) = (rgb(frame), drawing(&workshop, name, Canvas::evaluation(40, 30), 1));
        let errors = shown.iter().zip(drawn.iter()).map(|(&a, &b)| u32::from(a.abs_diff(b)));
        // 60 tiles need no more than the 255 colours of a frame.
        assert_eq!(errors.sum::<u32>(), 0, "{name}");
    }
    let delays = delays_ms(&frames);
    let (last, others) = delays.split_last().unwrap();
    assert!(*last == 1000 && others.iter().all(|delay| [30, 40].contains(delay)), "{delays:?}");
    assert!(others.iter().sum::<u32>().abs_diff(others.len() as u32 * 1000 / 30) <= 10, "{delays:?}");
}

#[test]
fn a_gif_of_many_colours_comes_near_to_all_of_them() {
    let workshop = Workshop::new();
    workshop.run("evolve photo.png --scheme paper -n 2000 --births 400 -o m.png --save-run run --save-every 200");
    timelapse(&workshop, "-o a.gif -o a.png --output-size 200");
    let (gif, png) = (gif_frames(workshop.read("a.gif")), apng_frames(workshop.read("a.png")));
    assert_eq!(gif.len(), png.len());
    for (shown, drawn) in gif.iter().zip(&png) {
        let errors = rgb(shown).iter().zip(rgb(drawn).iter()).map(|(&a, &b)| u64::from(a.abs_diff(b))).sum::<u64>();
        assert!(errors < 8 * 200 * 150 * 3, "a mean of {}", errors as f64 / (200.0 * 150.0 * 3.0));
    }
}

#[test]
fn animations_are_played_as_often_as_asked_for() {
    let (workshop, _) = with_run();
    timelapse(&workshop, "-o once.gif -o once.png --loop 1");
    timelapse(&workshop, "-o thrice.gif -o thrice.png --loop 3");
    timelapse(&workshop, "-o ever.gif -o ever.png");
    for (name, repeat, plays) in
        [("once", gif::Repeat::Finite(0), 1), ("thrice", gif::Repeat::Finite(2), 3), ("ever", gif::Repeat::Infinite, 0)]
    {
        let bytes = workshop.read(&format!("{name}.gif"));
        let mut decoder = gif::Decoder::new(&bytes[..]).unwrap();
        // The repetitions stand ahead of the first frame.
        decoder.next_frame_info().unwrap();
        assert_eq!(decoder.repeat(), repeat, "{name}");
        let bytes = workshop.read(&format!("{name}.png"));
        let reader = png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_plays, plays, "{name}");
    }
}

#[test]
fn neither_threads_nor_device_change_an_animation() {
    let (workshop, _) = with_run();
    for (name, rest) in [("one", "--threads 1"), ("two", "--threads 2"), ("gpu", "--device name:llvmpipe")] {
        timelapse(&workshop, &format!("-o {name}.png -o {name}.gif --output-size 70 {rest}"));
    }
    for ending in ["png", "gif"] {
        let one = workshop.read(&format!("one.{ending}"));
        assert!(one == workshop.read(&format!("two.{ending}")) && one == workshop.read(&format!("gpu.{ending}")));
    }
}

#[test]
fn fewer_frames_keep_the_first_and_the_last_snapshot() {
    let (workshop, names) = with_run();
    for (rest, count) in [("--frames 1", 1), ("--frames 2", 2), ("--frames 5 --spacing births", 5)] {
        let file = format!("{count}.png");
        timelapse(&workshop, &format!("-o {file} {rest}"));
        let frames = apng_frames(workshop.read(&file));
        assert_eq!(frames.len(), count);
        let canvas = Canvas::evaluation(40, 30);
        assert!(rgb(frames.last().unwrap()) == drawing(&workshop, names.last().unwrap(), canvas, 1), "{rest}");
        assert!(count == 1 || rgb(&frames[0]) == drawing(&workshop, &names[0], canvas, 1), "{rest}");
    }
}

#[test]
fn the_background_may_be_another_one() {
    let workshop = Workshop::new();
    workshop.run("evolve photo.png --scheme paper -n 3 --births 50 -o m.png --save-run run");
    timelapse(&workshop, "-o a.png");
    timelapse(&workshop, "-o b.png --background 336699");
    let count = |name: &str, color: [u8; 3]| {
        apng_frames(workshop.read(name))
            .iter()
            .map(rgb)
            .map(|frame| frame.pixels().filter(|p| p.0 == color).count())
            .sum::<usize>()
    };
    assert!(count("a.png", [0; 3]) > 0);
    assert_eq!(count("a.png", [0; 3]), count("b.png", [0x33, 0x66, 0x99]));
}

#[test]
fn an_animation_is_replaced_by_the_same_command_and_by_no_other() {
    let (workshop, _) = with_run();
    for ending in ["gif", "png"] {
        let command = format!("timelapse run -o t.{ending}");
        assert_eq!(workshop.run(&command).code, Some(0));
        let before = workshop.read(&format!("t.{ending}"));
        assert_eq!(workshop.run(&command).code, Some(0));
        let ran = workshop.run(&format!("{command} --fps 10"));
        assert_eq!(ran.code, Some(2));
        assert!(ran.stderr.contains("is not what this command writes"), "{}", ran.stderr);
        assert_eq!(workshop.read(&format!("t.{ending}")), before);
        assert_eq!(workshop.run(&format!("{command} --fps 10 --force")).code, Some(0));
        assert_ne!(workshop.read(&format!("t.{ending}")), before);
    }
    assert_eq!(workshop.run("timelapse run -o a.png").code, Some(2), "a mosaic");
}

#[test]
fn what_cannot_be_shown_is_refused_in_one_sentence() {
    let (workshop, names) = with_run();
    std::fs::create_dir(workshop.path("empty")).unwrap();
    std::fs::create_dir(workshop.path("mixed")).unwrap();
    std::fs::copy(workshop.path(&names[0]), workshop.path("mixed/000000000000.npz")).unwrap();
    workshop.evolve("-o b.png --seed 1 --save-run other");
    std::fs::copy(workshop.path("other/000000000300.npz"), workshop.path("mixed/000000000300.npz")).unwrap();
    std::fs::create_dir(workshop.path("renamed")).unwrap();
    std::fs::copy(workshop.path(&names[0]), workshop.path("renamed/000000000001.npz")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("/dev/null", workshop.path("pipe.gif")).unwrap();
    let before = workshop.files();
    for (line, code, words) in [
        ("nowhere -o t.gif", 2, "nowhere: there is no such folder"),
        ("photo.png -o t.gif", 2, "photo.png: is a file, and a timelapse needs a folder of snapshots"),
        ("empty -o t.gif", 2, "empty: holds no snapshots"),
        ("mixed -o t.gif", 2, "mixed: holds snapshots of more than one evolution"),
        ("renamed -o t.gif", 2, "000000000001.npz: is no snapshot"),
        ("run -o t.avi", 2, "t.avi: an animation must end in .png"),
        ("run -o t.gif -o t.gif", 2, "t.gif is named twice"),
        ("run -o t.gif -o ./t.gif", 2, "./t.gif is named twice"),
        #[cfg(unix)]
        ("run -o pipe.gif", 2, "pipe.gif is a device or a pipe"),
        ("run -o t.gif --fps 60", 2, "--fps 60: a GIF has at most 50"),
        ("run -o t.png --fps 0", 2, "--fps 0: must be 1 to 120"),
        ("run -o t.png --hold=-1", 2, "--hold"),
        ("run -o t.png --hold 601", 2, "--hold 601: must be 0 to 600 seconds"),
        ("run -o t.png --frames 0", 2, "--frames 0: must be 1 to"),
        ("run -o nowhere/t.png", 1, "nowhere/t.png: its folder does not exist"),
    ] {
        let ran = workshop.run(&format!("timelapse {line}"));
        assert_eq!(ran.code, Some(code), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(words) && ran.stderr.lines().count() == 1, "{line}: {}", ran.stderr);
        assert_eq!(workshop.files(), before, "{line}");
    }
}

#[test]
fn quiet_says_nothing_and_progress_in_json_has_one_object_a_line() {
    let (workshop, _) = with_run();
    assert_eq!(timelapse(&workshop, "-o t.gif -q").stderr, "");
    assert!(timelapse(&workshop, "-o t.gif").stderr.starts_with("wrote t.gif: "));
    let ran = timelapse(&workshop, "-o big.png --output-size 1500 --progress json -q");
    for line in ran.stderr.lines() {
        let told: serde_json::Value = serde_json::from_str(line).expect("JSON");
        assert!(told["frames"].as_u64() <= told["frame_count"].as_u64() && told["eta_s"].is_f64(), "{line}");
    }
}

#[cfg(unix)]
mod videos {
    use std::os::unix::fs::PermissionsExt;
    use std::path::Path;

    use super::*;

    /// A program called ffmpeg in a folder of its own, which is all of the path.
    fn with_ffmpeg(workshop: &Workshop, script: &str) -> std::path::PathBuf {
        let folder = workshop.path("bin");
        std::fs::create_dir_all(&folder).unwrap();
        workshop.write("bin/ffmpeg", format!("#!/bin/sh\n{script}\n").as_bytes());
        std::fs::set_permissions(workshop.path("bin/ffmpeg"), std::fs::Permissions::from_mode(0o755)).unwrap();
        folder
    }

    fn run_with_path(workshop: &Workshop, path: &Path, line: &str) -> (Option<i32>, String) {
        let output = workshop.command(line).env("PATH", path).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    }

    #[test]
    fn without_ffmpeg_a_video_is_refused_with_the_package_to_install() {
        let (workshop, _) = with_run();
        std::fs::create_dir(workshop.path("bin")).unwrap();
        let before = workshop.files();
        for ending in ["mp4", "webm"] {
            let line = format!("timelapse run -o t.gif -o t.{ending}");
            let (code, stderr) = run_with_path(&workshop, &workshop.path("bin"), &line);
            assert_eq!(code, Some(1), "{stderr}");
            let sentence = format!(
                "smalti: t.{ending}: needs the program ffmpeg, which is not installed; install the package ffmpeg, or \
                 write .png or .gif\n"
            );
            assert_eq!(stderr, sentence);
            assert_eq!(workshop.files(), before);
        }
    }

    #[test]
    fn ffmpeg_gets_the_drawings_with_even_sides_and_the_last_one_as_often_as_it_is_shown() {
        let (workshop, names) = with_run();
        // What was piped becomes the file, behind the size that ffmpeg is told.
        let script = "for last; do :; done\n/bin/cat > \"${last#file:}\"";
        let path = with_ffmpeg(&workshop, script);
        let line = "timelapse run -o t.mp4 --output-size 39 --spacing snapshots --fps 10 --hold 0.5";
        let (code, stderr) = run_with_path(&workshop, &path, line);
        assert_eq!(code, Some(0), "{stderr}");
        let bytes = workshop.read("t.mp4");
        let frames: Vec<&[u8]> = bytes.chunks(40 * 30 * 3).collect();
        assert_eq!(frames.len(), names.len() + 4);
        for (frame, name) in frames.iter().zip(names.iter().chain([names.last().unwrap(); 4])) {
            let drawn = drawing(&workshop, name, Canvas::scaled(40, 30, 39), 4);
            assert_eq!(drawn.dimensions(), (39, 29));
            let even = RgbImage::from_fn(40, 30, |x, y| *drawn.get_pixel(x.min(38), y.min(28)));
            assert!(*frame == even.as_raw().as_slice(), "{name}");
        }
        assert!(!workshop.files().iter().any(|name| name.ends_with(".partial")), "{:?}", workshop.files());
    }

    #[test]
    fn what_ffmpeg_says_last_is_repeated_and_only_its_file_is_missing() {
        for script in [
            "echo first >&2; echo Unknown encoder libx264 >&2; exit 1",
            "/bin/cat > /dev/null; echo first >&2; echo Unknown encoder libx264 >&2; exit 1",
        ] {
            let (workshop, _) = with_run();
            let path = with_ffmpeg(&workshop, script);
            let before = workshop.files();
            let (code, stderr) =
                run_with_path(&workshop, &path, "timelapse run -o t.mp4 -o t.gif -q --output-size 300");
            assert_eq!(code, Some(1), "{stderr}");
            let sentence =
                "smalti: t.mp4: ffmpeg failed (Unknown encoder libx264); write .png or .gif, which need no ffmpeg\n";
            assert_eq!(stderr, sentence);
            let new: Vec<String> = workshop.files().difference(&before).cloned().collect();
            assert_eq!(new, ["t.gif"]);
        }
    }

    #[test]
    fn an_interrupt_ends_in_order_and_leaves_no_file_and_no_ffmpeg() {
        let (workshop, _) = with_run();
        let path = with_ffmpeg(&workshop, "echo $$ > pid\nexec /bin/cat > /dev/null");
        let before = workshop.files();
        let line = "timelapse run -o t.mp4 -o t.png --output-size 3000 --progress json -q";
        let mut child = workshop.command(line).env("PATH", &path).spawn().unwrap();
        while std::fs::read_to_string(workshop.path("pid")).map_or(true, |pid| !pid.ends_with('\n')) {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        send("INT", &child);
        assert_eq!(child.wait().unwrap().code(), Some(75));
        let ffmpeg = workshop.read("pid");
        let ffmpeg = Path::new("/proc").join(std::str::from_utf8(&ffmpeg).unwrap().trim());
        assert!(!ffmpeg.exists(), "it still runs");
        std::fs::remove_file(workshop.path("pid")).unwrap();
        assert_eq!(workshop.files(), before);
    }
}
