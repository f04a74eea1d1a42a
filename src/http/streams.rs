//! How many event streams are open, of all tenants and of each.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::access::Caller;
use super::problem::Problem;
use jobs::TenantName;

/// The open streams.
#[derive(Clone, Debug)]
pub(super) struct Streams {
    most: usize,
    open: Arc<Mutex<HashMap<TenantName, usize>>>,
}

/// One open stream; closed when dropped.
pub(super) struct OpenStream {
    tenant: TenantName,
    streams: Streams,
}

impl Streams {
    pub(super) fn new(most: usize) -> Self {
        Self { most, open: Arc::default() }
    }

    /// Opens one for the caller.
    ///
    /// # Errors
    /// If as many are open as may be.
    pub(super) fn open(&self, caller: &Caller) -> Result<OpenStream, Problem> {
        let mut open = self.lock();
        if open.values().sum::<usize>() >= self.most {
            return Err(Problem::busy("too many event streams are open; poll, or try again later"));
        }
        let own = open.entry(caller.tenant.clone()).or_default();
        if caller.limits.max_streams.is_some_and(|most| *own >= most as usize) {
            return Err(Problem::too_much("the tenant has as many event streams open as it may"));
        }
        *own += 1;
        Ok(OpenStream { tenant: caller.tenant.clone(), streams: self.clone() })
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<TenantName, usize>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for OpenStream {
    fn drop(&mut self) {
        let mut open = self.streams.lock();
        if let Some(own) = open.get_mut(&self.tenant) {
            *own -= 1;
            if *own == 0 {
                open.remove(&self.tenant);
            }
        }
    }
}
