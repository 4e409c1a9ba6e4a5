//! Writing results so that a reader sees either the old file or the whole new one, never half of one.
//!
//! The bytes go to a temporary file beside the target, which is then renamed to the target. Nothing here knows what the
//! bytes mean, or whether the user agreed to replace what is there.

mod journal;

use std::fs::{self, DirEntry, File, Metadata, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf, is_separator};
use std::sync::OnceLock;
use std::time::Duration;

use tempfile::{Builder, NamedTempFile, TempDir};

pub use self::journal::Journal;
use crate::error::{Error, Result, in_words};

/// How the names of temporary files begin and end.
const PREFIX: &str = ".smalti-";
const SUFFIX: &str = ".partial";
/// Ends the host's name in the name of a temporary file; no host's name contains it.
const HOST_END: char = '@';
/// Temporary files of another host count as abandoned if nobody wrote to them for this long, since its locks may not be
/// visible here.
const LEFT_AFTER: Duration = Duration::from_secs(24 * 3600);
/// The file in a temporary folder on which its process holds a lock.
const LOCK: &str = ".lock";

/// Writes `bytes` to `path`, replacing what is there in one step.
///
/// A new file gets the permissions that the user's umask asks for; a replaced one keeps its own. A symbolic link to a
/// file stays, and the file is replaced; a broken link is itself replaced. A device or a pipe (such as `/dev/stdout`)
/// is written to directly. After a failure the old file is unchanged, and nothing is left beside it.
///
/// # Errors
/// [`Error::Output`] if the folder is missing or may not be written, the disk is full, or `path` is a folder.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    write(path, bytes, Durability::OnDisk)
}

/// As [`write_atomically`], but the system decides when the bytes reach the disk. This is for files that are written by
/// the hundred and can be made again. A crash of the system may leave an empty file; a crash of the program does not.
///
/// # Errors
/// [`Error::Output`], as from [`write_atomically`].
pub fn write_atomically_soon(path: &Path, bytes: &[u8]) -> Result<()> {
    write(path, bytes, Durability::Soon)
}

/// When the bytes of a file must be on the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Durability {
    /// Before the writer continues.
    OnDisk,
    /// Whenever the system writes them.
    Soon,
}

fn write(path: &Path, bytes: &[u8], durability: Durability) -> Result<()> {
    let write = || match Place::of(path)? {
        Place::Stream => File::options().write(true).open(path)?.write_all(bytes),
        Place::File { target, old } => {
            let mut file = create_beside(&target)?;
            file.write_all(bytes)?;
            persist(file, &target, old.as_ref(), durability)
        }
    };
    write().map_err(|error| output_error(path, &error))
}

/// A file that grows beside its target and takes the target's name only when it is complete. Dropping it earlier
/// removes it.
#[derive(Debug)]
pub struct PartialFile {
    /// The target, as the user wrote it.
    path: PathBuf,
    target: PathBuf,
    old: Option<Metadata>,
    file: NamedTempFile,
}

impl PartialFile {
    /// An empty file for `path`.
    ///
    /// # Errors
    /// [`Error::Output`], as from [`write_atomically`], and if `path` is a device or a pipe.
    pub fn create(path: &Path) -> Result<Self> {
        let create = || match Place::of(path)? {
            Place::Stream => Err(io::Error::other("it is a device or a pipe")),
            Place::File { target, old } => {
                let file = create_beside(&target)?;
                Ok(Self { path: path.to_owned(), target, old, file })
            }
        };
        create().map_err(|error| output_error(path, &error))
    }

    /// A handle to write with.
    ///
    /// # Errors
    /// [`Error::Output`] if the process can hold no more files open.
    pub fn writer(&self) -> Result<File> {
        self.file.as_file().try_clone().map_err(|error| output_error(&self.path, &error))
    }

    /// The path of the file while it grows, so that other programs can write to it.
    #[must_use]
    pub fn growing_path(&self) -> &Path {
        self.file.path()
    }

    /// The error that [`write_atomically`] would return for `error`.
    #[must_use]
    pub fn failure(&self, error: &io::Error) -> Error {
        output_error(&self.path, error)
    }

    /// Gives the file the name of its target, in one step.
    ///
    /// # Errors
    /// [`Error::Output`], as from [`write_atomically`].
    pub fn commit(self) -> Result<()> {
        let Self { path, target, old, file } = self;
        persist(file, &target, old.as_ref(), Durability::OnDisk).map_err(|error| output_error(&path, &error))
    }
}

/// A folder that is filled beside its target and takes the target's name only when it is complete. Dropping it earlier
/// removes it.
#[derive(Debug)]
pub struct PartialFolder {
    folder: TempDir,
    lock: File,
}

impl PartialFolder {
    /// Creates an empty folder in `parent`, which must exist.
    ///
    /// # Errors
    /// [`Error::Output`] if `parent` cannot be written to.
    pub fn create_in(parent: &Path) -> Result<Self> {
        let create = || loop {
            let folder = names(0o777).tempdir_in(parent)?;
            match File::create_new(folder.path().join(LOCK)) {
                Ok(lock) if is_held(&lock, &folder.path().join(LOCK)) => return Ok(Self { folder, lock }),
                // A sweep found it before it was locked.
                Ok(_) => {}
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        };
        create().map_err(|error| output_error(parent, &error))
    }

    /// The path of the folder while it is filled.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Renames the folder to `target` in one step. Returns it unchanged if something other than an empty folder is
    /// there.
    ///
    /// # Errors
    /// [`Error::Output`] if it cannot be renamed.
    pub fn commit(self, target: &Path) -> Result<Option<Self>> {
        use io::ErrorKind::{AlreadyExists, DirectoryNotEmpty, NotADirectory};
        match fs::rename(self.path(), target) {
            Ok(()) => {
                // Only now, since without its lock the folder could be swept.
                drop(self.lock);
                let _ = self.folder.keep();
                let _ = fs::remove_file(target.join(LOCK));
                Ok(None)
            }
            Err(error) if matches!(error.kind(), AlreadyExists | DirectoryNotEmpty | NotADirectory) => Ok(Some(self)),
            Err(error) => Err(output_error(target, &error)),
        }
    }
}

/// Checks whether [`write_atomically`] could write to `path` now, and leaves nothing behind.
///
/// Call this before hours of work. It cannot foresee that the disk fills up.
///
/// # Errors
/// [`Error::Output`], as [`write_atomically`] would return.
pub fn check_writable(path: &Path) -> Result<()> {
    let check = || match Place::of(path)? {
        // Opening a pipe would block until it has a reader.
        Place::Stream => Ok(()),
        Place::File { target, .. } => create_beside(&target)?.close(),
    };
    check().map_err(|error| output_error(path, &error))
}

/// Checks whether files can be written into `folder` now, and leaves nothing behind.
///
/// # Errors
/// [`Error::Output`] about the folder.
pub fn check_folder_writable(folder: &Path) -> Result<()> {
    create_in(folder).and_then(NamedTempFile::close).map_err(|error| match error.kind() {
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            Error::output(folder, "the folder may not be written to; change its permissions, or name another one")
        }
        _ => output_error(folder, &error),
    })
}

/// What a path leads to.
enum Place {
    /// A device, pipe or socket: it cannot be replaced, only written to.
    Stream,
    /// A regular file, or the place for one; `target` has no symbolic link as its last part.
    File { target: PathBuf, old: Option<Metadata> },
}

impl Place {
    fn of(path: &Path) -> io::Result<Self> {
        if names_a_folder(path) {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
            Ok(found) if found.is_file() => Ok(Self::File { target: fs::canonicalize(path)?, old: Some(found) }),
            Ok(_) => Ok(Self::Stream),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                Ok(Self::File { target: path.to_owned(), old: None })
            }
            Err(error) => Err(error),
        }
    }
}

/// Whether `path` ends in a separator or in `.`. `Path` ignores both, but no file can have such a name.
fn names_a_folder(path: &Path) -> bool {
    let last = path.as_os_str().as_encoded_bytes().rsplit(|&byte| is_separator(char::from(byte))).next();
    matches!(last, Some(b"" | b"."))
}

/// Creates an empty temporary file in the folder of `target`, since a rename is a single step only within one file
/// system.
fn create_beside(target: &Path) -> io::Result<NamedTempFile> {
    create_in(target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")))
}

fn create_in(folder: &Path) -> io::Result<NamedTempFile> {
    loop {
        let file = names(0o666).tempfile_in(folder)?;
        if is_held(file.as_file(), file.path()) {
            return Ok(file);
        }
    }
}

/// How the names of this host's temporary files begin.
fn own_prefix() -> &'static str {
    static OWN: OnceLock<String> = OnceLock::new();
    OWN.get_or_init(|| {
        let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        let plain = |char: char| if char.is_ascii_alphanumeric() || char == '.' { char } else { '-' };
        let host: String = name.trim().chars().map(plain).take(64).collect();
        format!("{PREFIX}{host}{HOST_END}")
    })
}

/// The names of temporary files and folders, and their permissions before the umask applies.
fn names(mode: u32) -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(own_prefix()).suffix(SUFFIX);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
    #[cfg(not(unix))]
    let _ = mode;
    builder
}

/// Locks a file that was just created. False if a sweep found it first, which removes it.
fn is_held(file: &File, path: &Path) -> bool {
    // On file systems without locks, nothing is swept.
    !matches!(file.try_lock(), Err(TryLockError::WouldBlock)) && path.exists()
}

/// Removes the temporary files and folders that killed processes left in `folder`. Those of this host are removed if no
/// living process holds their lock, and those of other hosts if nobody wrote to them for a day, judged by `age_of`.
/// Those that belong to another user stay.
///
/// # Errors
/// [`Error::Output`] if the folder cannot be read, or such a file cannot be removed.
pub fn sweep(folder: &Path, age_of: impl Fn(&Metadata) -> Option<Duration>) -> Result<()> {
    let is_old = |entry: &DirEntry| entry.metadata().ok().and_then(|found| age_of(&found)) > Some(LEFT_AFTER);
    let sweep = || -> io::Result<()> {
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name();
            let name = name.as_encoded_bytes();
            let is_named_so = name.starts_with(PREFIX.as_bytes()) && name.ends_with(SUFFIX.as_bytes());
            if !is_named_so || !(name.starts_with(own_prefix().as_bytes()) || is_old(&entry)) {
                continue;
            }
            let kind = entry.file_type()?;
            if kind.is_dir() {
                pass_over_others(remove_folder_unless_in_use(&entry.path()))?;
            // Opening a pipe would block until it has a writer.
            } else if kind.is_file() {
                pass_over_others(remove_unless_in_use(&entry.path()))?;
            }
        }
        Ok(())
    };
    sweep().map_err(|error| output_error(folder, &error))
}

fn remove_unless_in_use(path: &Path) -> io::Result<()> {
    // NFS grants an exclusive lock only on a file that is open for writing.
    let file = File::options().read(true).write(true).open(path)?;
    if file.try_lock().is_ok() { fs::remove_file(path) } else { Ok(()) }
}

fn remove_folder_unless_in_use(path: &Path) -> io::Result<()> {
    let lock = match File::options().read(true).write(true).open(path.join(LOCK)) {
        Ok(lock) => lock,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            // Its process has not locked it yet, or was killed before it could. A folder in use is not empty, so this
            // does not remove it.
            let _ = fs::remove_dir(path);
            return Ok(());
        }
        Err(error) => return Err(error),
    };
    if lock.try_lock().is_err() {
        return Ok(());
    }
    let removed = fs::remove_dir_all(path).or_else(|error| {
        // A file that is open may keep its folder there.
        drop(lock);
        if cfg!(windows) { fs::remove_dir_all(path) } else { Err(error) }
    });
    match removed {
        // A child of the killed process still writes into it. A later sweep may succeed.
        Err(error) if error.kind() == io::ErrorKind::DirectoryNotEmpty => File::create(path.join(LOCK)).map(drop),
        removed => removed,
    }
}

fn pass_over_others(removed: io::Result<()>) -> io::Result<()> {
    removed.or_else(|error| match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied => Ok(()),
        _ => Err(error),
    })
}

/// Renames a temporary file to its target, with the permissions of the file that it replaces.
fn persist(file: NamedTempFile, target: &Path, old: Option<&Metadata>, durability: Durability) -> io::Result<()> {
    if let Some(old) = old {
        file.as_file().set_permissions(old.permissions())?;
    }
    if durability == Durability::OnDisk {
        file.as_file().sync_all()?;
    }
    file.persist(target)?;
    Ok(())
}

const DISK_FULL: &str = "the disk is full; free some space, or name a folder on another disk";

/// Whether an error of this module was caused by a full disk.
#[must_use]
pub fn is_disk_full(error: &Error) -> bool {
    matches!(error, Error::Output { reason, .. } if reason == DISK_FULL)
}

fn output_error(path: &Path, error: &io::Error) -> Error {
    use io::ErrorKind::{
        FileTooLarge, IsADirectory, NotADirectory, NotFound, PermissionDenied, QuotaExceeded, ReadOnlyFilesystem,
        StorageFull,
    };
    let reason = match error.kind() {
        IsADirectory => "is a folder; name a file in it".to_owned(),
        NotFound | NotADirectory => "its folder does not exist; create it first, or name another one".to_owned(),
        PermissionDenied | ReadOnlyFilesystem => {
            "its folder may not be written to; change its permissions, or name another one".to_owned()
        }
        StorageFull | QuotaExceeded => DISK_FULL.to_owned(),
        FileTooLarge => {
            "is larger than a file may be here; raise the limit (ulimit -f), or name another disk".to_owned()
        }
        _ => format!("cannot be written, since {}; name another file", in_words(error)),
    };
    Error::output(path, reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_process_left_is_swept_and_what_a_living_one_writes_is_not() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let left = folder.path().join(format!("{}1-abc{SUFFIX}", own_prefix()));
        let other = folder.path().join(".other.partial");
        let of_host = folder.path().join(".smalti-another.host@1-abc.partial");
        for path in [&left, &other, &of_host] {
            fs::write(path, b"half").expect("the folder is ours");
        }
        let growing = PartialFile::create(&folder.path().join("out.png")).expect("the folder is ours");
        let left_folder = folder.path().join(format!("{}def.partial", own_prefix()));
        let fill =
            |()| fs::write(left_folder.join(LOCK), b"").and_then(|()| fs::write(left_folder.join("1.png"), b"half"));
        fs::create_dir(&left_folder).and_then(fill).expect("the folder is ours");
        let filling = PartialFolder::create_in(folder.path()).expect("the folder is ours");
        sweep(folder.path(), |_| Some(Duration::ZERO)).expect("the folder is ours");
        assert!(!left_folder.exists() && filling.path().exists());
        assert!(filling.commit(&folder.path().join("frames")).expect("nothing is there").is_none());
        assert!(!left.exists() && other.exists() && of_host.exists() && growing.growing_path().exists());
        sweep(folder.path(), |_| Some(2 * LEFT_AFTER)).expect("the folder is ours");
        assert!(other.exists() && !of_host.exists() && growing.growing_path().exists());
        growing.commit().expect("nothing took it away");
        assert!(folder.path().join("out.png").exists());
        assert!(sweep(&folder.path().join("none"), |_| None).is_err());
    }
}
