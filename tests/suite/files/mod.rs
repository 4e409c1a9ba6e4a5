//! Files in and out, through the public functions.

pub mod archives;
mod encoding;
mod kinds;
mod openraster;
mod outputs;
mod photos;
mod planes;
mod tables;
mod vector;

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use smalti::photo::{Loaded, Photo, ReadOptions, read};

/// A picture of `tests/photos`.
fn photo_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos").join(name)
}

fn load_with(name: &str, options: &ReadOptions) -> Loaded {
    read(&photo_path(name), options).expect("the pictures of the tests can be read")
}

fn load(name: &str) -> Photo {
    load_with(name, &ReadOptions::default()).photo
}

/// The first 16 digits of the SHA-256 of bytes.
fn short_hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

/// Pseudo-random bytes, the same in every run.
fn noise(count: usize) -> Vec<u8> {
    let mut state = 1_u64;
    std::iter::repeat_with(|| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    })
    .take(count)
    .collect()
}
