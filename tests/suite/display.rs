//! A display without a screen, for windows in tests: Xvfb, with openbox to manage windows and xdotool to use them.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Longer than anything takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// A display that ends with the test.
pub struct Display {
    server: Child,
    manager: Option<Child>,
    name: String,
}

/// The way to install a program of these tests.
fn missing(program: &str, package: &str, error: &std::io::Error) -> ! {
    panic!("tests of the window need {program}; apt-get install {package}: {error}")
}

impl Display {
    /// A display of this size in px, with nothing on it.
    ///
    /// Its number is that of no display before it: a server that ends would take the socket of the next one away, if
    /// that had the same number.
    pub fn start(width_px: u32, height_px: u32) -> Self {
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let screen = format!("{width_px}x{height_px}x24");
        for _ in 0..20 {
            let count = STARTED.fetch_add(1, Ordering::Relaxed);
            let name = format!(":{}", 100 + (std::process::id() * 64 + count) % 30_000);
            let mut server = Command::new("Xvfb")
                .args([&name, "-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp"])
                .stdout(Stdio::piped())
                .stderr(Stdio::null())
                .spawn()
                .unwrap_or_else(|error| missing("Xvfb", "xvfb", &error));
            // It tells its number once it listens, and nothing if another one has it.
            let mut told = String::new();
            let stdout = server.stdout.take().expect("it is piped");
            BufReader::new(stdout).read_line(&mut told).expect("it can be read");
            if !told.trim().is_empty() {
                return Self { server, manager: None, name };
            }
            server.wait().expect("it has ended");
        }
        panic!("Xvfb does not start");
    }

    /// Lets openbox manage the windows.
    pub fn manage(mut self) -> Self {
        let manager = Command::new("openbox")
            .env("DISPLAY", &self.name)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|error| missing("openbox", "openbox", &error));
        self.manager = Some(manager);
        // A window that comes while it takes over is never shown.
        let began = Instant::now();
        let asked = ["-root", "-display", &self.name, "_NET_SUPPORTING_WM_CHECK"];
        loop {
            let told = Command::new("xprop").args(asked).output();
            let told = told.unwrap_or_else(|error| missing("xprop", "x11-utils", &error));
            if String::from_utf8_lossy(&told.stdout).contains("window id") {
                return self;
            }
            assert!(began.elapsed() < PATIENCE, "openbox does not begin");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// What DISPLAY is set to.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The number of the window whose title ends so, once it is there and `is_alive` says that it may come.
    pub fn window(&self, title: &str, mut is_alive: impl FnMut() -> bool) -> String {
        let began = Instant::now();
        let ending = format!("{title}\"");
        loop {
            let listed = Command::new("xwininfo").args(["-root", "-tree", "-display", &self.name]).output();
            let listed = listed.unwrap_or_else(|error| missing("xwininfo", "x11-utils", &error));
            let text = String::from_utf8_lossy(&listed.stdout).into_owned();
            let line = text.lines().find(|line| line.split(": (").next().is_some_and(|name| name.ends_with(&ending)));
            if let Some(number) = line.and_then(|line| line.split_whitespace().next()) {
                return number.to_owned();
            }
            assert!(is_alive(), "the program ended before its window came");
            assert!(began.elapsed() < PATIENCE, "no window {title}:\n{text}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Uses the windows: the words of an xdotool command.
    pub fn act(&self, words: &str) {
        let status = Command::new("xdotool").args(words.split_whitespace()).env("DISPLAY", &self.name).status();
        let status = status.unwrap_or_else(|error| missing("xdotool", "xdotool", &error));
        assert!(status.success(), "xdotool {words}");
    }

    /// Puts a picture into the clipboard, as a program that copied it does.
    pub fn copy_png(&self, picture: &Path) {
        let words = ["-selection", "clipboard", "-target", "image/png", "-in"];
        let mut xclip = Command::new("xclip");
        xclip.args(words).arg(picture).env("DISPLAY", &self.name);
        // It stays to hand the picture out, and must not hold what the tests print into.
        let status = xclip.stdout(Stdio::null()).stderr(Stdio::null()).status();
        let status = status.unwrap_or_else(|error| missing("xclip", "xclip", &error));
        assert!(status.success(), "xclip takes {}", picture.display());
        let offered = || {
            let mut asking = Command::new("xclip");
            asking.args(["-selection", "clipboard", "-target", "TARGETS", "-out"]).env("DISPLAY", &self.name);
            let told = asking.output().expect("xclip runs");
            String::from_utf8_lossy(&told.stdout).into_owned()
        };
        let began = Instant::now();
        while !offered().contains("image/png") {
            assert!(began.elapsed() < PATIENCE, "the clipboard never holds a picture");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Ends the display under its windows.
    pub fn lose(&mut self) {
        self.server.kill().expect("it runs");
    }

    /// Looks at the display until it is as it should be.
    pub fn until(
        &self,
        picture: &Path,
        what: &str,
        mut is_so: impl FnMut(&image::RgbImage) -> bool,
    ) -> image::RgbImage {
        let began = Instant::now();
        loop {
            photograph(&self.name, picture);
            let seen = image::open(picture).expect("import writes a picture").to_rgb8();
            if is_so(&seen) {
                return seen;
            }
            assert!(began.elapsed() < PATIENCE, "the display never shows {what}");
            std::thread::sleep(Duration::from_millis(150));
        }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        for process in self.manager.iter_mut().chain([&mut self.server]) {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

/// Writes what a whole display shows.
pub fn photograph(display: &str, picture: &Path) {
    let status = Command::new("import").args(["-display", display, "-window", "root"]).arg(picture).status();
    let status = status.unwrap_or_else(|error| missing("import", "imagemagick", &error));
    assert!(status.success(), "import takes a picture");
}
