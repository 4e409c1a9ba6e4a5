//! The compiled pipelines of a device, kept from one run to the next in the user's cache folder.
//!
//! There is a file for each device and driver version. It only saves time: whatever goes wrong with it, the pipelines are
//! compiled anew, and nobody is told. A driver that has nothing to keep, as lavapipe, gets no file.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use crate::output;
use crate::vk::{Device, DeviceInfo};

/// Names the folder in place of the usual one; empty keeps nothing.
const VARIABLE: &str = "SMALTI_CACHE";
/// Bytes of the header that Vulkan puts before what a driver keeps.
const HEADER_BYTES: usize = 32;
/// Bytes of the digest before them: a driver may not survive bytes that are not its own.
const DIGEST_BYTES: usize = 32;

/// Where the pipelines of a device are kept.
pub(super) struct PipelineFile {
    path: Option<PathBuf>,
    /// What was there.
    found: Vec<u8>,
}

impl PipelineFile {
    /// The file for a device, and what it holds.
    pub(super) fn read(info: &DeviceInfo) -> Self {
        let path = folder(|name| std::env::var_os(name)).filter(|_| !info.uuid.is_empty());
        let path = path.map(|folder| folder.join(format!("{}-{:08x}.pipelines", info.uuid, info.driver_version)));
        let found = path.as_deref().and_then(|path| std::fs::read(path).ok());
        let found = found.and_then(|file| unsealed(&file)).unwrap_or_default();
        Self { path, found }
    }

    /// What an earlier run kept; empty if nothing that can be used.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.found
    }

    fn write(&self, bytes: &[u8]) {
        let Some(path) = self.path.as_deref().filter(|_| bytes.len() > HEADER_BYTES && bytes != self.found) else {
            return;
        };
        let folder = path.parent().unwrap_or(Path::new("."));
        // Another run may be writing the same file; it only saves time.
        let _ = std::fs::create_dir_all(folder).map(|()| output::write_atomically_soon(path, &sealed(bytes)));
    }
}

/// Keeps the pipelines of a device when it is dropped.
pub(super) struct KeptPipelines {
    file: PipelineFile,
    device: Arc<Device>,
}

impl KeptPipelines {
    pub(super) fn new(file: PipelineFile, device: &Arc<Device>) -> Self {
        Self { file, device: Arc::clone(device) }
    }
}

impl Drop for KeptPipelines {
    fn drop(&mut self) {
        self.file.write(&self.device.pipeline_cache_bytes());
    }
}

/// The folder of our caches, if there is to be one.
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

/// What was sealed, if it is whole.
fn unsealed(file: &[u8]) -> Option<Vec<u8>> {
    let (digest, bytes) = file.split_at_checked(DIGEST_BYTES)?;
    (digest == &Sha256::digest(bytes)[..]).then(|| bytes.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let file = |found| PipelineFile { path: Some(path.clone()), found };
        file(Vec::new()).write(&[7; HEADER_BYTES]);
        assert!(!path.exists(), "the header alone is worth nothing");
        file(vec![7; 100]).write(&[7; 100]);
        assert!(!path.exists(), "it would be what was there");
        file(Vec::new()).write(&[7; 100]);
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
        // A folder that cannot be made is no failure.
        PipelineFile { path: Some(path.join("below a file")), found: Vec::new() }.write(&[7; 100]);
    }
}
