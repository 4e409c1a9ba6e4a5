//! Populations as tables for other programs: CSV and JSON, one row per fly, with the columns of the `.npz` file.
//!
//! Numbers are the shortest decimals that give the same f32 back, so a table is as exact as the `.npz`; `color` repeats
//! `r g b` as tiles show it. A CSV has no place for metadata except its columns. So every row repeats in its last
//! columns what decides whether the file may be replaced; a JSON table has that in `meta`. A CSV has the living flies
//! only, since for other programs every row is a tile; a JSON table has all.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::BlendName;
use crate::error::{Error, Result};
use crate::model::fly::Genes;
use crate::model::target::hexadecimal;
use crate::model::{Backdrop, Fly, Population};
use crate::photo;

/// First line of every CSV table.
const CSV_HEADER: &[u8] = b"x,y,z,r,g,b,w,h,angle,mask,alive,fitness,color,status,restarts_made,sae,key\n";
/// What the first line ends with if flies were left out: a column that tells how many rows there are, without which a
/// table that was cut short could pass for a whole one.
const ROW_COUNT_COLUMN: &[u8] = b",living";
/// Where the column `alive` is.
const ALIVE_COLUMN: usize = 10;
/// Number of digits of a key that a row of a table holds.
pub const KEY_DIGITS: usize = 16;
/// The first two lines of a CSV table are searched for in this many bytes, many times what they need.
const HEAD_BYTES_MAX: u64 = 1 << 12;
/// The beginning of every JSON table. The metadata follows on the same line, so it can be read without the rows.
const JSON_HEAD: &str = "{\"meta\":";
/// Most bytes of the first line of a JSON table that is read.
const META_BYTES_MAX: u64 = 1 << 20;

/// One fly. The fields have the order of the columns.
#[derive(Serialize)]
struct FlyRow {
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

impl FlyRow {
    fn new(fly: &Fly, fitness: i64) -> Self {
        let Genes { x, y, z, r, g, b, w, h, angle_deg } = fly.genes();
        let color = hexadecimal(fly.color());
        Self { x, y, z, r, g, b, w, h, angle: angle_deg, mask: fly.mask, alive: fly.alive, fitness, color }
    }
}

/// The last columns of a CSV; empty where the metadata has no such key.
#[derive(Serialize)]
struct LastColumns<'a> {
    status: &'a str,
    restarts_made: Option<u64>,
    sae: Option<u64>,
    key: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    living: Option<usize>,
}

impl<'a> LastColumns<'a> {
    fn new(meta: &'a Map<String, Value>, living: Option<usize>) -> Self {
        let text = |name| meta.get(name).and_then(Value::as_str).unwrap_or_default();
        let number = |name| meta.get(name).and_then(Value::as_u64);
        let key = text("key");
        Self {
            status: text("status"),
            restarts_made: number("restarts_made"),
            sae: number("sae"),
            key: key.get(..KEY_DIGITS).unwrap_or(key),
            living,
        }
    }
}

fn rows<'a>(population: &'a Population, fitness: &'a [i64]) -> impl Iterator<Item = FlyRow> + 'a {
    population.flies.iter().zip(fitness).map(|(fly, &fitness)| FlyRow::new(fly, fitness))
}

/// The living flies with their marginal fitness as CSV: a line of names, then a line per fly, which ends with `status`,
/// `restarts_made`, `sae` and the first [`KEY_DIGITS`] digits of `key`, all from `meta`. If some flies do not live, a
/// last column tells how many do.
///
/// # Errors
/// [`Error::Internal`] if the rows cannot be encoded.
pub fn encode_csv(population: &Population, fitness: &[i64], meta: &Map<String, Value>) -> Result<Vec<u8>> {
    let living = population.flies.iter().filter(|fly| fly.alive).count();
    let has_dead = living < population.flies.len();
    let last = LastColumns::new(meta, has_dead.then_some(living));
    let failed = |error: &dyn std::fmt::Display| Error::Internal(format!("no CSV: {error}"));
    let mut csv = csv::WriterBuilder::new().has_headers(false).from_writer(csv_header(has_dead));
    for row in rows(population, fitness).filter(|row| row.alive) {
        csv.serialize((row, &last)).map_err(|error| failed(&error))?;
    }
    csv.into_inner().map_err(|error| failed(&error))
}

/// The first line of a CSV table; `has_dead` tells whether flies were left out.
fn csv_header(has_dead: bool) -> Vec<u8> {
    let mut header = CSV_HEADER.trim_ascii_end().to_vec();
    if has_dead {
        header.extend(ROW_COUNT_COLUMN);
    }
    header.push(b'\n');
    header
}

/// Whether these are the bytes of a whole CSV table of `fly_count` flies, as [`encode_csv`] writes it today. Older
/// versions wrote dead flies, too; such a table is to be made anew.
#[must_use]
pub fn is_whole_csv(bytes: &[u8], fly_count: usize) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    if !text.ends_with('\n') || text.contains('\0') {
        return false;
    }
    let mut rows = text.lines();
    let header = rows.next().unwrap_or_default().as_bytes();
    let has_dead = match header.strip_prefix(CSV_HEADER.trim_ascii_end()) {
        Some(b"") => false,
        Some(more) if more == ROW_COUNT_COLUMN => true,
        _ => return false,
    };
    let (mut count, mut living) = (0, None);
    for row in rows {
        count += 1;
        if has_dead {
            living = row.rsplit(',').next().and_then(|cell| cell.parse::<usize>().ok());
        } else if row.split(',').nth(ALIVE_COLUMN) == Some("false") {
            return false;
        }
    }
    if has_dead { living == Some(count) } else { count == fly_count }
}

/// Whether the file at `path` is a CSV table without any row, which nobody can miss.
#[must_use]
pub fn is_csv_without_rows(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD_BYTES_MAX).read_to_end(&mut head));
    read.is_ok() && [false, true].into_iter().any(|has_dead| head == csv_header(has_dead))
}

/// `status`, `restarts_made`, `sae` and `key` from the first row of the CSV table at `path`; `None` if smalti did not
/// write the table, or if it has no fly.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read.
pub fn read_csv_meta(path: &Path) -> Result<Option<Map<String, Value>>> {
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(HEAD_BYTES_MAX).read_to_end(&mut head))
        .map_err(|error| Error::input(path, photo::why_unreadable(&error)))?;
    let table =
        [false, true].into_iter().find_map(|has_dead| Some((head.strip_prefix(&*csv_header(has_dead))?, has_dead)));
    let Some((rows, has_dead)) = table else { return Ok(None) };
    let row = rows.split(|&byte| byte == b'\n').next().and_then(|row| std::str::from_utf8(row).ok());
    let Some(row) = row else { return Ok(None) };
    let from_last = |column: usize| row.rsplit(',').nth(column + usize::from(has_dead)).unwrap_or_default();
    let [key, sae, restarts_made, status] = [0, 1, 2, 3].map(from_last);
    let is_key = key.len() == KEY_DIGITS && key.bytes().all(|byte| byte.is_ascii_hexdigit());
    let number = |text: &str| text.parse::<u64>().map_or(Value::Null, Value::from);
    let meta = [
        ("key", Value::from(key)),
        ("sae", number(sae)),
        ("restarts_made", number(restarts_made)),
        ("status", Value::from(status)),
    ];
    Ok(is_key.then(|| meta.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()))
}

/// The flies with their marginal fitness as one JSON object, one fly per line, with `meta` under that name.
///
/// # Errors
/// [`Error::Internal`] if the rows cannot be encoded.
pub fn encode_json(population: &Population, fitness: &[i64], meta: &Map<String, Value>) -> Result<Vec<u8>> {
    let Population { width_px, height_px, background, grout, masks, .. } = population;
    let grout = grout.map(|grout| ("grout", json!({"width": grout.width, "color": hexadecimal(grout.color)})));
    let mut text = format!("{JSON_HEAD}{},\n", Value::Object(meta.clone())).into_bytes();
    let header = [
        ("width_px", json!(width_px)),
        ("height_px", json!(height_px)),
        ("background", json!(background_word(*background))),
        ("blend", json!(BlendName::from(masks.blend()))),
        ("masks", json!(masks.layers().len())),
    ];
    for (name, value) in header.into_iter().chain(grout) {
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

/// A colour as `#rrggbb`, or `transparent`.
fn background_word(background: Backdrop) -> String {
    match background {
        Backdrop::Color(color) => hexadecimal(color),
        Backdrop::Transparent => "transparent".to_owned(),
    }
}

/// The `meta` of the JSON table at `path`, without reading its rows; `None` if smalti did not write the table.
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
