//! Jobs as clients see them, kept ready while nothing in the store changes: many
//! programs ask for the same job again and again.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum_extra::headers::ETag;
use bytes::Bytes;

use super::artifacts::Published;
use super::bounded::Bounded;
use super::problem::Problem;
use super::resource::{Resource, store_problem, unknown, version_of};
use jobs::{Job, JobId, JobStore, Revision, TenantName};

/// What is kept ready at a time, bytes of documents and lists of artifacts.
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
    /// What its downloads need.
    pub published: Published,
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
            published: Published::of(job),
        })
    }

    /// About what it takes in memory, bytes.
    fn size(&self) -> usize {
        self.body.len() + self.published.size()
    }
}

/// The statuses kept ready, all of one revision of the store.
#[derive(Default)]
pub(super) struct Statuses(Mutex<Kept>);

struct Kept {
    revision: Option<Revision>,
    statuses: Bounded<JobId, Arc<Status>>,
}

impl Default for Kept {
    fn default() -> Self {
        Self { revision: None, statuses: Bounded::new(MAX_BYTES) }
    }
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
        kept.revision = Some(revision);
        kept.statuses.clear();
        None
    }

    fn keep(&self, revision: Revision, id: JobId, status: &Arc<Status>) {
        let mut kept = self.lock();
        if kept.revision == Some(revision) {
            kept.statuses.keep(id, Arc::clone(status), status.size());
        }
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::reconstructions::Reconstructions;
    use crate::http::sheets::Sheets;
    use jobs::bytes::Home;
    use jobs::{NewJob, SqliteStore, SystemClock};
    use serde_json::json;

    #[tokio::test]
    async fn a_status_is_kept_until_something_is_committed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("jobs.sqlite");
        let store = SqliteStore::open(&path, Arc::new(SystemClock)).await.unwrap();
        let statuses = Statuses::default();
        let job = |payload| NewJob::new(JobId::new(), Reconstructions::KIND, payload, 1);
        let id = store.enqueue(job(json!(null))).await.unwrap().id;
        let get = || statuses.get::<Reconstructions>(&store, id);
        let first = get().await.unwrap();
        assert!(Arc::ptr_eq(&first, &get().await.unwrap()), "nothing was committed");
        assert!(statuses.get::<Sheets>(&store, id).await.is_err(), "it is no sheet");
        store.request_cancel(id).await.unwrap();
        let second = get().await.unwrap();
        assert!(!first.is_final && second.is_final);
        assert_ne!(first.etag, second.etag);
        // A commit to another job says nothing of which one: all are read anew.
        store.enqueue(job(json!(null))).await.unwrap();
        let third = get().await.unwrap();
        assert!(!Arc::ptr_eq(&second, &third));
        assert_eq!(second.body, third.body);
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let statuses = Statuses::default();
        let published = Published {
            id: JobId::new(),
            noun: "reconstruction",
            is_final: true,
            attempt: 1,
            home: Home::Shared,
            name: None,
            artifacts: Vec::new(),
        };
        let status = |bytes| {
            Arc::new(Status {
                tenant: TenantName::default(),
                kind: Reconstructions::KIND,
                is_final: true,
                etag: "W/\"1\"".parse().unwrap(),
                body: vec![b' '; bytes].into(),
                published: published.clone(),
            })
        };
        let revision = Revision::default();
        assert!(statuses.kept(revision, JobId::new()).is_none());
        let ids = [(); 5].map(|()| JobId::new());
        for id in ids {
            statuses.keep(revision, id, &status(MAX_BYTES / 4));
            assert!(statuses.kept(revision, id).is_some());
        }
        assert!(statuses.kept(revision, ids[0]).is_none(), "it made room");
        statuses.keep(revision, ids[0], &status(MAX_BYTES + 1));
        assert!(statuses.kept(revision, ids[0]).is_none(), "too large");
    }
}
