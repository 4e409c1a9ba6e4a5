//! `smalti gallery`: shows every mask under every shader on the same pictures, as contact sheets and a page of
//! Markdown.

use std::fmt::Write;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;

use crate::cli::files::destination::{self, Overwrite};
use crate::cli::files::places::Inputs;
use crate::cli::files::sheet::sheet;
use crate::cli::mosaics::{Made, MosaicsArgs, PaperRecipe, Workshop};
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::{self, Verbosity};
use crate::cli::values;
use crate::error::{Error, Result, in_words};
use crate::evolve::{ColorMode, ColorRule, PaperScheme};
use crate::model::{Canvas, Target};
use crate::output;
use crate::photo::{self, Format, Loaded, Metadata, Photo, ReadOptions};
use crate::shapes::{BuiltIn, Shader};
use crate::studio::{Dress, Look, LookChoices, Mask};

/// Longer side in px at which pictures are evolved and shown.
const SIDE_PX: u32 = 256;
/// Number of tiles: few enough that their shape is visible.
const FLY_COUNT: usize = 700;
/// Runs after the first. Each halves the steps, which comes closer to the picture than one long run.
const RESTARTS: u32 = 3;
/// Samples along each side of a pixel of a cell.
const SUPERSAMPLING: u32 = 4;
/// JPEG quality of the contact sheets, 1 to 100.
const JPEG_QUALITY: u8 = 85;
/// Opacity of whole tiles under shaders that are made for translucent tiles.
const OPACITY: f64 = 0.85;

/// The flags.
#[derive(Debug, Args)]
pub(crate) struct GalleryArgs {
    /// Pictures to show every mask and shader on
    #[arg(value_name = "IN", required = true)]
    pub inputs: Vec<PathBuf>,
    /// Folder for README.md and its pictures; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Births in each of the four runs (4k, 40k)
    #[arg(long, value_name = "B", value_parser = values::count, default_value = "5k")]
    pub births: u64,
    #[command(flatten)]
    pub mosaics: MosaicsArgs,
}

/// First line of a gallery's page, which distinguishes it from other files.
const TITLE: &str = "# Gallery of masks and shaders";

/// Makes the gallery; returns the exit code of the process.
pub(crate) fn make(args: &GalleryArgs) -> ExitCode {
    terminal::exit_code(try_make(args))
}

fn try_make(args: &GalleryArgs) -> Result<()> {
    let page = args.output.join("README.md");
    check_folder(&args.output, &page, args.mosaics.overwrite())?;
    let written: Vec<PathBuf> = Shader::ALL.iter().map(|&shader| args.output.join(file_of(shader))).collect();
    let written = written.iter().chain([&page]).map(PathBuf::as_path);
    Inputs::new(args.inputs.iter().map(PathBuf::as_path)).refuse(written)?;
    let verbosity = args.mosaics.verbosity();
    let targets = args.inputs.iter().map(|path| read(path, verbosity)).collect::<Result<Vec<_>>>()?;
    let interrupt = Interrupt::listen()?;
    std::fs::create_dir_all(&args.output).map_err(|error| {
        Error::output(&args.output, format!("cannot be created, since {}; name another folder", in_words(&error)))
    })?;
    output::check_writable(&page)?;
    let device = args.mosaics.computing.begin(verbosity)?;
    let write = |path: &Path, bytes: &[u8]| {
        interrupt.check()?;
        interrupt.while_writing(|| output::write_atomically(path, bytes))
    };
    // Written first, so that the folder counts as a gallery even if this one is not finished.
    write(&page, format!("{TITLE}\n\nNot finished; run the same command again.\n").as_bytes())?;
    let began = Instant::now();
    let workshop = Workshop::new(&device, &interrupt, args.mosaics.progress());
    let made = Shader::ALL.into_iter().try_for_each(|shader| {
        let bytes = make_sheet(args, &workshop, &targets, shader)?;
        write(&args.output.join(file_of(shader)), &bytes)
    });
    workshop.finish();
    made?;
    write(&page, markdown(args).as_bytes())?;
    args.mosaics.say_written(&page, began);
    Ok(())
}

/// Refuses a folder that holds anything but a gallery, since other pictures may be named like its sheets.
fn check_folder(folder: &Path, page: &Path, overwrite: Overwrite) -> Result<()> {
    if folder.is_file() {
        return Err(Error::Usage(format!("{} is a file; name a folder", folder.display())));
    }
    if folder.is_dir() {
        destination::sweep(folder)?;
    }
    let mut head = Vec::new();
    let read = File::open(page).and_then(|file| file.take(TITLE.len() as u64).read_to_end(&mut head));
    let is_gallery = read.is_ok() && head == TITLE.as_bytes();
    let is_empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    if is_gallery || is_empty || overwrite == Overwrite::Force {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "{} holds files that are not a gallery; name another folder, or add to it with --force",
        folder.display()
    )))
}

fn read(path: &Path, verbosity: Verbosity) -> Result<Arc<Target>> {
    let reading = ReadOptions { long_side_px: Some(SIDE_PX), ..ReadOptions::default() };
    let Loaded { photo, warnings, .. } = photo::read(path, &reading)?;
    if verbosity > Verbosity::Quiet {
        warnings.iter().for_each(|warning| terminal::error(&format!("{}: {warning}", path.display())));
    }
    let Photo { width_px, height_px, pixels } = photo;
    Target::new(width_px, height_px, pixels).map(Arc::new)
}

/// Evolves every mask under `shader` on all pictures. The sheet has a row for each picture and a column for each mask.
fn make_sheet(args: &GalleryArgs, workshop: &Workshop<'_>, targets: &[Arc<Target>], shader: Shader) -> Result<Vec<u8>> {
    let recipes = targets
        .iter()
        .flat_map(|target| BuiltIn::ALL.map(|shape| recipe(args, target, shape, shader)))
        .collect::<Result<Vec<PaperRecipe>>>()?;
    let evolved = workshop.evolve(&recipes)?;
    let draw = |made: &Made| {
        let population = &made.population;
        let canvas = Canvas::scaled(population.width_px, population.height_px, SIDE_PX);
        workshop.draw(population, &canvas, SUPERSAMPLING)
    };
    let photos = evolved.iter().map(draw).collect::<Result<Vec<_>>>()?;
    let rows: Vec<Vec<Option<&Photo>>> =
        photos.chunks(BuiltIn::ALL.len()).map(|row| row.iter().map(Some).collect()).collect();
    let jpeg = Format::Jpeg { quality: JPEG_QUALITY };
    photo::encode(jpeg, &sheet(&rows, SIDE_PX)?, &Metadata::new())
}

fn recipe(args: &GalleryArgs, target: &Arc<Target>, shape: BuiltIn, shader: Shader) -> Result<PaperRecipe> {
    let look = LookChoices {
        masks: vec![Mask::named_or_file(shape.name())],
        shader: Some(shader),
        opacity: shader.is_translucent().then_some(OPACITY),
        ..LookChoices::default()
    };
    let Dress { masks, layers_by_run } = Look::new(&look, &[], None)?.dress()?;
    let scheme = PaperScheme {
        seed: args.mosaics.seed,
        births: args.births,
        restarts: RESTARTS,
        cool_q16: 1 << 15,
        masks: layers_by_run,
        color: ColorRule { mode: ColorMode::Mean, ..ColorRule::default() },
        ..PaperScheme::default()
    };
    Ok(PaperRecipe { target: Arc::clone(target), fly_count: FLY_COUNT, masks: Arc::new(masks), scheme })
}

fn file_of(shader: Shader) -> String {
    format!("{}.jpg", shader.name())
}

/// The page.
fn markdown(args: &GalleryArgs) -> String {
    let mut page = format!(
        "{TITLE}\n\nEach sheet is one shader (`--shader`), each column one mask (`--mask`), in this order:\n\n| mask | what it is |\n|---|---|\n"
    );
    // Writing to a string cannot fail.
    for shape in BuiltIn::ALL {
        let _ = writeln!(page, "| `{}` | {} |", shape.name(), shape.description());
    }
    for shader in Shader::ALL {
        let (name, description, file) = (shader.name(), shader.description(), file_of(shader));
        let blend = if shader.is_translucent() { format!(" (here with `--opacity {OPACITY}`)") } else { String::new() };
        let columns = BuiltIn::ALL.map(BuiltIn::name).join(", ");
        let _ = write!(page, "\n## `{name}`\n\n{description}{blend}.\n\n![{name}]({file})\n\nFrom left: {columns}.\n");
    }
    let names: Vec<String> = args.inputs.iter().map(|path| path.display().to_string()).collect();
    let (names, output) = (names.join(" "), args.output.display());
    let (births, seed) = (args.births, args.mosaics.seed);
    let command = format!("smalti gallery {names} -o {output} --births {births} --seed {seed}");
    let _ = write!(
        page,
        "\nMade by {}: {FLY_COUNT} tiles at {SIDE_PX} px, {} runs with steps \
         halved at each, mean colours; {} are translucent.\n",
        code(&command),
        RESTARTS + 1,
        Shader::ALL
            .iter()
            .filter(|shader| shader.is_translucent())
            .map(|shader| shader.name())
            .collect::<Vec<_>>()
            .join(", ")
    );
    page
}

/// A text as code in Markdown, on one line and whatever is in it.
fn code(text: &str) -> String {
    let text = terminal::shown(text);
    let longest = text.split(|c| c != '`').map(str::len).max().unwrap_or_default();
    let fence = "`".repeat(longest + 1);
    let space = if longest > 0 { " " } else { "" };
    format!("{fence}{space}{text}{space}{fence}")
}

#[cfg(test)]
mod tests {
    use super::code;

    #[test]
    fn no_name_leaves_the_code_that_it_stands_in() {
        assert_eq!(code("smalti gallery a.png"), "`smalti gallery a.png`");
        assert_eq!(code("a `b` <i>.png"), "`` a `b` <i>.png ``");
        assert_eq!(code("```\n# x"), "```` ```\\n# x ````");
    }
}
