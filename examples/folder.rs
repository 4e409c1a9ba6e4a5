//! All pictures of a folder on one device, side by side.
//!
//! `cargo run --release --example folder -- photos mosaics`

#![allow(clippy::print_stdout, reason = "an example tells what it made")]

use std::path::PathBuf;

use smalti::{Device, Mosaic, Picture, Recipe, make_all};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (from, to) = (arguments.next().ok_or("name a folder")?, arguments.next().ok_or("name another folder")?);
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(from)?.map(|entry| Ok(entry?.path())).collect::<Result<_, std::io::Error>>()?;
    paths.sort();
    std::fs::create_dir_all(&to)?;

    let recipe = Recipe::spray().tiles(150).size(96);
    // Pictures are read as they are needed; one that cannot be read does not stop the others.
    let tasks = paths.iter().map(|path| Ok((Picture::open(path)?, recipe.clone())));
    let mut failed = 0;
    let keep = |number: usize, mosaic: smalti::Result<Mosaic>| {
        let stem = paths[number].file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let write = || -> Result<(), Box<dyn std::error::Error>> {
            Ok(std::fs::write(PathBuf::from(&to).join(stem + ".jpg"), mosaic?.jpeg()?)?)
        };
        if let Err(error) = write() {
            failed += 1;
            eprintln!("picture {number}: {error}");
        }
        true
    };
    make_all(&Device::auto()?, tasks, || true, keep)?;
    println!("{} made, {failed} failed", paths.len() - failed);
    Ok(())
}
