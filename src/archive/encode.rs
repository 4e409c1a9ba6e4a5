//! From a population to the bytes of a `.npz` file.

use std::io::{Cursor, Write};

use npyz::{AutoSerialize, DType, WriterBuilder};
use serde_json::{Map, Value};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipWriter};

use super::{GENE_COLUMNS, HEADER_KEYS, HEADER_MEMBER, Header, SCHEMA};
use crate::error::{Error, Result};
use crate::model::fly::Genes;
use crate::model::mask::MASK_SIDE;
use crate::model::population::FLY_COUNT_MAX;
use crate::model::{Backdrop, Fly, Mask, Population};

/// Deflate level of every member, 1 to 9.
const LEVEL: i64 = 6;
/// Deflate level of what is compressed in a snapshot.
const SNAPSHOT_LEVEL: i64 = 1;

/// What to save: bytes of the file, or time to write it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Thrift {
    Bytes,
    /// Genes are not compressed: they are nearly random, so compressing them takes most of the time and saves only a
    /// third of their bytes.
    Time,
}

/// The population, with the marginal fitness of each fly, as a `.npz` file. `meta` goes into its `meta.json`.
///
/// # Errors
/// [`Error::Parameter`] if there is not one fitness per fly, if `meta` holds one of the keys that say how to read the
/// file (`schema`, `width_px`, `height_px`, `background`, `transparent`, `blend`, `grout`), or if there are more than
/// [`FLY_COUNT_MAX`] flies; [`Error::Encoding`] if the file would be larger than its format allows.
pub fn encode(population: &Population, fitness: &[i64], meta: &Map<String, Value>) -> Result<Vec<u8>> {
    let fly_count = population.flies.len();
    if fly_count != fitness.len() || fly_count > FLY_COUNT_MAX {
        let reason = format!(
            "{fly_count} flies with {} values of fitness cannot be written: each fly needs one, and there may be at most \
             {FLY_COUNT_MAX}",
            fitness.len()
        );
        return Err(Error::parameter("population", reason));
    }
    encode_members(population, Some(fitness), meta, Thrift::Bytes)
}

/// The population as [`encode`] writes it, but without marginal fitness and in less time: for the many populations on
/// the way to a result.
///
/// # Errors
/// [`Error::Parameter`], as from [`encode`].
pub fn encode_snapshot(population: &Population, meta: &Map<String, Value>) -> Result<Vec<u8>> {
    encode_members(population, None, meta, Thrift::Time)
}

fn encode_members(
    population: &Population,
    fitness: Option<&[i64]>,
    meta: &Map<String, Value>,
    thrift: Thrift,
) -> Result<Vec<u8>> {
    if let Some(key) = HEADER_KEYS.iter().find(|&&key| meta.contains_key(key)) {
        return Err(Error::parameter("metadata", format!("a population cannot have a `{key}`: the file has its own")));
    }
    write_members(population, fitness, meta, Members::new(thrift)).map_err(|error| Error::Encoding {
        what: "population",
        format: "npz",
        reason: error.to_string(),
    })
}

fn write_members(
    population: &Population,
    fitness: Option<&[i64]>,
    meta: &Map<String, Value>,
    mut members: Members,
) -> zip::result::ZipResult<Vec<u8>> {
    let flies = &population.flies;
    for (column, name) in GENE_COLUMNS.into_iter().enumerate() {
        members.add_column(name, "<f4", flies.iter().map(|fly| gene_values(fly)[column]))?;
    }
    if let Some(fitness) = fitness {
        members.add_column("fitness", "<i8", fitness.iter().copied())?;
    }
    members.add_column("mask", "<u2", flies.iter().map(|fly| fly.mask))?;
    members.add_column("alive", "|b1", flies.iter().map(|fly| fly.alive))?;
    for (index, mask) in population.masks.layers().iter().enumerate() {
        members.add_mask(index, mask)?;
    }
    let header = Header {
        schema: SCHEMA,
        width_px: population.width_px,
        height_px: population.height_px,
        background: population.background.color(),
        transparent: population.background == Backdrop::Transparent,
        blend: population.masks.blend().into(),
        grout: population.grout.map(Into::into),
        meta: meta.clone(),
    };
    members.start(HEADER_MEMBER)?;
    members.zip.write_all(&serde_json::to_vec_pretty(&header).map_err(std::io::Error::from)?)?;
    Ok(members.zip.finish()?.into_inner())
}

/// The genes of a fly in the order of [`GENE_COLUMNS`].
fn gene_values(fly: &Fly) -> [f32; 9] {
    let Genes { x, y, z, r, g, b, w, h, angle_deg } = fly.genes();
    [x, y, z, r, g, b, w, h, angle_deg]
}

/// The zip file under construction.
struct Members {
    zip: ZipWriter<Cursor<Vec<u8>>>,
    thrift: Thrift,
}

impl Members {
    fn new(thrift: Thrift) -> Self {
        Self { zip: ZipWriter::new(Cursor::new(Vec::new())), thrift }
    }

    /// Begins a member. Date, permissions, system and level are fixed, so only the content decides the bytes.
    fn start(&mut self, name: &str) -> zip::result::ZipResult<()> {
        let is_gene = || GENE_COLUMNS.iter().any(|column| npyz::npz::file_name_from_array_name(column) == name);
        let (method, level) = match self.thrift {
            Thrift::Bytes => (CompressionMethod::Deflated, Some(LEVEL)),
            Thrift::Time if is_gene() => (CompressionMethod::Stored, None),
            Thrift::Time => (CompressionMethod::Deflated, Some(SNAPSHOT_LEVEL)),
        };
        let options = SimpleFileOptions::default()
            .compression_method(method)
            .compression_level(level)
            .last_modified_time(DateTime::default())
            .unix_permissions(0o644)
            .system(System::Unix);
        self.zip.start_file(name, options)
    }

    fn add_column<T: AutoSerialize>(
        &mut self,
        name: &str,
        type_string: &str,
        values: impl ExactSizeIterator<Item = T>,
    ) -> zip::result::ZipResult<()> {
        self.add_array(name, type_string, &[values.len() as u64], values)
    }

    fn add_mask(&mut self, index: usize, mask: &Mask) -> zip::result::ZipResult<()> {
        let texels = mask.texels().iter().flat_map(|texel| [texel.coverage, texel.shade]);
        self.add_array(&format!("mask_{index}"), "|u1", &[MASK_SIDE as u64, MASK_SIDE as u64, 2], texels)
    }

    fn add_array<T: AutoSerialize>(
        &mut self,
        name: &str,
        type_string: &str,
        shape: &[u64],
        values: impl Iterator<Item = T>,
    ) -> zip::result::ZipResult<()> {
        let dtype = DType::Plain(type_string.parse().expect("the type strings of this file are valid"));
        // The array is built first and compressed in one call; value by value, the compressor would be called a million
        // times.
        let mut bytes = Vec::new();
        let mut array = npyz::WriteOptions::new().dtype(dtype).shape(shape).writer(&mut bytes).begin_nd()?;
        array.extend(values)?;
        array.finish()?;
        self.start(&npyz::npz::file_name_from_array_name(name))?;
        Ok(self.zip.write_all(&bytes)?)
    }
}
