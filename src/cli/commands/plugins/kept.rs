//! A plug-in in one folder: put there, looked at, taken away. A list beside it says what was put there, so that nothing
//! else is ever replaced or removed.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::Others;
use super::hosts::File;
use crate::error::{Error, Result, in_words};
use crate::output;

/// How all that is ours is called, with or without an ending, or the folder that it is in.
const NAME: &str = "smalti";
/// The list, in the folder that a plug-in has to itself.
const LIST: &str = "smalti_installed.json";
/// A longer list is none of ours.
const LIST_BYTES_MAX: u64 = 1 << 16;

/// What was put into a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct List {
    /// The version of the program that did it.
    version: String,
    /// The SHA-256 of each file, by its path below the folder of plug-ins. While another version is put there, that of
    /// the old file as well.
    files: BTreeMap<String, Vec<String>>,
}

/// How a plug-in is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// It is not there.
    Absent,
    /// It is that of this version.
    Current,
    /// It is that of another version.
    Other(String),
    /// Somebody has changed or removed this file of it.
    Changed(PathBuf),
    /// Something of its name is there that smalti did not put there.
    Foreign(PathBuf),
    /// It cannot be told, for this reason.
    Unreadable(String),
}

/// The plug-in in the folder in which a host looks for plug-ins.
pub(super) struct Kept<'a> {
    folder: &'a Path,
    /// The folder below it that the plug-in has to itself.
    own: PathBuf,
}

impl<'a> Kept<'a> {
    /// The plug-in below `folder`, in which the folder `own` belongs to it alone.
    pub fn at(folder: &'a Path, own: &str) -> Self {
        Self { folder, own: folder.join(own) }
    }

    /// How the plug-in is.
    pub fn state(&self) -> State {
        self.state_or_failure().unwrap_or_else(|failure| State::Unreadable(failure.to_string()))
    }

    fn state_or_failure(&self) -> Result<State> {
        let Some(list) = self.list()? else {
            let is_there = self.own.symlink_metadata().is_ok();
            return Ok(if is_there { State::Foreign(self.own.clone()) } else { State::Absent });
        };
        for (path, hashes) in &list.files {
            let path = self.folder.join(path);
            if read(&path)?.is_none_or(|bytes| !hashes.contains(&hash_of(&bytes))) {
                return Ok(State::Changed(path));
            }
        }
        Ok(if list.version == env!("CARGO_PKG_VERSION") { State::Current } else { State::Other(list.version) })
    }

    /// Puts the files there, and takes away those of another version that this one no longer has.
    ///
    /// # Errors
    /// [`Error::Output`] if a file cannot be written, or if one is there that smalti did not put there, or that was
    /// changed since; then nothing is written.
    pub fn install(&self, files: &[File], others: Others) -> Result<()> {
        let before = self.list()?.unwrap_or_default();
        for file in files {
            self.check_is_no_link(&file.path)?;
            if others == Others::Leave {
                self.check_replaceable(file, &before)?;
            }
        }
        // Whatever ends this half-way, the list tells of all that is there.
        let mut during = List { version: env!("CARGO_PKG_VERSION").to_owned(), ..before.clone() };
        for file in files {
            during.files.entry(file.path.clone()).or_default().push(hash_of(&file.bytes));
        }
        self.write_list(&during)?;
        for file in files {
            let path = self.folder.join(&file.path);
            make_folder(path.parent().unwrap_or(self.folder))?;
            output::write_atomically(&path, &file.bytes)?;
            if file.is_program {
                make_program(&path)?;
            }
        }
        let after = List {
            files: files.iter().map(|file| (file.path.clone(), vec![hash_of(&file.bytes)])).collect(),
            ..during
        };
        let is_left = |(path, hashes): &(&String, &Vec<String>)| {
            let bytes = read(&self.folder.join(path)).ok().flatten();
            !after.files.contains_key(*path) && bytes.is_some_and(|bytes| hashes.contains(&hash_of(&bytes)))
        };
        self.take_away(before.files.iter().filter(is_left).map(|(path, _)| path))?;
        self.write_list(&after)
    }

    /// Takes the plug-in away; whether there was one.
    ///
    /// # Errors
    /// [`Error::Output`] if a file was changed since it was put there, and then nothing is removed, or if one cannot be
    /// removed.
    pub fn remove(&self, others: Others) -> Result<bool> {
        let Some(list) = self.list()? else { return Ok(false) };
        for (path, hashes) in &list.files {
            self.check_is_no_link(path)?;
            if others == Others::Leave {
                let path = self.folder.join(path);
                if read(&path)?.is_some_and(|bytes| !hashes.contains(&hash_of(&bytes))) {
                    let reason = "was changed since smalti put it there; remove it yourself, or with --force";
                    return Err(Error::output(&path, reason));
                }
            }
        }
        self.take_away(list.files.keys())?;
        remove_file(&self.list_path())?;
        remove_empty(&self.own);
        Ok(true)
    }

    /// Refuses to replace what smalti did not put there.
    fn check_replaceable(&self, file: &File, before: &List) -> Result<()> {
        let path = self.folder.join(&file.path);
        let Some(bytes) = read(&path)? else { return Ok(()) };
        let hash = hash_of(&bytes);
        match before.files.get(&file.path) {
            Some(put) if put.contains(&hash) || bytes == file.bytes => Ok(()),
            Some(_) => Err(Error::output(&path, "was changed since smalti put it there; --force replaces it")),
            None => Err(Error::output(&path, "is there, and smalti did not put it there; --force replaces it")),
        }
    }

    /// Refuses a path that a link leads out of the folder: what lies behind it is not ours.
    fn check_is_no_link(&self, path: &str) -> Result<()> {
        let path = self.folder.join(path);
        let inside = path.ancestors().take_while(|&part| part != self.folder);
        let is_link = |part: &&Path| part.symlink_metadata().is_ok_and(|found| found.is_symlink());
        match inside.into_iter().find(is_link) {
            Some(link) => Err(Error::output(link, "is a link, which smalti did not make; remove it yourself")),
            None => Ok(()),
        }
    }

    fn write_list(&self, list: &List) -> Result<()> {
        let text = serde_json::to_vec_pretty(list).map_err(|error| Error::Internal(format!("no JSON: {error}")))?;
        make_folder(&self.own)?;
        output::write_atomically(&self.list_path(), &text)
    }

    /// Removes files, with what Python compiled of them.
    fn take_away<'p>(&self, paths: impl Iterator<Item = &'p String>) -> Result<()> {
        for path in paths {
            let path = self.folder.join(path);
            if path.symlink_metadata().is_err() {
                continue;
            }
            remove_file(&path)?;
            remove_compiled(&path);
            // Folders of ours that are empty now; those of the host stay.
            let ours = path.ancestors().skip(1).take_while(|folder| folder.starts_with(&self.own));
            ours.for_each(remove_empty);
        }
        Ok(())
    }

    fn list_path(&self) -> PathBuf {
        self.own.join(LIST)
    }

    /// The list, if smalti has put a plug-in there.
    fn list(&self) -> Result<Option<List>> {
        let path = self.list_path();
        let is_small = fs::metadata(&path).map(|metadata| metadata.len() <= LIST_BYTES_MAX);
        let bytes = if is_small.unwrap_or(true) { read(&path)? } else { Some(Vec::new()) };
        let Some(bytes) = bytes else { return Ok(None) };
        let list: Option<List> = serde_json::from_slice(&bytes).ok();
        list.filter(|list| list.files.keys().all(|path| is_below(path))).map(Some).ok_or_else(|| {
            Error::input(&path, "is not the list that smalti wrote there; remove the folder that it is in yourself")
        })
    }
}

/// Whether a path leads to a file of ours, and never out of the folder of plug-ins.
fn is_below(path: &str) -> bool {
    let names: Option<Vec<&str>> = Path::new(path)
        .components()
        .map(|component| match component {
            Component::Normal(name) => name.to_str(),
            _ => None,
        })
        .collect();
    names.is_some_and(|names| names.iter().any(|name| name.split('.').next() == Some(NAME)))
}

fn hash_of(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// What is in a file, if it is there.
fn read(path: &Path) -> Result<Option<Vec<u8>>> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => Ok(None),
        Err(error) => Err(Error::input(path, format!("cannot be read, since {}", in_words(&error)))),
    }
}

fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder)
        .map_err(|error| Error::output(folder, format!("the folder cannot be made, since {}", in_words(&error))))
}

fn remove_file(path: &Path) -> Result<()> {
    fs::remove_file(path).map_err(|error| Error::output(path, format!("cannot be removed, since {}", in_words(&error))))
}

/// Removes a folder, if it is empty.
fn remove_empty(folder: &Path) {
    let _ = fs::remove_dir(folder);
}

/// Removes what Python keeps of a module that it has run: it is made of nothing else.
fn remove_compiled(path: &Path) {
    let (Some(folder), Some(stem)) = (path.parent(), path.file_stem().and_then(|stem| stem.to_str())) else { return };
    if path.extension().is_none_or(|ending| ending != "py") {
        return;
    }
    let cache = folder.join("__pycache__");
    let is_of_module = |name: &str| name.starts_with(&format!("{stem}.")) && name.ends_with(".pyc");
    for entry in fs::read_dir(&cache).into_iter().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(is_of_module) {
            let _ = fs::remove_file(entry.path());
        }
    }
    remove_empty(&cache);
}

#[cfg(unix)]
fn make_program(path: &Path) -> Result<()> {
    use std::os::unix::fs::PermissionsExt;
    let set = fs::metadata(path).and_then(|metadata| {
        let mode = metadata.permissions().mode();
        // Whoever may read it may run it.
        fs::set_permissions(path, fs::Permissions::from_mode(mode | (mode & 0o444) >> 2))
    });
    set.map_err(|error| Error::output(path, format!("cannot be made a program, since {}", in_words(&error))))
}

#[cfg(not(unix))]
#[allow(clippy::unnecessary_wraps, reason = "elsewhere it can fail")]
fn make_program(_path: &Path) -> Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(path: &str, text: &str) -> File {
        File { path: path.to_owned(), bytes: text.as_bytes().to_vec(), is_program: path.ends_with("tool.py") }
    }

    fn all(folder: &Path) -> Vec<String> {
        let mut found = Vec::new();
        let mut open = vec![folder.to_owned()];
        while let Some(next) = open.pop() {
            for entry in fs::read_dir(&next).expect("it is a folder").flatten() {
                let path = entry.path();
                if path.is_dir() {
                    open.push(path.clone());
                }
                found.push(path.strip_prefix(folder).expect("it is below").display().to_string().replace('\\', "/"));
            }
        }
        found.sort();
        found
    }

    #[test]
    fn what_was_put_there_is_replaced_and_removed_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        let kept = Kept::at(folder, NAME);
        assert_eq!(kept.state(), State::Absent);
        fs::write(folder.join("other.py"), "not ours").expect("the folder is ours");
        kept.install(&[file("smalti/tool.py", "1"), file("smalti/old.py", "1")], Others::Leave)
            .expect("it is put there");
        assert_eq!(kept.state(), State::Current);
        kept.install(&[file("smalti/tool.py", "2"), file("smalti.desktop", "2")], Others::Leave)
            .expect("it is replaced");
        let there = ["other.py", "smalti", "smalti.desktop", "smalti/smalti_installed.json", "smalti/tool.py"];
        assert_eq!(all(folder), there);
        assert_eq!(fs::read(folder.join("smalti/tool.py")).expect("it is there"), b"2");
        fs::create_dir(folder.join("smalti/__pycache__")).expect("the folder is ours");
        fs::write(folder.join("smalti/__pycache__/tool.cpython-311.pyc"), "").expect("the folder is ours");
        assert!(kept.remove(Others::Leave).expect("it can be removed"));
        assert_eq!(all(folder), ["other.py"]);
        assert!(!kept.remove(Others::Leave).expect("nothing is to do"));
    }

    #[test]
    fn what_smalti_did_not_put_there_stays_unless_forced() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        let kept = Kept::at(folder, NAME);
        fs::create_dir(folder.join("smalti")).expect("the folder is ours");
        fs::write(folder.join("smalti/tool.py"), "mine").expect("the folder is ours");
        assert_eq!(kept.state(), State::Foreign(folder.join("smalti")));
        let files = [file("smalti/a.py", "1"), file("smalti/tool.py", "1")];
        let refusal = kept.install(&files, Others::Leave).expect_err("it is not ours").to_string();
        assert!(refusal.ends_with("is there, and smalti did not put it there; --force replaces it"), "{refusal}");
        assert_eq!(all(folder), ["smalti", "smalti/tool.py"], "nothing is half done");
        kept.install(&files, Others::Force).expect("it is forced");
        fs::write(folder.join("smalti/tool.py"), "changed").expect("the folder is ours");
        assert_eq!(kept.state(), State::Changed(folder.join("smalti/tool.py")));
        let refusal = kept.remove(Others::Leave).expect_err("it was changed").to_string();
        assert!(refusal.contains("tool.py: was changed since"), "{refusal}");
        assert_eq!(fs::read(folder.join("smalti/tool.py")).expect("it stays"), b"changed");
        assert!(kept.remove(Others::Force).expect("it is forced"));
        assert_eq!(all(folder), [""; 0]);
    }

    #[test]
    fn another_version_is_told_and_a_list_that_leads_elsewhere_is_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        let kept = Kept::at(folder, NAME);
        let write = |text: &str| {
            fs::create_dir_all(folder.join("smalti")).expect("the folder is ours");
            fs::write(folder.join("smalti").join(LIST), text).expect("the folder is ours");
        };
        write("{}");
        assert!(matches!(kept.state(), State::Unreadable(sentence) if sentence.contains("is not the list")));
        write(r#"{"version": "0.0.1", "files": {}}"#);
        assert_eq!(kept.state(), State::Other("0.0.1".to_owned()));
        for path in ["../victim", "/victim", "smalti/../../victim", "other/file", ""] {
            write(&format!(r#"{{"version": "0.0.1", "files": {{"{path}": ["00"]}}}}"#));
            let refusal = kept.remove(Others::Force).expect_err(path).to_string();
            assert!(refusal.contains("is not the list that smalti wrote"), "{refusal}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_written_or_removed_through_a_link() {
        let both = tempfile::tempdir().expect("a temporary folder");
        let [folder, source] = ["plug-ins", "source"].map(|name| both.path().join(name));
        for folder in [&folder, &source] {
            fs::create_dir(folder).expect("the folder is ours");
        }
        std::os::unix::fs::symlink(&source, folder.join("smalti")).expect("the folder is ours");
        fs::write(source.join("tool.py"), "1").expect("the folder is ours");
        let kept = Kept::at(&folder, NAME);
        for others in [Others::Leave, Others::Force] {
            let refusal = kept.install(&[file("smalti/tool.py", "1")], others).expect_err("it is a link").to_string();
            assert!(refusal.contains("is a link, which smalti did not make"), "{refusal}");
        }
        fs::write(source.join(LIST), r#"{"version": "0.0.1", "files": {"smalti/tool.py": ["00"]}}"#).expect("ours");
        assert!(kept.remove(Others::Force).is_err());
        assert_eq!(all(&source), [LIST, "tool.py"]);
    }

    #[test]
    fn what_is_half_installed_can_be_installed_and_removed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        let kept = Kept::at(folder, NAME);
        kept.install(&[file("smalti/a.py", "1"), file("smalti/b.py", "1")], Others::Leave).expect("it is put there");
        // A folder where a file should be ends the next one half-way.
        fs::create_dir(folder.join("smalti/c.py")).expect("the folder is ours");
        let next = [file("smalti/a.py", "2"), file("smalti/c.py", "2"), file("smalti/b.py", "2")];
        assert!(kept.install(&next, Others::Force).is_err());
        assert_eq!(fs::read(folder.join("smalti/a.py")).expect("it is there"), b"2");
        fs::remove_dir(folder.join("smalti/c.py")).expect("the folder is ours");
        kept.install(&next, Others::Leave).expect("the same again");
        assert_eq!(kept.state(), State::Current);
        assert!(kept.remove(Others::Leave).expect("it can be removed"));
        assert_eq!(all(folder), [""; 0]);
    }

    #[cfg(unix)]
    #[test]
    fn programs_can_be_run_by_those_who_may_read_them() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let kept = Kept::at(folder.path(), NAME);
        kept.install(&[file("smalti/tool.py", "1"), file("smalti/a.py", "1")], Others::Leave).expect("it is put there");
        let mode = |name: &str| {
            fs::metadata(folder.path().join("smalti").join(name)).expect("it is there").permissions().mode()
        };
        assert_eq!(mode("tool.py") & 0o100, 0o100);
        assert_eq!(mode("a.py") & 0o111, 0);
    }
}
