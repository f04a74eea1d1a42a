//! Who may use the service: tenants, whose jobs are kept apart, and their keys.

use std::fmt;
use std::str::FromStr;

use async_trait::async_trait;
use jiff::Timestamp;
use rand::RngCore;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::StoreError;
use super::bytes::BytesOf;

/// The name of a tenant: 1 to 63 lower-case letters, digits and hyphens.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct TenantName(String);

/// A text that names no tenant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is no name of a tenant: 1 to 63 lower-case letters, digits and hyphens")]
pub struct InvalidTenantName(String);

impl TenantName {
    /// Its text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// The tenant of jobs from before there were others, and of requests without keys.
impl Default for TenantName {
    fn default() -> Self {
        Self("default".to_owned())
    }
}

impl TryFrom<String> for TenantName {
    type Error = InvalidTenantName;

    fn try_from(text: String) -> Result<Self, InvalidTenantName> {
        let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        if (1..=63).contains(&text.len()) && text.bytes().all(plain) {
            Ok(Self(text))
        } else {
            Err(InvalidTenantName(text))
        }
    }
}

impl FromStr for TenantName {
    type Err = InvalidTenantName;

    fn from_str(text: &str) -> Result<Self, InvalidTenantName> {
        text.to_owned().try_into()
    }
}

impl From<TenantName> for String {
    fn from(name: TenantName) -> Self {
        name.0
    }
}

impl fmt::Display for TenantName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// What of the service's limits is otherwise for one tenant; `None` where they hold.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TenantLimits {
    /// Requests a second.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requests_per_second: Option<u32>,
    /// Jobs waiting at a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_queued: Option<u32>,
    /// Jobs running at a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_running: Option<u32>,
    /// Event streams open at a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_streams: Option<u32>,
    /// Bytes stored for jobs and pages: uploads are refused above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_bytes: Option<u64>,
    /// Seconds after which jobs and pages are deleted that do not say it themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expires_in: Option<u32>,
}

/// Somebody whose jobs nobody else sees.
#[derive(Clone, Debug, PartialEq)]
pub struct Tenant {
    /// Its name.
    pub name: TenantName,
    /// When it was made.
    pub created_at: Timestamp,
    /// What is otherwise for it.
    pub limits: TenantLimits,
}

/// What a key allows; each scope includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    /// Look at the tenant's jobs and results.
    Read,
    /// Upload, cancel and delete jobs of the tenant.
    Write,
    /// Make and delete tenants and keys.
    Admin,
}

/// A key, without its secret.
#[derive(Clone, Debug, PartialEq)]
pub struct ApiKey {
    /// The readable first part of it.
    pub id: String,
    /// Whose it is.
    pub tenant: TenantName,
    /// What people call it.
    pub label: String,
    /// What it allows.
    pub scope: Scope,
    /// When it was made.
    pub created_at: Timestamp,
    /// When it was revoked, if it was.
    pub revoked_at: Option<Timestamp>,
}

/// A key to be stored.
#[derive(Clone, Debug)]
pub struct NewKey {
    /// Whose it is.
    pub tenant: TenantName,
    /// What people call it.
    pub label: String,
    /// What it allows.
    pub scope: Scope,
}

/// The whole of a key, as clients send it: `ta_`, its id, and a secret. Shown
/// once; the store has a hash of it.
#[derive(Clone, PartialEq, Eq)]
pub struct KeyText(String);

/// A text that is no key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a key is `ta_`, 12 hexadecimal digits, `_`, and 64 hexadecimal digits")]
pub struct InvalidKey;

const PREFIX: &str = "ta_";
const ID_DIGITS: usize = 12;
const SECRET_DIGITS: usize = 64;

impl KeyText {
    /// A new key from the system's randomness: 256 secret bits.
    pub fn generate() -> Self {
        let mut bytes = [0; (ID_DIGITS + SECRET_DIGITS) / 2];
        rand::rng().fill_bytes(&mut bytes);
        let digits = hex::encode(bytes);
        let (id, secret) = digits.split_at(ID_DIGITS);
        Self(format!("{PREFIX}{id}_{secret}"))
    }

    /// The readable first part, by which it is found.
    pub fn id(&self) -> &str {
        &self.0[..PREFIX.len() + ID_DIGITS]
    }

    /// The whole key: to be shown once.
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// Lower-case hexadecimal SHA-256. The secret is too long to be guessed, so
    /// that no slower hash is needed.
    pub(crate) fn hash(&self) -> String {
        hex::encode(Sha256::digest(&self.0))
    }
}

impl FromStr for KeyText {
    type Err = InvalidKey;

    fn from_str(text: &str) -> Result<Self, InvalidKey> {
        let (id, secret) =
            text.strip_prefix(PREFIX).and_then(|rest| rest.split_once('_')).ok_or(InvalidKey)?;
        let are_digits = |text: &str, count| {
            text.len() == count
                && text.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
        };
        if are_digits(id, ID_DIGITS) && are_digits(secret, SECRET_DIGITS) {
            Ok(Self(text.to_owned()))
        } else {
            Err(InvalidKey)
        }
    }
}

/// Keeps the secret out of logs.
impl fmt::Debug for KeyText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}_…", self.id())
    }
}

/// Tenants and keys, beside the jobs that they are about.
#[async_trait]
pub trait AccessStore: Send + Sync {
    /// Makes a tenant.
    ///
    /// # Errors
    /// [`StoreError::TenantExists`] if the name is taken.
    async fn create_tenant(&self, name: &TenantName) -> Result<Tenant, StoreError>;

    /// Every tenant, by name.
    async fn tenants(&self) -> Result<Vec<Tenant>, StoreError>;

    /// One tenant.
    ///
    /// # Errors
    /// [`StoreError::NoTenant`] if there is none of this name.
    async fn tenant(&self, name: &TenantName) -> Result<Tenant, StoreError>;

    /// Sets what is otherwise for a tenant.
    async fn limit_tenant(
        &self,
        name: &TenantName,
        limits: &TenantLimits,
    ) -> Result<Tenant, StoreError>;

    /// Forgets a tenant with its keys and jobs. Returns the jobs, whose bytes
    /// are to be deleted.
    ///
    /// # Errors
    /// [`StoreError::TenantInUse`] while a job of it runs, and for the default one.
    async fn delete_tenant(&self, name: &TenantName) -> Result<Vec<BytesOf>, StoreError>;

    /// Stores a key.
    ///
    /// # Errors
    /// [`StoreError::NoTenant`] if its tenant is not there.
    async fn add_key(&self, key: &NewKey, text: &KeyText) -> Result<ApiKey, StoreError>;

    /// Every key, revoked ones too, by tenant and age.
    async fn keys(&self) -> Result<Vec<ApiKey>, StoreError>;

    /// Revokes a key for good; doing so again changes nothing.
    ///
    /// # Errors
    /// [`StoreError::NoKey`] if there is none of this id.
    async fn revoke_key(&self, id: &str) -> Result<ApiKey, StoreError>;

    /// The key that `text` is, unless it was revoked. Compared in constant time.
    async fn authenticate(&self, text: &KeyText) -> Result<Option<ApiKey>, StoreError>;

    /// A secret of the service itself, made when it is first asked for: 256
    /// random bits in lower-case hexadecimal, the same for all processes.
    async fn secret(&self, name: &str) -> Result<String, StoreError>;

    /// Whether there is a key that was not revoked.
    async fn has_keys(&self) -> Result<bool, StoreError>;

    /// Whether a key was ever made, by whatever process, and [`Self::open_to_all`] not
    /// called since.
    async fn is_closed(&self) -> Result<bool, StoreError>;

    /// Lets everybody in until the next key is made. `false`, and nothing is changed,
    /// while there is a key that was not revoked.
    async fn open_to_all(&self) -> Result<bool, StoreError>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_told_from_other_texts_and_keep_their_secret() {
        let key = KeyText::generate();
        assert_eq!(key.reveal().parse::<KeyText>(), Ok(key.clone()));
        assert_ne!(KeyText::generate(), key);
        let secret = key.reveal().rsplit('_').next().unwrap();
        assert!(!format!("{key:?}").contains(secret) && !key.hash().contains(secret));
        let long = format!("{}0", key.reveal());
        let upper = key.reveal().to_uppercase();
        for text in ["", "ta_", "ta_0_0", &key.reveal()[1..], &long, &upper, &key.id().repeat(9)] {
            assert_eq!(text.parse::<KeyText>(), Err(InvalidKey), "{text}");
        }
    }

    #[test]
    fn names_of_tenants_are_plain_words() {
        for text in ["a", "show-7", "default"] {
            assert_eq!(text.parse::<TenantName>().unwrap().as_str(), text);
        }
        for text in ["", "A", "a b", "a/b", "..", "ä", &"a".repeat(64)] {
            assert!(text.parse::<TenantName>().is_err(), "{text}");
        }
    }
}
