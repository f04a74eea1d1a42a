//! How much is stored, and what goes first when it is too much.

use async_trait::async_trait;

use super::bytes::BytesOf;
use super::{JobId, StoreError, TenantName};

/// Counts stored bytes, and forgets jobs and pages to make room.
#[async_trait]
pub trait StorageStore: Send + Sync {
    /// Bytes stored for the tenant's jobs and pages, or for all.
    async fn stored_bytes(&self, tenant: Option<&TenantName>) -> Result<u64, StoreError>;

    /// Some jobs and pages whose bytes were never counted.
    async fn unmeasured(&self) -> Result<Vec<BytesOf>, StoreError>;

    /// Writes down how many bytes are stored for one of them.
    async fn measured(&self, id: JobId, bytes: u64) -> Result<(), StoreError>;

    /// Forgets the jobs that have ended, and the pages, whose time is over, and
    /// the jobs that were to be deleted when they have. Returns them: their bytes
    /// may go.
    async fn expire(&self) -> Result<Vec<BytesOf>, StoreError>;

    /// Forgets jobs that have ended and are not pinned, and pages, until at most
    /// `most` bytes are stored: first what ended or was changed longest ago.
    /// Returns them: their bytes may go.
    async fn make_room(&self, most: u64) -> Result<Vec<BytesOf>, StoreError>;
}
