//! Pages in the table `pages`.

use async_trait::async_trait;
use jiff::Timestamp;
use serde_json::Value;
use sqlx::{FromRow, QueryBuilder, Row as _};

use super::access::tenant_name;
use super::rows::{json, tags, time};
use super::store::narrow;
use super::{
    Connection, Db, LOCK, Row, Store, backend, commit_error, idempotency, ownerless, storage,
};
use crate::pages::{NewPage, PageQuery, PageStore, StoredPage};
use crate::{Idempotency, JobId, StoreError, Tags, TenantName};

impl<'r> FromRow<'r, Row> for StoredPage {
    fn from_row(row: &'r Row) -> sqlx::Result<Self> {
        let id: &str = row.try_get("id")?;
        Ok(Self {
            id: id.parse().map_err(|error| sqlx::Error::Decode(Box::new(error)))?,
            tenant: tenant_name(row, "tenant")?,
            content: json(row, "content")?,
            version: row.try_get::<i64, _>("version")?.cast_unsigned(),
            tags: tags(row)?,
            tags_version: row.try_get::<i64, _>("tags_version")?.cast_unsigned(),
            created_at: time(row, "created_ms")?,
            changed_at: time(row, "changed_ms")?,
        })
    }
}

async fn load(connection: &mut Connection, id: JobId) -> Result<StoredPage, StoreError> {
    select(connection, id, "").await
}

/// Loads a page that nobody else may change until the transaction ends.
async fn lock(connection: &mut Connection, id: JobId) -> Result<StoredPage, StoreError> {
    select(connection, id, LOCK).await
}

async fn select(
    connection: &mut Connection,
    id: JobId,
    lock: &'static str,
) -> Result<StoredPage, StoreError> {
    sqlx::query_as(sqlx::AssertSqlSafe(format!("SELECT * FROM pages WHERE id = $1{lock}")))
        .bind(id.to_string())
        .fetch_optional(connection)
        .await
        .map_err(backend)?
        .ok_or(StoreError::NotFound(id))
}

#[async_trait]
impl PageStore for Store {
    async fn add_page(&self, page: NewPage) -> Result<StoredPage, StoreError> {
        let NewPage { id, tenant, content, bytes, max_bytes, tags, idempotency: given } = page;
        let (mut transaction, now) = self.begin().await?;
        if let Some(given) = &given {
            if let Some(id) = idempotency::find(&mut transaction, &tenant, given, now.time).await? {
                return load(&mut transaction, id).await;
            }
            idempotency::remember(&mut transaction, &tenant, given, id, now.time).await?;
        }
        storage::expect_room(&mut transaction, &tenant, bytes, max_bytes).await?;
        sqlx::query(
            "INSERT INTO pages (id, tenant, content, version, created_ms, changed_ms, bytes,
                 expires_ms, name, labels, pinned)
             VALUES ($1, $4, $2, 1, $3, $3, $5, $6, $7, $8, $9)",
        )
        .bind(id.to_string())
        .bind(content.to_string())
        .bind(now.time.as_millisecond())
        .bind(tenant.as_str())
        .bind(bytes.cast_signed())
        .bind(tags.expires_at.map(Timestamp::as_millisecond))
        .bind(&tags.name)
        .bind(serde_json::to_string(&tags.labels).map_err(backend)?)
        .bind(i64::from(tags.pinned))
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        ownerless::remove(&mut transaction, id).await?;
        let page = load(&mut transaction, id).await?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(page)
    }

    async fn page_of_key(
        &self,
        tenant: &TenantName,
        given: &Idempotency,
    ) -> Result<Option<StoredPage>, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        let now = self.present(&mut connection).await?.time;
        match idempotency::find(&mut connection, tenant, given, now).await? {
            Some(id) => Ok(Some(load(&mut connection, id).await?)),
            None => Ok(None),
        }
    }

    async fn pages(&self, query: &PageQuery) -> Result<Vec<StoredPage>, StoreError> {
        let mut sql = QueryBuilder::<Db>::new("SELECT * FROM pages WHERE tenant = ");
        sql.push_bind(query.tenant.as_str());
        let PageQuery { labels, created_from, created_before, before, .. } = query;
        narrow(&mut sql, labels, *created_from, *created_before, *before);
        sql.push(" ORDER BY id DESC LIMIT ").push_bind(i64::from(query.limit));
        sql.build_query_as().fetch_all(self.readers()).await.map_err(backend)
    }

    async fn page(&self, id: JobId) -> Result<StoredPage, StoreError> {
        let mut connection = self.readers().acquire().await.map_err(backend)?;
        load(&mut connection, id).await
    }

    async fn replace_page(
        &self,
        id: JobId,
        version: u64,
        content: Value,
        bytes: u64,
    ) -> Result<StoredPage, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        let found = lock(&mut transaction, id).await?.version;
        if found != version {
            return Err(StoreError::Changed { id, version: found });
        }
        sqlx::query(
            "UPDATE pages SET content = $2, version = version + 1, changed_ms = $3, bytes = $4
             WHERE id = $1",
        )
        .bind(id.to_string())
        .bind(content.to_string())
        .bind(now.time.as_millisecond())
        .bind(bytes.cast_signed())
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        let page = load(&mut transaction, id).await?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(page)
    }

    async fn tag_page(&self, id: JobId, tags: &Tags) -> Result<StoredPage, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        lock(&mut transaction, id).await?;
        sqlx::query(
            "UPDATE pages SET name = $2, labels = $3, expires_ms = $4, pinned = $5,
                 tags_version = tags_version + 1, changed_ms = $6 WHERE id = $1",
        )
        .bind(id.to_string())
        .bind(&tags.name)
        .bind(serde_json::to_string(&tags.labels).map_err(backend)?)
        .bind(tags.expires_at.map(Timestamp::as_millisecond))
        .bind(i64::from(tags.pinned))
        .bind(now.time.as_millisecond())
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        let page = load(&mut transaction, id).await?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(page)
    }

    async fn delete_page(&self, id: JobId) -> Result<(), StoreError> {
        let (mut transaction, now) = self.begin().await?;
        lock(&mut transaction, id).await?;
        sqlx::query("DELETE FROM pages WHERE id = $1")
            .bind(id.to_string())
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        ownerless::add(&mut transaction, id, &now.uptime).await?;
        transaction.commit().await.map_err(commit_error)
    }
}
