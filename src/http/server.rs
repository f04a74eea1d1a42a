//! Accepts connections until the shutdown.

use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio_util::sync::CancellationToken;
use tower_http::timeout::RequestBodyTimeoutLayer;

use super::ServerTimeouts;

/// Answers connections of `listener` with `router` until `shutdown`; then takes
/// no more, and gives those open [`ServerTimeouts::shutdown_grace`] to end.
///
/// HTTP/1.1 only: telling HTTP/2 apart waits without a timeout for the first
/// bytes of a connection.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    timeouts: &ServerTimeouts,
    shutdown: CancellationToken,
) -> std::io::Result<()> {
    let service =
        TowerToHyperService::new(router.layer(RequestBodyTimeoutLayer::new(timeouts.body_idle)));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(timeouts.header_read);
    let connections = GracefulShutdown::new();
    loop {
        let stream = tokio::select! {
            stream = accept(&listener) => stream,
            () = shutdown.cancelled() => break,
        };
        let connection = http.serve_connection(TokioIo::new(stream), service.clone());
        let watched = connections.watch(connection);
        tokio::spawn(async move {
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
