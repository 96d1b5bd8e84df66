//! The listener and its connections.

use std::convert::Infallible;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::{HOST, HeaderName, ORIGIN};
use hyper::http::uri::PathAndQuery;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::TcpStream;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;
use tokio::time::{sleep, timeout};

use crate::answer::Answer;
use crate::error::ServeError;
use crate::folder::Folder;
use crate::request::{self, Request};

/// How long it waits for somebody before it looks whether it should end, or after the system had no connection to give.
const PATIENCE: Duration = Duration::from_millis(200);

/// Connections at the same time. More wait.
const MAX_CONNECTIONS: usize = 128;

/// How long a browser may take to ask, and to have its answer.
const MAX_ASKING: Duration = Duration::from_secs(10);
const MAX_CONNECTION: Duration = Duration::from_secs(120);

/// Longer heads of requests are refused [bytes].
const MAX_HEAD_BYTES: usize = 16 << 10;

/// The page's server.
#[derive(Debug)]
pub struct Server {
    runtime: Runtime,
    listener: TcpListener,
    address: SocketAddr,
    shown: Arc<Shown>,
}

/// What is shown.
#[derive(Debug)]
struct Shown {
    folder: Folder,
    /// What to type for a first run.
    hint: String,
}

impl Server {
    /// Opens the door at `host`:`port`, 0 for any free port. `hint` is what to type for a first run, which an empty page says.
    ///
    /// # Errors
    /// A folder that is not there, a port that is taken.
    pub fn bind(folder: &Path, host: IpAddr, port: u16, hint: &str) -> Result<Self, ServeError> {
        let shown = Arc::new(Shown { folder: Folder::open(folder)?, hint: hint.to_owned() });
        let wanted = SocketAddr::new(host, port);
        let cannot = |source| ServeError::Bind { address: wanted, source };
        let listener = TcpListener::bind(wanted).map_err(cannot)?;
        listener.set_nonblocking(true).map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let runtime = Builder::new_current_thread().enable_all().build().map_err(ServeError::Start)?;
        Ok(Self { runtime, listener, address, shown })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until `stop` is set; what is on its way then is broken off.
    ///
    /// # Errors
    /// If the system cannot wait for connections.
    pub fn run(self, stop: &AtomicBool) -> Result<(), ServeError> {
        let Self { runtime, listener, shown, .. } = self;
        let result = runtime.block_on(listen(listener, &shown, stop));
        runtime.shutdown_background();
        result
    }
}

async fn listen(listener: TcpListener, shown: &Arc<Shown>, stop: &AtomicBool) -> Result<(), ServeError> {
    let listener = tokio::net::TcpListener::from_std(listener).map_err(ServeError::Start)?;
    let free = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    while !stop.load(Ordering::Relaxed) {
        let Ok(Ok(permit)) = timeout(PATIENCE, free.clone().acquire_owned()).await else { continue };
        match timeout(PATIENCE, listener.accept()).await {
            Ok(Ok((stream, _))) => {
                let shown = shown.clone();
                tokio::spawn(async move {
                    // A connection that breaks or takes too long is the browser's affair.
                    let _ = timeout(MAX_CONNECTION, converse(stream, shown)).await;
                    drop(permit);
                });
            }
            // The system has no more connections to give, for now.
            Ok(Err(_)) => sleep(PATIENCE).await,
            Err(_) => {}
        }
    }
    Ok(())
}

/// One request and its answer.
async fn converse(stream: TcpStream, shown: Arc<Shown>) -> Result<(), hyper::Error> {
    let service = service_fn(move |request| respond(request, shown.clone()));
    http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(MAX_ASKING)
        .max_buf_size(MAX_HEAD_BYTES)
        .keep_alive(false)
        .serve_connection(TokioIo::new(stream), service)
        .await
}

/// What comes with a request is not read.
async fn respond(
    http: hyper::Request<Incoming>,
    shown: Arc<Shown>,
) -> Result<hyper::Response<Full<Bytes>>, Infallible> {
    // Files are read on threads for that, so that no other request waits for them.
    let answer = spawn_blocking(move || {
        let header = |name: HeaderName| http.headers().get(name).map(|value| value.to_str().unwrap_or_default());
        let request = Request {
            method: http.method().as_str(),
            // With an authority it is meant for a proxy.
            target: http
                .uri()
                .path_and_query()
                .filter(|_| http.uri().authority().is_none())
                .map_or("", PathAndQuery::as_str),
            host: header(HOST),
            origin: header(ORIGIN),
            fetch_site: header(HeaderName::from_static("sec-fetch-site")),
        };
        request::answer(&request, &shown.folder, &shown.hint)
    });
    let answer = answer.await.unwrap_or_else(|_| Answer::refusal(500, "canter serve has a fault here"));
    Ok(answer.into_response())
}
