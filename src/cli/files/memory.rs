//! How much memory is free, and whether the work fits into it.

use std::path::{Path, PathBuf};

use crate::error::{Error, Remedy, Result};

/// The bytes that a batch may use: four fifths of what is free now, or any number if that is unknown.
pub(crate) fn share_of_free() -> u64 {
    free_bytes().map_or(u64::MAX, |bytes| bytes / 5 * 4)
}

/// Refuses work that needs more memory than is free. Where the free memory is unknown, it allows everything.
///
/// # Errors
/// [`Error::TooLarge`].
pub(crate) fn check(needed_bytes: u64) -> Result<()> {
    check_against(needed_bytes, free_bytes())
}

fn check_against(needed_bytes: u64, available_bytes: Option<u64>) -> Result<()> {
    match available_bytes {
        Some(available_bytes) if needed_bytes > available_bytes => Err(Error::TooLarge {
            what: format!(
                "this needs about {} MiB of memory and {} MiB are free",
                needed_bytes >> 20,
                available_bytes >> 20
            ),
            remedies: &[Remedy::SmallerPicture, Remedy::SmallerOutput, Remedy::FewerTiles],
        }),
        _ => Ok(()),
    }
}

/// The free memory of the machine, or what a scheduler or a container leaves of it.
fn free_bytes() -> Option<u64> {
    let of_machine = std::fs::read_to_string("/proc/meminfo").ok().and_then(|told| available_bytes(&told));
    let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    of_machine.into_iter().chain(granted_bytes(&groups, Path::new("/sys/fs/cgroup"))).min()
}

/// The memory that the control groups of a process still leave it; `None` if they set no limit. `groups` is the text of
/// `/proc/self/cgroup`, and `root` the folder that the groups lie in.
fn granted_bytes(groups: &str, root: &Path) -> Option<u64> {
    let left = |(folder, limit, used): (PathBuf, &str, &str)| {
        let number = |name: &str| std::fs::read_to_string(folder.join(name)).ok()?.trim().parse::<u64>().ok();
        let stat = std::fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
        // The kernel drops cached files when memory is needed, so they count as free.
        let cached = stat.lines().find_map(|line| line.strip_prefix("inactive_file ")?.parse().ok()).unwrap_or(0);
        Some(number(limit)?.saturating_sub(number(used)?.saturating_sub(cached)))
    };
    let of_line = |line: &str| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?.trim_start_matches('/'));
        // The group without controllers is the one of version 2. Inside a container its files lie at the root.
        let (root, limit, used) = match controllers {
            "" => (root.to_owned(), "memory.max", "memory.current"),
            "memory" => (root.join("memory"), "memory.limit_in_bytes", "memory.usage_in_bytes"),
            _ => return None,
        };
        let within = |folder: &&Path| folder.starts_with(&root);
        let group = root.join(path);
        let folders = group.ancestors().take_while(within).map(|folder| (folder.to_owned(), limit, used));
        folders.filter_map(left).min()
    };
    groups.lines().filter_map(of_line).min()
}

/// The memory that Linux could give out without swapping.
fn available_bytes(meminfo: &str) -> Option<u64> {
    let kibibytes = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    kibibytes.trim().strip_suffix(" kB")?.parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_free_memory_is_found_in_what_linux_tells() {
        let meminfo = "MemTotal:       24689124 kB\nMemFree:  1 kB\nMemAvailable:   23000000 kB\nBuffers: 2 kB\n";
        assert_eq!(available_bytes(meminfo), Some(23_000_000 * 1024));
        assert_eq!(available_bytes("MemTotal: 1 kB\n"), None);
    }

    #[test]
    fn the_tightest_control_group_counts_and_none_without_a_limit() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let write = |name: &str, text: &str| {
            let path = root.path().join(name);
            std::fs::create_dir_all(path.parent().expect("it is below the root")).expect("the folder is ours");
            std::fs::write(path, text).expect("the folder is ours");
        };
        write("job/step/memory.max", "max\n");
        write("job/step/memory.current", "7\n");
        assert_eq!(granted_bytes("0::/job/step\n", root.path()), None);
        write("job/memory.max", "1000\n");
        write("job/memory.current", "400\n");
        write("job/memory.stat", "anon 300\ninactive_file 60\n");
        assert_eq!(granted_bytes("0::/job/step\n", root.path()), Some(660));
        write("memory/old/memory.limit_in_bytes", "500\n");
        write("memory/old/memory.usage_in_bytes", "600\n");
        assert_eq!(granted_bytes("4:cpu:/x\n3:memory:/old\n0::/job/step\n", root.path()), Some(0));
    }

    #[test]
    fn more_than_the_free_memory_is_refused_with_both_numbers() {
        assert!(check_against(1 << 30, Some(1 << 30)).is_ok());
        assert!(check_against(1 << 60, None).is_ok());
        let refusal = check_against(3 << 30, Some(1 << 30)).expect_err("there is not enough").to_string();
        assert!(refusal.contains("3072 MiB") && refusal.contains("1024 MiB"), "{refusal}");
    }
}
