//! Tables of flies for other programs.

use serde_json::{Map, Value, json};
use smalti::archive::{encode_csv, encode_json, is_whole_csv, read_csv_meta, read_json_meta};
use smalti::model::fly::Genes;
use smalti::model::{Blend, Fly, Grout, Population};

use super::archives::{fitness, population};
use crate::workshop::Workshop;

const COLUMNS: [&str; 13] = ["x", "y", "z", "r", "g", "b", "w", "h", "angle", "mask", "alive", "fitness", "color"];

/// The first line of a CSV table.
fn names() -> String {
    format!("{},status,restarts_made,sae,key", COLUMNS.join(","))
}

fn meta() -> Map<String, Value> {
    let key = "0123456789abcdef".repeat(4);
    json!({"key": key, "status": "partial", "restarts_made": 2, "sae": 77}).as_object().unwrap().clone()
}

/// The fly and its fitness in a row of values as they are spelt.
fn fly_of(row: &[String]) -> (Fly, i64) {
    let [x, y, z, r, g, b, w, h, angle_deg] = std::array::from_fn(|column| row[column].parse::<f32>().unwrap());
    let genes = Genes { x, y, z, r, g, b, w, h, angle_deg };
    let fly = Fly { alive: row[10].parse().unwrap(), ..Fly::from_genes(&genes, row[9].parse().unwrap()) };
    let [red, green, blue] = fly.color();
    assert_eq!(row[12], format!("#{red:02x}{green:02x}{blue:02x}"));
    (fly, row[11].parse().unwrap())
}

fn assert_flies(expected: Population, rows: impl Iterator<Item = Vec<String>>) {
    let expected: Vec<(Fly, i64)> = expected.flies.into_iter().zip(fitness()).collect();
    let found: Vec<(Fly, i64)> = rows.map(|row| fly_of(&row)).collect();
    assert!(found == expected);
}

/// The population with all its flies alive.
fn all_alive() -> Population {
    let flies = population().flies.into_iter().map(|fly| Fly { alive: true, ..fly }).collect();
    Population { flies, ..population() }
}

#[test]
fn a_csv_table_has_a_line_of_names_and_a_line_per_fly_and_loses_no_bit() {
    let csv = encode_csv(&all_alive(), &fitness(), &meta()).unwrap();
    assert_eq!(csv, encode_csv(&all_alive(), &fitness(), &meta()).unwrap());
    let text = std::str::from_utf8(&csv).unwrap();
    assert_eq!(text.lines().count(), 501);
    assert!(text.starts_with(&names()) && text.ends_with('\n') && !text.contains(['"', '\r']));
    assert!(text.lines().skip(1).all(|line| line.ends_with(",partial,2,77,0123456789abcdef")));
    let mut reader = csv::Reader::from_reader(&csv[..]);
    assert_flies(all_alive(), reader.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()));
}

#[test]
fn flies_that_do_not_live_are_in_no_csv_table_which_then_tells_how_many_do() {
    let living: Vec<(Fly, i64)> = population().flies.into_iter().zip(fitness()).filter(|(fly, _)| fly.alive).collect();
    assert!((1..500).contains(&living.len()));
    let csv = encode_csv(&population(), &fitness(), &meta()).unwrap();
    let mut reader = csv::Reader::from_reader(&csv[..]);
    assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>().join(","), names() + ",living");
    let rows: Vec<Vec<String>> = reader.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect();
    assert!(rows.iter().all(|row| row[17] == living.len().to_string() && row[16] == "0123456789abcdef"));
    assert!(rows.iter().map(|row| fly_of(row)).collect::<Vec<_>>() == living);
}

#[test]
fn a_csv_table_is_whole_to_its_last_line_and_holds_no_dead_fly() {
    for population in [population(), all_alive()] {
        let csv = encode_csv(&population, &fitness(), &meta()).unwrap();
        assert!(is_whole_csv(&csv, 500));
        let ends = csv.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(end, _)| end + 1);
        for end in ends.take(499).chain([0, 1, csv.len() - 1]).filter(|&end| end < csv.len()) {
            assert!(!is_whole_csv(&csv[..end], 500), "cut at {end} of {}", csv.len());
        }
    }
    let csv = String::from_utf8(encode_csv(&all_alive(), &fitness(), &meta()).unwrap()).unwrap();
    assert!(!is_whole_csv(csv.replacen(",true,", ",false,", 1).as_bytes(), 500), "as older versions wrote it");
    assert!(!is_whole_csv(csv.as_bytes(), 501));
}

#[test]
fn an_empty_csv_table_still_has_its_names() {
    let csv = encode_csv(&Population { flies: vec![], ..population() }, &[], &meta()).unwrap();
    assert_eq!(String::from_utf8(csv).unwrap(), format!("{}\n", names()));
}

#[test]
fn a_json_table_is_one_object_and_loses_no_bit() {
    let meta = json!({"key": "k", "note": "a \"b\"\n"}).as_object().unwrap().clone();
    let population = Population { masks: population().masks.with_blend(Blend::Translucent), ..population() };
    let bytes = encode_json(&population, &fitness(), &meta).unwrap();
    let table: Value = serde_json::from_slice(&bytes).unwrap();
    assert_eq!(table["meta"], Value::Object(meta));
    let header = ["width_px", "height_px", "background", "blend", "masks"].map(|name| table[name].clone());
    assert_eq!(header, [json!(300), json!(300), json!("#010203"), json!("translucent"), json!(2)]);
    assert_eq!(table.get("grout"), None);
    let grout = Some(Grout { width: 9, color: [255, 0, 1] });
    let grouted = encode_json(&Population { grout, ..population }, &fitness(), &Map::new()).unwrap();
    let grouted: Value = serde_json::from_slice(&grouted).unwrap();
    assert_eq!(grouted["grout"], json!({"width": 9, "color": "#ff0001"}));
    let spelt = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let flies = table["flies"].as_array().unwrap();
    assert!(flies.iter().all(|fly| fly.as_object().unwrap().len() == COLUMNS.len()));
    assert_flies(
        self::population(),
        flies.iter().map(|fly| COLUMNS.iter().map(|column| spelt(&fly[column])).collect()),
    );
}

#[test]
fn a_table_is_known_by_how_it_begins() {
    let workshop = Workshop::new();
    let meta = json!({"key": "k", "note": "line\nbreak"}).as_object().unwrap().clone();
    workshop.write("a.json", &encode_json(&population(), &fitness(), &meta).unwrap());
    workshop.write("a.csv", &encode_csv(&all_alive(), &fitness(), &self::meta()).unwrap());
    workshop.write("dead.csv", &encode_csv(&population(), &fitness(), &self::meta()).unwrap());
    let drawn = json!({"key": "ab".repeat(32)}).as_object().unwrap().clone();
    workshop.write("drawn.csv", &encode_csv(&population(), &fitness(), &drawn).unwrap());
    workshop.write("keyless.csv", &encode_csv(&population(), &fitness(), &Map::new()).unwrap());
    workshop
        .write("empty.json", &encode_json(&Population { flies: vec![], ..population() }, &[], &Map::new()).unwrap());
    workshop.write("other.json", b"{\"meta\": {\"key\": \"k\"}}");
    assert_eq!(read_json_meta(&workshop.path("a.json")).unwrap(), Some(meta));
    assert_eq!(read_json_meta(&workshop.path("empty.json")).unwrap(), Some(Map::new()));
    for name in ["other.json", "a.csv", "photo.png"] {
        assert_eq!(read_json_meta(&workshop.path(name)).unwrap(), None, "{name}");
    }
    assert!(read_json_meta(&workshop.path("missing.json")).is_err());
    let told = |name| read_csv_meta(&workshop.path(name)).unwrap().map(Value::Object);
    let of_a = json!({"key": "0123456789abcdef", "sae": 77, "restarts_made": 2, "status": "partial"});
    assert_eq!([told("a.csv"), told("dead.csv")], [Some(of_a.clone()), Some(of_a)]);
    let of_drawn = json!({"key": "ab".repeat(8), "sae": null, "restarts_made": null, "status": ""});
    assert_eq!(told("drawn.csv"), Some(of_drawn));
    assert_eq!(["keyless.csv", "a.json", "photo.png"].map(told), [None, None, None]);
    assert!(read_csv_meta(&workshop.path("missing.csv")).is_err());
}
