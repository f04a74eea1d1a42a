//! Says what is wrong where the HTTP library refuses a request by itself, with a
//! bare status: one that is no HTTP never reaches the service.

use std::io::{self, IoSlice};
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

use super::problem::{BAD_REQUEST, HEADER_TOO_LARGE, Problem, ProblemType};

/// A connection whose bare refusals become problem details.
pub(super) struct Explained<S> {
    inner: S,
    /// What is written in place of a bare refusal and has not gone out yet.
    pending: Vec<u8>,
}

impl<S> Explained<S> {
    pub(super) fn new(inner: S) -> Self {
        Self { inner, pending: Vec::new() }
    }
}

/// The whole answer in place of a bare refusal, if `head` is one: the service's
/// own refusals have a media type.
fn explained(head: &[u8]) -> Option<Vec<u8>> {
    if head.len() > 256 || !head.starts_with(b"HTTP/1.1 4") || !head.ends_with(b"\r\n\r\n") {
        return None;
    }
    let head = std::str::from_utf8(head).ok()?.to_ascii_lowercase();
    if head.contains("content-type") || !head.contains("content-length: 0\r\n") {
        return None;
    }
    let (kind, detail): (ProblemType, _) = match head.get(9..12)? {
        "431" => (HEADER_TOO_LARGE, "the request's header is too long; send less of it"),
        "414" => (BAD_REQUEST, "the request's path is too long"),
        _ => (BAD_REQUEST, "this is no HTTP request; its first lines cannot be read"),
    };
    let body = Problem::new(kind, detail).body("");
    let (status, length) = (kind.status, body.len());
    let mut answer = format!(
        "HTTP/1.1 {status}\r\ncontent-type: application/problem+json\r\n\
         cache-control: no-store\r\ncontent-length: {length}\r\nconnection: close\r\n\r\n"
    )
    .into_bytes();
    answer.extend(body);
    Some(answer)
}

impl<S: AsyncWrite + Unpin> Explained<S> {
    fn poll_pending(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        while !self.pending.is_empty() {
            match ready!(Pin::new(&mut self.inner).poll_write(cx, &self.pending))? {
                0 => return Poll::Ready(Err(io::ErrorKind::WriteZero.into())),
                written => drop(self.pending.drain(..written)),
            }
        }
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Explained<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        into: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_read(cx, into)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Explained<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        ready!(self.poll_pending(cx))?;
        match explained(bytes) {
            None => Pin::new(&mut self.inner).poll_write(cx, bytes),
            Some(answer) => {
                self.pending = answer;
                // What does not go out now does so at the flush.
                let _ = self.poll_pending(cx)?;
                Poll::Ready(Ok(bytes.len()))
            }
        }
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        ready!(self.poll_pending(cx))?;
        match slices {
            [only] => self.poll_write(cx, only),
            _ => Pin::new(&mut self.inner).poll_write_vectored(cx, slices),
        }
    }

    fn is_write_vectored(&self) -> bool {
        self.inner.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.poll_pending(cx))?;
        Pin::new(&mut self.inner).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.poll_pending(cx))?;
        Pin::new(&mut self.inner).poll_shutdown(cx)
    }
}
