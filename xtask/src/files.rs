//! Files and folders, with failures that name them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::Failure;

/// The files in a folder.
pub fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let entries = fs::read_dir(folder).map_err(|error| failed("read", folder, &error))?;
    Ok(entries.filter_map(Result::ok).map(|entry| entry.path()).filter(|path| path.is_file()).collect())
}

/// Makes a folder and those that it lies in.
pub fn make(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| failed("make", folder, &error))
}

/// Removes a folder, if it is there.
pub fn remove(folder: &Path) -> Result<(), Failure> {
    if folder.exists() { fs::remove_dir_all(folder).map_err(|error| failed("remove", folder, &error)) } else { Ok(()) }
}

/// Copies a file into a folder that need not be there yet.
pub fn copy(from: &Path, to: &Path) -> Result<(), Failure> {
    make(to.parent().unwrap_or(to))?;
    fs::copy(from, to).map(drop).map_err(|error| failed("write", to, &error))
}

/// Writes a file into a folder that need not be there yet.
pub fn write(path: &Path, content: &str) -> Result<(), Failure> {
    make(path.parent().unwrap_or(path))?;
    fs::write(path, content).map_err(|error| failed("write", path, &error))
}

/// What could not be done with which file, and what the system says.
pub fn failed(what: &str, path: &Path, error: &std::io::Error) -> Failure {
    Failure::Task(format!("cannot {what} {}: {error}", path.display()))
}
