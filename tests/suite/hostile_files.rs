//! Files that somebody made to do harm: each is refused in one sentence, quietly and at once, and shows nothing but its
//! name.

use std::fs;

use serde_json::Value;

use crate::cli_refusals::refused;
use crate::files::archives::{Members, npy};
use crate::workshop::{Ran, Workshop};

/// A PNG of 4x4 px whose palette has 4 bytes, which its decoder counts as one colour and a third.
const BROKEN_PALETTE: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x04\0\0\0\x04\x08\x03\0\0\0\x9e\x2f\x6e\x4c\
    \0\0\0\x04PLTE\x01\x02\x03\x04\x23\xdb\x8a\xab\0\0\0\x0bIDAT\x78\x9c\x63\x60\xc0\x04\0\0\x14\0\x01\x7d\xfe\x1e\xee\
    \0\0\0\0IEND\xae\x42\x60\x82";

pub fn assert_quiet(ran: &Ran) {
    for word in ["panicked", "internal error"] {
        assert!(!ran.stderr.contains(word), "{}", ran.stderr);
    }
}

/// A workshop with a population in `flies.npz`.
fn with_flies() -> (Workshop, Vec<u8>) {
    let workshop = Workshop::new();
    workshop.evolve("-o flies.npz");
    let flies = workshop.read("flies.npz");
    (workshop, flies)
}

#[test]
fn a_picture_that_makes_its_decoder_panic_is_broken_wherever_it_is_read() {
    let workshop = Workshop::new();
    workshop.write("bad.png", BROKEN_PALETTE);
    for line in [
        "evolve bad.png -o o.png -n 8",
        "evolve photo.png -o o.png -n 8 --mask bad.png",
        "evolve photo.png -o o.png -n 8 --palette bad.png",
        "evolve photo.png -o o.png -n 8 --weight bad.png",
        "score bad.png photo.png",
        "score photo.png bad.png",
    ] {
        assert_quiet(&refused(&workshop, line, 2, "bad.png: the file is broken"));
    }
}

#[test]
fn a_picture_that_makes_its_decoder_panic_fails_alone_in_a_batch() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.path("in")).unwrap();
    workshop.write("in/bad.png", BROKEN_PALETTE);
    workshop.paint("in/good.png", 20, 20);
    let ran = workshop.run("batch in -o out -n 8 --evals 1k --progress none");
    assert_eq!(ran.code, Some(3), "{}", ran.stderr);
    assert_quiet(&ran);
    let rows = String::from_utf8(workshop.read("out/results.jsonl")).unwrap();
    let of = |id: &str| -> Value {
        let rows = rows.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        rows.into_iter().find(|row| row["id"] == id).expect("each picture has a row")
    };
    assert!(of("bad")["error"].as_str().unwrap().contains("bad.png: the file is broken"), "{rows}");
    assert_eq!(of("good")["status"], "complete");
}

#[test]
fn an_array_whose_description_is_no_form_of_numpy_is_refused_at_once() {
    let (workshop, flies) = with_flies();
    let array = |header: &str| {
        let length = header.len() as u16;
        [b"\x93NUMPY\x01\0", &length.to_le_bytes()[..], header.as_bytes(), &[0; 240]].concat()
    };
    for header in [
        format!("{{'descr': {}\n", "[".repeat(18)),
        format!("{{'descr': {}\n", "[".repeat(3_900)),
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {}60,), }}\n", "(".repeat(24)),
        format!("{{'descr': '<f4', 'fortran_order': {}, 'shape': (60,), }}\n", "{1:".repeat(24)),
        "{'descr': '<f4', 'fortran_order': False, 'shape': (999999999999, 999999999999), }\n".to_owned(),
        "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (60,), }\n".to_owned(),
    ] {
        workshop.write("bad.npz", &Members::of(&flies).with("x.npy", array(&header)).zipped());
        for line in ["render bad.npz -o o.png", "evolve photo.png --init bad.npz -o o.png"] {
            assert_quiet(&refused(&workshop, line, 2, "bad.npz: its `x` "));
        }
    }
}

#[test]
fn members_that_swell_to_gigabytes_are_refused() {
    let (workshop, flies) = with_flies();
    let column = npy("<f8", "(999999,)", &vec![0; 8 * 999_999]);
    let bomb = |name: &str| Members::of(&flies).with(name, vec![0; 1 << 26]).zipped();
    workshop.write("x.npz", &bomb("x.npy"));
    workshop.write("mask.npz", &bomb("mask_1.npy"));
    workshop.write("meta.npz", &bomb("meta.json"));
    workshop.write("long.npz", &Members::of(&flies).with("x.npy", column).zipped());
    for (name, words) in [
        ("x.npz", "is larger than the limit"),
        ("mask.npz", "is larger than the limit"),
        ("meta.npz", "is larger than the limit"),
        ("long.npz", "they must be as many"),
    ] {
        assert_quiet(&refused(&workshop, &format!("render {name} -o o.png"), 2, words));
    }
}
