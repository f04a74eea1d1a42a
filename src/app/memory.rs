//! How much memory a job may take on this machine.

use std::fs;
use std::path::Path;

/// Kept for uploads, decoding and the service itself.
const RESERVE_BYTES: u64 = 1 << 30;
/// Less than this does no job.
const LEAST_BYTES: u64 = 256 << 20;

/// What each of `workers` jobs may take: its part of three quarters of the memory
/// that the reserve leaves.
pub(super) fn of_a_job(workers: usize) -> u64 {
    share(available(Path::new("/")), workers)
}

fn share(available: Option<u64>, workers: usize) -> u64 {
    let Some(available) = available else { return crate::draft::DEFAULT_WORKING_BYTES };
    let free = available.saturating_sub(RESERVE_BYTES);
    (free / 4 * 3 / workers.max(1) as u64).max(LEAST_BYTES)
}

/// The machine's memory, or that of the control group the process is in if that
/// is less; `None` where the system does not tell.
fn available(root: &Path) -> Option<u64> {
    let of_machine = fs::read_to_string(root.join("proc/meminfo")).ok().and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
        Some(line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()? << 10)
    });
    of_machine.into_iter().chain(of_groups(root)).min()
}

/// The limits of the process's control group and of those around it, versions 2
/// and 1. A group without a limit says `max`, or more than any machine has.
fn of_groups(root: &Path) -> Vec<u64> {
    let own = fs::read_to_string(root.join("proc/self/cgroup")).unwrap_or_default();
    let mut limits = Vec::new();
    for line in own.lines() {
        let mut fields = line.splitn(3, ':').skip(1);
        let (Some(kinds), Some(path)) = (fields.next(), fields.next()) else { continue };
        let (folder, file) = match kinds {
            "" => ("sys/fs/cgroup", "memory.max"),
            _ if kinds.split(',').any(|kind| kind == "memory") => {
                ("sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        let top = root.join(folder);
        // In a container the path may be that of the host, and the top its own.
        for group in top.join(path.trim_start_matches('/')).ancestors() {
            let limit = fs::read_to_string(group.join(file)).ok();
            limits.extend(limit.and_then(|text| text.trim().parse::<u64>().ok()));
            if group == top {
                break;
            }
        }
    }
    limits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(root: &Path, file: &str, text: &str) {
        let path = root.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    #[test]
    fn the_least_of_machine_and_groups_counts() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        assert_eq!(available(root), None);
        write(root, "proc/meminfo", "MemTotal:       25165824 kB\nMemFree: 1 kB\n");
        assert_eq!(available(root), Some(24 << 30));
        write(root, "proc/self/cgroup", "0::/farm/job\n");
        write(root, "sys/fs/cgroup/farm/job/memory.max", "max\n");
        assert_eq!(available(root), Some(24 << 30));
        write(root, "sys/fs/cgroup/farm/memory.max", "4294967296\n");
        assert_eq!(available(root), Some(4 << 30));
        write(root, "proc/self/cgroup", "5:cpu,memory:/x\n");
        write(root, "sys/fs/cgroup/memory/memory.limit_in_bytes", "2147483648\n");
        assert_eq!(available(root), Some(2 << 30));
    }

    #[test]
    fn workers_share_what_the_reserve_leaves() {
        assert_eq!(share(Some(25 << 30), 1), 18 << 30);
        assert_eq!(share(Some(25 << 30), 4), (18 << 30) / 4);
        assert_eq!(share(Some(1 << 30), 4), LEAST_BYTES);
        assert_eq!(share(None, 2), crate::draft::DEFAULT_WORKING_BYTES);
    }
}
