//! The files of a plan. Decides which files in its folder belong to a plan and may be replaced.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::cli::files::destination::{self, Overwrite};
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::{Error, Result, in_words};
use crate::output;

/// The file that lists the others.
const LIST: &str = "plan.json";
/// Most bytes of that file; a plan has a few hundred files at most.
const LIST_BYTES_MAX: u64 = 1 << 26;

/// What a plan remembers about its files.
#[derive(Debug, Default, Deserialize, Serialize)]
struct List {
    version: String,
    /// The hashes of the files that a plan wrote, by name. A file has more than one while it is being replaced.
    files: BTreeMap<String, Vec<String>>,
}

/// Writes `files` to `folder`, and removes the files of an older plan that are not among them.
///
/// A reader sees either the old file or the new one. If this is interrupted, the same command can be run again.
///
/// # Errors
/// [`Error::Usage`] if it would replace a file that no plan wrote, or that was changed since; [`Error::Output`] if one
/// cannot be written.
pub(super) fn write(folder: &Path, files: &BTreeMap<String, String>, overwrite: Overwrite) -> Result<()> {
    fs::create_dir_all(folder).map_err(|error| {
        Error::output(folder, format!("cannot be created, since {}; name another folder", in_words(&error)))
    })?;
    let old = old_list(folder, overwrite)?;
    check_ours(folder, files, &old, overwrite)?;
    // Old and new hashes are written together first, so that whatever an interruption leaves is recognised.
    let mut list = List { version: env!("CARGO_PKG_VERSION").to_owned(), files: old.files.clone() };
    for (name, text) in files {
        list.files.entry(name.clone()).or_default().push(hash(text.as_bytes()));
    }
    destination::sweep(folder)?;
    let interrupt = Interrupt::listen()?;
    interrupt.while_writing(|| write_list(folder, &list))?;
    for (name, text) in files {
        interrupt.check()?;
        interrupt.while_writing(|| output::write_atomically_soon(&folder.join(name), text.as_bytes()))?;
    }
    for (name, hashes) in &old.files {
        let path = folder.join(name);
        if !files.contains_key(name) && is_one_of(&path, hashes) {
            fs::remove_file(&path).map_err(|error| {
                Error::output(
                    &path,
                    format!("belongs to an older plan and cannot be removed, since {}", in_words(&error)),
                )
            })?;
        }
    }
    list.files = files.iter().map(|(name, text)| (name.clone(), vec![hash(text.as_bytes())])).collect();
    interrupt.while_writing(|| write_list(folder, &list))
}

/// The names of everything that [`write`] writes.
pub(super) fn all_names(files: &BTreeMap<String, String>) -> impl Iterator<Item = &str> {
    files.keys().map(String::as_str).chain([LIST])
}

fn old_list(folder: &Path, overwrite: Overwrite) -> Result<List> {
    let path = folder.join(LIST);
    let mut bytes = Vec::new();
    let read = File::open(&path).and_then(|file| file.take(LIST_BYTES_MAX).read_to_end(&mut bytes));
    if read.is_err() {
        return Ok(List::default());
    }
    match serde_json::from_slice(&bytes) {
        Ok(list) => Ok(list),
        Err(_) if overwrite == Overwrite::Force => Ok(List::default()),
        Err(_) => Err(refusal(&path)),
    }
}

fn check_ours(folder: &Path, files: &BTreeMap<String, String>, old: &List, overwrite: Overwrite) -> Result<()> {
    if overwrite == Overwrite::Force {
        return Ok(());
    }
    for (name, text) in files {
        let path = folder.join(name);
        let known = old.files.get(name).into_iter().flatten();
        let hashes: Vec<String> = known.cloned().chain([hash(text.as_bytes())]).collect();
        if path.symlink_metadata().is_ok() && !is_one_of(&path, &hashes) {
            return Err(refusal(&path));
        }
    }
    Ok(())
}

fn refusal(path: &Path) -> Error {
    let path = path.display();
    Error::Usage(format!(
        "{path} is not as a plan wrote it; move it away, name another folder with --into, or replace it with --force"
    ))
}

fn is_one_of(path: &Path, hashes: &[String]) -> bool {
    fs::read(path).is_ok_and(|bytes| hashes.contains(&hash(&bytes)))
}

fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn write_list(folder: &Path, list: &List) -> Result<()> {
    let mut bytes = serde_json::to_vec_pretty(list).map_err(|error| Error::Internal(format!("no JSON: {error}")))?;
    bytes.push(b'\n');
    output::write_atomically(&folder.join(LIST), &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::terminal::advice;

    fn files(names: &[&str], text: &str) -> BTreeMap<String, String> {
        names.iter().map(|name| ((*name).to_owned(), format!("{name}: {text}\n"))).collect()
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("the folder is there");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("it can be read").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_plan_replaces_an_older_one_and_removes_its_surplus_files() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path().join("new/plan");
        write(&folder, &files(&["a", "b", "c"], "first"), Overwrite::Refuse).expect("the folder is empty");
        fs::write(folder.join("notes.txt"), "mine").expect("the folder is ours");
        write(&folder, &files(&["a", "b"], "second"), Overwrite::Refuse).expect("all are of a plan");
        assert_eq!(names(&folder), ["a", "b", "notes.txt", LIST]);
        assert_eq!(fs::read_to_string(folder.join("b")).expect("it is text"), "b: second\n");
    }

    #[test]
    fn a_file_that_no_plan_wrote_or_that_was_changed_since_is_replaced_only_by_force() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        fs::write(folder.join("a"), "mine").expect("the folder is ours");
        let first = files(&["a", "b"], "first");
        let refusal = write(folder, &first, Overwrite::Refuse).expect_err("a is not of a plan");
        assert_eq!((advice::exit_code(&refusal), names(folder)), (2, vec!["a".to_owned()]));
        write(folder, &first, Overwrite::Force).expect("it may be replaced");
        fs::write(folder.join("b"), "edited").expect("the folder is ours");
        write(folder, &files(&["a", "b"], "second"), Overwrite::Refuse).expect_err("b was edited");
        // An edited file stays, even if the new plan does not need it.
        write(folder, &files(&["a"], "second"), Overwrite::Refuse).expect("b is not touched");
        assert_eq!(names(folder), ["a", "b", LIST]);
    }

    #[test]
    fn a_plan_that_was_cut_half_way_is_its_own() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        write(folder, &files(&["a", "b"], "first"), Overwrite::Refuse).expect("the folder is empty");
        let list = fs::read(folder.join(LIST)).expect("it is there");
        let second = files(&["a", "b"], "second");
        write(folder, &second, Overwrite::Refuse).expect("all are of a plan");
        // The state after an interruption between the list and its files: one file is new already, the other is not.
        let mut both: List = serde_json::from_slice(&list).expect("it is JSON");
        for (name, text) in &second {
            both.files.entry(name.clone()).or_default().push(hash(text.as_bytes()));
        }
        fs::write(folder.join("b"), "b: first\n").expect("the folder is ours");
        write_list(folder, &both).expect("the folder is ours");
        write(folder, &files(&["a", "b"], "third"), Overwrite::Refuse).expect("either version is of a plan");
        assert_eq!(fs::read_to_string(folder.join("a")).expect("it is text"), "a: third\n");
    }
}
