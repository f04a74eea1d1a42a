//! Pages of drawings: documents that clients look at and put right before a job
//! takes them as its source.

use async_trait::async_trait;
use jiff::Timestamp;
use serde_json::Value;

use super::{JobId, StoreError, TenantName};

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
    /// Counts its changes, from 1.
    pub version: u64,
    /// When it was stored first.
    pub created_at: Timestamp,
    /// When it was changed last.
    pub changed_at: Timestamp,
    /// When it is deleted by itself.
    pub expires_at: Option<Timestamp>,
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
    /// When it is deleted by itself.
    pub expires_at: Option<Timestamp>,
}

/// Durable pages. Every method is one transaction; when it returns, its effect
/// survives a crash of process and machine.
#[async_trait]
pub trait PageStore: Send + Sync {
    /// Stores a new page.
    ///
    /// # Errors
    /// [`StoreError::TooManyBytes`] if its tenant stores too much.
    async fn add_page(&self, page: NewPage) -> Result<StoredPage, StoreError>;

    /// The tenant's pages older than `before`, newest first, `limit` at most.
    async fn pages(
        &self,
        tenant: &TenantName,
        before: Option<JobId>,
        limit: u32,
    ) -> Result<Vec<StoredPage>, StoreError>;

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

    /// Forgets a page; its bytes are ownerless from then on.
    async fn delete_page(&self, id: JobId) -> Result<(), StoreError>;
}
