//! What the window remembers until the next time: its size, the last folder, light or dark. Nothing of it is needed,
//! and what cannot be read or written is left out without a word.

use std::env;
use std::path::{Path, PathBuf};

use egui::ThemePreference;
use serde::{Deserialize, Serialize};

use crate::output;

/// Most bytes of the file.
const BYTES_MAX: u64 = 1 << 16;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub(super) struct Remembered {
    /// Width and height in points.
    pub size: Option<[f32; 2]>,
    pub is_maximized: bool,
    /// Where the last file was opened or saved.
    pub folder: Option<PathBuf>,
    pub theme: Option<Theme>,
}

/// Light, dark, or as the desktop has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Theme {
    Light,
    Dark,
    System,
}

impl From<ThemePreference> for Theme {
    fn from(preference: ThemePreference) -> Self {
        match preference {
            ThemePreference::Light => Self::Light,
            ThemePreference::Dark => Self::Dark,
            ThemePreference::System => Self::System,
        }
    }
}

impl From<Theme> for ThemePreference {
    fn from(theme: Theme) -> Self {
        match theme {
            Theme::Light => Self::Light,
            Theme::Dark => Self::Dark,
            Theme::System => Self::System,
        }
    }
}

/// The folder of the user's configuration of smalti.
pub(super) fn folder() -> Option<PathBuf> {
    let of = |name: &str| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let home = || env::home_dir().filter(|home| home.is_absolute());
    let base = if cfg!(windows) {
        of("APPDATA")
    } else if cfg!(target_os = "macos") {
        home().map(|home| home.join("Library/Application Support"))
    } else {
        of("XDG_CONFIG_HOME").or_else(|| home().map(|home| home.join(".config")))
    };
    base.map(|base| base.join("smalti"))
}

impl Remembered {
    pub(super) fn read() -> Self {
        folder().map(|folder| Self::read_from(&folder.join("window.json"))).unwrap_or_default()
    }

    fn read_from(path: &Path) -> Self {
        let is_small = std::fs::metadata(path).is_ok_and(|metadata| metadata.len() <= BYTES_MAX);
        let bytes = if is_small { std::fs::read(path).unwrap_or_default() } else { Vec::new() };
        let remembered: Self = serde_json::from_slice(&bytes).unwrap_or_default();
        let is_usable = |size: &[f32; 2]| size.iter().all(|side| (200.0..20_000.0).contains(side));
        Self { size: remembered.size.filter(is_usable), ..remembered }
    }

    pub(super) fn write(&self) {
        if let Some(folder) = folder() {
            // Nobody waits for it, and without it the next window opens as the first one did.
            let _ = std::fs::create_dir_all(&folder);
            let text = serde_json::to_vec_pretty(self).unwrap_or_default();
            let _ = output::write_atomically(&folder.join("window.json"), &text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_nonsense_is_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("window.json");
        assert_eq!(Remembered::read_from(&path), Remembered::default());
        let theme = Some(Theme::Light);
        let known = Remembered { size: Some([900.0, 700.0]), is_maximized: true, folder: Some("/a".into()), theme };
        std::fs::write(&path, serde_json::to_vec(&known).expect("it is plain")).expect("it is written");
        assert_eq!(Remembered::read_from(&path), known);
        for text in ["", "{", "[1]", r#"{"size": [1, 1e30]}"#] {
            std::fs::write(&path, text).expect("it is written");
            assert_eq!(Remembered::read_from(&path), Remembered::default(), "{text}");
        }
    }
}
