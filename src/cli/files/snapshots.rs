//! The folder of a run: one population file for each snapshot, named by the evals before it. In the paper's scheme
//! evals are births.
//!
//! Names and metadata tell everything, so no index can disagree with the files. All snapshots with one key lie on one
//! course. A folder may therefore hold those of an interrupted run, until a whole one leaves only its own.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::destination::Overwrite;
use super::places::{Inputs, place_of};
use crate::archive;
use crate::cli::values::in_range;
use crate::error::{Error, Result, in_words};
use crate::studio::SOFTWARE;

/// Least digits of the evals in a name, so that names sort like their evals up to a trillion.
const NAME_DIGITS: usize = 12;
/// The planned evals are cut into this many equal steps by default. With the closer snapshots at the beginning, that
/// makes about 240.
const STEP_COUNT: u64 = 100;

/// Where the snapshots of an evolution go, and how often one is taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SaveRun {
    /// The folder, as the user wrote it.
    pub folder: PathBuf,
    /// Evals between two snapshots.
    every: Option<u64>,
}

/// A snapshot in a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Snapshot {
    pub path: PathBuf,
    /// Evals before it; in the paper's scheme the births of all runs.
    pub evals: u64,
    /// Global fitness of the best population at that time.
    pub sae: u64,
    /// Key of the evolution that it belongs to.
    pub key: String,
}

impl SaveRun {
    /// Snapshots in `folder`, one for each `every` evals.
    ///
    /// # Errors
    /// [`Error::Usage`] if `every` is 0.
    pub(crate) fn new(folder: &Path, every: Option<u64>) -> Result<Self> {
        let every = every.map(|births| in_range("--save-every", births, 1..=u64::MAX)).transpose()?;
        Ok(Self { folder: folder.to_owned(), every })
    }

    /// Checks, before anything is read, that the folder is neither another output nor an input.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is.
    pub(crate) fn check_place<'a>(&self, mut others: impl Iterator<Item = &'a Path>, inputs: &Inputs) -> Result<()> {
        let (place, folder) = (place_of(&self.folder), self.folder.display());
        if inputs.has(&self.folder) {
            return Err(Error::Usage(format!("{folder} is an input; name another folder for the snapshots")));
        }
        if inputs.are_in(&self.folder) {
            return Err(Error::Usage(format!("{folder} holds an input; name another folder for the snapshots")));
        }
        if others.any(|other| place_of(other) == place) {
            return Err(Error::Usage(format!("{folder} is named twice as an output")));
        }
        Ok(())
    }

    /// Evals between two snapshots of an evolution that plans this many evals.
    pub(crate) fn evals_between(&self, evals_planned: u64) -> u64 {
        self.every.unwrap_or_else(|| evals_planned.div_ceil(STEP_COUNT)).max(1)
    }

    /// Checks that the folder is empty, missing, or holds snapshots of the evolution with this key.
    ///
    /// # Errors
    /// [`Error::Usage`] if something else is in it that may not be overwritten; [`Error::Output`] if it is not a
    /// folder.
    pub(crate) fn check(&self, key: &str, overwrite: Overwrite) -> Result<()> {
        let contents = contents(&self.folder).map_err(|error| self.unusable(&error))?;
        if overwrite == Overwrite::Force {
            return Ok(());
        }
        let why = if contents.snapshots.is_empty() && contents.has_others {
            "holds files that are no snapshots"
        } else if contents.snapshots.iter().any(|path| key_of(path).as_deref() != Some(key)) {
            "holds snapshots of another evolution"
        } else {
            return Ok(());
        };
        let folder = self.folder.display();
        Err(Error::Usage(format!("{folder} {why}; name another folder, or use this one with --force")))
    }

    /// Makes the folder ready for the evolution with this key: creates it, and removes snapshots of others, which
    /// [`SaveRun::check`] has allowed. Files that are not smalti's snapshots stay, whatever their names.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub(crate) fn prepare(&self, key: &str) -> Result<()> {
        let prepare = || {
            fs::create_dir_all(&self.folder)?;
            let others = contents(&self.folder)?.snapshots.into_iter();
            others.filter(|path| key_of(path).is_some_and(|found| found != key)).try_for_each(fs::remove_file)
        };
        prepare().map_err(|error| self.unusable(&error))
    }

    /// Removes the snapshots of the evolution with this key that are not after one of these numbers of evals.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub(crate) fn keep_only(&self, evals: &BTreeSet<u64>, key: &str) -> Result<()> {
        let is_surplus = |path: &PathBuf| {
            evals_of(path).is_some_and(|found| !evals.contains(&found)) && key_of(path).as_deref() == Some(key)
        };
        let remove = || contents(&self.folder)?.snapshots.into_iter().filter(is_surplus).try_for_each(fs::remove_file);
        remove().map_err(|error| self.unusable(&error))
    }

    /// The file of the snapshot after this many evals.
    pub(crate) fn path_of(&self, evals: u64) -> PathBuf {
        self.folder.join(format!("{evals:0NAME_DIGITS$}.npz"))
    }

    fn unusable(&self, error: &io::Error) -> Error {
        Error::output(
            &self.folder,
            format!("cannot be used as a folder for snapshots, since {}; name another one", in_words(error)),
        )
    }
}

/// The snapshots in `folder`, in the order of their evals.
///
/// # Errors
/// [`Error::Input`] if the folder cannot be read or holds no snapshot, if a snapshot does not tell its SAE, or if they
/// come from more than one evolution.
pub(crate) fn list(folder: &Path) -> Result<Vec<Snapshot>> {
    let unreadable = |error: io::Error| {
        let reason = match error.kind() {
            io::ErrorKind::NotFound => "there is no such folder; check its name".to_owned(),
            io::ErrorKind::NotADirectory => {
                "is a file, and a timelapse needs a folder of snapshots; smalti evolve --save-run DIR keeps them"
                    .to_owned()
            }
            _ => format!("cannot be read as a folder, since {}", in_words(&error)),
        };
        Error::input(folder, reason)
    };
    // Unlike `contents`, this must fail for a missing folder.
    fs::read_dir(folder).map_err(unreadable)?;
    let found = contents(folder).map_err(unreadable)?.snapshots.into_iter();
    let mut snapshots = found.map(read).collect::<Result<Vec<_>>>()?;
    snapshots.sort_by_key(|snapshot| snapshot.evals);
    let Some(first) = snapshots.first() else {
        let reason = "holds no snapshots; make some with smalti evolve --save-run";
        return Err(Error::input(folder, reason));
    };
    if snapshots.iter().any(|snapshot| snapshot.key != first.key) {
        return Err(Error::input(folder, "holds snapshots of more than one evolution; keep those of one"));
    }
    Ok(snapshots)
}

/// What is in a folder.
#[derive(Debug, Default)]
struct Contents {
    /// Files whose names are those of snapshots.
    snapshots: Vec<PathBuf>,
    /// Whether anything else is there that is not hidden.
    has_others: bool,
}

fn contents(folder: &Path) -> io::Result<Contents> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Contents::default()),
        entries => entries?,
    };
    let mut contents = Contents::default();
    for entry in entries {
        let path = entry?.path();
        if evals_of(&path).is_some() {
            contents.snapshots.push(path);
        } else {
            let name = path.file_name().unwrap_or_default().as_encoded_bytes();
            contents.has_others |= !name.starts_with(b".");
        }
    }
    Ok(contents)
}

/// The evals in the name of a snapshot; none for any other name.
fn evals_of(path: &Path) -> Option<u64> {
    let digits = path.file_name()?.to_str()?.strip_suffix(".npz")?;
    let is_name = digits.len() >= NAME_DIGITS && digits.bytes().all(|byte| byte.is_ascii_digit());
    digits.parse().ok().filter(|_| is_name)
}

/// The key of the evolution that the snapshot at `path` belongs to, if it is one.
fn key_of(path: &Path) -> Option<String> {
    read(path.to_owned()).ok().map(|snapshot| snapshot.key)
}

fn read(path: PathBuf) -> Result<Snapshot> {
    let told = archive::read_meta(&path)?;
    let text = |key| told.get(key).and_then(Value::as_str);
    let number = |key| told.get(key).and_then(Value::as_u64);
    let evals = number("evals").or(number("births"));
    let is_ours = text("software") == Some(SOFTWARE) && evals == evals_of(&path);
    match (text("key"), evals, number("sae")) {
        (Some(key), Some(evals), Some(sae)) if is_ours => Ok(Snapshot { evals, sae, key: key.to_owned(), path }),
        _ => Err(Error::input(&path, "is no snapshot of smalti evolve --save-run; remove it from the folder")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_evals_and_sort_like_them() {
        let save_run = SaveRun::new(Path::new("run"), None).expect("the default is fine");
        let names: Vec<PathBuf> = [0, 7, 12_000, 999_999_999_999].map(|evals| save_run.path_of(evals)).into();
        assert_eq!(names[2], Path::new("run/000000012000.npz"));
        assert!(names.is_sorted());
        assert_eq!(evals_of(&save_run.path_of(u64::MAX)), Some(u64::MAX));
        for name in ["run/12000.npz", "run/+00000012000.npz", "run/000000012000.png", "run/a00000012000.npz"] {
            assert_eq!(evals_of(Path::new(name)), None, "{name}");
        }
    }

    #[test]
    fn the_default_covers_all_planned_evals_in_a_hundred_steps() {
        let every = |asked, planned| SaveRun::new(Path::new("run"), asked).map(|run| run.evals_between(planned)).ok();
        assert_eq!([every(None, 40_000), every(None, 40_001)], [Some(400), Some(401)]);
        assert_eq!([every(None, 0), every(Some(7), 40_000), every(Some(0), 40_000)], [Some(1), Some(7), None]);
    }
}
