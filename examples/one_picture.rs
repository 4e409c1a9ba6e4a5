//! One picture as a mosaic: its tiles as numbers, and as an SVG, a PNG and a population.
//!
//! `cargo run --release --example one_picture -- photo.jpg folder`

#![allow(clippy::print_stdout, reason = "an example tells what it made")]

use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let photo = arguments.next().ok_or("name a picture")?;
    let folder: PathBuf = arguments.next().unwrap_or_else(|| ".".to_owned()).into();

    let picture = smalti::Picture::open(photo)?;
    let device = smalti::Device::auto()?;
    let recipe = smalti::Recipe::mosaic().tiles(1_000).size(256).seed(7);
    let mosaic = recipe.make(&picture, &device, |_| true)?;

    let largest = mosaic.tiles().max_by(|one, other| one.size_px().0.total_cmp(&other.size_px().0));
    println!("SAE {}, {} tiles, the widest {largest:?}", mosaic.sae(), mosaic.tiles().count());
    std::fs::write(folder.join("mosaic.svg"), mosaic.svg()?)?;
    std::fs::write(folder.join("mosaic.npz"), mosaic.npz()?)?;
    std::fs::write(folder.join("poster.png"), mosaic.resized(1_024, &device)?.png()?)?;
    Ok(())
}
