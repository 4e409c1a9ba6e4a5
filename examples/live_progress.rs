//! Shows how a picture comes along, looks at its tiles meanwhile, and stops when it is good enough.
//!
//! `cargo run --release --example live_progress -- photo.jpg folder`

#![allow(clippy::print_stdout, reason = "an example tells what it made")]

use std::path::PathBuf;

use smalti::{Device, Picture, Recipe};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let photo = arguments.next().ok_or("name a picture")?;
    let folder: PathBuf = arguments.next().unwrap_or_else(|| ".".to_owned()).into();

    let (picture, device) = (Picture::open(photo)?, Device::auto()?);
    let mut last = (0, f64::INFINITY);
    let mosaic = Recipe::paint().tiles(500).size(192).make(&picture, &device, |progress| {
        let (tenth, error) = ((10.0 * progress.share()) as u32, progress.objective() as f64);
        if tenth == last.0 {
            return true;
        }
        let laid = progress.tiles().map_or(0, |tiles| tiles.len());
        println!("{:3.0} %: {laid} tiles, error {error}", 100.0 * progress.share());
        let goes_on = error < 0.98 * last.1;
        last = (tenth, error);
        goes_on
    })?;
    println!("ended by {} after {} evals", mosaic.stop_reason().word(), mosaic.evals());
    std::fs::write(folder.join("painting.png"), mosaic.png()?)?;
    Ok(())
}
