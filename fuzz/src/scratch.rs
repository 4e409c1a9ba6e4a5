//! The folder in which a target has the file that it reads, and in which nothing else may be left.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("smalti-fuzz-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("the temporary folder can be written to");
    folder
});

/// The folder; made at the first call.
#[must_use]
pub fn folder() -> &'static Path {
    &FOLDER
}

/// What `read` makes of a file of these bytes, which is there as long as it reads.
pub fn with_file<T>(name: &str, bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    let path = FOLDER.join(name);
    fs::write(&path, bytes).expect("the temporary folder can be written to");
    let came = read(&path);
    // If it panics, the driver cleans up.
    fs::remove_file(&path).expect("nobody else removes it");
    came
}

/// What is in the folder though it should be empty.
#[must_use]
pub fn left_over() -> Vec<String> {
    let entries = fs::read_dir(folder()).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

/// Empties the folder.
pub fn clean() {
    let _ = fs::remove_dir_all(folder());
    let _ = fs::create_dir_all(folder());
}

/// Removes the folder.
pub fn remove() {
    let _ = fs::remove_dir_all(folder());
}
