//! How many files and connections the process may have open.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Kept for work: the database, inputs, artifacts being written.
const RESERVE: u64 = 256;
/// More connections than this help nobody.
const MOST_CONNECTIONS: u64 = 8192;

/// Raises the soft limit of open files to the hard one. Returns what holds now;
/// `None` if there is no limit.
pub(super) fn raise_limit() -> Option<u64> {
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit { current: limit.maximum, ..limit };
    match setrlimit(Resource::Nofile, raised) {
        Ok(()) => limit.maximum,
        Err(error) => {
            tracing::warn!(%error, "the limit of open files stays as it is");
            limit.current
        }
    }
}

/// How many connections may be open at a time, so that some files are left for
/// work. One that downloads has a file open besides.
pub(super) fn connections(limit: Option<u64>) -> usize {
    let most = limit.map_or(MOST_CONNECTIONS, |limit| limit.saturating_sub(RESERVE) / 2);
    // Within a `usize`: at most `MOST_CONNECTIONS`.
    most.clamp(16, MOST_CONNECTIONS) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_keeps_its_share_of_the_files() {
        assert_eq!(connections(Some(1024)), 384);
        assert_eq!(connections(Some(64)), 16);
        assert_eq!(connections(None), 8192);
        let raised = raise_limit().unwrap_or(u64::MAX);
        assert_eq!(getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX), raised);
    }
}
