//! Does the `cells` search reach its targets? All figures are for one seed and for this machine, which should do
//! nothing else meanwhile.
//!
//! `cargo bench --bench targets -- FOLDER --small FOLDER_256 [--primg PROGRAM] [--primg-outputs FOLDER] [--only P,..]`
//! reads star, yin_yang, hats, parrots and woman (.png, 512x512) in FOLDER. The targets were set for 256x256 pictures
//! that another Lanczos filter made; without `--small`, smalti reduces the pictures itself.
//!
//! Parts: `likeness` (SAE of the style `free`), `rivals` (SAE of primg at equal numbers of shapes), `speed`, `mosaic`,
//! `paint`, and `growth` (cost of an eval from 256 to 4096 px; needs 4 GB).

#![allow(clippy::print_stdout, reason = "a bench prints its tables")]

#[path = "../common/mod.rs"]
mod common;
mod growth;
mod likeness;
mod mosaic;
mod paint;
mod report;
mod rivals;
mod speed;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Parser;
use smalti::cpu::cells::CpuSearch;
use smalti::metrics::Difference;
use smalti::model::Target;
use smalti::model::cells::Search;

use report::Report;

#[derive(Parser)]
struct Options {
    /// Folder with star.png, yin_yang.png, hats.png, parrots.png and woman.png of 512x512 px
    folder: PathBuf,
    /// Folder with the same pictures of 256x256 px
    #[arg(long)]
    small: Option<PathBuf>,
    /// The program of primg, to make what `--primg-outputs` lacks
    #[arg(long)]
    primg: Option<PathBuf>,
    /// Folder for what primg makes of the pictures of 256 px: NAME-N.png
    #[arg(long)]
    primg_outputs: Option<PathBuf>,
    /// Parts to measure
    #[arg(long, value_delimiter = ',', default_value = "likeness,rivals,speed,mosaic,paint,growth")]
    only: Vec<String>,
    /// Largest side of the part `growth`
    #[arg(long, default_value_t = 4096)]
    largest_px: u32,
    /// What `cargo bench` says to every bench
    #[arg(long, hide = true)]
    bench: bool,
}

/// The pictures, by name.
pub struct Gallery {
    small: BTreeMap<&'static str, (PathBuf, Arc<Target>)>,
    large: BTreeMap<&'static str, (PathBuf, Arc<Target>)>,
}

impl Gallery {
    fn read(options: &Options) -> Self {
        let read = |folder: &Path, side_px| {
            let pictures = common::cells::pictures(folder).into_iter();
            let pictures = pictures.map(|(name, path)| (name, (path.clone(), common::cells::read(&path, side_px))));
            pictures.collect::<BTreeMap<_, _>>()
        };
        let small = read(options.small.as_ref().unwrap_or(&options.folder), 256);
        let large = read(&options.folder, 512);
        let is_whole = |pictures: &BTreeMap<_, _>| pictures.len() == common::cells::PICTURES.len();
        assert!(is_whole(&small) && is_whole(&large), "each folder needs {:?} as .png", common::cells::PICTURES);
        Self { small, large }
    }

    /// The picture of this name with 256 or 512 px.
    fn target(&self, name: &str, side_px: u32) -> &Arc<Target> {
        let pictures = if side_px == 256 { &self.small } else { &self.large };
        &pictures[name].1
    }
}

/// What to search.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// The picture.
    pub target: &'a Arc<Target>,
    /// Number of tiles.
    pub fly_count: usize,
    /// Children tried in each step.
    pub candidates: u32,
    /// Children to evaluate in all.
    pub evals: u64,
}

impl Task<'_> {
    /// Searches on the CPU twin in the current pool, guide included, until the budget is spent or the objective is at
    /// most `enough`.
    pub fn search(&self, style: &str, enough: Option<i64>) -> (CpuSearch, Duration) {
        let began = Instant::now();
        let course = common::cells::course(self.target, style, self.fly_count, self.candidates);
        let mut search = CpuSearch::new(course);
        common::cells::search_until(&mut search, self.evals, enough);
        (search, began.elapsed())
    }

    /// The SAE of what the style `free` leads to, counted in the drawn picture.
    pub fn free_sae(&self) -> u64 {
        let (mut search, _) = self.search("free", None);
        let sae = drawn_sae(&mut search);
        assert_eq!(i64::try_from(sae), Ok(search.standing().objective), "without penalties the objective is the SAE");
        sae
    }
}

/// The SAE of what a search has come to, counted in the drawn picture.
pub fn drawn_sae(search: &mut dyn Search) -> u64 {
    let mosaic = common::cells::draw(search);
    Difference::between(search.course().target.pixels(), &mosaic.pixels).sae()
}

fn main() {
    let options = Options::parse();
    let gallery = Gallery::read(&options);
    let mut report = Report::default();
    for part in &options.only {
        match part.as_str() {
            "likeness" => likeness::measure(&gallery, &mut report),
            "rivals" => rivals::measure(&gallery, &options, &mut report),
            "speed" => speed::measure(&gallery, &mut report),
            "mosaic" => mosaic::measure(&gallery, &mut report),
            "paint" => paint::measure(&gallery, &mut report),
            "growth" => growth::measure(&gallery, options.largest_px, &mut report),
            _ => panic!("no part is called {part}; see benches/targets/main.rs"),
        }
    }
    report.finish();
}
