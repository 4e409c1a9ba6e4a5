//! The cache of compiled pipelines, which lies in the user's cache folder from one run to the next.
//!
//! There is a file for each device and driver version. It only saves time: if anything goes wrong with it, the
//! pipelines are compiled anew without a message. A driver that has nothing to cache, such as lavapipe, gets no file.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use crate::output;
use crate::studio::PipelineKeeper;
use crate::vk::DeviceInfo;

/// The environment variable that names another folder. If it is empty, nothing is cached.
const VARIABLE: &str = "SMALTI_CACHE";
/// Bytes of the header that Vulkan puts before a driver's cache.
const HEADER_BYTES: usize = 32;
/// Bytes of the digest at the beginning of the file. It is checked because a driver may crash on bytes that it did not
/// write.
const DIGEST_BYTES: usize = 32;

/// The caches of all devices.
pub(crate) fn keeper() -> Arc<dyn PipelineKeeper> {
    Arc::new(CacheFolder)
}

/// The user's cache folder.
struct CacheFolder;

impl PipelineKeeper for CacheFolder {
    fn read(&self, info: &DeviceInfo) -> Vec<u8> {
        path_of(info).and_then(|path| read(&path)).unwrap_or_default()
    }

    fn write(&self, info: &DeviceInfo, bytes: &[u8]) {
        if let Some(path) = path_of(info) {
            write(&path, bytes);
        }
    }
}

/// The file of a device, if pipelines are cached at all.
fn path_of(info: &DeviceInfo) -> Option<PathBuf> {
    let folder = folder(|name| std::env::var_os(name)).filter(|_| !info.uuid.is_empty());
    folder.map(|folder| folder.join(format!("{}-{:08x}.pipelines", info.uuid, info.driver_version)))
}

/// What an earlier run cached, if it can be used.
fn read(path: &Path) -> Option<Vec<u8>> {
    unsealed(&std::fs::read(path).ok()?)
}

fn write(path: &Path, bytes: &[u8]) {
    if bytes.len() <= HEADER_BYTES || read(path).is_some_and(|kept| kept == bytes) {
        return;
    }
    let folder = path.parent().unwrap_or(Path::new("."));
    // A failure is ignored: another run may be writing the same file, and the cache only saves time.
    let _ = std::fs::create_dir_all(folder).map(|()| output::write_atomically_soon(path, &sealed(bytes)));
}

/// The folder of our caches, if pipelines are cached at all.
fn folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    if let Some(folder) = variable(VARIABLE) {
        return (!folder.is_empty()).then(|| folder.into());
    }
    let absolute = |name| variable(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let usual = absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".cache")));
    usual.or_else(|| absolute("LOCALAPPDATA")).map(|caches| caches.join("smalti"))
}

fn sealed(bytes: &[u8]) -> Vec<u8> {
    [&Sha256::digest(bytes)[..], bytes].concat()
}

/// The bytes after the digest, if they match it.
fn unsealed(file: &[u8]) -> Option<Vec<u8>> {
    let (digest, bytes) = file.split_at_checked(DIGEST_BYTES)?;
    (digest == &Sha256::digest(bytes)[..]).then(|| bytes.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    // Windows has other absolute paths.
    #[cfg(unix)]
    #[test]
    fn the_folder_is_the_one_that_is_named_or_the_users() {
        let of = |set: &[(&str, &str)]| {
            folder(|name| set.iter().find(|(set, _)| *set == name).map(|(_, value)| (*value).into()))
        };
        let home = ("HOME", "/home/ada");
        assert_eq!(of(&[home]), Some("/home/ada/.cache/smalti".into()));
        assert_eq!(of(&[home, ("XDG_CACHE_HOME", "/caches")]), Some("/caches/smalti".into()));
        assert_eq!(of(&[home, ("XDG_CACHE_HOME", "relative")]), Some("/home/ada/.cache/smalti".into()));
        assert_eq!(of(&[home, ("SMALTI_CACHE", "here")]), Some("here".into()));
        assert_eq!(of(&[home, ("SMALTI_CACHE", "")]), None);
        assert_eq!(of(&[]), None);
    }

    #[test]
    fn what_is_kept_comes_back_whole_or_not_at_all() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("new/device.pipelines");
        write(&path, &[7; HEADER_BYTES]);
        assert!(!path.exists(), "the header alone is worth nothing");
        write(&path, &[7; 100]);
        let written = std::fs::read(&path).expect("it is written");
        assert_eq!(unsealed(&written), Some(vec![7; 100]));
        for length in 0..written.len() {
            assert_eq!(unsealed(&written[..length]), None, "cut at {length}");
        }
        for place in 0..written.len() {
            let mut other = written.clone();
            other[place] ^= 1;
            assert_eq!(unsealed(&other), None, "byte {place} differs");
        }
        // A folder that cannot be created is no failure.
        write(&path.join("below a file"), &[7; 100]);
    }
}
