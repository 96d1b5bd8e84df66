//! Why there is no server.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Why the page is not served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The folder with the runs cannot be opened.
    #[error("{}: {source}; name the folder that holds your runs", path.display())]
    Folder {
        /// As it was given.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file where a folder should be.
    #[error("{} is no folder; name the one that holds your runs", .0.display())]
    NotAFolder(PathBuf),
    /// Nothing can listen there.
    #[error(
        "cannot listen at {address}: {source}{}",
        if source.kind() == io::ErrorKind::AddrInUse {
            "; perhaps another `canter serve` does. Choose another port with --port, or any free one with --port 0"
        } else {
            ""
        }
    )]
    Bind {
        /// Where.
        address: SocketAddr,
        /// What the system says.
        source: io::Error,
    },
    /// The system has nothing to wait for connections with.
    #[error("cannot start the server: {0}")]
    Start(io::Error),
}
