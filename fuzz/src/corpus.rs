//! The examples of each kind of file, which are damaged: the project's own small files.

use std::fs;
use std::path::{Path, PathBuf};

use smalti_fuzz::mutate;
use smalti_fuzz::targets::Target;

/// Larger examples would only make fewer inputs.
const EXAMPLE_BYTES_MAX: u64 = 16 << 10;

/// What inputs of a target are made of.
pub struct Corpus {
    pub examples: Vec<Vec<u8>>,
    /// What such files say.
    pub words: Vec<Vec<u8>>,
}

impl Corpus {
    /// Reads the examples of `target`.
    pub fn of(target: &Target) -> Result<Self, String> {
        let fuzz = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut folders = vec![fuzz.join("corpus").join(target.name)];
        folders.extend(target.reads_photos.then(|| fuzz.join("../tests/photos")));
        let mut paths: Vec<PathBuf> = Vec::new();
        for folder in folders {
            let entries = fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
            paths.extend(entries.flatten().map(|entry| entry.path()));
        }
        // The order of a folder is nobody's choice.
        paths.sort();
        let is_small = |path: &PathBuf| fs::metadata(path).is_ok_and(|found| found.len() <= EXAMPLE_BYTES_MAX);
        let is_example =
            |path: &PathBuf| !path.extension().is_some_and(|extension| extension == "md" || extension == "py");
        paths.retain(|path| is_small(path) && is_example(path));
        let read = |path: &PathBuf| fs::read(path).map_err(|error| format!("{}: {error}", path.display()));
        let examples = paths.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        if examples.is_empty() {
            return Err(format!("fuzz/corpus/{} has no example", target.name));
        }
        let dictionary = fs::read_to_string(fuzz.join("dictionaries").join(format!("{}.dict", target.name)));
        Ok(Self { examples, words: mutate::words(&dictionary.unwrap_or_default()) })
    }

    /// The input with this index: first the examples as they are, then damaged ones.
    pub fn input(&self, target: &Target, seed: u64, index: u64) -> Vec<u8> {
        let count = self.examples.len() as u64;
        if index < count {
            return self.examples[index as usize].clone();
        }
        let mut dice = smalti_fuzz::dice::Dice::new(seed, target.name, index);
        let (file, other) = (dice.pick(&self.examples), dice.pick(&self.examples));
        mutate::mutated(file, other, &self.words, &mut dice)
    }
}
