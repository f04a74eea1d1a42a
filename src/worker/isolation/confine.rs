//! Takes from a child what work does not need.

use std::collections::BTreeMap;
use std::{fs, io};

use libc::c_long;
use rustix::process::{Resource, Rlimit, Signal, set_parent_process_death_signal, setrlimit};
use rustix::thread::{UnshareFlags, unshare_unsafe};
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
    SeccompRule,
};
use serde::{Deserialize, Serialize};

/// What holds a child, limits of memory and files apart, which always do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Held {
    /// It is alone in a network of its own, where nothing can be reached.
    pub network_namespace: bool,
    /// The kernel refuses it sockets, files, programs and other processes.
    pub filter: bool,
}

/// The first thing a child does: it dies with the thread that started it.
pub(super) fn die_with_parent() -> io::Result<()> {
    Ok(set_parent_process_death_signal(Some(Signal::KILL))?)
}

/// Confines this process, which has no other threads yet, for good.
///
/// * `memory_bytes`: memory that it may write to.
///
/// # Errors
/// If its memory or files can't be limited. That a namespace or a filter is not
/// to be had is no error: the answer says so.
pub(super) fn confine(memory_bytes: u64) -> io::Result<Held> {
    // Where the machine or its group runs out of memory all the same, the kernel
    // takes a child before the service.
    let _ = fs::write("/proc/self/oom_score_adj", "1000");
    let network_namespace = leave_network();
    // Private memory that can be written to, not what is merely set apart, such as
    // the allocator's reserves: of these 64 bits have plenty.
    for (resource, most) in
        [(Resource::Data, memory_bytes), (Resource::Fsize, 0), (Resource::Core, 0)]
    {
        setrlimit(resource, Rlimit { current: Some(most), maximum: Some(most) })?;
    }
    let filter = filter().is_ok();
    Ok(Held { network_namespace, filter })
}

/// Root may leave the network, others together with their user's rights, where the
/// system lets them.
fn leave_network() -> bool {
    [UnshareFlags::NEWNET, UnshareFlags::NEWNET | UnshareFlags::NEWUSER].into_iter().any(|flags| {
        // SAFETY: only unsharing the table of files makes file descriptors dangle.
        unsafe { unshare_unsafe(flags) }.is_ok()
    })
}

/// What computing needs no more once all libraries are loaded. Everything else is
/// let through: what a libc of another version calls can't be foreseen.
const REFUSED: &[c_long] = &[
    // Sockets.
    libc::SYS_socket,
    libc::SYS_socketpair,
    libc::SYS_connect,
    libc::SYS_bind,
    libc::SYS_listen,
    libc::SYS_accept,
    libc::SYS_accept4,
    // Files.
    libc::SYS_openat,
    libc::SYS_openat2,
    libc::SYS_unlinkat,
    libc::SYS_renameat2,
    libc::SYS_mkdirat,
    libc::SYS_mknodat,
    libc::SYS_linkat,
    libc::SYS_symlinkat,
    libc::SYS_fchmodat,
    libc::SYS_fchownat,
    libc::SYS_truncate,
    libc::SYS_mount,
    libc::SYS_umount2,
    libc::SYS_pivot_root,
    libc::SYS_chroot,
    libc::SYS_open_by_handle_at,
    // Programs and other processes.
    libc::SYS_execve,
    libc::SYS_execveat,
    libc::SYS_kill,
    libc::SYS_ptrace,
    libc::SYS_process_vm_readv,
    libc::SYS_process_vm_writev,
    libc::SYS_pidfd_open,
    libc::SYS_pidfd_getfd,
    libc::SYS_setns,
    libc::SYS_unshare,
    // Ways around the above.
    libc::SYS_io_uring_setup,
    libc::SYS_bpf,
    libc::SYS_perf_event_open,
    libc::SYS_userfaultfd,
    libc::SYS_keyctl,
    libc::SYS_add_key,
    libc::SYS_request_key,
    libc::SYS_setrlimit,
    libc::SYS_prlimit64,
    libc::SYS_init_module,
    libc::SYS_finit_module,
    libc::SYS_kexec_load,
];

/// The same by the names that only older processors have.
#[cfg(target_arch = "x86_64")]
const REFUSED_OLD: &[c_long] = &[
    libc::SYS_open,
    libc::SYS_creat,
    libc::SYS_unlink,
    libc::SYS_rename,
    libc::SYS_renameat,
    libc::SYS_mkdir,
    libc::SYS_rmdir,
    libc::SYS_mknod,
    libc::SYS_link,
    libc::SYS_symlink,
    libc::SYS_chmod,
    libc::SYS_chown,
    libc::SYS_lchown,
    libc::SYS_fork,
    libc::SYS_vfork,
];
#[cfg(not(target_arch = "x86_64"))]
const REFUSED_OLD: &[c_long] = &[libc::SYS_renameat];

/// Refuses those calls to this thread and those that it starts.
fn filter() -> Result<(), seccompiler::Error> {
    let any = |call: &c_long| (*call, Vec::new());
    let mut refused: BTreeMap<_, _> = REFUSED.iter().chain(REFUSED_OLD).map(any).collect();
    // Threads share all with their process; whatever shares less is another one.
    let thread = libc::CLONE_THREAD as u64;
    let no_thread = SeccompCmpOp::MaskedEq(thread);
    let no_thread = SeccompCondition::new(0, SeccompCmpArgLen::Qword, no_thread, 0)?;
    refused.insert(libc::SYS_clone, vec![SeccompRule::new(vec![no_thread])?]);
    install(refused, libc::EACCES)?;
    // Its flags lie in memory, which filters can't see; libc then takes the old call.
    install(BTreeMap::from([(libc::SYS_clone3, Vec::new())]), libc::ENOSYS)
}

fn install(
    calls: BTreeMap<c_long, Vec<SeccompRule>>,
    errno: i32,
) -> Result<(), seccompiler::Error> {
    let refuse = SeccompAction::Errno(errno.unsigned_abs());
    let target = std::env::consts::ARCH.try_into()?;
    let filter = SeccompFilter::new(calls, SeccompAction::Allow, refuse, target)?;
    seccompiler::apply_filter(&BpfProgram::try_from(filter)?)
}
