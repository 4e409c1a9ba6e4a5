//! Populations as files: exact when they are ours, and one sentence for whatever is no population.

use std::fs;
use std::io::{Cursor, Read, Write};
use std::path::Path;

use serde_json::{Map, Value, json};
use smalti::Error;
use smalti::archive::{Archive, encode, read};
use smalti::model::mask::Texel;
use smalti::model::{Fly, Grout, Mask, MaskSet, Population};
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use super::{noise, short_hash};

const SIDE_PX: u32 = 300;

pub fn population() -> Population {
    let flies = noise(500 * 16).as_chunks::<16>().0.iter().map(fly_of).collect();
    let texels = noise(256 * 256 * 2);
    let texels = texels.as_chunks::<2>().0.iter().map(|&[coverage, shade]| Texel { coverage, shade });
    let masks = MaskSet::with_layers(vec![Mask::new(texels.collect()).expect("256x256 texels")]);
    Population {
        width_px: SIDE_PX,
        height_px: SIDE_PX,
        background: [1, 2, 3].into(),
        grout: None,
        masks: masks.expect("two layers"),
        flies,
    }
}

fn fly_of(bytes: &[u8; 16]) -> Fly {
    let wide = |i: usize| u16::from_le_bytes([bytes[i], bytes[i + 1]]);
    let fly = Fly {
        x: i32::from(wide(0)),
        y: i32::from(wide(1)),
        z: u32::from(wide(2)) << 8 | u32::from(bytes[0]),
        r: wide(4),
        g: wide(5),
        b: wide(6),
        angle: wide(7),
        w: u32::from(wide(8)),
        h: u32::from(wide(9)) << 2,
        mask: u16::from(bytes[10] % 2),
        alive: bytes[11] > 50,
    };
    fly.clamped(SIDE_PX, SIDE_PX)
}

pub fn fitness() -> Vec<i64> {
    (0..500).map(|i| (i - 250) * 1_000_000_007_i64).collect()
}

fn meta() -> Map<String, Value> {
    let Value::Object(meta) =
        json!({"scheme": "cells", "seed": u64::MAX, "cool": 0.1 + 0.2, "versions": {"smalti": "1"}})
    else {
        unreachable!("it is an object");
    };
    meta
}

fn ours() -> Vec<u8> {
    encode(&population(), &fitness(), &meta()).expect("it can be encoded")
}

fn read_bytes(bytes: &[u8]) -> smalti::Result<Archive> {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    fs::write(file.path(), bytes).expect("it can be written");
    read(file.path())
}

fn refusal(bytes: &[u8]) -> String {
    match read_bytes(bytes) {
        Err(Error::Input { reason, .. }) => reason,
        other => panic!("a refusal was expected, not {other:?}"),
    }
}

#[test]
fn a_population_comes_back_as_it_was() {
    let archive = read_bytes(&ours()).expect("it is ours");
    assert!(archive.population == population());
    assert_eq!(archive.fitness, fitness());
    assert_eq!(archive.meta, meta());
}

/// `meta.json` of a file, with its keys in place.
fn header(bytes: &[u8]) -> Value {
    let Members(members) = Members::of(bytes);
    let (_, text) = members.iter().find(|(name, _)| name == "meta.json").expect("it is there");
    serde_json::from_slice(text).expect("it is JSON")
}

#[test]
fn grout_comes_back_as_it_was_and_a_file_without_any_does_not_speak_of_it() {
    let grouted = Population { grout: Some(Grout { width: 77, color: [250, 0, 9] }), ..population() };
    let bytes = encode(&grouted, &fitness(), &meta()).expect("it can be encoded");
    assert_eq!(header(&bytes)["grout"], json!({"width": 77, "color": [250, 0, 9]}));
    let archive = read_bytes(&bytes).expect("it is ours");
    assert_eq!(archive.population.grout, grouted.grout);
    assert!(encode(&archive.population, &archive.fitness, &archive.meta).expect("it can be encoded") == bytes);
    assert_eq!(header(&ours()).get("grout"), None);
    for width in [0, 131_073] {
        let mut told = header(&bytes);
        told["grout"]["width"] = json!(width);
        let message = refusal(&Members::of(&bytes).with("meta.json", told.to_string().into_bytes()).zipped());
        let expected = format!("its `meta.json` gives grout of width {width}; it must be 1 to 131072, in 1/64 px");
        assert_eq!(message, expected);
    }
}

#[test]
fn an_empty_population_comes_back_as_it_was() {
    let empty = Population { flies: vec![], masks: MaskSet::default(), ..population() };
    let bytes = encode(&empty, &[], &Map::new()).expect("it can be encoded");
    assert_eq!(
        read_bytes(&bytes).expect("it is ours"),
        Archive { population: empty, fitness: vec![], meta: Map::new() }
    );
}

#[test]
fn saving_what_was_loaded_gives_the_same_bytes_and_always_the_same() {
    let bytes = ours();
    let archive = read_bytes(&bytes).expect("it is ours");
    assert!(encode(&archive.population, &archive.fitness, &archive.meta).expect("it can be encoded") == bytes);
    assert_eq!(short_hash(&bytes), "7bc374764010e815");
}

#[test]
fn what_cannot_be_read_back_is_not_written() {
    let population = population();
    assert!(encode(&population, &fitness()[1..], &meta()).is_err());
    for key in ["width_px", "grout"] {
        let mut reserved = meta();
        reserved.insert(key.to_owned(), json!(1));
        assert!(encode(&population, &fitness(), &reserved).is_err());
    }
}

/// The members of a `.npz` file, to be changed and zipped again.
pub struct Members(Vec<(String, Vec<u8>)>);

impl Members {
    pub fn of(bytes: &[u8]) -> Self {
        let mut zip = ZipArchive::new(Cursor::new(bytes)).expect("it is a zip file");
        let names: Vec<String> =
            (0..zip.len()).map(|i| zip.name_for_index(i).expect("it is there").expect("ASCII").into_owned()).collect();
        Self(
            names
                .into_iter()
                .map(|name| {
                    let mut content = Vec::new();
                    zip.by_name(&name).expect("it is there").read_to_end(&mut content).expect("it is whole");
                    (name, content)
                })
                .collect(),
        )
    }

    pub fn content(&self, name: &str) -> &[u8] {
        &self.0.iter().find(|(member, _)| member == name).expect("it is there").1
    }

    pub fn without(mut self, name: &str) -> Self {
        self.0.retain(|(member, _)| member != name);
        self
    }

    pub fn with(self, name: &str, content: Vec<u8>) -> Self {
        let mut others = self.without(name);
        others.0.push((name.to_owned(), content));
        others
    }

    pub fn zipped(self) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, content) in self.0 {
            zip.start_file(name, SimpleFileOptions::default()).expect("a new member");
            zip.write_all(&content).expect("memory is there");
        }
        zip.finish().expect("memory is there").into_inner()
    }
}

/// An array as numpy writes it.
pub fn npy(descr: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    let header = format!("{header:<117}\n");
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), values].concat()
}

fn refusal_with(name: &str, content: Vec<u8>) -> String {
    refusal(&Members::of(&ours()).with(name, content).zipped())
}

#[test]
fn columns_of_wide_and_of_big_endian_floats_are_read() {
    let population = population();
    let wide: Vec<u8> = population.flies.iter().flat_map(|fly| f64::from(fly.genes().x).to_le_bytes()).collect();
    let big: Vec<u8> = population.flies.iter().flat_map(|fly| fly.genes().y.to_be_bytes()).collect();
    let members =
        Members::of(&ours()).with("x.npy", npy("<f8", "(500,)", &wide)).with("y.npy", npy(">f4", "(500,)", &big));
    assert!(read_bytes(&members.zipped()).expect("it is a population").population == population);
}

#[test]
fn without_fitness_every_fly_has_none() {
    let archive = read_bytes(&Members::of(&ours()).without("fitness.npy").zipped()).expect("it is a population");
    assert_eq!(archive.fitness, vec![0; 500]);
}

/// The file with fly 7 changed in one column of floats.
fn with_value(column: &str, value: f32) -> Vec<u8> {
    let genes = population().flies.iter().map(Fly::genes).collect::<Vec<_>>();
    let of = |index: usize| match column {
        "x" => genes[index].x,
        "y" => genes[index].y,
        "z" => genes[index].z,
        "r" => genes[index].r,
        "g" => genes[index].g,
        "b" => genes[index].b,
        "w" => genes[index].w,
        "h" => genes[index].h,
        _ => genes[index].angle_deg,
    };
    let values = (0..500).flat_map(|index| if index == 7 { value } else { of(index) }.to_le_bytes());
    Members::of(&ours()).with(&format!("{column}.npy"), npy("<f4", "(500,)", &values.collect::<Vec<_>>())).zipped()
}

#[test]
fn genes_that_no_fly_can_have_are_refused_with_column_and_fly() {
    for (column, value, message) in [
        ("x", 299.02, "its column `x` has 299.02 (fly 7); it must be 0 to 299"),
        ("x", -1e30, "its column `x` has -1e30 (fly 7); it must be 0 to 299"),
        ("y", -0.01, "its column `y` has -0.01 (fly 7); it must be 0 to 299"),
        ("z", 1.0001, "its column `z` has 1.0001 (fly 7); it must be -1 to 1"),
        ("r", 255.0, "its column `r` has 255.0 (fly 7); it must be 0 to 1"),
        ("g", -0.0001, "its column `g` has -0.0001 (fly 7); it must be 0 to 1"),
        ("b", 1.0001, "its column `b` has 1.0001 (fly 7); it must be 0 to 1"),
        ("w", 0.0, "its column `w` has 0.0 (fly 7); it must be 0.25 to 4096"),
        ("h", 4096.1, "its column `h` has 4096.1 (fly 7); it must be 0.25 to 4096"),
    ] {
        assert_eq!(refusal(&with_value(column, value)), message);
    }
}

#[test]
fn what_rounding_puts_beyond_a_bound_is_moved_to_it_and_angles_wrap() {
    let changed =
        |column, value| read_bytes(&with_value(column, value)).expect("it is a population").population.flies[7];
    assert_eq!([changed("x", 299.007).x, changed("x", -0.007).x], [299 * 64, 0]);
    assert_eq!(changed("x", 299.0 + 0.5 / 64.0).x, 299 * 64);
    assert_eq!([changed("z", 1.0).z, changed("z", -1.0).z], [(1 << 24) - 1, 0]);
    assert_eq!([changed("b", 1.000_005).b, changed("b", -0.000_005).b], [65_535, 0]);
    assert_eq!([changed("w", 0.245).w, changed("w", 4096.0).w], [16, 4096 * 64]);
    assert_eq!([changed("angle", -90.0).angle, changed("angle", 720.0 + 45.0).angle], [3 << 14, 1 << 13]);
}

#[test]
fn a_missing_member_is_named() {
    for name in ["x.npy", "angle.npy", "mask.npy", "alive.npy", "mask_0.npy", "meta.json"] {
        let message = refusal(&Members::of(&ours()).without(name).zipped());
        assert_eq!(message, format!("is not a population: it has no `{name}`"));
    }
    // Without layer 1 the flies that wear it have no shape.
    let message = refusal(&Members::of(&ours()).without("mask_1.npy").zipped());
    assert!(message.starts_with("its column `mask` asks for mask 1 and the file has 1 (fly "), "{message}");
}

#[test]
fn a_column_of_another_type_or_length_is_named() {
    let zeros = [0; 4000];
    let cases = [
        ("r.npy", npy("<i4", "(500,)", &zeros[..2000]), "its column `r` is of type '<i4' instead of f32 or f64"),
        ("fitness.npy", npy("<f8", "(500,)", &zeros), "its column `fitness` is of type '<f8' instead of i64"),
        ("mask.npy", npy("|u1", "(500,)", &zeros[..500]), "its column `mask` is of type '|u1' instead of u16"),
        ("alive.npy", npy("|u1", "(500,)", &zeros[..500]), "its column `alive` is of type '|u1' instead of bool"),
        ("g.npy", npy("<f4", "(250, 2)", &zeros[..2000]), "its column `g` has 2 dimensions instead of one"),
        (
            "b.npy",
            npy("<f4", "(499,)", &zeros[..1996]),
            "its column `b` has 499 values and `x` has 500; they must be as many",
        ),
        (
            "alive.npy",
            npy("|b1", "(3,)", &zeros[..3]),
            "its column `alive` has 3 values and `x` has 500; they must be as many",
        ),
        ("h.npy", npy("<f4", "(500,)", &zeros[..100]), "its column `h` is broken or cut short"),
        ("h.npy", b"nothing like an array".to_vec(), "its `h` is not an array of numpy"),
        (
            "h.npy",
            npy("<f4", "(2000000,)", &zeros),
            "its column `h` has 2000000 values, more than the limit of 1000000 flies",
        ),
        ("mask_1.npy", npy("|u1", "(2, 2, 2)", &zeros[..8]), "its `mask_1` is not 256x256x2 in C order"),
        ("mask_0.npy", npy("|u1", "(256, 256, 2)", &[0; 256 * 256 * 2]), "its `mask_0` is not the full square"),
    ];
    for (name, content, expected) in cases {
        let message = refusal_with(name, content);
        assert!(message.starts_with(expected), "{message}");
    }
}

#[test]
fn values_that_are_no_numbers_are_refused() {
    for value in [f32::NAN, f32::INFINITY] {
        let mut values = [0; 2000];
        values[28..32].copy_from_slice(&value.to_le_bytes());
        let message = refusal_with("z.npy", npy("<f4", "(500,)", &values));
        assert_eq!(message, "its column `z` has a value that is no finite number (fly 7)");
    }
}

#[test]
fn a_meta_file_that_describes_no_population_is_refused() {
    let cases = [
        (json!({"schema": 1}), "its `meta.json` does not describe a population (missing field `width_px`"),
        (
            json!({"schema": 2, "width_px": 9, "height_px": 9, "background": [0, 0, 0]}),
            "has layout 2, this program reads 1",
        ),
        (
            json!({"schema": 1, "width_px": 0, "height_px": 9, "background": [0, 0, 0]}),
            "its `meta.json` gives a picture of 0x9 px",
        ),
        (
            json!({"schema": 1, "width_px": 9, "height_px": 70_000, "background": [0, 0, 0]}),
            "its `meta.json` gives a picture of 9x70000 px",
        ),
        (json!([]), "its `meta.json` does not describe a population"),
    ];
    for (meta, expected) in cases {
        let message = refusal_with("meta.json", meta.to_string().into_bytes());
        assert!(message.starts_with(expected), "{message}");
    }
}

#[test]
fn members_that_swell_when_unpacked_are_not_unpacked_to_their_end() {
    for name in ["x.npy", "mask_1.npy", "meta.json"] {
        let message = refusal_with(name, vec![0; 64 << 20]);
        assert!(message.contains(&format!("its `{name}` is larger than the limit of ")), "{message}");
    }
}

#[test]
fn an_array_whose_description_nests_too_deep_is_refused() {
    let nested = [b"\x93NUMPY\x02\0", &1_000_000_u32.to_le_bytes()[..], &[b'('; 1_000_000]].concat();
    assert_eq!(refusal_with("x.npy", nested), "its `x` is not an array of numpy");
}

#[test]
fn what_is_no_zip_file_is_refused() {
    for bytes in [&b""[..], b"hello", &ours()[..1000]] {
        assert!(refusal(bytes).starts_with("is not a population: it is no .npz file"), "{}", refusal(bytes));
    }
    assert!(read(Path::new("/no/such/file.npz")).is_err());
}

#[test]
fn damaged_bytes_never_bring_the_reader_down() {
    let whole = ours();
    for place in noise(300).as_chunks::<3>().0 {
        let mut damaged = whole.clone();
        let offset = usize::from(u16::from_be_bytes([place[0], place[1]])) * whole.len() / 65_536;
        damaged[offset] ^= place[2] | 1;
        // Either answer is right: some bytes do not matter.
        let _ = read_bytes(&damaged);
    }
}
