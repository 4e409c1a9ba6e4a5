//! A file of lines, to which one process or several add.

use std::fs::{File, Metadata};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::output_error;
use crate::error::Result;

/// A file of lines that grows line by line, each written whole, by one process or by several.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// The journal at `path`, begun if there is none.
    ///
    /// # Errors
    /// [`crate::Error::Output`] if it cannot be written to.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::options().read(true).append(true).create(true).open(path);
        Ok(Self { path: path.to_owned(), file: file.map_err(|error| output_error(path, &error))? })
    }

    /// Adds a line, which has no end of its own. A line that a killed process left unfinished is ended first.
    ///
    /// # Errors
    /// [`crate::Error::Output`] if the disk is full or the file went away.
    pub fn append(&mut self, line: &str) -> Result<()> {
        // Where the file system has no locks, short writes at the end do not mix either.
        let is_locked = self.file.lock().is_ok();
        let length = self.file.metadata().ok().filter(Metadata::is_file).map(|found| found.len());
        let done = self.append_whole(line);
        if is_locked {
            // A half line tells nothing. If it cannot be taken away, the next line ends it. Without the lock, it might be
            // another process's line that would be cut.
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
