//! Tenants and keys.

use async_trait::async_trait;
use rand::RngCore;
use sqlx::{FromRow, Row as _};
use subtle::ConstantTimeEq;

use super::{Connection, LOCK, Row, Store, backend, commit_error, rows, storage};
use crate::StoreError;
use crate::access::{AccessStore, ApiKey, KeyText, NewKey, Tenant, TenantLimits, TenantName};
use crate::bytes::BytesOf;

impl<'r> FromRow<'r, Row> for Tenant {
    fn from_row(row: &'r Row) -> sqlx::Result<Self> {
        Ok(Self {
            name: tenant_name(row, "name")?,
            created_at: rows::time(row, "created_ms")?,
            limits: rows::json(row, "limits")?,
        })
    }
}

impl<'r> FromRow<'r, Row> for ApiKey {
    fn from_row(row: &'r Row) -> sqlx::Result<Self> {
        Ok(Self {
            id: row.try_get("id")?,
            tenant: tenant_name(row, "tenant")?,
            label: row.try_get("label")?,
            scope: rows::named(row, "scope")?,
            created_at: rows::time(row, "created_ms")?,
            revoked_at: rows::optional_time(row, "revoked_ms")?,
        })
    }
}

pub(super) fn tenant_name(row: &Row, column: &'static str) -> sqlx::Result<TenantName> {
    row.try_get::<String, _>(column)?.try_into().map_err(rows::decode)
}

/// Holds the tenant's row until the transaction ends, so that nobody else adds to
/// what is counted of it.
pub(super) async fn expect_tenant(
    connection: &mut Connection,
    tenant: &TenantName,
) -> Result<(), StoreError> {
    let found = sqlx::AssertSqlSafe(format!("SELECT name FROM tenants WHERE name = $1{LOCK}"));
    let found = sqlx::query_scalar(found).bind(tenant.as_str()).fetch_optional(connection);
    let found: Option<String> = found.await.map_err(backend)?;
    found.map(drop).ok_or_else(|| StoreError::NoTenant(tenant.clone()))
}

#[async_trait]
impl AccessStore for Store {
    async fn create_tenant(&self, name: &TenantName) -> Result<Tenant, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        let made = sqlx::query(
            "INSERT INTO tenants (name, created_ms) VALUES ($1, $2) ON CONFLICT DO NOTHING",
        )
        .bind(name.as_str())
        .bind(now.time.as_millisecond())
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        if made.rows_affected() == 0 {
            return Err(StoreError::TenantExists(name.clone()));
        }
        transaction.commit().await.map_err(commit_error)?;
        self.tenant(name).await
    }

    async fn tenants(&self) -> Result<Vec<Tenant>, StoreError> {
        let found = sqlx::query_as("SELECT * FROM tenants ORDER BY name");
        found.fetch_all(self.readers()).await.map_err(backend)
    }

    async fn tenant(&self, name: &TenantName) -> Result<Tenant, StoreError> {
        let found = sqlx::query_as("SELECT * FROM tenants WHERE name = $1").bind(name.as_str());
        let found: Option<Tenant> = found.fetch_optional(self.readers()).await.map_err(backend)?;
        found.ok_or_else(|| StoreError::NoTenant(name.clone()))
    }

    async fn limit_tenant(
        &self,
        name: &TenantName,
        limits: &TenantLimits,
    ) -> Result<Tenant, StoreError> {
        let (mut transaction, _) = self.begin().await?;
        sqlx::query("UPDATE tenants SET limits = $2 WHERE name = $1")
            .bind(name.as_str())
            .bind(serde_json::to_string(limits).map_err(backend)?)
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        transaction.commit().await.map_err(commit_error)?;
        self.tenant(name).await
    }

    async fn delete_tenant(&self, name: &TenantName) -> Result<Vec<BytesOf>, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        expect_tenant(&mut transaction, name).await?;
        let running: bool = sqlx::query_scalar(
            "SELECT EXISTS (SELECT 1 FROM jobs WHERE state = 'running' AND tenant = $1)",
        )
        .bind(name.as_str())
        .fetch_one(&mut *transaction)
        .await
        .map_err(backend)?;
        if running || *name == TenantName::default() {
            return Err(StoreError::TenantInUse(name.clone()));
        }
        let mut deleted = Vec::new();
        for sql in [
            "DELETE FROM jobs WHERE tenant = $1 RETURNING id, tenant",
            "DELETE FROM pages WHERE tenant = $1 RETURNING id, tenant",
        ] {
            let gone = sqlx::query(sql).bind(name.as_str()).fetch_all(&mut *transaction);
            deleted.extend(storage::all_bytes_of(&gone.await.map_err(backend)?)?);
        }
        for sql in
            ["DELETE FROM idempotency WHERE tenant = $1", "DELETE FROM tenants WHERE name = $1"]
        {
            let delete = sqlx::query(sql).bind(name.as_str()).execute(&mut *transaction);
            delete.await.map_err(backend)?;
        }
        self.let_go(transaction, deleted, &now.uptime).await
    }

    async fn add_key(&self, key: &NewKey, text: &KeyText) -> Result<ApiKey, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        expect_tenant(&mut transaction, &key.tenant).await?;
        let created_at = now.time;
        sqlx::query(
            "INSERT INTO keys (id, tenant, label, scope, hash, created_ms)
             VALUES ($1, $2, $3, $4, $5, $6)",
        )
        .bind(text.id())
        .bind(key.tenant.as_str())
        .bind(&key.label)
        .bind(rows::name(&key.scope)?)
        .bind(text.hash())
        .bind(created_at.as_millisecond())
        .execute(&mut *transaction)
        .await
        .map_err(backend)?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(ApiKey {
            id: text.id().to_owned(),
            tenant: key.tenant.clone(),
            label: key.label.clone(),
            scope: key.scope,
            created_at,
            revoked_at: None,
        })
    }

    async fn keys(&self) -> Result<Vec<ApiKey>, StoreError> {
        let found = sqlx::query_as("SELECT * FROM keys ORDER BY tenant, created_ms, id");
        found.fetch_all(self.readers()).await.map_err(backend)
    }

    async fn revoke_key(&self, id: &str) -> Result<ApiKey, StoreError> {
        let (mut transaction, now) = self.begin().await?;
        sqlx::query("UPDATE keys SET revoked_ms = $2 WHERE id = $1 AND revoked_ms IS NULL")
            .bind(id)
            .bind(now.time.as_millisecond())
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        let revoked = sqlx::query_as("SELECT * FROM keys WHERE id = $1").bind(id);
        let revoked: Option<ApiKey> =
            revoked.fetch_optional(&mut *transaction).await.map_err(backend)?;
        let revoked = revoked.ok_or_else(|| StoreError::NoKey(id.to_owned()))?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(revoked)
    }

    async fn authenticate(&self, text: &KeyText) -> Result<Option<ApiKey>, StoreError> {
        let found = sqlx::query("SELECT * FROM keys WHERE id = $1 AND revoked_ms IS NULL");
        let found = found.bind(text.id()).fetch_optional(self.readers()).await.map_err(backend)?;
        let Some(row) = found else { return Ok(None) };
        let stored: String = row.try_get("hash").map_err(backend)?;
        let is_same: bool = stored.as_bytes().ct_eq(text.hash().as_bytes()).into();
        is_same.then(|| ApiKey::from_row(&row).map_err(backend)).transpose()
    }

    async fn secret(&self, name: &str) -> Result<String, StoreError> {
        let mut bytes = [0; 32];
        rand::rng().fill_bytes(&mut bytes);
        let (mut transaction, _) = self.begin().await?;
        sqlx::query("INSERT INTO secrets (name, secret) VALUES ($1, $2) ON CONFLICT DO NOTHING")
            .bind(name)
            .bind(hex::encode(bytes))
            .execute(&mut *transaction)
            .await
            .map_err(backend)?;
        let found = sqlx::query_scalar("SELECT secret FROM secrets WHERE name = $1").bind(name);
        let found = found.fetch_one(&mut *transaction).await.map_err(backend)?;
        transaction.commit().await.map_err(commit_error)?;
        Ok(found)
    }

    async fn has_keys(&self) -> Result<bool, StoreError> {
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM keys WHERE revoked_ms IS NULL)")
            .fetch_one(self.readers())
            .await
            .map_err(backend)
    }

    async fn is_closed(&self) -> Result<bool, StoreError> {
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM closed)")
            .fetch_one(self.readers())
            .await
            .map_err(backend)
    }

    async fn open_to_all(&self) -> Result<bool, StoreError> {
        let (mut transaction, _) = self.begin().await?;
        let held: bool =
            sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM keys WHERE revoked_ms IS NULL)")
                .fetch_one(&mut *transaction)
                .await
                .map_err(backend)?;
        if !held {
            let open = sqlx::query("DELETE FROM closed").execute(&mut *transaction);
            open.await.map_err(backend)?;
        }
        transaction.commit().await.map_err(commit_error)?;
        Ok(!held)
    }
}
