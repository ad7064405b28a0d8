//! The memory that a run may use: that of the system, or less where a container, a scheduler or the shell limits it.
//! Only this module and `clock` use `rustix`.

use std::fs;
use std::path::{Path, PathBuf};

use rustix::process::{Resource, getrlimit};

/// Memory that is left for a run, and what limits it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Available {
    /// How much it is.
    pub bytes: usize,
    /// What the limit is called.
    pub limit: &'static str,
}

impl Available {
    /// For people.
    pub(crate) fn words(&self) -> String {
        format!("{} ({})", readable(self.bytes), self.limit)
    }
}

/// The least of what the system, the control groups and the limits of the process leave; `None` where nothing is
/// reported.
pub(crate) fn available() -> Option<Available> {
    let root = Path::new("/");
    let found = [free(root), groups(root), address_space(), data_segment()];
    found.into_iter().flatten().min_by_key(|available| available.bytes)
}

/// Memory that the system can give without swapping.
fn free(root: &Path) -> Option<Available> {
    let text = fs::read_to_string(root.join("proc/meminfo")).ok()?;
    Some(Available { bytes: 1024 * kib(&text, "MemAvailable:")?, limit: "free memory" })
}

/// The number of a line such as `VmSize:  1234 kB`.
fn kib(text: &str, name: &str) -> Option<usize> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

/// What this process's control groups leave, of either version: the tightest of its own and those around it. Files that
/// are cached count as used and can be given back.
fn groups(root: &Path) -> Option<Available> {
    let read = |path: &str| fs::read_to_string(root.join(path)).ok();
    let (own, mounts) = (read("proc/self/cgroup")?, read("proc/self/mounts")?);
    let left = own.lines().filter_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?);
        let names = match controllers {
            "" => ("cgroup2", ["memory.max", "memory.current", "inactive_file "]),
            list if list.split(',').any(|name| name == "memory") => {
                ("cgroup", ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file "])
            }
            _ => return None,
        };
        let (kind, names) = names;
        let folder = root.join(mount(&mounts, kind)?.trim_start_matches('/'));
        // In a container the path may be that of the host, and the mount that of the container.
        let inside: Vec<PathBuf> =
            Path::new(path.trim_start_matches('/')).ancestors().map(|part| folder.join(part)).collect();
        inside.iter().filter_map(|group| left_in(group, names)).min()
    });
    left.min().map(|bytes| Available { bytes, limit: "limit of the control group" })
}

/// Where the control groups of a kind that know of memory are mounted.
fn mount<'a>(mounts: &'a str, kind: &str) -> Option<&'a str> {
    mounts.lines().find_map(|line| {
        let words: Vec<&str> = line.split(' ').collect();
        let [_, folder, found, options, ..] = words[..] else { return None };
        let knows = kind == "cgroup2" || options.split(',').any(|option| option == "memory");
        (found == kind && knows).then_some(folder)
    })
}

fn left_in(group: &Path, [limit, used, cached]: [&str; 3]) -> Option<usize> {
    let number = |name: &str| fs::read_to_string(group.join(name)).ok()?.trim().parse::<usize>().ok();
    // Version 2 writes `max` where there is no limit, version 1 a number that no machine has.
    let limit = number(limit).filter(|limit| *limit < 1 << 60)?;
    let statistics = fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
    let cached =
        statistics.lines().find_map(|line| line.strip_prefix(cached)?.trim().parse::<usize>().ok());
    let used = number(used).unwrap_or(0).saturating_sub(cached.unwrap_or(0));
    Some(limit.saturating_sub(used))
}

/// What `ulimit -v` leaves.
fn address_space() -> Option<Available> {
    process_limit(Resource::As, "VmSize:", "limit of the address space, ulimit -v")
}

/// What `ulimit -d` leaves.
fn data_segment() -> Option<Available> {
    process_limit(Resource::Data, "VmData:", "limit of the data segment, ulimit -d")
}

/// Whether the limits of the process leave room for another thread. Beside its stack there must be room for what threads
/// take as they start: a thread that finds none then aborts the program, where one that is not created is an error.
pub(crate) fn has_room_for_thread() -> bool {
    const STACK: usize = 2 << 20;
    const STARTING: usize = 16 << 20;
    [address_space(), data_segment()].into_iter().flatten().all(|left| left.bytes >= STACK + STARTING)
}

fn process_limit(resource: Resource, used: &str, limit: &'static str) -> Option<Available> {
    let most = getrlimit(resource).current? as usize;
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let used = 1024 * kib(&status, used).unwrap_or(0);
    Some(Available { bytes: most.saturating_sub(used), limit })
}

/// A number of bytes for people.
pub(crate) fn readable(bytes: usize) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB", "PiB"];
    let mut value = bytes as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < units.len() {
        value /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{bytes} B") } else { format!("{value:.1} {}", units[unit]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A made-up system.
    fn system(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            let path = root.path().join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            fs::write(path, text).expect("a file");
        }
        root
    }

    const V1: &str = "tmpfs /sys/fs/cgroup tmpfs rw 0 0\ncgroup /sys/fs/cgroup/cpu cgroup rw,cpu 0 0\n\
                      cgroup /sys/fs/cgroup/memory cgroup rw,relatime,memory 0 0\n";
    const V2: &str = "cgroup2 /sys/fs/cgroup cgroup2 rw,nosuid 0 0\n";

    fn bytes(root: &tempfile::TempDir) -> Option<usize> {
        groups(root.path()).map(|available| available.bytes)
    }

    #[test]
    fn control_groups_of_version_2() {
        let root = system(&[
            ("proc/self/cgroup", "0::/slurm/job_7/step_0\n"),
            ("proc/self/mounts", V2),
            ("sys/fs/cgroup/slurm/job_7/memory.max", "1000000\n"),
            ("sys/fs/cgroup/slurm/job_7/memory.current", "300000\n"),
            ("sys/fs/cgroup/slurm/job_7/memory.stat", "anon 5\ninactive_file 100000\n"),
            ("sys/fs/cgroup/slurm/job_7/step_0/memory.max", "max\n"),
            ("sys/fs/cgroup/slurm/memory.max", "900000\n"),
        ]);
        assert_eq!(bytes(&root), Some(800_000));
    }

    // Docker: the host's path, and the container's group at the mount.
    #[test]
    fn control_groups_of_version_1() {
        let root = system(&[
            ("proc/self/cgroup", "5:cpu:/\n4:memory:/docker/ab12\n0::/\n"),
            ("proc/self/mounts", V1),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "104857600\n"),
            ("sys/fs/cgroup/memory/memory.usage_in_bytes", "4857600\n"),
        ]);
        assert_eq!(bytes(&root), Some(100_000_000));
        let free = system(&[
            ("proc/self/cgroup", "4:memory:/\n"),
            ("proc/self/mounts", V1),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n"),
        ]);
        assert_eq!(bytes(&free), None);
    }

    #[test]
    fn this_machine_has_memory() {
        let available = available().expect("a number");
        assert!(available.bytes > 1 << 20, "{available:?}");
    }

    #[test]
    fn bytes_for_people() {
        assert_eq!(readable(999), "999 B");
        assert_eq!(readable(3 << 20), "3.0 MiB");
    }
}
