//! An S3 server that checks signatures, and misbehaves when it is told to.

use std::convert::Infallible;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use http::{Request, Response, StatusCode};
use hyper::body::Incoming;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioExecutor, TokioIo};
use hyper_util::server::conn::auto;
use s3s::auth::SimpleAuth;
use s3s::service::{S3Service, S3ServiceBuilder};
use s3s_fs::FileSystem;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

/// The one bucket.
pub const BUCKET: &str = "turnaround";
/// The key that it knows.
pub const KEY_ID: &str = "AKIATESTBED";
/// The secret of that key.
pub const SECRET_KEY: &str = "testbed-secret";

/// How long a request hangs that is to time out.
const HANG: Duration = Duration::from_secs(60);

/// What the server does wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// Nothing.
    None,
    /// It answers 500 to every request.
    Error,
    /// It does what it is asked and answers 500 all the same.
    LateError,
    /// It does not answer for a minute.
    Hang,
}

/// An S3 server on a loopback port; its objects are files.
pub struct S3 {
    folder: TempDir,
    address: SocketAddr,
    fault: Arc<AtomicU8>,
    stop: Option<oneshot::Sender<()>>,
    server: Option<thread::JoinHandle<()>>,
}

impl S3 {
    /// Starts a server with one empty bucket.
    ///
    /// # Panics
    /// If the system gives no folder, port or thread.
    pub fn start() -> Self {
        Self::start_in(&std::env::temp_dir())
    }

    /// As [`Self::start`], with its objects in a folder of its own below `place`.
    ///
    /// # Panics
    /// As [`Self::start`].
    pub fn start_in(place: &Path) -> Self {
        let folder = tempfile::tempdir_in(place).expect("a folder for objects");
        std::fs::create_dir(folder.path().join(BUCKET)).expect("a bucket");
        let files = FileSystem::new(folder.path()).expect("objects as files");
        let mut service = S3ServiceBuilder::new(files);
        service.set_auth(SimpleAuth::from_single(KEY_ID, SECRET_KEY));
        let (service, fault) = (service.build(), Arc::new(AtomicU8::new(Fault::None as u8)));
        let (stop, stopped) = oneshot::channel();
        let (tell, told) = mpsc::channel();
        let faults = Arc::clone(&fault);
        let server = thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_multi_thread()
                .worker_threads(2)
                .enable_all()
                .build()
                .expect("a runtime");
            runtime.block_on(async {
                let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
                tell.send(listener.local_addr().expect("its number")).expect("who started it");
                tokio::select! {
                    () = serve(listener, service, faults) => {}
                    _ = stopped => {}
                }
            });
            runtime.shutdown_background();
        });
        let address = told.recv().expect("the server starts");
        Self { folder, address, fault, stop: Some(stop), server: Some(server) }
    }

    /// Where it answers, such as `http://127.0.0.1:4566`.
    pub fn endpoint(&self) -> String {
        format!("http://{}", self.address)
    }

    /// What a process must have in its environment to use the server.
    pub fn environment(&self) -> [(String, String); 5] {
        [
            ("AWS_ENDPOINT", self.endpoint()),
            ("AWS_ALLOW_HTTP", "true".to_owned()),
            ("AWS_REGION", "us-east-1".to_owned()),
            ("AWS_ACCESS_KEY_ID", KEY_ID.to_owned()),
            ("AWS_SECRET_ACCESS_KEY", SECRET_KEY.to_owned()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
    }

    /// Lets it misbehave, from the next request on.
    pub fn set_fault(&self, fault: Fault) {
        self.fault.store(fault as u8, Ordering::SeqCst);
    }

    /// The folder of the bucket's objects.
    pub fn objects(&self) -> std::path::PathBuf {
        Path::join(self.folder.path(), BUCKET)
    }
}

impl Drop for S3 {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(server) = self.server.take() {
            let _ = server.join();
        }
    }
}

async fn serve(listener: TcpListener, service: S3Service, fault: Arc<AtomicU8>) {
    loop {
        let Ok((socket, _)) = listener.accept().await else { continue };
        let (service, fault) = (service.clone(), Arc::clone(&fault));
        tokio::spawn(async move {
            let answer = service_fn(move |request| {
                answer(service.clone(), fault.load(Ordering::SeqCst), request)
            });
            let connection = auto::Builder::new(TokioExecutor::new());
            // A client that goes away is no matter.
            let _ = connection.serve_connection(TokioIo::new(socket), answer).await;
        });
    }
}

async fn answer(
    service: S3Service,
    fault: u8,
    request: Request<Incoming>,
) -> Result<Response<s3s::Body>, Infallible> {
    let broken = || {
        let mut response = Response::new(s3s::Body::empty());
        *response.status_mut() = StatusCode::INTERNAL_SERVER_ERROR;
        Ok(response)
    };
    if fault == Fault::Error as u8 {
        return broken();
    }
    if fault == Fault::Hang as u8 {
        tokio::time::sleep(HANG).await;
        return broken();
    }
    match Service::call(&service, request).await {
        Ok(response) if fault == Fault::None as u8 => Ok(response),
        _ => broken(),
    }
}
