//! `smalti view`: opens the window. What the window does not know, it is given here: devices by their flags, snapshots
//! of folders, and how saved tiles are drawn again.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use crate::cli::args::computing::ComputingArgs;
use crate::cli::files::snapshots;
use crate::cli::terminal;
use crate::error::Result;
use crate::view::{self, Figures, Options, Redraw};
use crate::vk::Validation;

const AFTER_HELP: &str = "\
The window shows the mosaic while it evolves, at any scale. On the left is what can be wished for; each change goes on from the \
present tiles where it can. Below is the course of the error, and a slider back in time.

Keys: Space pause and go on; S one step; Ctrl+R restart; T tiles, D divider, P photo, E error; hold C to see the photo; B brush; \
F fit, 1 one to one, + and - zoom, arrows move; Ctrl+O open, Ctrl+S save, Ctrl+Z and Ctrl+Shift+Z undo and redo, Ctrl+V paste a \
picture.

A mosaic that was steered or ended by hand is saved with its steps beside it, and smalti evolve IN --replay STEPS.json -o OUT makes \
it again, byte for byte.

Examples:
  smalti view photo.jpg
  smalti view flies.npz        # tiles that smalti evolve wrote
  smalti view run              # snapshots that smalti evolve --save-run kept";

/// The flags of `smalti view`.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER_HELP)]
pub(crate) struct ViewArgs {
    /// What to open: a picture, a population (.npz), or a folder of --save-run
    #[arg(value_name = "PICTURE|POP.npz|FOLDER")]
    pub path: Option<PathBuf>,
    #[command(flatten)]
    pub computing: ComputingArgs,
    /// Check what the window draws with the validation layer; any message is an error
    #[arg(long, help_heading = "Computing")]
    pub validate: bool,
    /// Say at the end how many frames were drawn, and how fast it searched
    #[arg(short, long, help_heading = "Messages")]
    pub verbose: bool,
}

/// Opens the window; returns the exit code of the process once it is closed.
pub(crate) fn view(args: &ViewArgs, redraw: Redraw) -> ExitCode {
    terminal::exit_code(open(args, redraw))
}

fn open(args: &ViewArgs, redraw: Redraw) -> Result<()> {
    // What searches may be the CPU, and the layer watches what draws.
    let computing = args.computing.check(Validation::Off)?;
    computing.start_threads()?;
    let figures = view::open(Options {
        path: args.path.clone(),
        device: Box::new(move || computing.select()),
        validation: if args.validate { Validation::On } else { Validation::Off },
        snapshots: listed,
        redraw,
        end_process: terminal::end_process,
    })?;
    if args.verbose {
        let Figures { frames, first_tiles, evals, evals_per_s } = figures;
        let first = first_tiles.map_or_else(|| "never".to_owned(), |time| format!("after {:.2} s", time.as_secs_f64()));
        terminal::say(&format!("first tiles {first}; the mosaic was drawn {frames} times"));
        terminal::say(&format!("{evals} evals in the last run, {evals_per_s:.0} a second"));
    }
    Ok(())
}

fn listed(folder: &Path) -> Result<Vec<(u64, u64, PathBuf)>> {
    let snapshots = snapshots::list(folder)?;
    Ok(snapshots.into_iter().map(|snapshot| (snapshot.evals, snapshot.sae, snapshot.path)).collect())
}
