//! A local web page about the runs in a folder: who trains, live curves, verdicts side by side, the robot in 3D.
//!
//! The server hands out what lies in the run directories (`docs/run-directory.md`) and writes nothing. It uses no other
//! crate of canter. `server` holds the connections, `request` decides what may be asked, in one place, `folder` which files
//! may be read. The page itself is TypeScript, in `web/`, and built into the program.

#![forbid(unsafe_code)]

mod answer;
mod error;
mod folder;
mod metrics;
mod page;
mod request;
mod server;
mod summary;

pub use error::ServeError;
pub use page::is_built;
pub use server::Server;
