//! Reading a file whose path somebody has typed or written.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// The bytes of the file at `path`, or `max_bytes` and one more: enough to see that it is too large.
///
/// # Errors
/// The file cannot be read. A folder, a pipe or a device is refused before it is opened: a pipe would wait for a writer,
/// and some devices have no end.
pub fn read(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    let kind = fs::metadata(path)?.file_type();
    if !kind.is_file() {
        let what = if kind.is_dir() { "a folder" } else { "a pipe or a device" };
        return Err(io::Error::other(format!("this is {what}; expected a file")));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(max_bytes + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}
