//! How much memory is free. Whatever decodes or evolves asks this before it begins, since a process that takes more is
//! killed without a word.

use std::path::{Path, PathBuf};

/// The free memory of the machine, or what a scheduler, a container or a limit of the process leaves of it; `None` if
/// the system tells nothing.
#[must_use]
pub fn free_bytes() -> Option<u64> {
    let told = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let of_machine = available_bytes(&told("/proc/meminfo"));
    let of_groups = granted_bytes(&told("/proc/self/cgroup"), Path::new("/sys/fs/cgroup"));
    let of_process = left_bytes(&told("/proc/self/limits"), &told("/proc/self/status"));
    of_machine.into_iter().chain(of_groups).chain(of_process).min()
}

/// The memory that the limits of a process (`ulimit -v` and `-d`) still leave it; `None` if it has none. The texts are
/// those of `/proc/self/limits` and `/proc/self/status`.
fn left_bytes(limits: &str, status: &str) -> Option<u64> {
    let left = |limit: &str, used: &str| {
        let most = limits.lines().find_map(|line| line.strip_prefix(limit))?.split_whitespace().next()?;
        let used = status.lines().find_map(|line| line.strip_prefix(used))?.trim().strip_suffix(" kB")?;
        Some(most.parse::<u64>().ok()?.saturating_sub(used.parse::<u64>().ok()?.saturating_mul(1024)))
    };
    left("Max address space", "VmSize:").into_iter().chain(left("Max data size", "VmData:")).min()
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
    fn what_a_process_has_taken_already_counts_against_its_limits() {
        let limits = "Limit  Soft Limit  Hard Limit  Units\nMax data size  unlimited  unlimited  bytes\n\
                      Max address space  1073741824  2147483648  bytes\n";
        let status = "VmSize:\t  524288 kB\nVmData:\t  100 kB\n";
        assert_eq!(left_bytes(limits, status), Some(512 << 20));
        assert_eq!(left_bytes(&limits.replace("1073741824", "1024"), status), Some(0));
        assert_eq!(left_bytes(&limits.replace("1073741824", "unlimited"), status), None);
        assert_eq!(left_bytes("", ""), None);
    }
}
