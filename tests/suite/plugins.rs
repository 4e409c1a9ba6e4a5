//! `smalti plugins` in a home folder of its own.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::workshop::{Ran, Workshop};

/// Runs `smalti plugins` for a user whose home is `home`, and who has no program of the hosts.
fn plugins(workshop: &Workshop, line: &str) -> Ran {
    let mut command = workshop.command(&format!("plugins {line}"));
    command.env("HOME", workshop.path("home")).env("PATH", workshop.path("bin"));
    for name in ["XDG_CONFIG_HOME", "XDG_DATA_HOME", "GIMP3_DIRECTORY", "GIMP2_DIRECTORY", "INKSCAPE_PROFILE_DIR"] {
        command.env_remove(name);
    }
    let output = command.output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    Ran { code: output.status.code(), stdout: output.stdout, stderr }
}

/// Paths of all files below a folder.
fn files(folder: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(next).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else {
                found.insert(path.strip_prefix(folder).unwrap().display().to_string());
            }
        }
    }
    found
}

#[test]
fn plug_ins_are_put_where_hosts_look_and_taken_away_again() {
    let workshop = Workshop::new();
    let home = workshop.path("home");
    for folder in [".config/GIMP/3.0", ".config/inkscape/extensions", ".var/app/org.kde.krita"] {
        std::fs::create_dir_all(home.join(folder)).unwrap();
    }
    std::fs::write(home.join(".config/inkscape/extensions/mine.inx"), "mine").unwrap();
    let before = files(&home);
    let ran = plugins(&workshop, "install");
    assert_eq!((ran.code, ran.stderr.lines().count()), (Some(0), 3), "{}", ran.stderr);
    let there = files(&home);
    for file in [
        ".config/GIMP/3.0/plug-ins/smalti/smalti.py",
        ".config/GIMP/3.0/plug-ins/smalti/smalti_program.py",
        ".config/inkscape/extensions/smalti/smalti.inx",
        ".var/app/org.kde.krita/data/krita/pykrita/smalti.desktop",
        ".var/app/org.kde.krita/data/krita/pykrita/smalti/__init__.py",
    ] {
        assert!(there.contains(file), "{file} is missing in {there:?}");
    }
    let note = std::fs::read_to_string(home.join(".config/GIMP/3.0/plug-ins/smalti/smalti_program.txt")).unwrap();
    assert_eq!(Path::new(&note), Path::new(env!("CARGO_BIN_EXE_smalti")).canonicalize().unwrap());
    let rows = plugins(&workshop, "status --json").row();
    let state = |host: &str| -> Vec<&Value> {
        let of_host = rows.as_array().unwrap().iter().filter(|row| row["host"] == host && row["found"] == true);
        of_host.map(|row| &row["state"]).collect()
    };
    for host in ["gimp3", "inkscape", "krita"] {
        assert_eq!(state(host), ["current"], "{host}: {rows}");
    }
    assert!(state("gimp2").is_empty(), "{rows}");
    // What runs it keeps something beside it.
    let cache = home.join(".config/GIMP/3.0/plug-ins/smalti/__pycache__");
    std::fs::create_dir(&cache).unwrap();
    std::fs::write(cache.join("smalti_program.cpython-311.pyc"), "").unwrap();
    assert_eq!(plugins(&workshop, "install --quiet").stderr, "", "again is no failure");
    assert_eq!(plugins(&workshop, "remove").code, Some(0));
    assert_eq!(files(&home), before);
}

#[test]
fn what_was_changed_stays_and_other_failures_are_told_in_one_sentence() {
    let workshop = Workshop::new();
    let home = workshop.path("home");
    std::fs::create_dir(&home).unwrap();
    for (line, code, sentence) in [
        ("install", 2, "neither GIMP, Krita nor Inkscape is found here"),
        ("install photoshop", 2, "photoshop"),
        ("install gimp2", 1, "is compiled by gimptool-2.0, which is missing"),
        ("remove", 0, "no plug-in of smalti is there"),
    ] {
        let ran = plugins(&workshop, line);
        assert_eq!((ran.code, ran.stderr.lines().count()), (Some(code), 1), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(sentence), "{line}: {}", ran.stderr);
    }
    assert_eq!(files(&home), BTreeSet::new());
    assert_eq!(plugins(&workshop, "install krita --quiet").code, Some(0), "one that is named needs not be found");
    let changed = home.join(".local/share/krita/pykrita/smalti/__init__.py");
    std::fs::write(&changed, "changed").unwrap();
    for line in ["install krita", "remove krita"] {
        let ran = plugins(&workshop, line);
        assert_eq!(ran.code, Some(1), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains("__init__.py: was changed since smalti put it there"), "{}", ran.stderr);
        assert_eq!(std::fs::read_to_string(&changed).unwrap(), "changed");
    }
    let table = plugins(&workshop, "status krita");
    assert!(String::from_utf8(table.stdout).unwrap().contains("__init__.py is not as smalti put it there"));
    assert_eq!(plugins(&workshop, "remove krita --force").code, Some(0));
    assert_eq!(files(&home), BTreeSet::new());
}

#[test]
fn what_finds_the_program_is_of_this_version_and_does_what_it_says() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("plugins/shared");
    let text = std::fs::read_to_string(shared.join("smalti_program.py")).unwrap();
    assert!(text.contains(&format!("\nVERSION = \"{}\"\n", env!("CARGO_PKG_VERSION"))), "another version");
    let of_gimp2 = std::fs::read_to_string(shared.join("../gimp2/smalti_program.h")).unwrap();
    assert!(
        of_gimp2.contains(&format!("\n#define SMALTI_VERSION \"{}\"\n", env!("CARGO_PKG_VERSION"))),
        "another version"
    );
    let mut command = Command::new("python3");
    command.args(["-m", "unittest", "-q", "test_smalti_program"]).env("SMALTI", env!("CARGO_BIN_EXE_smalti"));
    command.env("PYTHONDONTWRITEBYTECODE", "1").env("SMALTI_DEVICE", "cpu");
    let ran = command.current_dir(shared.join("../../tests/doors/shared")).output().expect("python3 is installed");
    let said = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{said}");
}
