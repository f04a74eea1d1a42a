//! How many requests a second a tenant may send.

use std::collections::HashMap;
use std::num::NonZeroU32;
use std::sync::{Arc, Mutex, PoisonError};

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use governor::clock::{Clock, DefaultClock};
use governor::middleware::StateInformationMiddleware;
use governor::state::{InMemoryState, NotKeyed};
use governor::{Quota, RateLimiter};

use super::Caller;
use crate::http::problem::{Problem, TOO_MANY_REQUESTS};
use jobs::TenantName;

type Bucket = RateLimiter<NotKeyed, InMemoryState, DefaultClock, StateInformationMiddleware>;

/// The tenants' buckets: each holds the requests of a second.
#[derive(Default)]
pub(super) struct Pace {
    buckets: Mutex<HashMap<TenantName, (NonZeroU32, Arc<Bucket>)>>,
}

/// What is left of a tenant's requests.
pub(super) struct Left {
    limit: u32,
    remaining: u32,
}

impl Pace {
    /// Takes one request of the caller's tenant. `None` if it has no limit.
    pub(super) fn take(&self, caller: &Caller) -> Result<Option<Left>, Problem> {
        let Some(limit) = caller.limits.requests_per_second.and_then(NonZeroU32::new) else {
            return Ok(None);
        };
        let bucket = self.bucket(&caller.tenant, limit);
        match bucket.check() {
            Ok(state) => {
                Ok(Some(Left { limit: limit.get(), remaining: state.remaining_burst_capacity() }))
            }
            Err(until) => {
                let wait = until.wait_time_from(DefaultClock::default().now());
                let seconds = wait.as_secs() + 1;
                let detail = format!(
                    "tenant {} may send {limit} requests a second; go on in {seconds} s",
                    caller.tenant
                );
                let mut problem = Problem::new(TOO_MANY_REQUESTS, detail)
                    .header(header::RETRY_AFTER, HeaderValue::from(seconds));
                let left = Left { limit: limit.get(), remaining: 0 };
                for (name, value) in left.fields() {
                    problem = problem.header(name, value);
                }
                Err(problem)
            }
        }
    }

    fn bucket(&self, tenant: &TenantName, limit: NonZeroU32) -> Arc<Bucket> {
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        match buckets.get(tenant) {
            Some((known, bucket)) if *known == limit => Arc::clone(bucket),
            _ => {
                let bucket = RateLimiter::direct(Quota::per_second(limit));
                let bucket = Arc::new(bucket.with_middleware::<StateInformationMiddleware>());
                buckets.insert(tenant.clone(), (limit, Arc::clone(&bucket)));
                bucket
            }
        }
    }
}

impl Left {
    pub(super) fn tell(&self, headers: &mut HeaderMap) {
        headers.extend(self.fields());
    }

    fn fields(&self) -> [(HeaderName, HeaderValue); 3] {
        [
            (HeaderName::from_static("ratelimit-limit"), self.limit.into()),
            (HeaderName::from_static("ratelimit-remaining"), self.remaining.into()),
            // The bucket is full again after this many seconds.
            (HeaderName::from_static("ratelimit-reset"), HeaderValue::from_static("1")),
        ]
    }
}
