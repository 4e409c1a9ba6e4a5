//! `smalti render`: draws a population from a file again, or writes it in another format.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::Args;
use serde::Serialize;
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use crate::archive::{self, Archive};
use crate::cli::args::computing::{self, Computing, ComputingArgs};
use crate::cli::args::look::LookArgs;
use crate::cli::files::destination::{self, Destination, Overwrite};
use crate::cli::files::places::Inputs;
use crate::cli::files::{memory, outputs, replacing};
use crate::cli::jobs::row::Status;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::progress::{Progress, ProgressKind};
use crate::cli::terminal::{self, Verbosity, advice};
use crate::cli::values;
use crate::error::{Error, Result};
use crate::evolve::{ALGORITHM_VERSION, PaperScheme, begin_from};
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::model::{Backdrop, Blend, Grout, Population};
use crate::studio::{
    Device, Drawn, Dress, KEEPS_MASKS, Look, Provenance, SUPERSAMPLING_MAX, Told, View, backdrop, drawing_bytes,
    hexadecimal, look_asked, population_sha256,
};
use crate::vk::Validation;

const EXAMPLES: &str = "\
Examples:
  smalti render flies.npz -o poster.png --output-size 4096
  smalti render flies.npz -o mosaic.svg -o layers.ora
  smalti render flies.npz -o flowers.png --mask flower --shader emboss --output-size 2048
  smalti render flies.npz -o paper.webp --background white --supersample 8";

#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct RenderArgs {
    /// Population to draw, a .npz file; - reads it from stdin
    #[arg(value_name = "POP.npz", value_parser = values::input())]
    pub input: PathBuf,

    /// File to write: .png .jpg .webp .svg .ora .npz .csv .json; repeat it for more
    ///
    /// .npz, .csv and .json hold the tiles themselves. - writes to stdout what --format says.
    #[arg(short, long = "output", value_name = "OUT", required = true, help_heading = "Output")]
    pub outputs: Vec<PathBuf>,
    /// Format of what -o - writes: png, jpg, webp, svg, ora, npz, csv or json [default: png]
    #[arg(long, value_name = "EXT", value_parser = values::ending, help_heading = "Output")]
    pub format: Option<String>,
    /// Replace files that smalti did not write, or wrote with other options
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Print one line of JSON about the result to stdout
    #[arg(long, help_heading = "Output")]
    pub json: bool,

    /// Longer side of the written picture, 1 to 65,535 px [default: that at which it evolved]
    #[arg(long, value_name = "PX", value_parser = values::count, help_heading = "Picture")]
    pub output_size: Option<u64>,
    /// Colour behind the tiles, such as navy or #f80, or none [default: as in the population]
    ///
    /// A .jpg cannot be transparent: instead of none, it has black.
    #[arg(long, value_name = "COLOR", value_parser = backdrop, help_heading = "Picture")]
    pub background: Option<Backdrop>,
    /// Samples along each side of a pixel, 1 to 16 [default: 1 at the size at which it evolved, else at least 4]
    #[arg(long, value_name = "S", value_parser = values::count, help_heading = "Picture")]
    pub supersample: Option<u64>,

    #[command(flatten)]
    pub look: LookArgs,

    #[command(flatten)]
    pub computing: ComputingArgs,
    /// Check every Vulkan call with the validation layer; any message is an error
    #[arg(long, help_heading = "Computing")]
    pub validate: bool,

    /// Say more
    #[arg(short, long, help_heading = "Messages", conflicts_with = "quiet")]
    pub verbose: bool,
    /// Say nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

/// All options of `smalti render`.
#[derive(Clone, Debug)]
struct RenderOptions {
    input: PathBuf,
    outputs: Vec<Destination>,
    overwrite: Overwrite,
    /// Longer side of the written picture in px; `None` writes it as evolved.
    output_long_side_px: Option<u32>,
    /// `None` takes the background of the population.
    background: Option<Backdrop>,
    /// Masks that the tiles wear instead of their own, if any.
    look: Option<Look>,
    /// `None` chooses by the size.
    supersampling: Option<u32>,
    computing: Computing,
    verbosity: Verbosity,
}

impl RenderOptions {
    fn new(args: &RenderArgs) -> Result<Self> {
        let validation = if args.validate { Validation::On } else { Validation::Off };
        let samples = 1..=u64::from(SUPERSAMPLING_MAX);
        let supersampling = args.supersample.map(|count| values::in_range("--supersample", count, samples));
        let options = Self {
            input: args.input.clone(),
            outputs: Destination::for_results(&args.outputs, args.format.as_deref())?,
            overwrite: if args.force { Overwrite::Force } else { Overwrite::Refuse },
            output_long_side_px: args.output_size.map(|px| values::side_px("--output-size", px)).transpose()?,
            background: args.background,
            look: look(&args.look)?,
            supersampling: supersampling.transpose()?.map(|count| count as u32),
            computing: args.computing.check(validation)?,
            verbosity: match (args.quiet, args.verbose) {
                (true, _) => Verbosity::Quiet,
                (false, true) => Verbosity::Verbose,
                (false, false) => Verbosity::Normal,
            },
        };
        if args.json {
            destination::check_stdout_is_free(&options.outputs)?;
        }
        destination::check_size_has_use(&options.outputs, options.output_long_side_px)?;
        if let Some(count) = options.supersampling
            && !options.outputs.iter().any(Destination::is_raster)
        {
            return Err(Error::Usage(format!(
                "--supersample {count}: no output has pixels; add one such as .png, or drop the flag"
            )));
        }
        Ok(options)
    }

    /// How a picture of this size is drawn.
    fn view(&self, width_px: u32, height_px: u32) -> Result<View> {
        let mut view = View::new(width_px, height_px, self.output_long_side_px);
        let Some(supersampling) = self.supersampling else { return Ok(view) };
        let long_side_px = view.canvas.width_px.max(view.canvas.height_px);
        if long_side_px * supersampling > TARGET_SIDE_MAX_PX {
            return Err(Error::Usage(format!(
                "--supersample {supersampling}: a picture of {long_side_px} px allows at most {}, so that it has no more \
                 than {TARGET_SIDE_MAX_PX} samples a side",
                TARGET_SIDE_MAX_PX / long_side_px
            )));
        }
        view.supersampling = supersampling;
        Ok(view)
    }
}

/// The masks from the flags, if any.
fn look(args: &LookArgs) -> Result<Option<Look>> {
    if args.masks.is_empty() && (args.shader.is_some() || args.blend.is_some() || args.opacity.is_some()) {
        return Err(Error::parameter("mask", KEEPS_MASKS));
    }
    if args.masks.is_empty() { Ok(None) } else { Look::new(&args.choices(), &[], None).map(Some) }
}

/// The result of a rendering. Fields that `evolve` also has mean the same here.
#[derive(Clone, Debug, Serialize)]
struct RenderRow {
    /// The input's file name without its ending.
    id: String,
    status: Status,
    /// The files that were written.
    output: Vec<String>,
    key: Option<String>,
    tiles: Option<usize>,
    load_ms: f64,
    draw_ms: f64,
    save_ms: f64,
    device: Option<String>,
    host: Option<String>,
    version: &'static str,
    error: Option<String>,
}

impl RenderRow {
    /// Of a file of which nothing is known yet.
    fn new(input: &Path) -> Self {
        Self {
            id: input.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            status: Status::Failed,
            output: Vec::new(),
            key: None,
            tiles: None,
            load_ms: 0.0,
            draw_ms: 0.0,
            save_ms: 0.0,
            device: None,
            host: terminal::host_name(),
            version: env!("CARGO_PKG_VERSION"),
            error: None,
        }
    }
}

/// Draws one population and reports on it; returns the exit code of the process.
pub(crate) fn render(args: &RenderArgs) -> ExitCode {
    let mut row = RenderRow::new(&args.input);
    let done = RenderOptions::new(args).and_then(|options| render_population(&options, &mut row));
    if let Err(error) = &done {
        row.error = Some(advice::sentence(error));
        terminal::error(&advice::sentence(error));
    }
    let printed = if args.json { terminal::print_json(&row) } else { Ok(()) };
    if let Err(error) = &printed {
        terminal::error(&advice::sentence(error));
    }
    done.and(printed).map_or_else(|error| ExitCode::from(advice::exit_code(&error)), |()| ExitCode::SUCCESS)
}

/// Draws the tiles of a file into another, with a longer side in px or as they evolved, as `smalti render` does without
/// further flags. What is there is replaced.
///
/// # Errors
/// If the file holds no tiles, the other one cannot be written, or the format cannot hold them.
#[cfg(feature = "view")]
pub(crate) fn redraw(input: &Path, output: &Path, long_side_px: Option<u32>) -> Result<()> {
    let options = RenderOptions {
        input: input.to_owned(),
        outputs: vec![Destination::for_result(output)?],
        overwrite: Overwrite::Force,
        output_long_side_px: long_side_px,
        background: None,
        look: None,
        supersampling: None,
        computing: Computing::usual(),
        verbosity: Verbosity::Quiet,
    };
    render_population(&options, &mut RenderRow::new(input))
}

/// The work, in order: check, read, draw, encode and write.
fn render_population(options: &RenderOptions, row: &mut RenderRow) -> Result<()> {
    options.computing.start_threads()?;
    let masks = options.look.iter().flat_map(Look::mask_paths).filter(|path| path.exists());
    let inputs = Inputs::new(masks.chain([options.input.as_path()]));
    destination::check_writable(options.outputs.iter(), &inputs)?;
    let device = options.computing.select()?;
    row.device = Some(device.label().to_owned());

    let began = Instant::now();
    let Archive { population, mut fitness, meta } = archive::read(&options.input)?;
    if population.flies.is_empty() {
        return Err(Error::input(&options.input, "holds no flies; give a population of at least one"));
    }
    let (population, asked) = adapted(population, options)?;
    if options.look.is_some() {
        // The fitness is that of other tiles, and there is no target to measure it again.
        fitness.fill(0);
    }
    row.load_ms = terminal::milliseconds(began.elapsed());
    row.tiles = Some(population.flies.len());
    if options.verbosity > Verbosity::Quiet {
        computing::say_device(&device);
    }
    let view = options.view(population.width_px, population.height_px)?;
    check_size(options, &population, &view)?;
    let provenances = Provenances::new(&population, &fitness, &view, asked);
    row.key = Some(provenances.of_row(options).key().to_owned());
    for output in &options.outputs {
        replacing::check_replaceable(output, provenances.of_output(output).key(), options.overwrite)?;
    }

    let began = Instant::now();
    let mut drawn = Drawn { population, marginal: fitness, view, picture: None, layers: None };
    draw(&mut drawn, options, &device)?;
    row.draw_ms = terminal::milliseconds(began.elapsed());
    let began = Instant::now();
    let files = outputs::encode(
        &options.outputs.iter().collect::<Vec<_>>(),
        &drawn,
        &provenances.told(&meta),
        options.verbosity,
    )?;
    // Before this point an interrupt leaves no files.
    destination::sweep_beside(options.outputs.iter().map(|output| output.path.as_path()));
    outputs::write(&files, &Interrupt::listen()?, &mut row.output)?;
    row.save_ms = terminal::milliseconds(began.elapsed());
    row.status = Status::Complete;
    if options.verbosity > Verbosity::Quiet {
        terminal::say(&format!("wrote {}", row.output.join(", ")));
    }
    if options.verbosity == Verbosity::Verbose {
        let RenderRow { load_ms, draw_ms, save_ms, .. } = row;
        terminal::say(&format!("read in {load_ms:.0} ms, drawn in {draw_ms:.0} ms, written in {save_ms:.0} ms"));
        terminal::say(&format!("key of the result {}", row.key.as_deref().unwrap_or_default()));
    }
    Ok(())
}

/// The population with the look that the options ask for, and what they ask for, under the names of the flags. Every
/// change is part of its key.
fn adapted(mut population: Population, options: &RenderOptions) -> Result<(Population, Map<String, Value>)> {
    let mut asked = Map::new();
    if let Some(background) = options.background.filter(|background| *background != population.background) {
        population.background = background;
        let color = match background {
            Backdrop::Color(color) => hexadecimal(&color),
            Backdrop::Transparent => "none".to_owned(),
        };
        asked.insert("background".to_owned(), color.into());
    }
    if let Some(look) = &options.look {
        let dress = look.dress()?;
        asked.extend(look_asked(look, None, Some(&dress)));
        let Dress { masks, layers_by_run } = dress;
        let worn = PaperScheme { masks: layers_by_run, ..PaperScheme::default() };
        population.flies = begin_from(&worn, population.flies);
        population.masks = masks;
        if population.grout.is_some() && population.masks.blend() == Blend::Translucent {
            return Err(Error::Usage(
                "the population has grout, which translucent tiles cannot have; render it with --blend opaque"
                    .to_owned(),
            ));
        }
    }
    Ok((population, asked))
}

/// Refuses pictures that are too large for their formats or for the memory.
fn check_size(options: &RenderOptions, population: &Population, view: &View) -> Result<()> {
    let (width_px, height_px) = (view.canvas.width_px, view.canvas.height_px);
    destination::check_fits_formats(&options.outputs, (width_px, height_px))?;
    if !options.outputs.iter().any(Destination::is_raster) {
        return Ok(());
    }
    let pixel_count = u64::from(width_px) * u64::from(height_px) * destination::memory_weight(&options.outputs);
    memory::check(drawing_bytes(population, &view.canvas.supersampled(view.supersampling), pixel_count))
}

/// Draws what the outputs need.
fn draw(drawn: &mut Drawn, options: &RenderOptions, device: &Device) -> Result<()> {
    if !options.outputs.iter().any(Destination::is_raster) {
        return Ok(());
    }
    let mut painter = device.open_painter()?;
    let kind = ProgressKind::Auto.unless(options.verbosity == Verbosity::Quiet);
    let progress = Progress::new(kind, options.verbosity);
    outputs::draw(drawn, &mut *painter, destination::pieces(&options.outputs), progress)?;
    drop(painter);
    device.check_validation()
}

/// The provenance of everything that one command writes.
struct Provenances {
    picture: Provenance,
    population: Provenance,
}

impl Provenances {
    fn new(population: &Population, fitness: &[i64], view: &View, mut asked: Map<String, Value>) -> Self {
        let mut decisive = Map::new();
        decisive.insert("content".to_owned(), "render".into());
        decisive.insert("algorithm".to_owned(), ALGORITHM_VERSION.into());
        decisive.insert("population_sha256".to_owned(), population_sha256(population).into());
        decisive.insert("width_px".to_owned(), population.width_px.into());
        decisive.insert("height_px".to_owned(), population.height_px.into());
        let background = match population.background {
            Backdrop::Color(color) => hexadecimal(&color),
            Backdrop::Transparent => "transparent".to_owned(),
        };
        decisive.insert("background".to_owned(), background.into());
        if let Some(Grout { width, color }) = population.grout {
            decisive.insert("grout".to_owned(), json!({"width": width, "color": hexadecimal(&color)}));
        }
        let recipe = |asked: &Map<String, Value>| [("recipe".to_owned(), Value::from(asked.clone()))];
        let with = |asked: &Map<String, Value>, specific: [(&str, Value); 2]| {
            let specific = specific.into_iter().map(|(name, value)| (name.to_owned(), value));
            Provenance::of(decisive.clone().into_iter().chain(recipe(asked)).chain(specific).collect())
        };
        let (width_px, height_px) = (view.canvas.width_px, view.canvas.height_px);
        let mut hash = Sha256::new();
        fitness.iter().for_each(|value| hash.update(value.to_le_bytes()));
        let fitness_sha256 = hexadecimal(&hash.finalize());
        let told = [("fitness_sha256", json!(fitness_sha256)), ("tiles", json!(fitness.len()))];
        let population_told = with(&asked, told);
        let long_side_px = width_px.max(height_px);
        if long_side_px != population.width_px.max(population.height_px) {
            asked.insert("output-size".to_owned(), long_side_px.into());
        }
        let usual = View::new(population.width_px, population.height_px, Some(long_side_px)).supersampling;
        if view.supersampling != usual {
            asked.insert("supersample".to_owned(), view.supersampling.into());
        }
        let told = [("output_size_px", json!(long_side_px)), ("supersampling", json!(view.supersampling))];
        Self { picture: with(&asked, told), population: population_told }
    }

    fn of_output(&self, output: &Destination) -> &Provenance {
        if output.is_picture() { &self.picture } else { &self.population }
    }

    fn of_row(&self, options: &RenderOptions) -> &Provenance {
        if options.outputs.iter().any(Destination::is_picture) { &self.picture } else { &self.population }
    }

    /// The metadata of the outputs. Of `meta`, the metadata of the population's file, they keep the key of the
    /// evolution.
    fn told(&self, meta: &Map<String, Value>) -> Told {
        let origin = meta.get("origin_key").or_else(|| meta.get("key")).and_then(Value::as_str);
        // Other values may be too long for a picture's metadata.
        let origin = origin.filter(|key| key.len() == 64 && key.bytes().all(|byte| byte.is_ascii_hexdigit()));
        let describe = |provenance: &Provenance| {
            let mut told = provenance.describe(None);
            told.insert("origin_key".to_owned(), json!(origin));
            told.sort_keys();
            told
        };
        Told { picture: describe(&self.picture), population: describe(&self.population) }
    }
}
