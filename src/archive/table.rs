//! Populations as tables for other programs: CSV and JSON, one row per fly, with the columns of the `.npz` file.
//!
//! Numbers are the shortest decimals that give the same f32 back, so a table is as exact as the `.npz`; `color` repeats
//! `r g b` as tiles show it. A CSV holds nothing but the table, so it cannot tell how it came to be.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::BlendName;
use crate::error::{Error, Result};
use crate::model::fly::Genes;
use crate::model::{Fly, Population};
use crate::photo;

/// First line of every CSV table.
const CSV_HEADER: &[u8] = b"x,y,z,r,g,b,w,h,angle,mask,alive,fitness,color\n";
/// What the first line of every JSON table begins with; the metadata follows, so that it is known without the rows.
const JSON_HEAD: &str = "{\"meta\":";
/// Most bytes of the first line of a JSON table that is read.
const META_BYTES_MAX: u64 = 1 << 20;

/// One fly; the order of the fields is that of the columns.
#[derive(Serialize)]
struct Row {
    x: f32,
    y: f32,
    z: f32,
    r: f32,
    g: f32,
    b: f32,
    w: f32,
    h: f32,
    angle: f32,
    mask: u16,
    alive: bool,
    fitness: i64,
    color: String,
}

impl Row {
    fn new(fly: &Fly, fitness: i64) -> Self {
        let Genes { x, y, z, r, g, b, w, h, angle_deg } = fly.genes();
        let color = hexadecimal(fly.color());
        Self { x, y, z, r, g, b, w, h, angle: angle_deg, mask: fly.mask, alive: fly.alive, fitness, color }
    }
}

fn hexadecimal([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn rows<'a>(population: &'a Population, fitness: &'a [i64]) -> impl Iterator<Item = Row> + 'a {
    population.flies.iter().zip(fitness).map(|(fly, &fitness)| Row::new(fly, fitness))
}

/// The flies with their marginal fitness as CSV: a line of names, then a line per fly.
///
/// # Errors
/// [`Error::Internal`] if the rows cannot be spelt.
pub fn encode_csv(population: &Population, fitness: &[i64]) -> Result<Vec<u8>> {
    let failed = |error: &dyn std::fmt::Display| Error::Internal(format!("no CSV: {error}"));
    let mut csv = csv::WriterBuilder::new().has_headers(false).from_writer(CSV_HEADER.to_vec());
    for row in rows(population, fitness) {
        csv.serialize(row).map_err(|error| failed(&error))?;
    }
    csv.into_inner().map_err(|error| failed(&error))
}

/// Whether the file at `path` begins as a table of [`encode_csv`].
#[must_use]
pub fn is_csv_table(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(CSV_HEADER.len() as u64).read_to_end(&mut head));
    read.is_ok() && head == CSV_HEADER
}

/// The flies with their marginal fitness as one JSON object, a fly a line; `meta` goes in under that name.
///
/// # Errors
/// [`Error::Internal`] if the rows cannot be spelt.
pub fn encode_json(population: &Population, fitness: &[i64], meta: &Map<String, Value>) -> Result<Vec<u8>> {
    let Population { width_px, height_px, background, masks, .. } = population;
    let mut text = format!("{JSON_HEAD}{},\n", Value::Object(meta.clone())).into_bytes();
    for (name, value) in [
        ("width_px", json!(width_px)),
        ("height_px", json!(height_px)),
        ("background", json!(hexadecimal(*background))),
        ("blend", json!(BlendName::from(masks.blend()))),
        ("masks", json!(masks.layers().len())),
    ] {
        text.extend(format!("\"{name}\":{value},\n").bytes());
    }
    text.extend(b"\"flies\":[");
    for (index, row) in rows(population, fitness).enumerate() {
        text.extend(if index == 0 { "\n" } else { ",\n" }.bytes());
        serde_json::to_writer(&mut text, &row).map_err(|error| Error::Internal(format!("no JSON: {error}")))?;
    }
    text.extend(b"\n]}\n");
    Ok(text)
}

/// The `meta` of the JSON table at `path`, without reading its rows; `None` if it is not one of ours.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub fn read_json_meta(path: &Path) -> Result<Option<Map<String, Value>>> {
    let mut line = Vec::new();
    File::open(path)
        .and_then(|file| BufReader::new(file).take(META_BYTES_MAX).read_until(b'\n', &mut line))
        .map_err(|error| Error::input(path, photo::why_unreadable(&error)))?;
    let meta = std::str::from_utf8(&line).ok().and_then(|line| line.strip_prefix(JSON_HEAD)?.strip_suffix(",\n"));
    Ok(meta.and_then(|meta| serde_json::from_str(meta).ok()))
}
