//! A file of lines that one or several processes append to.

use std::fs::{File, Metadata};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::output_error;
use crate::error::Result;

/// A file of lines. Each line is written whole, even if several processes append at once.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens the journal at `path`, or creates an empty one.
    ///
    /// # Errors
    /// [`crate::Error::Output`] if it cannot be written to.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::options().read(true).append(true).create(true).open(path);
        Ok(Self { path: path.to_owned(), file: file.map_err(|error| output_error(path, &error))? })
    }

    /// Appends `line`, which must not end in a line feed. A line that a killed process left unfinished is ended first.
    ///
    /// # Errors
    /// [`crate::Error::Output`] if the disk is full or the file is gone.
    pub fn append(&mut self, line: &str) -> Result<()> {
        // Even where the file system has no locks, short appends do not mix.
        let is_locked = self.file.lock().is_ok();
        let length = self.file.metadata().ok().filter(Metadata::is_file).map(|found| found.len());
        let done = self.append_whole(line);
        if is_locked {
            // Half a line is useless, so it is cut off; if that fails, the next line ends it. Without the lock, this
            // might cut the line of another process.
            if let (Err(_), Some(length)) = (&done, length) {
                let _ = self.file.set_len(length);
            }
            let _ = self.file.unlock();
        }
        done.map_err(|error| output_error(&self.path, &error))
    }

    fn append_whole(&mut self, line: &str) -> io::Result<()> {
        let mut bytes = format!("{line}\n").into_bytes();
        if !self.file.metadata()?.is_file() {
            return self.file.write_all(&bytes);
        }
        let length = self.file.seek(SeekFrom::End(0))?;
        if length > 0 {
            self.file.seek(SeekFrom::End(-1))?;
            let mut last = [0];
            self.file.read_exact(&mut last)?;
            if last != *b"\n" {
                bytes.insert(0, b'\n');
            }
        }
        self.file.write_all(&bytes)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_line_follows_one_that_was_never_ended_on_a_line_of_its_own() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("rows.jsonl");
        let (mut one, mut other) = (Journal::open(&path), Journal::open(&path));
        for (journal, line) in [(&mut one, "a"), (&mut other, "b")] {
            journal.as_mut().expect("the folder is ours").append(line).expect("there is room");
        }
        fs::write(&path, b"a\nb\n{\"half").expect("the folder is ours");
        other.expect("the folder is ours").append("c").expect("there is room");
        assert_eq!(fs::read_to_string(&path).expect("it is there"), "a\nb\n{\"half\nc\n");
    }
}
