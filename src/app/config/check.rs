//! Settings that make no sense are refused at the start, not found out later.

use anyhow::{Result, ensure};

use super::Config;

impl Config {
    /// Refuses settings that make no sense, alone or together.
    ///
    /// # Errors
    /// Says which, why, and what is taken.
    pub(super) fn check(&self) -> Result<()> {
        let Self { http, workers, limits, outbound, stores, storage, access, .. } = self;
        for origin in &http.cors_origin {
            ensure!(
                is_origin(origin),
                "cors_origin is `{origin}`; give an origin such as https://studio.example, without a path, or *"
            );
        }
        for host in &http.allowed_host {
            ensure!(
                is_host(host),
                "allowed_host is `{host}`; give a name or address without a port"
            );
        }
        for host in &outbound.trusted_host {
            ensure!(
                is_host(host),
                "trusted_host is `{host}`; give a name or address without a port"
            );
        }
        if let Some(url) = &stores.database_url {
            // The rest of it may be a secret.
            ensure!(
                url.starts_with("postgres://") || url.starts_with("postgresql://"),
                "database_url must begin with postgres://"
            );
        }
        if let Some(address) = &stores.store {
            ensure!(
                address.starts_with("s3://"),
                "store is `{address}`; give s3://BUCKET or s3://BUCKET/PREFIX"
            );
        }
        ensure!(
            !storage.make_room || storage.disk_budget_mib.is_some(),
            "make_room is set, but no disk_budget_mib that says when"
        );
        ensure!(
            storage.download_redirects.is_none() || stores.store.is_some(),
            "download_redirects is set, but files in the data folder have no URLs that could be signed; give --store s3://BUCKET, or leave it out"
        );
        if let Some(endpoint) = &storage.download_endpoint {
            ensure!(
                storage.download_redirects.is_some(),
                "download_endpoint is set, but no download_redirects that says for how long its URLs work"
            );
            ensure!(
                is_endpoint(endpoint),
                "download_endpoint is `{endpoint}`; give the http or https URL of the bucket's service, without a user or a query"
            );
        }
        for (name, value, range) in [
            ("workers", workers.workers as u64, 0..=256),
            ("threads_per_job", workers.threads_per_job as u64, 0..=1024),
            ("database_connections", stores.database_connections.into(), 2..=1000),
            ("max_attempts", workers.max_attempts.into(), 1..=100),
            ("max_job_seconds", workers.max_job_seconds, 1..=604_800),
            ("heartbeat", workers.heartbeat, 1..=3600),
            ("lease", workers.lease, 2..=86_400),
            ("shutdown_grace", workers.shutdown_grace, 0..=86_400),
            ("header_timeout", http.header_timeout, 1..=3600),
            ("body_idle_timeout", http.body_idle_timeout, 1..=3600),
            ("write_timeout", http.write_timeout, 1..=3600),
            ("max_streams", http.max_streams as u64, 1..=100_000),
            ("max_views", limits.max_views as u64, 1..=360),
            ("max_image_mib", limits.max_image_mib, 1..=4096),
            ("max_image_megapixels", limits.max_image_megapixels, 1..=4096),
            ("max_image_side", limits.max_image_side.into(), 1..=65_535),
            ("max_model_mib", limits.max_model_mib as u64, 1..=4096),
            ("max_model_triangles", limits.max_model_triangles as u64, 1..=100_000_000),
            ("max_body_mib", limits.max_body_mib, 1..=65_536),
            ("disk_budget_mib", storage.disk_budget_mib.unwrap_or(1), 1..=1 << 40),
            ("download_redirects", storage.download_redirects.unwrap_or(1).into(), 1..=3600),
            ("max_tenant_mib", access.max_tenant_mib.unwrap_or(1), 1..=1 << 40),
            ("expires_in", access.expires_in.unwrap_or(1).into(), 1..=316_224_000),
        ] {
            let (least, most) = (range.start(), range.end());
            ensure!(range.contains(&value), "{name} is {value}; give {least} to {most}");
        }
        let (lease, heartbeat) = (workers.lease, workers.heartbeat);
        ensure!(
            lease >= 2 * heartbeat,
            "lease is {lease} and heartbeat {heartbeat} seconds; a lease must last two heartbeats at least, or every job is taken from its worker"
        );
        Ok(())
    }
}

/// Whether browsers would send it as an origin.
fn is_origin(text: &str) -> bool {
    let authority = text.strip_prefix("https://").or_else(|| text.strip_prefix("http://"));
    text == "*" || authority.is_some_and(|rest| !rest.is_empty() && is_authority(rest))
}

/// Whether paths of objects can be put behind it.
fn is_endpoint(text: &str) -> bool {
    url::Url::parse(text).is_ok_and(|url| {
        let is_plain = url.username().is_empty()
            && url.password().is_none()
            && url.query().is_none()
            && url.fragment().is_none();
        matches!(url.scheme(), "http" | "https") && url.has_host() && is_plain
    })
}

fn is_authority(text: &str) -> bool {
    let parsed = text.parse::<axum::http::uri::Authority>();
    parsed.is_ok_and(|parsed| parsed.as_str() == text && !text.contains('@'))
}

fn is_host(text: &str) -> bool {
    is_authority(text) && (text.starts_with('[') && text.ends_with(']') || !text.contains(':'))
}

#[cfg(test)]
mod tests {
    use super::super::tests::resolve;

    #[test]
    fn what_makes_no_sense_is_refused() {
        for (args, told) in [
            (["--lease", "5"].as_slice(), "two heartbeats"),
            (&["--workers", "100000"], "workers is 100000; give 0 to 256"),
            (&["--database-url", "mysql://host/name"], "postgres://"),
            (&["--database-connections", "1"], "database_connections is 1"),
            (&["--store", "bucket"], "s3://BUCKET"),
            (&["--max-views", "0"], "max_views is 0"),
            (&["--cors-origin", "studio.example"], "`studio.example`"),
            (&["--cors-origin", "https://studio.example/app"], "without a path"),
            (&["--allowed-host", "studio.example:80"], "without a port"),
            (&["--max-job-seconds", "0"], "max_job_seconds is 0"),
            (&["--download-redirects", "60"], "give --store s3://BUCKET"),
            (
                &["--store", "s3://bucket", "--download-redirects", "3601"],
                "download_redirects is 3601; give 1 to 3600",
            ),
            (&["--download-endpoint", "https://s3.studio.example"], "--download-redirects"),
        ] {
            let error = resolve(args).unwrap_err().to_string();
            assert!(error.contains(told), "{args:?}: {error}");
        }
        for endpoint in ["s3.studio.example", "s3://bucket", "https://a:b@host", "https://host?x"] {
            let args = ["--store", "s3://bucket", "--download-redirects", "60"];
            let given = [args.as_slice(), &["--download-endpoint", endpoint]].concat();
            let error = resolve(&given).unwrap_err().to_string();
            assert!(error.contains("give the http or https URL"), "{endpoint}: {error}");
        }
        for args in [
            ["--lease", "20"].as_slice(),
            &[
                "--store",
                "s3://bucket",
                "--download-redirects",
                "3600",
                "--download-endpoint",
                "https://s3.studio.example/below",
            ],
            &["--cors-origin", "https://studio.example:8443,http://localhost:5173"],
            &["--cors-origin", "*"],
            &["--workers", "0", "--database-url", "postgres://host/name"],
            &["--store", "s3://bucket/a/b"],
            &["--allowed-host", "draft.studio.example,[::1],10.0.0.1"],
        ] {
            resolve(args).unwrap();
        }
    }
}
