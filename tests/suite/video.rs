//! `smalti video`: sequences whose tiles move instead of flickering, gone on with after any end, shot by shot.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;

use image::{Rgb, RgbImage};
use serde_json::Value;
use smalti::model::cells::leash::holds;
use smalti::model::fly::UNITS_PER_PX;

use crate::cli_interrupts::send;
use crate::cli_refusals::refused;
use crate::workshop::{Ran, Workshop};

const SMALL: &str = "-n 120 --evals 12k -q";

/// A workshop with `frames/`: a bright square moves over a still picture, and from the frame `cut` on over another one.
fn with_frames(count: usize, cut: usize) -> Workshop {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("frames")).unwrap();
    for number in 0..count {
        let pixel = |x: u32, y: u32| {
            let at = 4 + 4 * number as u32;
            if (at..at + 8).contains(&x) && (20..28).contains(&y) {
                return Rgb([250, 240, 60]);
            }
            let (red, blue) = ((x * 3) as u8, ((x * y) % 97) as u8);
            if number < cut { Rgb([red, (y * 4) as u8, blue]) } else { Rgb([255 - red, 90, 200 - blue]) }
        };
        // Natural order, not that of the alphabet.
        RgbImage::from_fn(72, 56, pixel).save(workshop.path(&format!("frames/f{}.png", number + 5))).unwrap();
    }
    workshop
}

fn video(workshop: &Workshop, rest: &str) -> Ran {
    let ran = workshop.run(&format!("video frames {SMALL} {rest}"));
    assert_eq!(ran.code, Some(0), "{rest}: {}", ran.stderr);
    ran
}

fn rows(ran: &Ran) -> Vec<Value> {
    ran.stdout.lines().map(|line| serde_json::from_str(&line.unwrap()).unwrap()).collect()
}

/// All files below a folder, by their names.
fn files(workshop: &Workshop, folder: &str) -> BTreeMap<String, Vec<u8>> {
    fn add(folder: &Path, root: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                add(&path, root, files);
            } else {
                let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
                files.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    let mut found = BTreeMap::new();
    add(&workshop.path(folder), &workshop.path(folder), &mut found);
    found
}

#[test]
fn a_still_background_is_still_and_as_good_as_in_frames_by_themselves() {
    let workshop = with_frames(10, 99);
    video(&workshop, "-o warm");
    video(&workshop, "-o alone --warm-start off");
    let scored = workshop.run("score --flicker frames alone warm --json");
    assert_eq!(scored.code, Some(0), "{}", scored.stderr);
    let scores: Value = serde_json::from_slice(&scored.stdout).unwrap();
    let figure = |row: usize, word: &str| scores[row][word].as_f64().unwrap();
    assert!(5.0 * figure(1, "FLICKER") <= figure(0, "FLICKER"), "{scores}");
    assert!(figure(1, "CHANGE") < figure(0, "CHANGE"), "{scores}");
    assert!(figure(1, "SAE") <= 1.03 * figure(0, "SAE"), "{scores}");
}

#[test]
fn a_frame_that_begins_anew_is_the_one_that_evolve_makes() {
    let workshop = with_frames(2, 99);
    video(&workshop, "-o out");
    let line = "evolve frames/f5.png -n 120 --evals 12k -q -o one.png -o one.npz";
    assert_eq!(workshop.run(line).code, Some(0));
    assert!(workshop.read("one.png") == workshop.read("out/000000.png"));
    assert!(workshop.read("one.npz") == workshop.read("out/populations/000000.npz"));
}

#[test]
fn after_any_end_and_any_damage_the_same_command_makes_the_same_files() {
    let workshop = with_frames(6, 4);
    video(&workshop, "-o whole");
    let whole = files(&workshop, "whole");
    assert_eq!(whole.len(), 12);
    let line = format!("video frames {SMALL} -o cut --json");
    for (signal, code) in [("KILL", None), ("INT", Some(75)), ("USR1", Some(75))] {
        let mut child = workshop.command(&line).spawn().unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        stdout.read_line(&mut String::new()).unwrap();
        send(signal, &child);
        std::io::copy(&mut stdout, &mut std::io::sink()).unwrap();
        let ended = child.wait().unwrap().code();
        // It may have been done already.
        assert!(ended == code || ended == Some(0), "{signal}: {ended:?}");
    }
    let damage = |name: &str| {
        if let Ok(bytes) = std::fs::read(workshop.path(name)) {
            workshop.write(name, &bytes[..bytes.len() / 2]);
        }
    };
    video(&workshop, "-o cut");
    damage("cut/populations/000002.npz");
    damage("cut/000003.png");
    std::fs::remove_file(workshop.path("cut/000001.png")).unwrap();
    std::fs::remove_file(workshop.path("cut/populations/000005.npz")).unwrap();
    let rows = rows(&video(&workshop, "-o cut --json"));
    let kept: Vec<&Value> = rows.iter().filter(|row| row["is_kept"] == true).map(|row| &row["frame"]).collect();
    assert_eq!(kept, [0, 4], "{rows:?}");
    let mut cut = files(&workshop, "cut");
    // What a killed process was writing.
    cut.retain(|name, _| !name.contains(".smalti-"));
    assert!(cut == whole, "{:?} {:?}", cut.keys(), whole.keys());
}

#[test]
fn a_shot_alone_is_what_it_is_in_the_whole_on_any_device_with_any_threads() {
    let workshop = with_frames(6, 3);
    let shots = workshop.run("video frames --shots --json");
    let shots = rows(&shots);
    let spans: Vec<&str> = shots.iter().map(|shot| shot["frames"].as_str().unwrap()).collect();
    assert_eq!((spans, &shots[1]["begin"]), (vec!["0..3", "3..6"], &Value::from("cut")));
    video(&workshop, "-o whole --threads 1");
    video(&workshop, "-o second --frames 3..6 --threads 2");
    video(&workshop, "-o device --frames 3..6 --device vulkan");
    let mut expected = files(&workshop, "whole");
    expected.retain(|name, _| name.trim_start_matches("populations/") >= "000003");
    assert!(files(&workshop, "second") == expected);
    assert!(files(&workshop, "device") == expected);
    let keyed = workshop.run("video frames --shots --json --scene-cut off --keyframe-every 4");
    let spans: Vec<Value> = rows(&keyed).iter().map(|shot| shot["frames"].clone()).collect();
    assert_eq!(spans, ["0..4", "4..6"]);
}

#[test]
fn what_decides_a_frame_is_in_the_keys_of_all_frames_that_go_on_from_it() {
    let workshop = with_frames(4, 2);
    let keys = |rest: &str| -> Vec<String> {
        let rows = rows(&video(&workshop, &format!("{rest} --force --json -o out")));
        rows[..4].iter().map(|row| row["key"].as_str().unwrap().to_owned()).collect()
    };
    let before = keys("");
    let same = |other: &[String]| before.iter().zip(other).map(|(a, b)| a == b).collect::<Vec<bool>>();
    assert_eq!(same(&keys("--warm-evals 5k")), [true, false, true, false]);
    assert_eq!(same(&keys("--noise 2")), [true, false, true, false]);
    assert_eq!(same(&keys("--max-tile-move 4")), [true, false, true, false]);
    assert_eq!(same(&keys("--warm-start off")), [true, false, true, false]);
    workshop.paint("frames/f5.png", 72, 56);
    assert_eq!(same(&keys("")), [false, false, true, true]);
}

/// How many tiles went farther than 1 px in all frames that go on from another, and how many tiles were born in them.
fn strays_and_births(workshop: &Workshop, folder: &str, frames: usize) -> (usize, u64) {
    let read = |frame: usize| {
        let path = workshop.path(&format!("{folder}/populations/{frame:06}.npz"));
        smalti::archive::read(&path).expect("a population")
    };
    let all: Vec<_> = (0..frames).map(read).collect();
    let strays = all.windows(2).map(|pair| {
        let flies = pair[0].population.flies.iter().zip(&pair[1].population.flies);
        flies.filter(|(old, new)| old.alive && new.alive && !holds(UNITS_PER_PX, old, new)).count()
    });
    let births = all[1..].iter().map(|frame| frame.meta["births"].as_u64().expect("a number of births"));
    (strays.sum(), births.sum())
}

#[test]
fn no_tile_that_lives_on_moves_farther_than_it_may() {
    let workshop = with_frames(5, 99);
    // Few births, so that most tiles that moved lived on.
    video(&workshop, "-o free");
    video(&workshop, "-o tied --max-tile-move 1");
    let (strays, births) = strays_and_births(&workshop, "tied", 5);
    assert!(strays as u64 <= births, "{strays} strays, {births} births");
    let (free_strays, free_births) = strays_and_births(&workshop, "free", 5);
    assert!(free_strays as u64 > free_births && free_strays > 2 * strays, "{free_strays} strays, {free_births} births");
}

#[test]
fn animations_show_the_frames_and_need_no_folder() {
    let workshop = with_frames(3, 99);
    video(&workshop, "-o out -o out.png --fps 10");
    video(&workshop, "-o alone.apng -o alone.gif --fps 10");
    assert!(workshop.read("alone.apng") == workshop.read("out.png"));
    assert_eq!(files(&workshop, "alone.apng.populations").len(), 3);
    let decoder = image::codecs::png::PngDecoder::new(std::io::Cursor::new(workshop.read("out.png"))).unwrap();
    let frames = image::AnimationDecoder::into_frames(decoder.apng().unwrap()).collect_frames().unwrap();
    for (number, frame) in frames.iter().enumerate() {
        let shown = image::DynamicImage::ImageRgba8(frame.buffer().clone()).to_rgb8();
        assert!(shown == workshop.pixels(&format!("out/{number:06}.png")), "frame {number}");
    }
    assert_eq!(frames.len(), 3);
}

/// Makes a video of `frames/`.
fn encode(workshop: &Workshop, name: &str) {
    let made = std::process::Command::new("ffmpeg")
        .args(["-loglevel", "error", "-framerate", "8", "-start_number", "5", "-i", "frames/f%d.png"])
        .args(["-c:v", "libx264", "-crf", "1", "-pix_fmt", "yuv444p", name])
        .current_dir(workshop.path("."))
        .status();
    assert!(made.expect("the tests need ffmpeg; tools/test installs it").success());
}

fn succeeds(workshop: &Workshop, line: &str) {
    let ran = workshop.run(line);
    assert_eq!(ran.code, Some(0), "{line}: {}", ran.stderr);
}

#[test]
fn damaged_frames_of_a_video_are_taken_from_it_again() {
    let workshop = with_frames(3, 99);
    encode(&workshop, "clip.mp4");
    let line = format!("video clip.mp4 {SMALL} -o out");
    succeeds(&workshop, &line);
    let whole = files(&workshop, "out");
    assert_eq!(whole.len(), 3 + 3 + 3 + 1);
    let [cut, changed, gone] = [1, 2, 3].map(|number| format!("out/populations/input/0000000{number}.png"));
    let bytes = workshop.read(&cut);
    workshop.write(&cut, &bytes[..bytes.len() / 2]);
    let mut bytes = workshop.read(&changed);
    bytes[60] ^= 1;
    workshop.write(&changed, &bytes);
    std::fs::remove_file(workshop.path(&gone)).unwrap();
    succeeds(&workshop, &line);
    assert!(files(&workshop, "out") == whole, "{:?}", files(&workshop, "out").keys());
}

#[test]
fn frames_of_another_video_make_room_and_pictures_of_the_user_do_not() {
    let workshop = with_frames(4, 99);
    encode(&workshop, "long.mp4");
    std::fs::remove_file(workshop.path("frames/f8.png")).unwrap();
    encode(&workshop, "short.mp4");
    let kept = "out/populations/input";
    let line = |clip: &str| format!("video {clip}.mp4 {SMALL} --force -o out");
    std::fs::create_dir_all(workshop.path(kept)).unwrap();
    workshop.paint(&format!("{kept}/mine.png"), 8, 8);
    let before = files(&workshop, "out");
    refused(&workshop, &line("long"), 2, "mine.png is where frames of the video go, and smalti did not put it there");
    assert!(files(&workshop, "out") == before);
    std::fs::remove_file(workshop.path(&format!("{kept}/mine.png"))).unwrap();
    succeeds(&workshop, &line("long"));
    assert_eq!(files(&workshop, kept).len(), 4 + 1);
    succeeds(&workshop, &line("short"));
    assert_eq!(files(&workshop, kept).len(), 3 + 1);
    workshop.paint(&format!("{kept}/mine.png"), 8, 8);
    let before = files(&workshop, "out");
    refused(&workshop, &line("long"), 2, "mine.png is where frames of the video go");
    assert!(files(&workshop, "out") == before);
}

#[test]
fn shots_of_one_video_may_be_made_at_once_in_one_folder() {
    let workshop = with_frames(6, 3);
    encode(&workshop, "clip.mp4");
    succeeds(&workshop, &format!("video clip.mp4 {SMALL} -o whole"));
    let shots = ["0..3", "3..6"]
        .map(|span| workshop.command(&format!("video clip.mp4 {SMALL} -o shots --frames {span}")).spawn().unwrap());
    for shot in shots {
        let ended = shot.wait_with_output().unwrap();
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    }
    assert!(files(&workshop, "shots") == files(&workshop, "whole"));
}

#[cfg(unix)]
#[test]
fn a_signal_ends_ffmpeg_too_and_what_a_killed_process_left_goes_away() {
    use std::os::unix::fs::PermissionsExt;
    let workshop = with_frames(2, 99);
    encode(&workshop, "clip.mp4");
    std::fs::create_dir(workshop.path("bin")).unwrap();
    // It tells its number, and does not end within the test.
    workshop.write("bin/ffmpeg", b"#!/bin/sh\necho $$ > started.new\nmv started.new started\nexec sleep 20\n");
    std::fs::set_permissions(workshop.path("bin/ffmpeg"), std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", workshop.path("bin").display(), std::env::var("PATH").unwrap());
    let line = format!("video clip.mp4 {SMALL} -o out");
    let is_running = |number: &str| {
        let status = std::process::Command::new("sh").args(["-c", &format!("kill -0 {number} 2>&-")]).status();
        status.unwrap().success()
    };
    let left = || std::fs::read_dir(workshop.path("out/populations")).unwrap().count();
    for (signal, code) in [("TERM", Some(75)), ("KILL", None)] {
        let mut child = workshop.command(&line).env("PATH", &path).spawn().unwrap();
        while !workshop.path("started").exists() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let number = String::from_utf8(workshop.read("started")).unwrap().trim().to_owned();
        std::fs::remove_file(workshop.path("started")).unwrap();
        assert!(is_running(&number));
        send(signal, &child);
        assert_eq!(child.wait().unwrap().code(), code, "{signal}");
        assert_eq!((is_running(&number), left()), (code.is_none(), usize::from(code.is_none())), "{signal}");
    }
    succeeds(&workshop, &line);
    assert!(files(&workshop, "out").keys().all(|name| !name.contains(".smalti-")));
}

#[test]
fn a_population_that_smalti_did_not_make_stays() {
    let workshop = with_frames(2, 99);
    let line = format!("video frames {SMALL} -o out");
    succeeds(&workshop, &line);
    let whole = files(&workshop, "out");
    let name = "out/populations/000001.npz";
    let mut zip = workshop.read("out/populations/000000.npz");
    // A zip file whose members have other names.
    for at in 0..zip.len() - 9 {
        if zip[at..].starts_with(b"meta.json") {
            zip[at] = b'b';
        }
    }
    let half = workshop.read("out/populations/000000.npz");
    for foreign in [&zip[..], b"my own", &half[..half.len() / 2]] {
        workshop.write(name, foreign);
        refused(&workshop, &line, 2, "000001.npz exists and was not made by smalti");
        assert!(workshop.read(name) == foreign);
    }
    // What is left of the file itself, as a file system may leave it.
    let ours = &whole["populations/000001.npz"];
    workshop.write(name, &[&ours[..ours.len() / 3], &[0; 99][..]].concat());
    succeeds(&workshop, &line);
    assert!(files(&workshop, "out") == whole);
    workshop.write(name, b"my own");
    succeeds(&workshop, &format!("{line} --force"));
    assert!(files(&workshop, "out") == whole);
}

#[test]
fn a_video_is_taken_apart_by_ffmpeg_and_put_together_again() {
    let workshop = with_frames(4, 99);
    encode(&workshop, "clip.mp4");
    let line = format!("video clip.mp4 {SMALL} -o made.mp4");
    for _ in 0..2 {
        let ran = workshop.run(&line);
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    }
    assert_eq!(files(&workshop, "made.mp4.populations").len(), 4 + 4 + 1);
    let told = std::process::Command::new("ffprobe")
        .args([
            "-v",
            "error",
            "-count_frames",
            "-show_entries",
            "stream=nb_read_frames,r_frame_rate,width",
            "-of",
            "csv=p=0",
        ])
        .arg(workshop.path("made.mp4"))
        .output()
        .unwrap();
    assert_eq!(String::from_utf8_lossy(&told.stdout).trim(), "72,8/1,4");
}

#[test]
fn what_makes_no_sequence_is_refused_with_a_sentence() {
    let workshop = with_frames(3, 99);
    workshop.paint("frames/f9.png", 40, 30);
    for (line, part) in [
        ("video frames -o out", "f9.png: becomes 40x30 px, and the first frame 72x56"),
        ("video frames -o out --frames 2..9", "--frames 2..9: there are 4 frames"),
        ("video frames -o out --frames 2..2", "expected frames such as 120..240"),
        ("video frames -o out --time 1s", "--time: frames that depend on the clock"),
        ("video frames -o out --scheme paper", "--scheme paper: a sequence needs"),
        ("video frames -o out --max-tile-move 0", "expected a distance from 0.02 to 512 px"),
        ("video frames -o out --scene-cut 300", "expected off or a difference from 0 to 255"),
        ("video frames -o frames", "holds the frames that are read"),
        ("video frames -o out -o other", "one folder of frames is enough"),
        ("video frames -o out.tif", "an animation must end in"),
        ("video none -o out", "none: "),
        ("score --flicker frames none", "none: "),
    ] {
        refused(&workshop, line, 2, part);
    }
    std::fs::remove_file(workshop.path("frames/f9.png")).unwrap();
    std::fs::create_dir(workshop.path("out")).unwrap();
    workshop.paint("out/000001.png", 8, 8);
    refused(&workshop, &format!("video frames {SMALL} -o out"), 2, "000001.png exists and was not made by smalti");
    video(&workshop, "-o out --force");
    refused(&workshop, &format!("video frames {SMALL} -o out --seed 1"), 2, "made with other options");
}
