//! `smalti paper`: makes each figure and table of "Evolutionary Art using the Fly Algorithm" with one command.
//!
//! Every figure is a page in a folder with its pictures, plots and tables, which are written as CSV, too. It can be
//! opened from disk. The results depend only on the pictures, the births and the seed.

mod colors;
mod folder;
mod gimp;
mod grid;
mod looks;
mod page;
mod pictures;
mod restarts;
mod tables;
mod workbench;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{Args, ValueEnum};

use crate::cli::files::places::Inputs;
use crate::cli::mosaics::{MosaicsArgs, Workshop};
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::{terminal, values};
use crate::error::{Error, Result};
use folder::Folder;
use page::{Content, Page};
use workbench::Workbench;

const EXAMPLES: &str = "\
Examples:
  smalti paper fig4 --images photos -o figures
  smalti paper all --images photos -o figures --births 4k      # a quick look";

/// The flags.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct PaperArgs {
    /// What to make: a figure or table of the paper, or all of them
    #[arg(value_enum, value_name = "NAME")]
    pub name: Name,
    /// Folder of the pictures to use; tables 1 and 2 and figure 7 need none
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
    /// Folder for the pages; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Births in each run (4k, 40k); fewer for a quick look
    #[arg(long, value_name = "B", value_parser = values::count, default_value = "40k")]
    pub births: u64,
    #[command(flatten)]
    pub mosaics: MosaicsArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Name {
    /// The random start
    Fig3,
    /// The 12 schemes on all pictures
    Fig4,
    /// Restarts, and the curve of global fitness
    Fig5,
    /// Colours evolved or picked, and edges
    Fig6,
    /// The templates of tiles
    Fig7,
    /// Shaders, large tiles, no rotation, tiles with an edge
    Fig8,
    /// Tile types beside GIMPressionist
    Fig9,
    /// The 12 schemes
    Table1,
    /// The parameters
    Table2,
    /// Everything, with an index
    All,
}

impl Name {
    /// The name of the figure, as the user types it.
    fn word(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
    }

    /// Whether the figure needs pictures.
    fn needs_pictures(self) -> bool {
        !matches!(self, Self::Fig7 | Self::Table1 | Self::Table2)
    }

    fn make(self, bench: &Workbench<'_>) -> Result<Page> {
        match self {
            Self::Fig3 => grid::fig3(bench),
            Self::Fig4 => grid::fig4(bench),
            Self::Fig5 => restarts::fig5(bench),
            Self::Fig6 => colors::fig6(bench),
            Self::Fig7 => looks::fig7(bench),
            Self::Fig8 => looks::fig8(bench),
            Self::Fig9 => colors::fig9(bench),
            Self::Table1 => tables::table1(bench),
            Self::Table2 => tables::table2(bench),
            Self::All => all(bench),
        }
    }
}

/// Makes the requested pages; returns the exit code of the process.
pub(crate) fn make(args: &PaperArgs) -> ExitCode {
    terminal::exit_code(try_make(args))
}

fn try_make(args: &PaperArgs) -> Result<()> {
    let verbosity = args.mosaics.verbosity();
    let images = match &args.images {
        None if args.name.needs_pictures() => {
            return Err(Error::Usage("this figure needs pictures; name their folder with --images".to_owned()));
        }
        Some(folder) if args.name.needs_pictures() => pictures::in_folder(folder, verbosity)?,
        _ => Vec::new(),
    };
    let interrupt = Interrupt::listen()?;
    let given = args.images.as_deref().filter(|_| args.name.needs_pictures()).map(std::fs::read_dir);
    let given: Vec<PathBuf> = given.into_iter().flatten().flatten().flatten().map(|entry| entry.path()).collect();
    let inputs = Inputs::new(given.iter().map(PathBuf::as_path));
    let folder = Folder::open(&args.output, args.mosaics.overwrite(), inputs, &interrupt)?;
    let device = args.mosaics.computing.begin(verbosity)?;
    let began = Instant::now();
    let workshop = Workshop::new(&device, &interrupt, args.mosaics.progress());
    let bench = Workbench {
        workshop: &workshop,
        pictures: images,
        folder,
        interrupt: &interrupt,
        births: args.births,
        seed: args.mosaics.seed,
    };
    let made = write_page(&bench, args.name);
    workshop.finish();
    args.mosaics.say_written(&bench.folder.path(&made?.0), began);
    Ok(())
}

/// Makes a page and writes it; returns its file and its title. Meanwhile a placeholder stands in its place, which also
/// marks the folder as ours.
fn write_page(bench: &Workbench<'_>, name: Name) -> Result<(String, String)> {
    let word = if name == Name::All { "index".to_owned() } else { name.word() };
    let command = format!("smalti paper {} --births {} --seed {}", name.word(), bench.births, bench.seed);
    let unfinished = Page::new(&word, "Not finished: this page was being made. Run the same command again.");
    bench.folder.write_page(&word, &unfinished, &command)?;
    let page = name.make(bench)?;
    bench.folder.write_page(&word, &page, &command)?;
    Ok((format!("{word}.html"), page.title))
}

/// Makes all pages, and an index of them.
fn all(bench: &Workbench<'_>) -> Result<Page> {
    let mut index = Page::new(
        "Evolutionary Art using the Fly Algorithm, reproduced",
        "Every table and figure of the paper that shows a result. Figures 1 and 2 are diagrams; they are in the documentation.",
    );
    let names = Name::value_variants().iter().copied().filter(|name| *name != Name::All);
    let links = names.map(|name| write_page(bench, name)).collect::<Result<_>>()?;
    index.push("Pages", Content::Links(links));
    Ok(index)
}
