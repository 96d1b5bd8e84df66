//! A local web page about the runs in a folder: who trains, live curves, verdicts side by side, the robot in 3D.
//!
//! The server hands out what lies in the run directories (`docs/run-directory.md`) and writes nothing. It uses no other
//! crate of canter. What a request is allowed to see is decided in `request`, in one place; where files come from in
//! `folder`. The page itself is TypeScript, in `web/`, and built into the program.

#![forbid(unsafe_code)]

mod answer;
mod error;
mod folder;
mod metrics;
mod page;
mod request;
mod summary;

use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

pub use error::ServeError;
pub use page::is_built;

use crate::folder::Folder;
use crate::request::Request;

/// Requests that are answered at the same time: a browser asks for a few things at once, and an episode takes a while.
const NUM_THREADS: usize = 4;

/// How long a thread waits for a request before it looks whether it should end.
const PATIENCE: Duration = Duration::from_millis(200);

/// The page's server.
pub struct Server {
    http: tiny_http::Server,
    address: SocketAddr,
    folder: Folder,
    hint: String,
}

impl Server {
    /// Opens the door at `host`:`port`, 0 for any free port. `hint` is what to type for a first run, which an empty page says.
    ///
    /// # Errors
    /// A folder that is not there, a port that is taken.
    pub fn bind(folder: &Path, host: IpAddr, port: u16, hint: &str) -> Result<Self, ServeError> {
        let folder = Folder::open(folder)?;
        let wanted = SocketAddr::new(host, port);
        let cannot = |source| ServeError::Bind { address: wanted, source };
        let listener = TcpListener::bind(wanted).map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let http = tiny_http::Server::from_listener(listener, None).map_err(ServeError::Start)?;
        Ok(Self { http, address, folder, hint: hint.to_owned() })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until `stop` is set.
    pub fn run(&self, stop: &AtomicBool) {
        thread::scope(|scope| {
            for _ in 0..NUM_THREADS {
                scope.spawn(|| {
                    while !stop.load(Ordering::Relaxed) {
                        // A connection that breaks is the browser's affair.
                        if let Ok(Some(request)) = self.http.recv_timeout(PATIENCE) {
                            self.respond(request);
                        }
                    }
                });
            }
        });
    }

    fn respond(&self, http: tiny_http::Request) {
        let header = |name: &'static str| {
            let of_name = http.headers().iter().find(|header| header.field.equiv(name));
            of_name.map(|header| header.value.as_str())
        };
        let request = Request {
            method: http.method().as_str(),
            target: http.url(),
            host: header("Host"),
            origin: header("Origin"),
            fetch_site: header("Sec-Fetch-Site"),
        };
        let answer = request::answer(&request, &self.folder, &self.hint);
        let _ = http.respond(answer.into_response());
    }
}
