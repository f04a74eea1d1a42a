//! Requests of the service to others: to where clients say, but only to whom the
//! [`OutboundPolicy`] lets through.
//!
//! A host's addresses are asked for, held against the policy and connected to in
//! one step, so that no answer in between can be another. No redirect is
//! followed, no proxy used, no connection kept, no cookie sent.

mod policy;

pub use policy::{OutboundPolicy, Refused};

use std::error::Error;
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use std::vec;

use axum::http::{HeaderMap, HeaderValue, Method, Request, StatusCode, header};
use bytes::Bytes;
use http_body_util::{BodyExt, Full, LengthLimitError, Limited};
use hyper_rustls::{HttpsConnector, HttpsConnectorBuilder};
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::client::legacy::connect::dns::Name;
use hyper_util::rt::TokioExecutor;
use rustls::pki_types::CertificateDer;
use rustls::{ClientConfig, RootCertStore};
use tower::Service;

/// From the look-up of the host to the end of the answer.
const TIMEOUT: Duration = Duration::from_secs(10);
const USER_AGENT: HeaderValue =
    HeaderValue::from_static(concat!("turnaround/", env!("CARGO_PKG_VERSION")));

/// Why a request came to nothing. Its text may be shown to who gave the URL.
#[derive(Debug, thiserror::Error)]
pub enum OutboundError {
    /// It may not be called.
    #[error("{0}")]
    Refused(#[from] Refused),
    /// It took too long.
    #[error("no whole answer came within {} s", TIMEOUT.as_secs())]
    Timeout,
    /// There was no connection, or it ended.
    #[error("no answer came: {0}")]
    Broken(&'static str),
}

/// What somebody answered.
#[derive(Debug)]
pub struct Answer {
    /// Its status; a redirect is not followed.
    pub status: StatusCode,
    /// Its body; `None` if it is longer than it may be.
    pub body: Option<Bytes>,
}

/// Calls others.
pub struct Outbound {
    policy: Arc<OutboundPolicy>,
    client: Client<HttpsConnector<HttpConnector<Resolver>>, Full<Bytes>>,
}

impl Outbound {
    /// Reads the machine's root certificates; without any, nobody is believed to
    /// be who they say but those for whom `authorities` answer.
    ///
    /// * `authorities`: certificates that are believed besides the machine's.
    ///
    /// # Errors
    /// If one of the authorities is none, or the TLS library has no protocol in
    /// common with its provider.
    pub fn new(
        policy: OutboundPolicy,
        authorities: Vec<CertificateDer<'static>>,
    ) -> io::Result<Self> {
        let policy = Arc::new(policy);
        let mut http = HttpConnector::new_with_resolver(Resolver(Arc::clone(&policy)));
        http.enforce_http(false);
        let https = HttpsConnectorBuilder::new()
            .with_tls_config(tls(authorities)?)
            .https_or_http()
            .enable_http1()
            .wrap_connector(http);
        let client = Client::builder(TokioExecutor::new()).pool_max_idle_per_host(0).build(https);
        Ok(Self { policy, client })
    }

    /// Which addresses may be called.
    pub fn policy(&self) -> &OutboundPolicy {
        &self.policy
    }

    /// Sends a request and reads the answer; of its body `max_bytes` at most, the
    /// rest is left unread.
    ///
    /// # Errors
    /// If it may not be called or does not answer in time. A status that says no
    /// is an answer.
    pub async fn send(
        &self,
        method: Method,
        url: &str,
        headers: HeaderMap,
        body: Bytes,
        max_bytes: usize,
    ) -> Result<Answer, OutboundError> {
        let url = self.policy.check(url)?;
        let mut request = Request::new(Full::new(body));
        *request.method_mut() = method;
        *request.uri_mut() = url.as_str().parse().map_err(|_| Refused::NotAUrl)?;
        *request.headers_mut() = headers;
        request.headers_mut().insert(header::USER_AGENT, USER_AGENT);
        let answering = async {
            let answer = self.client.request(request).await.map_err(|error| broken(&error))?;
            let status = answer.status();
            let body = match Limited::new(answer.into_body(), max_bytes).collect().await {
                Ok(body) => Some(body.to_bytes()),
                Err(error) if error.is::<LengthLimitError>() => None,
                Err(_) => return Err(OutboundError::Broken("the connection ended within it")),
            };
            Ok(Answer { status, body })
        };
        tokio::time::timeout(TIMEOUT, answering).await.unwrap_or(Err(OutboundError::Timeout))
    }
}

/// What went wrong, without the addresses that causes name.
fn broken(failed: &hyper_util::client::legacy::Error) -> OutboundError {
    let mut cause: Option<&dyn Error> = Some(failed);
    while let Some(error) = cause {
        // What an I/O error carries is not its source.
        let carried = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
        cause = carried.map(|carried| carried as &dyn Error).or_else(|| error.source());
        if let Some(refused) = error.downcast_ref::<Refused>() {
            return refused.clone().into();
        }
        if error.is::<UnknownHost>() {
            return OutboundError::Broken("the host's name is not known");
        }
        if error.is::<rustls::Error>() {
            return OutboundError::Broken("the host's certificate or TLS is not accepted");
        }
    }
    if failed.is_connect() {
        OutboundError::Broken("nothing takes connections there")
    } else {
        OutboundError::Broken("the connection ended before it")
    }
}

fn tls(authorities: Vec<CertificateDer<'static>>) -> io::Result<ClientConfig> {
    let mut roots = RootCertStore::empty();
    let found = rustls_native_certs::load_native_certs();
    roots.add_parsable_certificates(found.certs);
    for authority in authorities {
        roots.add(authority).map_err(io::Error::other)?;
    }
    if roots.is_empty() {
        tracing::warn!("the machine has no root certificates: https addresses can't be called");
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(io::Error::other)?;
    Ok(config.with_root_certificates(roots).with_no_client_auth())
}

/// Nobody knows the host's addresses.
#[derive(Debug, thiserror::Error)]
#[error("the host's name is not known")]
struct UnknownHost;

/// Asks the system for a host's addresses and lets those through that may be called.
#[derive(Clone)]
struct Resolver(Arc<OutboundPolicy>);

type Addresses = Result<vec::IntoIter<SocketAddr>, Box<dyn Error + Send + Sync>>;

impl Service<Name> for Resolver {
    type Response = vec::IntoIter<SocketAddr>;
    type Error = Box<dyn Error + Send + Sync>;
    type Future = Pin<Box<dyn Future<Output = Addresses> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, name: Name) -> Self::Future {
        let policy = Arc::clone(&self.0);
        Box::pin(async move {
            let found = tokio::net::lookup_host((name.as_str(), 0)).await;
            let found: Vec<_> = found.map_err(|_| UnknownHost)?.collect();
            Ok(policy.check_addresses(name.as_str(), found)?.into_iter())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The name is looked up, for nobody else's machine has it, and refused
    /// before anything is connected to.
    #[tokio::test]
    async fn names_of_the_loopback_are_refused_when_they_are_looked_up() {
        let mut resolver = Resolver(Arc::default());
        let refused = resolver.call("localhost".parse().unwrap()).await.unwrap_err();
        let why = Refused::NotPublic("localhost".to_owned());
        assert_eq!(refused.downcast_ref::<Refused>(), Some(&why));
        let outbound = Outbound::new(OutboundPolicy::default(), Vec::new()).unwrap();
        let (headers, body) = (HeaderMap::new(), Bytes::new());
        let asked = outbound.send(Method::GET, "https://localhost:1/", headers, body, 10);
        let error = asked.await.unwrap_err();
        assert!(matches!(&error, OutboundError::Refused(found) if *found == why), "{error:?}");
        let mut trusting = Resolver(Arc::new(OutboundPolicy {
            trusted_hosts: vec!["localhost".to_owned()],
            allow_http: false,
        }));
        assert!(trusting.call("localhost".parse().unwrap()).await.unwrap().count() > 0);
    }
}
