//! What can be wrong with what is read, and with writing.

use std::io;
use std::path::{Path, PathBuf};

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file that a report cannot do without is not there.
    #[error("{}: there is no such file; {advice}", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// What to do.
        advice: &'static str,
    },
    /// A file is not the JSON that its name promises.
    #[error("{}: {source}; {advice}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Place and reason.
        source: serde_json::Error,
        /// What to do.
        advice: &'static str,
    },
    /// A file has a version that this program does not know.
    #[error("{}: version {found}, but this canter reads version {expected}; make the report with the version that wrote it", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// As in the file.
        found: u64,
        /// As known here.
        expected: u64,
    },
    /// A file contradicts itself.
    #[error("{}: {what}; {advice}", path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
        /// What to do.
        advice: &'static str,
    },
    /// Runs that cannot stand on one page.
    #[error("{} and {} cannot stand on one page: {what}; report them one by one", first.display(), second.display())]
    Different {
        /// A run.
        first: PathBuf,
        /// Another one.
        second: PathBuf,
        /// In what they differ.
        what: String,
    },
    /// Nothing to report on.
    #[error("no run directory was given; name one that `canter train` has finished")]
    NoRun,
    /// A figure cannot be drawn as pixels.
    #[error("{}: {what}", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        what: String,
    },
}

impl ReportError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io { path, source }
    }
}
