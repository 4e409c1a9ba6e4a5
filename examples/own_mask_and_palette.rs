//! Tiles of a shape of one's own, in colours of one's own.
//!
//! `cargo run --release --example own_mask_and_palette -- photo.jpg folder`

use std::path::PathBuf;

use smalti::{Device, Mask, Picture, Recipe, Shader};

const LEAF: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10">
    <path d="M0 5 Q5 -2 10 5 Q5 12 0 5 Z" fill="white"/></svg>"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let photo = arguments.next().ok_or("name a picture")?;
    let folder: PathBuf = arguments.next().unwrap_or_else(|| ".".to_owned()).into();

    let recipe = Recipe::new()
        .tiles(600)
        .size(192)
        .masks([Mask::from_encoded(LEAF.as_bytes())?, Mask::named("disc")?])
        .shader(Shader::Flat)
        .palette(&[[20, 30, 60], [200, 60, 40], [240, 200, 80], [60, 120, 70], [245, 240, 230]]);
    let mosaic = recipe.make(&Picture::open(photo)?, &Device::auto()?, |_| true)?;
    std::fs::write(folder.join("leaves.webp"), mosaic.webp()?)?;
    Ok(())
}
