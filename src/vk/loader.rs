//! Opens the Vulkan loader: where the system looks for it, and on macOS also where it is installed without the system
//! looking there.

use ash::{Entry, LoadingError};

/// Names of files on macOS, best first. The last is a driver that does without a loader, and so without layers.
const FILES_ON_MACOS: [&str; 3] = ["libvulkan.dylib", "libvulkan.1.dylib", "libMoltenVK.dylib"];

/// Folders on macOS: wherever the system looks, then those of Homebrew on Apple silicon, of Homebrew on Intel and of
/// the Vulkan SDK, and of MacPorts.
const FOLDERS_ON_MACOS: [&str; 4] = ["", "/opt/homebrew/lib/", "/usr/local/lib/", "/opt/local/lib/"];

/// Opens the loader.
///
/// # Errors
/// What the system's own search came to, if the loader is nowhere.
pub(super) fn open() -> Result<Entry, LoadingError> {
    // SAFETY: loading libvulkan runs its initialisers, which every Vulkan program relies on.
    match unsafe { Entry::load() } {
        Err(error) if cfg!(target_os = "macos") => places_on_macos().find_map(|place| open_at(&place)).ok_or(error),
        opened => opened,
    }
}

/// The loader in the file of this path; none if there is none.
fn open_at(path: &str) -> Option<Entry> {
    // SAFETY: as in `open`.
    unsafe { Entry::load_from(path) }.ok()
}

/// Where the loader may be on macOS: each file in each folder.
fn places_on_macos() -> impl Iterator<Item = String> {
    let in_folders = |file| FOLDERS_ON_MACOS.into_iter().map(move |folder| format!("{folder}{file}"));
    FILES_ON_MACOS.into_iter().flat_map(in_folders)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn on_macos_every_place_is_tried_for_the_loader_before_any_for_a_driver() {
        let places: Vec<String> = places_on_macos().collect();
        for place in [
            "libvulkan.1.dylib",
            "/opt/homebrew/lib/libvulkan.dylib",
            "/opt/homebrew/lib/libMoltenVK.dylib",
            "/usr/local/lib/libvulkan.1.dylib",
            "/usr/local/lib/libMoltenVK.dylib",
        ] {
            assert_eq!(places.iter().filter(|other| *other == place).count(), 1, "{place}");
        }
        let is_driver: Vec<bool> = places.iter().map(|place| place.ends_with("libMoltenVK.dylib")).collect();
        assert!(is_driver.is_sorted(), "{places:?}");
    }

    #[test]
    fn a_file_that_is_not_there_is_no_loader() {
        assert!(open_at("/nowhere/libvulkan.dylib").is_none());
    }
}
