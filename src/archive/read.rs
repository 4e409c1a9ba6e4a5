//! From a `.npz` file to a population. Nothing in the file is trusted.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek};
use std::path::Path;

use npyz::{Deserialize, NpyFile, Order};
use serde_json::{Map, Value};
use zip::ZipArchive;
use zip::result::ZipError;

use super::array_header::{self, ARRAY_HEADER_BYTES_MAX};
use super::{Archive, GENE_COLUMNS, GroutEntry, HEADER_MEMBER, Header, SCHEMA};
use crate::error::{Error, Result, in_words};
use crate::guard;
use crate::model::fly::{Genes, SIDE_MAX, SIDE_MIN, UNITS_PER_PX};
use crate::model::grout::GROUT_WIDTH_MAX;
use crate::model::mask::{MASK_LAYERS_MAX, MASK_SIDE, Texel};
use crate::model::population::FLY_COUNT_MAX;
use crate::model::target::TARGET_SIDE_MAX_PX;
use crate::model::{Backdrop, Fly, Mask, MaskSet, Population};
use crate::photo::{self, Kind};

/// Most bytes of a column: eight per fly and an array header.
const COLUMN_BYTES_MAX: u64 = 8 * FLY_COUNT_MAX as u64 + ARRAY_HEADER_BYTES_MAX as u64 + 16;
/// Bytes at the beginning of a file that tell a picture.
const HEAD_BYTES: u64 = 64;
/// The refusal of a picture, which people give where its population is meant.
pub const IS_A_PICTURE: &str = "is a picture, which holds no population; name the .npz file of its population";
/// Most bytes that are taken from a pipe.
const PIPE_BYTES_MAX: u64 = 1 << 30;
/// Most bytes of `meta.json`.
const HEADER_BYTES_MAX: u64 = 1 << 20;

/// Reads the population at `path`, whether smalti or numpy wrote it.
///
/// Columns of floats may be f32 or f64; `fitness` may be absent. Values are rounded to the nearest gene; angles wrap.
///
/// # Errors
/// [`Error::Input`] with the name of the column if the file cannot be read, is not a population or lacks a column; if a
/// column has the wrong type or length; if a value is not finite, or out of a gene's range by more than rounding; or if
/// a fly wears a mask that does not exist.
pub fn read(path: &Path) -> Result<Archive> {
    guard::decoded(|| Members::open(path).and_then(read_population)).map_err(|reason| Error::input(path, reason))
}

/// As [`read`], of the population that a file of these bytes would hold.
///
/// # Errors
/// A sentence without the file's name.
pub fn decode(bytes: &[u8]) -> Result<Archive, String> {
    guard::decoded(|| Members::of(Cursor::new(bytes)).and_then(read_population))
}

/// The metadata of the population at `path`, without reading the population.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read or is not a population.
pub fn read_meta(path: &Path) -> Result<Map<String, Value>> {
    guard::decoded(|| Members::open(path)?.header())
        .map(|header| header.meta)
        .map_err(|reason| Error::input(path, reason))
}

/// Whether the file at `path` could be an `.npz` file that was cut short, perhaps with zeros after the cut: it lacks
/// the list of members at the end.
#[must_use]
pub fn is_cut_short(path: &Path) -> bool {
    const BEGIN: [u8; 4] = *b"PK\x03\x04";
    let Ok(mut file) = File::open(path) else { return false };
    let mut begin = Vec::new();
    if file.by_ref().take(BEGIN.len() as u64).read_to_end(&mut begin).is_err() {
        return false;
    }
    let length = begin.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    let opens = || guard::caught(|| ZipArchive::new(BufReader::new(file)).is_ok()).unwrap_or(false);
    BEGIN.starts_with(&begin[..length]) && !opens()
}

fn read_population<R: Read + Seek>(mut members: Members<R>) -> Result<Archive, String> {
    let header = members.header()?;
    let masks = members.masks()?.with_blend(header.blend.into());
    let columns = members.genes()?;
    check_ranges(&columns, &header)?;
    let [x, y, z, r, g, b, w, h, angle] = columns;
    let fly_count = x.len();
    let mask = members.column::<u16>("mask", "u16")?;
    let alive = members.column::<bool>("alive", "bool")?;
    let fitness = if members.has("fitness") { members.column("fitness", "i64")? } else { vec![0; fly_count] };
    let lengths = [("mask", mask.len()), ("alive", alive.len()), ("fitness", fitness.len())];
    if let Some((name, length)) = lengths.iter().find(|(_, length)| *length != fly_count) {
        return Err(format!("its column `{name}` has {length} values and `x` has {fly_count}; they must be as many"));
    }
    let layer_count = masks.layers().len();
    if let Some(fly) = mask.iter().position(|&mask| usize::from(mask) >= layer_count) {
        return Err(format!(
            "its column `mask` asks for mask {} and the file has {layer_count} (fly {fly})",
            mask[fly]
        ));
    }
    let flies = (0..fly_count)
        .map(|i| {
            let genes =
                Genes { x: x[i], y: y[i], z: z[i], r: r[i], g: g[i], b: b[i], w: w[i], h: h[i], angle_deg: angle[i] };
            let fly = Fly { alive: alive[i], ..Fly::from_genes(&genes, mask[i]) };
            fly.clamped(header.width_px, header.height_px)
        })
        .collect();
    let Header { width_px, height_px, background, transparent, grout, meta, .. } = header;
    let background = if transparent { Backdrop::Transparent } else { background.into() };
    let grout = grout.map(Into::into);
    Ok(Archive { population: Population { width_px, height_px, background, grout, masks, flies }, fitness, meta })
}

/// Least and largest value of each of [`GENE_COLUMNS`], and half the unit to which it is rounded; `None` for angles,
/// which wrap.
///
/// A value that is out of range by at most half a unit comes from rounding, and is rounded to the bound.
fn ranges(width_px: u32, height_px: u32) -> [Option<(f64, f64, f64)>; 9] {
    let px = f64::from(UNITS_PER_PX);
    let position = |side_px: u32| Some((0.0, f64::from(side_px - 1), 0.5 / px));
    let channel = Some((0.0, 1.0, 0.5 / 65_535.0));
    let side = Some((f64::from(SIDE_MIN) / px, f64::from(SIDE_MAX) / px, 0.5 / px));
    let depth = Some((-1.0, 1.0, 0.5 / f64::from(1 << 23)));
    [position(width_px), position(height_px), depth, channel, channel, channel, side, side, None]
}

/// Refuses genes that no fly of such a picture can have.
fn check_ranges(columns: &[Vec<f32>; 9], header: &Header) -> Result<(), String> {
    let ranges = ranges(header.width_px, header.height_px);
    for ((name, column), range) in GENE_COLUMNS.into_iter().zip(columns).zip(ranges) {
        let Some((least, most, slack)) = range else { continue };
        let allowed = least - slack..=most + slack;
        if let Some(fly) = column.iter().position(|&value| !allowed.contains(&f64::from(value))) {
            return Err(format!("its column `{name}` has {:?} (fly {fly}); it must be {least} to {most}", column[fly]));
        }
    }
    Ok(())
}

/// The members of a zip file. Every error is a sentence for the user.
struct Members<R> {
    zip: ZipArchive<R>,
}

impl Members<BufReader<File>> {
    fn open(path: &Path) -> Result<Self, String> {
        let unreadable = |error: io::Error| photo::why_unreadable(&error);
        let file = File::open(path).map_err(unreadable)?;
        let found = file.metadata().map_err(unreadable)?;
        // A folder can be opened; reading it would fail with a message of the zip reader.
        if found.is_dir() {
            return Err(unreadable(io::ErrorKind::IsADirectory.into()));
        }
        let file = if found.is_file() { file } else { spooled(file).map_err(unreadable)? };
        Self::of(BufReader::new(file))
    }
}

/// What comes through a pipe, as a file without a name: the list of members is at the end.
fn spooled(pipe: File) -> io::Result<File> {
    let mut file = tempfile::tempfile()?;
    io::copy(&mut pipe.take(PIPE_BYTES_MAX), &mut file)?;
    file.rewind()?;
    Ok(file)
}

impl<R: Read + Seek> Members<R> {
    fn of(mut file: R) -> Result<Self, String> {
        let unreadable = |error: io::Error| photo::why_unreadable(&error);
        let mut head = Vec::new();
        file.by_ref().take(HEAD_BYTES).read_to_end(&mut head).map_err(unreadable)?;
        file.rewind().map_err(unreadable)?;
        if matches!(photo::kind_of(&head), Kind::Read(_)) {
            return Err(IS_A_PICTURE.to_owned());
        }
        let wrong = |_| "is not a population: it is no .npz file, or is cut short; get the file again".to_owned();
        ZipArchive::new(file).map(|zip| Self { zip }).map_err(wrong)
    }

    fn has(&self, array: &str) -> bool {
        self.zip.index_for_name(&npyz::npz::file_name_from_array_name(array)).is_some()
    }

    /// The bytes of a member, at most `bytes_max`: a few bytes of a zip file may expand to terabytes.
    fn bytes(&mut self, member: &str, bytes_max: u64) -> Result<Vec<u8>, String> {
        let member_file = self.zip.by_name(member).map_err(|error| match error {
            ZipError::FileNotFound => format!("is not a population: it has no `{member}`"),
            ZipError::Io(error) => format!("its `{member}` cannot be read, since {}", in_words(&error)),
            _ => format!("its `{member}` is packed in a way that is not read, or is broken; get the file again"),
        })?;
        let mut bytes = Vec::new();
        member_file
            .take(bytes_max + 1)
            .read_to_end(&mut bytes)
            .map_err(|_| format!("its `{member}` is broken; get the file again"))?;
        if bytes.len() as u64 > bytes_max {
            return Err(format!("its `{member}` is larger than the limit of {bytes_max} bytes"));
        }
        Ok(bytes)
    }

    fn header(&mut self) -> Result<Header, String> {
        let bytes = self.bytes(HEADER_MEMBER, HEADER_BYTES_MAX)?;
        let header: Header = serde_json::from_slice(&bytes)
            .map_err(|error| format!("its `{HEADER_MEMBER}` does not describe a population ({error})"))?;
        if header.schema != SCHEMA {
            return Err(format!("has layout {}, this program reads {SCHEMA}; use a version that fits", header.schema));
        }
        let sides = 1..=TARGET_SIDE_MAX_PX;
        if !sides.contains(&header.width_px) || !sides.contains(&header.height_px) {
            return Err(format!(
                "its `{HEADER_MEMBER}` gives a picture of {}x{} px; sides must be 1 to {TARGET_SIDE_MAX_PX} px",
                header.width_px, header.height_px
            ));
        }
        if let Some(GroutEntry { width, .. }) = header.grout
            && !(1..=GROUT_WIDTH_MAX).contains(&width)
        {
            return Err(format!(
                "its `{HEADER_MEMBER}` gives grout of width {width}; it must be 1 to {GROUT_WIDTH_MAX}, in 1/64 px"
            ));
        }
        Ok(header)
    }

    /// The columns [`GENE_COLUMNS`], all of one length and finite.
    fn genes(&mut self) -> Result<[Vec<f32>; 9], String> {
        let mut columns: [Vec<f32>; 9] = Default::default();
        for (index, name) in GENE_COLUMNS.into_iter().enumerate() {
            let column = self.float_column(name)?;
            if let Some(fly) = column.iter().position(|value| !value.is_finite()) {
                return Err(format!("its column `{name}` has a value that is no finite number (fly {fly})"));
            }
            if index > 0 && column.len() != columns[0].len() {
                let (length, fly_count) = (column.len(), columns[0].len());
                return Err(format!(
                    "its column `{name}` has {length} values and `x` has {fly_count}; they must be as many"
                ));
            }
            columns[index] = column;
        }
        Ok(columns)
    }

    fn float_column(&mut self, name: &str) -> Result<Vec<f32>, String> {
        let bytes = self.array_bytes(name, COLUMN_BYTES_MAX)?;
        if array(name, &bytes)?.dtype().num_bytes() == Some(size_of::<f64>()) {
            let wide: Vec<f64> = column_of(name, &bytes, "f32 or f64")?;
            return Ok(wide.into_iter().map(|value| value as f32).collect());
        }
        column_of(name, &bytes, "f32 or f64")
    }

    fn column<T: Deserialize>(&mut self, name: &str, type_name: &str) -> Result<Vec<T>, String> {
        let bytes = self.array_bytes(name, COLUMN_BYTES_MAX)?;
        column_of(name, &bytes, type_name)
    }

    /// The layers `mask_0`, `mask_1`, ...; the first must be the square.
    fn masks(&mut self) -> Result<MaskSet, String> {
        let square = self.mask(0)?;
        if square != Mask::square() {
            return Err("its `mask_0` is not the full square; put other masks into `mask_1` and on".to_owned());
        }
        let mut others = Vec::new();
        while self.has(&format!("mask_{}", others.len() + 1)) && others.len() < MASK_LAYERS_MAX {
            others.push(self.mask(others.len() + 1)?);
        }
        MaskSet::with_layers(others).map_err(|error| error.to_string())
    }

    fn mask(&mut self, index: usize) -> Result<Mask, String> {
        let name = format!("mask_{index}");
        let bytes = self.array_bytes(&name, (MASK_SIDE * MASK_SIDE * 2 + ARRAY_HEADER_BYTES_MAX + 16) as u64)?;
        let array = array(&name, &bytes)?;
        let side = MASK_SIDE as u64;
        if array.shape() != [side, side, 2] || array.order() != Order::C {
            return Err(format!("its `{name}` is not {side}x{side}x2 in C order"));
        }
        let values: Vec<u8> =
            array.into_vec().map_err(|_| format!("its `{name}` is not of type u8, or is cut short"))?;
        let texels = values.as_chunks::<2>().0.iter().map(|&[coverage, shade]| Texel { coverage, shade }).collect();
        Mask::new(texels).map_err(|error| error.to_string())
    }

    fn array_bytes(&mut self, name: &str, bytes_max: u64) -> Result<Vec<u8>, String> {
        self.bytes(&npyz::npz::file_name_from_array_name(name), bytes_max)
    }
}

/// The array in a member, with its header parsed.
fn array<'a>(name: &str, bytes: &'a [u8]) -> Result<NpyFile<&'a [u8]>, String> {
    array_header::check(bytes).map_err(|reason| format!("its `{name}` {reason}"))?;
    NpyFile::new(bytes).map_err(|_| format!("its `{name}` is not an array of numpy"))
}

fn column_of<T: Deserialize>(name: &str, bytes: &[u8], type_name: &str) -> Result<Vec<T>, String> {
    let array = array(name, bytes)?;
    let &[length] = array.shape() else {
        return Err(format!("its column `{name}` has {} dimensions instead of one", array.shape().len()));
    };
    if length > FLY_COUNT_MAX as u64 {
        return Err(format!("its column `{name}` has {length} values, more than the limit of {FLY_COUNT_MAX} flies"));
    }
    let descr = array.dtype().descr();
    let wrong_type = || format!("its column `{name}` is of type {descr} instead of {type_name}");
    let values = array.data::<T>().map_err(|_| wrong_type())?;
    values.collect::<io::Result<Vec<T>>>().map_err(|_| format!("its column `{name}` is broken or cut short"))
}
