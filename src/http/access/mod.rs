//! Who may do what: a layer over all routes, so that a new one is closed unless
//! it is said to be open here.
//!
//! Whatever lies under `/v1/` and the metrics need a key; health and pages are
//! the same for everybody. What a request may do follows from its method and
//! path; whose jobs it is about, from its key.

mod admin;
mod caller;
mod documents;
mod limits;

pub(super) use admin::*;
pub(super) use caller::Caller;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use self::limits::Pace;
use super::problem::{INSUFFICIENT_SCOPE, NOT_FOUND, Problem, UNAUTHORIZED};
use jobs::{AccessStore, KeyText, Scope, StoreError, TenantLimits, TenantName};

/// What is under this is for keys of the scope admin.
const ADMIN: &str = "/v1/admin";
/// Addresses of receivers are often secrets themselves: not for keys that only look.
const WEBHOOK: &str = "/v1/webhook";
/// How long a key that was looked up is taken as it was; one that is revoked by
/// another process works for as long.
const FRESH: Duration = Duration::from_secs(1);
/// Keys that are remembered at a time.
const REMEMBERED: usize = 10_000;

/// Whether requests need a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyPolicy {
    /// Always.
    Required,
    /// From the first one on, also when none is left.
    OnceThereWasAKey,
    /// Never: whoever reaches the service may do everything.
    Off,
}

/// Who may use the service, and how much of it.
#[derive(Clone)]
pub struct Access {
    /// Tenants and keys.
    pub store: Arc<dyn AccessStore>,
    /// Whether requests need a key.
    pub policy: KeyPolicy,
    /// What holds for tenants for whom nothing else is said.
    pub defaults: TenantLimits,
    /// Whether `/metrics` needs no key.
    pub open_metrics: bool,
    /// Whether `/docs` is served.
    pub docs: bool,
}

/// The layer's state.
pub(super) struct Gate {
    access: Access,
    pace: Pace,
    known: Mutex<HashMap<String, (Arc<Caller>, Instant)>>,
    is_closed: Mutex<Option<(bool, Instant)>>,
}

/// Lets a request through if its key allows it, and tells the handlers whose it is.
pub(super) async fn admit(
    State(gate): State<Arc<Gate>>,
    mut request: Request,
    next: Next,
) -> Response {
    let needed = match gate.access.needed(request.method(), request.uri().path()) {
        Ok(Some(scope)) => scope,
        Ok(None) => return next.run(request).await,
        Err(problem) => return problem.into_response(),
    };
    let caller = match gate.caller(request.headers()).await {
        Ok(caller) => caller,
        Err(problem) => return problem.into_response(),
    };
    let paced = gate.pace.take(&caller);
    let refused = if let Err(problem) = &paced {
        Some(problem.clone())
    } else {
        (caller.scope < needed).then(|| out_of_scope(caller.scope, needed))
    };
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let mut response = match refused {
        Some(problem) => problem.into_response(),
        None => {
            request.extensions_mut().insert(Arc::clone(&caller));
            next.run(request).await
        }
    };
    if let Ok(Some(left)) = paced {
        left.tell(response.headers_mut());
    }
    if needed != Scope::Read {
        let (tenant, key, status) = (&caller.tenant, &caller.key, response.status().as_u16());
        tracing::info!(target: "audit", %tenant, key, %method, path, status, "change");
    }
    if needed == Scope::Admin {
        // What was looked up may be otherwise now.
        gate.forget();
    }
    response
}

fn out_of_scope(has: Scope, needed: Scope) -> Problem {
    let name = |scope| match scope {
        Scope::Read => "read",
        Scope::Write => "write",
        Scope::Admin => "admin",
    };
    let (has, needed) = (name(has), name(needed));
    let detail = format!("the key's scope is `{has}`, and this needs `{needed}`");
    Problem::new(INSUFFICIENT_SCOPE, detail)
}

impl Access {
    /// The scope that a request needs; `None` if it is open to everybody.
    fn needed(&self, method: &Method, path: &str) -> Result<Option<Scope>, Problem> {
        if path == "/metrics" {
            // They count the jobs of all tenants.
            return Ok((!self.open_metrics).then_some(Scope::Admin));
        }
        if (path == "/docs" || path.starts_with("/docs/")) && !self.docs {
            return Err(Problem::new(NOT_FOUND, "the documentation is switched off here"));
        }
        if path != "/v1" && !path.starts_with("/v1/") {
            return Ok(None);
        }
        let is_admin =
            path.strip_prefix(ADMIN).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'));
        let is_webhook =
            path.strip_prefix(WEBHOOK).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'));
        Ok(Some(match *method {
            _ if is_admin => Scope::Admin,
            _ if is_webhook => Scope::Write,
            Method::GET | Method::HEAD | Method::OPTIONS => Scope::Read,
            _ => Scope::Write,
        }))
    }
}

impl Gate {
    pub(super) fn new(access: Access) -> Self {
        let (pace, known) = (Pace::default(), Mutex::default());
        Self { access, pace, known, is_closed: Mutex::default() }
    }

    fn forget(&self) {
        lock(&self.known).clear();
        *lock(&self.is_closed) = None;
    }

    async fn caller(&self, headers: &HeaderMap) -> Result<Arc<Caller>, Problem> {
        match headers.get(header::AUTHORIZATION) {
            Some(_) if self.access.policy == KeyPolicy::Off => self.anybody().await,
            Some(given) => self.key_holder(given).await,
            None if self.needs_key().await? => {
                Err(unauthorized("this needs a key; send it as `Authorization: Bearer KEY`"))
            }
            None => self.anybody().await,
        }
    }

    async fn needs_key(&self) -> Result<bool, StoreError> {
        match self.access.policy {
            KeyPolicy::Required => return Ok(true),
            KeyPolicy::Off => return Ok(false),
            KeyPolicy::OnceThereWasAKey => {}
        }
        let known = *lock(&self.is_closed);
        if let Some((is_closed, at)) = known
            && at.elapsed() < FRESH
        {
            return Ok(is_closed);
        }
        let is_closed = self.access.store.is_closed().await?;
        *lock(&self.is_closed) = Some((is_closed, Instant::now()));
        Ok(is_closed)
    }

    async fn key_holder(&self, given: &HeaderValue) -> Result<Arc<Caller>, Problem> {
        let wrong = || unauthorized("there is no such key, or it was revoked");
        let text = given.to_str().ok().and_then(|given| given.split_once(' '));
        let text = text.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"));
        let text: KeyText =
            text.and_then(|(_, text)| text.trim().parse().ok()).ok_or_else(wrong)?;
        if let Some(caller) = self.remembered(text.reveal()) {
            return Ok(caller);
        }
        let key = self.access.store.authenticate(&text).await?.ok_or_else(wrong)?;
        let limits = self.limits_of(&key.tenant).await?;
        let caller = Caller { tenant: key.tenant, scope: key.scope, key: key.id, limits };
        Ok(self.remember(text.reveal(), caller))
    }

    /// Who sends no key where none is needed.
    async fn anybody(&self) -> Result<Arc<Caller>, Problem> {
        if let Some(caller) = self.remembered("") {
            return Ok(caller);
        }
        let tenant = TenantName::default();
        let limits = self.limits_of(&tenant).await?;
        let caller = Caller { tenant, scope: Scope::Admin, key: String::new(), limits };
        Ok(self.remember("", caller))
    }

    /// The tenant's own limits over those of all.
    async fn limits_of(&self, tenant: &TenantName) -> Result<TenantLimits, StoreError> {
        let (own, all) = (self.access.store.tenant(tenant).await?.limits, &self.access.defaults);
        Ok(TenantLimits {
            requests_per_second: own.requests_per_second.or(all.requests_per_second),
            max_queued: own.max_queued.or(all.max_queued),
            max_running: own.max_running,
            max_streams: own.max_streams.or(all.max_streams),
            max_bytes: own.max_bytes.or(all.max_bytes),
            expires_in: own.expires_in.or(all.expires_in),
        })
    }

    fn remembered(&self, text: &str) -> Option<Arc<Caller>> {
        let known = lock(&self.known);
        let (caller, at) = known.get(text)?;
        (at.elapsed() < FRESH).then(|| Arc::clone(caller))
    }

    fn remember(&self, text: &str, caller: Caller) -> Arc<Caller> {
        let caller = Arc::new(caller);
        let mut known = lock(&self.known);
        if known.len() >= REMEMBERED {
            known.clear();
        }
        known.insert(text.to_owned(), (Arc::clone(&caller), Instant::now()));
        caller
    }
}

fn unauthorized(detail: &str) -> Problem {
    Problem::new(UNAUTHORIZED, detail)
        .header(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
