//! Writing whole files or none.

use std::fs;
use std::path::Path;

use smalti::Error;
use smalti::output::{check_writable, write_atomically};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn names_in(folder: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("it is there");
    entries.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned()).collect()
}

fn reason(result: smalti::Result<()>) -> String {
    match result {
        Err(Error::Output { reason, .. }) => reason,
        other => panic!("an output error was expected, not {other:?}"),
    }
}

#[test]
fn a_file_is_created_and_replaced_and_nothing_else_is_left() {
    let folder = folder();
    let path = folder.path().join("out.png");
    write_atomically(&path, b"first").expect("it can be created");
    write_atomically(&path, b"second").expect("it can be replaced");
    assert_eq!(fs::read(&path).expect("it is there"), b"second");
    assert_eq!(names_in(&folder), ["out.png"]);
}

#[test]
fn checking_leaves_nothing_and_changes_nothing() {
    let folder = folder();
    let path = folder.path().join("out.png");
    check_writable(&path).expect("the folder is ours");
    assert!(names_in(&folder).is_empty());
    fs::write(&path, b"old").expect("it can be written");
    check_writable(&path).expect("the file is ours");
    assert_eq!(fs::read(&path).expect("it is there"), b"old");
    assert_eq!(names_in(&folder), ["out.png"]);
}

#[test]
fn a_missing_folder_and_a_folder_as_target_are_refused_before_and_after() {
    let folder = folder();
    let missing = folder.path().join("none/out.png");
    let through_a_file = folder.path().join("file/out.png");
    fs::write(folder.path().join("file"), b"").expect("it can be written");
    for refuse in [check_writable, |path: &Path| write_atomically(path, b"bytes")] {
        for path in [&missing, &through_a_file] {
            assert_eq!(reason(refuse(path)), "its folder does not exist; create it first, or name another one");
        }
        assert_eq!(reason(refuse(folder.path())), "is a folder; name a file in it");
    }
    assert_eq!(names_in(&folder), ["file"]);
}

#[cfg(unix)]
mod on_unix {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};

    use super::*;

    #[test]
    fn a_new_file_has_the_permissions_that_any_program_would_give_it() {
        let folder = folder();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_atomically(&ours, b"bytes").expect("it can be created");
        fs::write(&plain, b"bytes").expect("it can be written");
        let mode = |path| fs::metadata(path).expect("it is there").mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[test]
    fn a_replaced_file_keeps_its_permissions() {
        let folder = folder();
        let path = folder.path().join("out.png");
        fs::write(&path, b"old").expect("it can be written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("it is ours");
        write_atomically(&path, b"new").expect("it can be replaced");
        assert_eq!(fs::metadata(&path).expect("it is there").mode() & 0o777, 0o640);
    }

    #[test]
    fn a_link_stays_and_its_file_is_replaced() {
        let folder = folder();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, b"old").expect("it can be written");
        symlink("file", &link).expect("links can be made");
        write_atomically(&link, b"new").expect("it can be replaced");
        assert_eq!(fs::read(&file).expect("it is there"), b"new");
        assert!(fs::symlink_metadata(&link).expect("it is there").is_symlink());
    }

    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        write_atomically(Path::new("/dev/null"), b"bytes").expect("it takes everything");
        check_writable(Path::new("/dev/null")).expect("it takes everything");
        assert!(!fs::metadata("/dev/null").expect("it is there").is_file());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_called_so() {
    let reason = reason(write_atomically(Path::new("/dev/full"), b"bytes"));
    assert_eq!(reason, "the disk is full; free some space, or name a folder on another disk");
}
