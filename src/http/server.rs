//! Accepts connections until the shutdown.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutStream;
use tokio_util::sync::CancellationToken;
use tower::Layer;
use tower_http::timeout::RequestBodyTimeoutLayer;

use super::ServerTimeouts;
use super::bare::Explained;

/// Header bytes that are read before the request is refused, and most lines. Those
/// that are a little over the limit are told so by the guard.
const MAX_HEADER_BYTES: usize = 2 * super::guard::MAX_HEADER_BYTES;
const MAX_HEADER_LINES: usize = 100;

/// Answers connections of `listener` with `router` until `shutdown`; then takes
/// no more, and gives those open [`ServerTimeouts::shutdown_grace`] to end.
///
/// * `most`: connections open at a time; others wait in the system's queue, for
///   they would take the files that work needs.
///
/// HTTP/1.1 only: telling HTTP/2 apart waits without a timeout for the first
/// bytes of a connection.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    timeouts: &ServerTimeouts,
    most: usize,
    shutdown: CancellationToken,
) -> std::io::Result<()> {
    let within = RequestBodyTimeoutLayer::new(timeouts.body_idle);
    let service = TowerToHyperService::new(within.layer(router));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(timeouts.header_read)
        .max_buf_size(MAX_HEADER_BYTES)
        .max_headers(MAX_HEADER_LINES);
    let connections = GracefulShutdown::new();
    let slots = Arc::new(Semaphore::new(most));
    loop {
        let accepted = async {
            let slot = Arc::clone(&slots).acquire_owned().await;
            (slot, accept(&listener).await)
        };
        let (slot, stream) = tokio::select! {
            accepted = accepted => accepted,
            () = shutdown.cancelled() => break,
        };
        let mut stream = TimeoutStream::new(stream);
        // Of a client that reads nothing more of its answer.
        stream.set_write_timeout(Some(timeouts.write));
        let connection =
            http.serve_connection(TokioIo::new(Explained::new(Box::pin(stream))), service.clone());
        let watched = connections.watch(connection);
        tokio::spawn(async move {
            let _slot = slot;
            if let Err(error) = watched.await {
                tracing::debug!(%error, "connection ended");
            }
        });
    }
    drop(listener);
    if tokio::time::timeout(timeouts.shutdown_grace, connections.shutdown()).await.is_err() {
        tracing::warn!("connections are still open; leaving them");
    }
    Ok(())
}

/// The next connection. Errors concern one connection, or pass once others
/// have ended (no more file descriptors), so they never end the server.
async fn accept(listener: &TcpListener) -> TcpStream {
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                // Answers are small and whole; waiting to fill packets only delays.
                let _ = stream.set_nodelay(true);
                return stream;
            }
            Err(error) => {
                tracing::warn!(%error, "could not accept a connection");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
}
