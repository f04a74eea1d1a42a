//! Pages of drawings: documents that clients look at and put right before a job
//! takes them as its source.

use std::collections::BTreeMap;

use async_trait::async_trait;
use jiff::Timestamp;
use serde_json::Value;

use super::bytes::Home;
use super::{Idempotency, JobId, StoreError, Tags, TenantName};

/// A page as stored.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredPage {
    /// Its name. Names are of one space with those of jobs, so that the bytes of
    /// both lie in one store.
    pub id: JobId,
    /// Whose it is.
    pub tenant: TenantName,
    /// What it holds, apart from stored bytes.
    pub content: Value,
    /// Counts the changes of its content, from 1.
    pub version: u64,
    /// What people say of it.
    pub tags: Tags,
    /// Counts the changes of that, from 0: apart, for its files lie under its version.
    pub tags_version: u64,
    /// When it was stored first.
    pub created_at: Timestamp,
    /// When it was changed last.
    pub changed_at: Timestamp,
}

impl StoredPage {
    /// Where its bytes lie.
    pub fn home(&self) -> Home {
        self.id.home(&self.tenant)
    }
}

/// A page to be stored.
#[derive(Clone, Debug)]
pub struct NewPage {
    /// Its name.
    pub id: JobId,
    /// Whose it is.
    pub tenant: TenantName,
    /// What it holds, apart from stored bytes.
    pub content: Value,
    /// Stored bytes that it takes.
    pub bytes: u64,
    /// How many bytes may be stored for its tenant, these among them.
    pub max_bytes: Option<u64>,
    /// What people say of it.
    pub tags: Tags,
    /// The client's name for the upload.
    pub idempotency: Option<Idempotency>,
}

/// Which pages of a tenant to list, newest first.
#[derive(Clone, Debug)]
pub struct PageQuery {
    /// Whose they are.
    pub tenant: TenantName,
    /// Only pages that have all of these labels.
    pub labels: BTreeMap<String, String>,
    /// Only pages stored at this time or later.
    pub created_from: Option<Timestamp>,
    /// Only pages stored before this time.
    pub created_before: Option<Timestamp>,
    /// Only pages older than this one.
    pub before: Option<JobId>,
    /// At most this many.
    pub limit: u32,
}

impl PageQuery {
    /// The newest pages of a tenant.
    pub fn newest(tenant: TenantName, limit: u32) -> Self {
        let (labels, created_from, created_before) = (BTreeMap::new(), None, None);
        Self { tenant, labels, created_from, created_before, before: None, limit }
    }
}

/// Durable pages. Every method is one transaction; when it returns, its effect
/// survives a crash of process and machine.
#[async_trait]
pub trait PageStore: Send + Sync {
    /// Stores a new page. If its key came before with the same upload, nothing is
    /// stored and the page of then is answered, as it is now.
    ///
    /// # Errors
    /// [`StoreError::TooManyBytes`] if its tenant stores too much,
    /// [`StoreError::OtherUpload`] if its key came with another upload,
    /// [`StoreError::NotFound`] if what the key became is deleted.
    async fn add_page(&self, page: NewPage) -> Result<StoredPage, StoreError>;

    /// The page that the upload of this key became.
    ///
    /// # Errors
    /// Those of keys of [`add_page`](Self::add_page).
    async fn page_of_key(
        &self,
        tenant: &TenantName,
        given: &Idempotency,
    ) -> Result<Option<StoredPage>, StoreError>;

    /// The pages asked for, newest first.
    async fn pages(&self, query: &PageQuery) -> Result<Vec<StoredPage>, StoreError>;

    /// The page as it is now.
    ///
    /// # Errors
    /// [`StoreError::NotFound`] if there is none of this name.
    async fn page(&self, id: JobId) -> Result<StoredPage, StoreError>;

    /// Replaces the content of a page that is still at `version`.
    ///
    /// * `bytes`: that it takes now.
    ///
    /// # Errors
    /// [`StoreError::Changed`] if it is at another by now.
    async fn replace_page(
        &self,
        id: JobId,
        version: u64,
        content: Value,
        bytes: u64,
    ) -> Result<StoredPage, StoreError>;

    /// Replaces what people say of a page.
    ///
    /// # Errors
    /// [`StoreError::NotFound`] if there is none of this name.
    async fn tag_page(&self, id: JobId, tags: &Tags) -> Result<StoredPage, StoreError>;

    /// Forgets a page; its bytes are ownerless from then on.
    async fn delete_page(&self, id: JobId) -> Result<(), StoreError>;
}
