//! A temporary folder in which tests run the program as a person would.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use image::{Rgb, RgbImage};
use serde_json::Value;
use tempfile::TempDir;

/// A folder with `photo.png`, 40x30 px, in it.
pub struct Workshop {
    folder: TempDir,
}

/// What a run of the program led to.
pub struct Ran {
    pub code: Option<i32>,
    pub stdout: Vec<u8>,
    pub stderr: String,
}

impl Workshop {
    pub fn new() -> Self {
        let workshop = Self { folder: tempfile::tempdir().expect("a temporary folder") };
        workshop.paint("photo.png", 40, 30);
        workshop
    }

    /// A picture without a flat spot.
    pub fn paint(&self, name: &str, width_px: u32, height_px: u32) {
        let pixel = |i, j| Rgb([(i * 6) as u8, (j * 8) as u8, ((i * j) % 251) as u8]);
        RgbImage::from_fn(width_px, height_px, pixel).save(self.path(name)).expect("the picture is written");
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).expect("the file is written");
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn pixels(&self, name: &str) -> RgbImage {
        image::open(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}")).to_rgb8()
    }

    /// Names of all files, temporary ones too.
    pub fn files(&self) -> BTreeSet<String> {
        let entries = std::fs::read_dir(self.folder.path()).expect("the folder can be listed");
        entries.map(|entry| entry.expect("it can be read").file_name().to_string_lossy().into_owned()).collect()
    }

    /// The program in this folder, on the CPU twin unless the arguments say otherwise.
    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_smalti"));
        command.args(line.split_whitespace()).current_dir(self.folder.path()).env("SMALTI_DEVICE", "cpu");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Runs the program to its end.
    pub fn run(&self, line: &str) -> Ran {
        let output = self.command(line).output().expect("the program starts");
        let stderr = String::from_utf8(output.stderr).expect("messages are UTF-8");
        Ran { code: output.status.code(), stdout: output.stdout, stderr }
    }

    /// Runs `evolve photo.png` by the paper's scheme with small settings and fails unless it succeeds.
    pub fn evolve(&self, rest: &str) -> Ran {
        let ran = self.run(&format!("evolve photo.png --scheme paper -n 60 --births 300 {rest}"));
        assert_eq!(ran.code, Some(0), "{rest}: {}", ran.stderr);
        ran
    }

    /// As [`Workshop::evolve`], and returns the row of JSON.
    pub fn evolve_to_row(&self, rest: &str) -> Value {
        self.evolve(&format!("{rest} --json")).row()
    }
}

impl Ran {
    /// The one line of JSON on stdout.
    pub fn row(&self) -> Value {
        let text = std::str::from_utf8(&self.stdout).expect("JSON is UTF-8");
        assert_eq!(text.lines().count(), 1, "one line, not {text:?}");
        serde_json::from_str(text).expect("it is JSON")
    }
}
