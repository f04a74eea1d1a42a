//! The byte store of a farm: a bucket of an S3-compatible service.

use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use object_store::aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey};
use object_store::path::Path;
use object_store::prefix::PrefixStore;
use object_store::signer::{Method, SignedUrlOptions, Signer};
use object_store::{BackoffConfig, ClientOptions, ObjectStore, RetryConfig};
use url::Url;

use super::key::{Home, Key};
use super::store::{ByteError, ByteStore, backend, from_store};

const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Without a byte from the service. A whole answer may take as long as its reader.
const READ_TIMEOUT: Duration = Duration::from_secs(20);
/// For how long a request that failed is sent again; then the job waits.
const RETRIES_FOR: Duration = Duration::from_secs(30);

/// An address that names no bucket.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is no store; give s3://BUCKET or s3://BUCKET/PREFIX")]
struct InvalidAddress(String);

/// The address's prefix, and what makes the client of its bucket.
fn bucket(
    address: &str,
    environment: impl IntoIterator<Item = (String, String)>,
) -> Result<(Path, AmazonS3Builder), ByteError> {
    let invalid = || ByteError::other(InvalidAddress(address.to_owned()));
    let url = Url::parse(address).map_err(|_| invalid())?;
    let bucket = url.host_str().filter(|_| url.scheme() == "s3").ok_or_else(invalid)?;
    let prefix = Path::from_url_path(url.path()).map_err(backend)?;
    // Of the two that could be linked, the one that is.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let client = ClientOptions::new()
        .with_timeout_disabled()
        .with_connect_timeout(CONNECT_TIMEOUT)
        .with_read_timeout(READ_TIMEOUT);
    let retry = RetryConfig {
        backoff: BackoffConfig { max_backoff: Duration::from_secs(5), ..Default::default() },
        max_retries: 30,
        retry_timeout: RETRIES_FOR,
    };
    let mut store = AmazonS3Builder::new().with_client_options(client);
    for (name, value) in environment {
        if name.starts_with("AWS_")
            && let Ok(key) = name.to_ascii_lowercase().parse()
        {
            store = store.with_config(key, value);
        }
    }
    Ok((prefix, store.with_bucket_name(bucket).with_retry(retry)))
}

impl ByteStore {
    /// Bytes in a bucket, below the prefix of `address`: `s3://bucket/prefix`.
    ///
    /// * `environment`: endpoint, region and credentials by the names that AWS's own
    ///   programs use (`AWS_ENDPOINT_URL`, `AWS_REGION`, `AWS_ACCESS_KEY_ID` ...;
    ///   `AWS_ALLOW_HTTP` for an endpoint without TLS). Other variables are passed over.
    ///
    /// # Errors
    /// [`ByteError::Backend`] if `address` is none or the environment makes no sense.
    pub fn s3(
        address: &str,
        environment: impl IntoIterator<Item = (String, String)>,
    ) -> Result<Self, ByteError> {
        let (prefix, store) = bucket(address, environment)?;
        let store = store.build().map_err(from_store)?;
        let store: Arc<dyn ObjectStore> = match prefix.as_ref() {
            "" => Arc::new(store),
            _ => Arc::new(PrefixStore::new(store, prefix)),
        };
        Ok(Self::remote(store))
    }
}

/// Objects that nobody can fetch by a URL alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("objects encrypted with a key of the client (SSE-C) can't be fetched by a signed URL")]
struct NeedsCustomerKey;

/// Signs URLs by which others fetch what a bucket has, without credentials, for a time.
#[derive(Clone, Debug)]
pub struct UrlSigner {
    store: AmazonS3,
    prefix: Path,
}

/// What the bucket says of the bytes that it sends. It is part of what is signed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResponseHeaders<'a> {
    /// `Content-Type`.
    pub media_type: &'a str,
    /// `Content-Disposition`.
    pub disposition: &'a str,
    /// `Cache-Control`.
    pub cache_control: &'a str,
}

impl UrlSigner {
    /// * `address`, `environment`: as for [`ByteStore::s3`].
    /// * `endpoint`: by which those who fetch reach the bucket, if not by that of
    ///   `environment`: the signature covers the host.
    ///
    /// # Errors
    /// As [`ByteStore::s3`], and if the bucket's objects need more than a URL.
    pub fn s3(
        address: &str,
        environment: impl IntoIterator<Item = (String, String)>,
        endpoint: Option<&str>,
    ) -> Result<Self, ByteError> {
        let (prefix, mut store) = bucket(address, environment)?;
        let customer_key =
            AmazonS3ConfigKey::from_str("aws_sse_customer_key_base64").map_err(from_store)?;
        if store.get_config_value(&customer_key).is_some() {
            return Err(ByteError::other(NeedsCustomerKey));
        }
        if let Some(endpoint) = endpoint {
            // The one that is asked for first.
            store = store.with_config(AmazonS3ConfigKey::S3Endpoint, endpoint);
        }
        Ok(Self { store: store.build().map_err(from_store)?, prefix })
    }

    /// A URL that gets what is stored under `key`, all of it or a range.
    ///
    /// * `lifetime`: whole seconds, a week at most; credentials that end sooner end it too.
    ///
    /// # Errors
    /// [`ByteError::Backend`] if there are no credentials now.
    pub async fn url(
        &self,
        home: &Home,
        key: &Key<'_>,
        lifetime: Duration,
        headers: &ResponseHeaders<'_>,
    ) -> Result<String, ByteError> {
        let below = [home.prefix(), key.path()?];
        let path: Path = self.prefix.parts().chain(below.iter().flat_map(Path::parts)).collect();
        let options = SignedUrlOptions::new().with_query([
            ("response-cache-control", headers.cache_control),
            ("response-content-disposition", headers.disposition),
            ("response-content-type", headers.media_type),
        ]);
        let signed = self.store.signed_url_opts(Method::GET, &path, lifetime, &options);
        Ok(signed.await.map_err(from_store)?.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_buckets_are_taken() {
        for wrong in ["", "bucket", "https://host/bucket", "s3:bucket", "s3:///prefix"] {
            let error = ByteStore::s3(wrong, []).map(drop).unwrap_err();
            assert!(error.to_string().contains("give s3://BUCKET"), "{wrong}: {error}");
        }
    }

    #[test]
    fn objects_that_need_a_key_of_the_client_are_not_fetched_by_url() {
        let key = ("AWS_SSE_CUSTOMER_KEY_BASE64".to_owned(), "c2VjcmV0".to_owned());
        let error = UrlSigner::s3("s3://bucket", [key], None).unwrap_err();
        assert!(error.to_string().contains("SSE-C"), "{error}");
    }
}
