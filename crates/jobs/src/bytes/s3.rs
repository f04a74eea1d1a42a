//! The byte store of a farm: a bucket of an S3-compatible service.

use std::sync::Arc;
use std::time::Duration;

use object_store::aws::AmazonS3Builder;
use object_store::path::Path;
use object_store::prefix::PrefixStore;
use object_store::{BackoffConfig, ClientOptions, ObjectStore, RetryConfig};
use url::Url;

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
        let store = store.with_bucket_name(bucket).with_retry(retry);
        let store = store.build().map_err(from_store)?;
        let store: Arc<dyn ObjectStore> = match prefix.as_ref() {
            "" => Arc::new(store),
            _ => Arc::new(PrefixStore::new(store, prefix)),
        };
        Ok(Self::remote(store))
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
}
