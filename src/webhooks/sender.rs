//! Sends the messages of the outbox.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::http::Method;
use jiff::Timestamp;
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinSet;

use super::message;
use crate::outbound::{Outbound, OutboundError};
use jobs::{Delivery, DeliveryAttempt, JobStore, StoreError, TenantName};

/// Of an answer, which is not looked at.
const MAX_ANSWER_BYTES: usize = 64 << 10;

/// How messages are sent.
#[derive(Clone, Debug)]
pub struct SenderConfig {
    /// Pauses between the tries; after the last one the message is given up.
    pub pauses: Vec<Duration>,
    /// How long a message stays with a sender that is silent; longer than a try
    /// takes.
    pub lease: Duration,
    /// How often messages that other processes wrote are looked for.
    pub poll_interval: Duration,
    /// Messages being sent at a time, and of those, of one tenant: receivers that
    /// do not answer must not hold up those of others.
    pub at_a_time: (usize, usize),
}

impl Default for SenderConfig {
    fn default() -> Self {
        // A day and three and a half hours.
        let pauses = [5, 300, 1800, 7200, 18_000, 36_000, 36_000].map(Duration::from_secs);
        Self {
            pauses: pauses.to_vec(),
            lease: Duration::from_secs(15),
            poll_interval: Duration::from_secs(1),
            at_a_time: (16, 4),
        }
    }
}

/// Sends messages until its future is dropped.
pub struct Sender {
    /// How.
    pub config: SenderConfig,
    /// Whose messages.
    pub store: Arc<dyn JobStore>,
    /// Through what.
    pub outbound: Arc<Outbound>,
}

impl Sender {
    /// Sends for ever.
    pub async fn run(self) {
        let mut changes = self.store.changes();
        let mut sending: JoinSet<TenantName> = JoinSet::new();
        let mut busy: HashMap<TenantName, usize> = HashMap::new();
        let shared = Arc::new(self);
        let (most, most_of_one) = shared.config.at_a_time;
        loop {
            while sending.len() < most {
                let left_out: Vec<_> = busy
                    .iter()
                    .filter(|(_, sending)| **sending >= most_of_one)
                    .map(|(tenant, _)| tenant.clone())
                    .collect();
                let lease = shared.config.lease;
                match shared.store.claim_delivery(lease, &left_out).await {
                    Ok(Some(delivery)) => {
                        *busy.entry(delivery.tenant.clone()).or_default() += 1;
                        sending.spawn(Arc::clone(&shared).send(delivery));
                    }
                    Ok(None) => break,
                    Err(error) => {
                        tracing::error!(%error, "could not look for messages to send");
                        break;
                    }
                }
            }
            tokio::select! {
                Some(sent) = sending.join_next() => match sent {
                    Ok(tenant) => release(&mut busy, &tenant),
                    Err(error) => {
                        // Whose it was is not known: count anew.
                        tracing::error!(%error, "a message's sender broke");
                        busy.clear();
                    }
                },
                () = told_of_an_end(&mut changes) => {}
                () = tokio::time::sleep(shared.config.poll_interval) => {}
            }
        }
    }

    /// One try. Returns whose message it was.
    async fn send(self: Arc<Self>, delivery: Delivery) -> TenantName {
        let at = Timestamp::now();
        let begun = Instant::now();
        let (status, error) = match self.post(&delivery, at).await {
            Ok(status) if (200..300).contains(&status) => (Some(status), None),
            Ok(status) => (Some(status), Some(refusal(status))),
            Err(SendError::Call(error)) => (None, Some(error.to_string())),
            Err(SendError::NoSecret) => {
                (None, Some("there is no secret to sign with; make one".to_owned()))
            }
            // Not the receiver's fault: it is claimed again when its lease is over.
            Err(SendError::Store(error)) => {
                tracing::error!(id = %delivery.id, %error, "could not send a message");
                return delivery.tenant;
            }
        };
        let tries = delivery.tries.saturating_sub(1) as usize;
        let pause = self.config.pauses.get(tries).copied();
        let attempt = DeliveryAttempt { at, duration: begun.elapsed(), status, error };
        let why = attempt.error.as_deref();
        tracing::info!(job = %delivery.ended.job, status, why, tries = delivery.tries, "message");
        if let Err(error) = self.store.attempted(delivery.id, &attempt, pause).await {
            tracing::error!(id = %delivery.id, %error, "could not write down a message's fate");
        }
        delivery.tenant
    }

    async fn post(&self, delivery: &Delivery, now: Timestamp) -> Result<u16, SendError> {
        let secrets = self.store.webhook_secrets(&delivery.tenant).await?;
        if secrets.is_empty() {
            return Err(SendError::NoSecret);
        }
        let body = message::body(delivery);
        let headers = message::headers(delivery, &body, &secrets, now);
        let headers = headers.map_err(|_| SendError::NoSecret)?;
        let url = &delivery.url;
        let sent = self.outbound.send(Method::POST, url, headers, body, MAX_ANSWER_BYTES);
        Ok(sent.await?.status.as_u16())
    }
}

#[derive(Debug, thiserror::Error)]
enum SendError {
    #[error(transparent)]
    Call(#[from] OutboundError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("no secret")]
    NoSecret,
}

fn refusal(status: u16) -> String {
    let redirects = if (300..400).contains(&status) { "; redirects are not followed" } else { "" };
    format!("the receiver answered {status}{redirects}")
}

fn release(busy: &mut HashMap<TenantName, usize>, tenant: &TenantName) {
    if let Some(sending) = busy.get_mut(tenant) {
        *sending -= 1;
        if *sending == 0 {
            busy.remove(tenant);
        }
    }
}

/// Waits until a job of this process ended, or may have.
async fn told_of_an_end(changes: &mut tokio::sync::broadcast::Receiver<jobs::JobChange>) {
    loop {
        match changes.recv().await {
            Ok(change) if change.kind.is_final() => return,
            Ok(_) => {}
            Err(RecvError::Lagged(_)) => return,
            // What is left is found by polling.
            Err(RecvError::Closed) => std::future::pending().await,
        }
    }
}
