//! A request body as it comes in, held to its limits.

use std::error::Error;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::{Body, BodyDataStream};
use bytes::Bytes;
use futures::{Stream, StreamExt};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tower_http::timeout::TimeoutError;

use crate::http::problem::{BODY_TOO_LARGE, MALFORMED_MULTIPART, Problem, REQUEST_TIMEOUT};

const BUSY: &str = "too many uploads are being received; try again later";

/// Bytes that all uploads together may hold in memory.
#[derive(Clone, Debug)]
pub(crate) struct Budget(Arc<Semaphore>);

impl Budget {
    pub(crate) fn new(bytes: u64) -> Self {
        let permits = usize::try_from(bytes).unwrap_or(usize::MAX);
        Self(Arc::new(Semaphore::new(permits.min(Semaphore::MAX_PERMITS))))
    }

    /// A hold on as many bytes, for what does not come in a request's body.
    pub(super) fn hold(&self, bytes: usize) -> Result<OwnedSemaphorePermit, Problem> {
        self.take(bytes).map_err(|_| Problem::busy(BUSY))
    }

    fn take(&self, bytes: usize) -> Result<OwnedSemaphorePermit, IntakeError> {
        let bytes = u32::try_from(bytes).map_err(|_| IntakeError::Busy)?;
        self.0.clone().try_acquire_many_owned(bytes).map_err(|_| IntakeError::Busy)
    }
}

/// Why the body could not be read on.
#[derive(Debug, thiserror::Error)]
pub(super) enum IntakeError {
    #[error("the body is over the limit of {limit} bytes")]
    TooLarge { limit: u64 },
    #[error("too many uploads are being received")]
    Busy,
    #[error(transparent)]
    Body(#[from] axum::Error),
}

/// The bytes of one request body, counted against its limit and the budget.
pub(super) struct Intake {
    body: BodyDataStream,
    limit: u64,
    received: u64,
    budget: Budget,
    held: Option<OwnedSemaphorePermit>,
}

impl Intake {
    pub(super) fn new(body: Body, limit: u64, budget: Budget) -> Self {
        Self { body: body.into_data_stream(), limit, received: 0, budget, held: None }
    }

    fn account(&mut self, chunk: &Bytes) -> Result<(), IntakeError> {
        self.received += chunk.len() as u64;
        if self.received > self.limit {
            return Err(IntakeError::TooLarge { limit: self.limit });
        }
        let permit = self.budget.take(chunk.len())?;
        match &mut self.held {
            Some(held) => held.merge(permit),
            held => *held = Some(permit),
        }
        Ok(())
    }

    /// The hold on the budget, to be kept as long as the bytes.
    pub(super) fn into_hold(self) -> Option<OwnedSemaphorePermit> {
        self.held
    }
}

impl Stream for Intake {
    type Item = Result<Bytes, IntakeError>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.body.poll_next_unpin(cx).map(|next| match next? {
            Ok(chunk) => Some(self.account(&chunk).map(|()| chunk)),
            Err(error) => Some(Err(error.into())),
        })
    }
}

/// The problem behind an error of the multipart reader.
pub(super) fn multipart_problem(error: multer::Error) -> Problem {
    let multer::Error::StreamReadFailed(cause) = &error else {
        return Problem::new(
            MALFORMED_MULTIPART,
            format!("{error}; send a complete multipart/form-data body"),
        );
    };
    match cause.downcast_ref::<IntakeError>() {
        Some(IntakeError::TooLarge { limit }) => too_large(*limit),
        Some(IntakeError::Busy) => Problem::busy(BUSY),
        _ if chain(cause.as_ref()).any(|e| e.is::<TimeoutError>()) => Problem::new(
            REQUEST_TIMEOUT,
            "no more of the body came for too long; send the request again",
        ),
        _ => Problem::new(MALFORMED_MULTIPART, "the body ended early; send the request again"),
    }
}

/// The problem of a body over its limit.
pub(super) fn too_large(limit: u64) -> Problem {
    Problem::new(
        BODY_TOO_LARGE,
        format!("the body is over the limit of {limit} bytes; send smaller or fewer pictures"),
    )
}

fn chain<'e>(error: &'e (dyn Error + 'static)) -> impl Iterator<Item = &'e (dyn Error + 'static)> {
    std::iter::successors(Some(error), |error: &&(dyn Error + 'static)| (*error).source())
}
