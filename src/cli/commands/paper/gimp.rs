//! The method that the paper compares with: GIMPressionist, a plug-in of GIMP (Figs 6 and 9). It runs without a
//! display, if GIMP is installed.
//!
//! Everything that GIMP writes stays in its own temporary folder. GIMP exits with 0 even if a plug-in fails, so only
//! the picture shows whether it worked.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::cli::files::child::in_its_own_group;
use crate::cli::terminal::advice;
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::in_words;
use crate::model::mask::{MASK_SIDE, Mask};
use crate::photo::{self, Photo, ReadOptions};

/// GIMP starts in seconds and paints in a few more.
const TIME_LIMIT: Duration = Duration::from_secs(180);
const PROGRAM: &str = "gimp";

/// The script that GIMP runs: load, paint, save.
const SCRIPT: &str = r"(define (smalti-paint in out preset)
  (let* ((image (car (gimp-file-load RUN-NONINTERACTIVE in in)))
         (drawable (car (gimp-image-get-active-layer image))))
    (plug-in-gimpressionist RUN-NONINTERACTIVE image drawable preset)
    (gimp-file-save RUN-NONINTERACTIVE image (car (gimp-image-flatten image)) out out)
    (gimp-image-delete image)))
";

/// Whether GIMP is installed.
pub(super) fn is_installed() -> bool {
    let mut asked = Command::new(PROGRAM);
    asked.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    asked.status().is_ok_and(|status| status.success())
}

/// `picture` painted with about `stroke_count` strokes. The brush is the coverage of `mask`. Its size and density are
/// those that were best for the square brush at 500 to 2,500 strokes.
///
/// # Errors
/// A sentence for the page if no picture comes out, for instance because the user interrupts.
pub(super) fn paint(picture: &Photo, stroke_count: usize, mask: &Mask, interrupt: &Interrupt) -> Result<Photo, String> {
    let folder = tempfile::tempdir()
        .map_err(|error| failed(&format!("there is no place for temporary files, since {}", in_words(&error))))?;
    let files = Files { folder: folder.path() };
    files.prepare(picture, stroke_count, mask)?;
    files.run(interrupt)?;
    let painted = photo::read(&files.folder.join("out.png"), &ReadOptions::default())
        .map_err(|_| failed("it wrote no picture"))?
        .photo;
    if painted.pixels == picture.pixels {
        return Err(failed("its plug-in gimpressionist changed nothing"));
    }
    Ok(painted)
}

fn failed(what: &str) -> String {
    format!("GIMP did not paint: {what}")
}

/// GIMP's folder, the picture and the result.
struct Files<'a> {
    folder: &'a Path,
}

impl Files<'_> {
    fn prepare(&self, picture: &Photo, stroke_count: usize, mask: &Mask) -> Result<(), String> {
        let side = f64::from(picture.width_px) * f64::from(picture.height_px) / stroke_count as f64;
        let settings = settings(side.sqrt());
        let files: [(&str, Vec<u8>); 4] = [
            ("in.png", photo::encode_png(picture, &photo::Metadata::new()).map_err(|error| advice::sentence(&error))?),
            ("scripts/smalti.scm", SCRIPT.as_bytes().to_vec()),
            ("gimpressionist/Presets/smalti", settings.into_bytes()),
            ("gimpressionist/Brushes/smalti.pgm", brush(mask)),
        ];
        for (name, bytes) in files {
            let path = self.folder.join(name);
            let folder = path.parent().unwrap_or(self.folder);
            std::fs::create_dir_all(folder)
                .and_then(|()| std::fs::write(&path, bytes))
                .map_err(|error| failed(&format!("its folder cannot be written, since {}", in_words(&error))))?;
        }
        Ok(())
    }

    fn run(&self, interrupt: &Interrupt) -> Result<(), String> {
        let call = r#"(smalti-paint "in.png" "out.png" "smalti")"#;
        let mut command = Command::new(PROGRAM);
        command
            .args(["-i", "-d", "-f", "-b", call, "-b", "(gimp-quit 0)"])
            .current_dir(self.folder)
            .env("GIMP2_DIRECTORY", self.folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let mut gimp = in_its_own_group(&mut command)
            .spawn()
            .map_err(|error| failed(&format!("it does not start, since {}", in_words(&error))))?;
        let began = Instant::now();
        loop {
            match gimp.try_wait() {
                Ok(Some(_)) => return Ok(()),
                Ok(None) if began.elapsed() < TIME_LIMIT && !interrupt.is_requested() => {
                    std::thread::sleep(Duration::from_millis(50));
                }
                outcome => {
                    // We give up on it, whether or not it could be killed.
                    let _ = gimp.kill();
                    let _ = gimp.wait();
                    return Err(failed(&match outcome {
                        Err(error) => error.to_string(),
                        _ if interrupt.is_requested() => "it was interrupted".to_owned(),
                        _ => "it took more than three minutes".to_owned(),
                    }));
                }
            }
        }
    }
}

/// The mask's coverage, a quarter as wide, as the grey picture that GIMPressionist takes for a brush.
fn brush(mask: &Mask) -> Vec<u8> {
    const STEP: usize = 4;
    let side = MASK_SIDE / STEP;
    let mut bytes = format!("P5\n{side} {side}\n255\n").into_bytes();
    for row in (0..MASK_SIDE).step_by(STEP) {
        let texels = (0..MASK_SIDE).step_by(STEP).map(|column| mask.texel(column as u32, row as u32));
        bytes.extend(texels.map(|texel| texel.coverage));
    }
    bytes
}

/// A preset of GIMPressionist: strokes of one size laid evenly over black, turned along what they paint, without
/// relief.
fn settings(tile_side_px: f64) -> String {
    // 7 px at 256x256 with 2,500 strokes, and in proportion.
    let size = (1.37 * tile_side_px).round().max(1.0);
    let density = 3.0 * ((std::f64::consts::SQRT_2 * size).ceil() + 1.0) / tile_side_px;
    format!(
        "PaperPreset\norientnum=12\norientfirst=0.000000\norientlast=360.000000\norienttype=6\nsizenum=1\n\
         sizefirst={size:.6}\nsizelast={size:.6}\nbrushdensity={density:.6}\nbrushrelief=0.000000\n\
         generaldarkedge=0.000000\ngeneralbgtype=0\nselectedbrush=Brushes/smalti.pgm\ncolor=000000\nplacetype=1\n"
    )
}
