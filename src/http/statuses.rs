//! Jobs as clients see them, kept ready while nothing in the store changes: many
//! programs ask for the same job again and again.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum_extra::headers::ETag;
use bytes::Bytes;

use super::problem::Problem;
use super::resource::{Resource, store_problem, unknown, version_of};
use jobs::{Job, JobId, JobStore, Revision, TenantName};

/// What is kept ready at a time, bytes of documents.
const MAX_BYTES: usize = 16 << 20;

/// A job as its tenant is answered.
pub(super) struct Status {
    pub tenant: TenantName,
    /// Its kind in the job store.
    kind: &'static str,
    pub is_final: bool,
    pub etag: ETag,
    /// The document, as JSON.
    pub body: Bytes,
}

impl Status {
    fn of<R: Resource>(job: &Job) -> Result<Self, Problem> {
        let body = serde_json::to_vec(&R::View::from(job))
            .map_err(|error| Problem::internal("writing a job's status", &error))?;
        Ok(Self {
            tenant: job.tenant.clone(),
            kind: R::KIND,
            is_final: job.state.is_final(),
            etag: version_of(job),
            body: body.into(),
        })
    }
}

/// The statuses kept ready, all of one revision of the store.
#[derive(Default)]
pub(super) struct Statuses(Mutex<Kept>);

#[derive(Default)]
struct Kept {
    revision: Option<Revision>,
    bytes: usize,
    statuses: HashMap<JobId, Arc<Status>>,
}

impl Statuses {
    /// The status of a job as it is stored now, if it is an `R`, whoever's it is.
    pub(super) async fn get<R: Resource>(
        &self,
        store: &dyn JobStore,
        id: JobId,
    ) -> Result<Arc<Status>, Problem> {
        // Asked for before reading: a commit in between makes what is kept pass for
        // older than it is, never for newer.
        let revision = store.revision();
        if let Some(kept) = revision.and_then(|revision| self.kept(revision, id)) {
            return if kept.kind == R::KIND { Ok(kept) } else { Err(unknown::<R>(id)) };
        }
        let job = store.get(id).await.map_err(store_problem::<R>)?;
        if job.kind != R::KIND {
            return Err(unknown::<R>(id));
        }
        let status = Arc::new(Status::of::<R>(&job)?);
        if let Some(revision) = revision {
            self.keep(revision, id, &status);
        }
        Ok(status)
    }

    /// What is kept of this revision; that of others goes.
    fn kept(&self, revision: Revision, id: JobId) -> Option<Arc<Status>> {
        let mut kept = self.lock();
        if kept.revision == Some(revision) {
            return kept.statuses.get(&id).map(Arc::clone);
        }
        *kept = Kept { revision: Some(revision), ..Kept::default() };
        None
    }

    fn keep(&self, revision: Revision, id: JobId, status: &Arc<Status>) {
        let mut kept = self.lock();
        let bytes = status.body.len();
        if kept.revision != Some(revision) || bytes > MAX_BYTES {
            return;
        }
        if kept.bytes + bytes > MAX_BYTES {
            (kept.bytes, kept.statuses) = (0, HashMap::new());
        }
        // Two requests may have read the same job at once.
        if kept.statuses.insert(id, Arc::clone(status)).is_none() {
            kept.bytes += bytes;
        }
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
