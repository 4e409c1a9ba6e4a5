//! The programs that have a plug-in, and the files that each of them gets.

use clap::ValueEnum;

use super::built;
use crate::error::Result;

/// A program with a plug-in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Host {
    /// GIMP 3
    Gimp3,
    /// GIMP 2.10, which compiles its plug-in
    Gimp2,
    Krita,
    Inkscape,
}

/// A file of a plug-in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct File {
    /// Where it lies in the host's folder of plug-ins, with slashes.
    pub path: String,
    pub bytes: Vec<u8>,
    /// Whether the host runs it as a program.
    pub is_program: bool,
}

/// A file of our source.
macro_rules! source {
    ($path:literal) => {
        include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/plugins/", $path))
    };
}

/// Tells a plug-in, beside it, which program put it there.
const NOTE: &str = "smalti_program.txt";
/// What the hosts that speak Python share.
const SHARED: &[u8] = source!("shared/smalti_program.py");

impl Host {
    pub const ALL: [Self; 4] = [Self::Gimp3, Self::Gimp2, Self::Krita, Self::Inkscape];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gimp3 => "gimp3",
            Self::Gimp2 => "gimp2",
            Self::Krita => "krita",
            Self::Inkscape => "inkscape",
        }
    }

    /// The name for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Gimp3 => "GIMP 3",
            Self::Gimp2 => "GIMP 2.10",
            Self::Krita => "Krita",
            Self::Inkscape => "Inkscape",
        }
    }

    /// The folder that its plug-in has to itself, in that in which the host looks.
    pub fn own_folder(self) -> &'static str {
        if self == Self::Krita { "pykrita/smalti" } else { "smalti" }
    }

    /// What to do once the plug-in is there.
    pub fn next(self) -> &'static str {
        match self {
            Self::Gimp3 | Self::Gimp2 => "start it anew, and see Filters > Artistic > smalti",
            Self::Krita => {
                "start it anew, tick smalti in Settings > Configure Krita > Python Plugin Manager, start it once more, \
                 and see Filter > Mosaic of Tiles (smalti)"
            }
            Self::Inkscape => "start it anew, and see Extensions > Images > Trace Bitmap into Tiles (smalti)",
        }
    }

    /// The files of its plug-in, which is told of the program that puts it there.
    ///
    /// # Errors
    /// [`crate::Error::Output`] if the plug-in has to be compiled, and cannot be.
    pub fn files(self, program: Option<&str>) -> Result<Vec<File>> {
        let text =
            |(path, bytes): (&str, &[u8])| File { path: path.to_owned(), bytes: bytes.to_vec(), is_program: false };
        let runs = |path: &str, bytes: &[u8]| File { path: path.to_owned(), bytes: bytes.to_vec(), is_program: true };
        let mut files = match self {
            Self::Gimp3 => {
                vec![runs("smalti/smalti.py", source!("gimp3/smalti.py")), text(("smalti/smalti_program.py", SHARED))]
            }
            Self::Gimp2 => vec![runs(
                if cfg!(windows) { "smalti/smalti.exe" } else { "smalti/smalti" },
                &built::for_gimp2(&[
                    ("smalti.c", source!("gimp2/smalti.c")),
                    ("smalti_dialog.h", source!("gimp2/smalti_dialog.h")),
                    ("smalti_program.h", source!("gimp2/smalti_program.h")),
                ])?,
            )],
            Self::Krita => vec![
                text(("pykrita/smalti.desktop", source!("krita/smalti.desktop"))),
                text(("actions/smalti.action", source!("krita/smalti.action"))),
                text(("pykrita/smalti/Manual.html", source!("krita/smalti/Manual.html"))),
                text(("pykrita/smalti/__init__.py", source!("krita/smalti/__init__.py"))),
                text(("pykrita/smalti/colors.py", source!("krita/smalti/colors.py"))),
                text(("pykrita/smalti/dialog.py", source!("krita/smalti/dialog.py"))),
                text(("pykrita/smalti/extension.py", source!("krita/smalti/extension.py"))),
                text(("pykrita/smalti/mask.kra", source!("krita/smalti/mask.kra"))),
                text(("pykrita/smalti/mosaic.py", source!("krita/smalti/mosaic.py"))),
                text(("pykrita/smalti/qt.py", source!("krita/smalti/qt.py"))),
                text(("pykrita/smalti/smalti_program.py", SHARED)),
            ],
            Self::Inkscape => vec![
                text(("smalti/smalti.inx", source!("inkscape/smalti.inx"))),
                text(("smalti/smalti_bitmaps.py", source!("inkscape/smalti_bitmaps.py"))),
                text(("smalti/smalti_trace.py", source!("inkscape/smalti_trace.py"))),
                text(("smalti/smalti_program.py", SHARED)),
            ],
        };
        let note = |program: &str| File {
            path: format!("{}/{NOTE}", self.own_folder()),
            bytes: program.as_bytes().to_vec(),
            is_program: false,
        };
        files.extend(program.map(note));
        Ok(files)
    }
}
