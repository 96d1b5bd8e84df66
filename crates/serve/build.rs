//! Lists the page's files, `web/dist`, for `page.rs`. An empty folder gives an empty list: Node is not needed to build canter.

use std::env;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // It always exists: a missing path would have cargo build this crate every time.
    println!("cargo::rerun-if-changed=web/dist");
    let dist = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("web").join("dist");
    let mut files = Vec::new();
    if dist.join("index.html").is_file() {
        list(&dist, "", &mut files);
        files.sort();
    }
    let mut source = String::from("&[\n");
    for name in files {
        writeln!(source, "    ({name:?}, include_bytes!({:?})),", dist.join(&name)).expect("strings grow");
    }
    source.push(']');
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it")).join("page.rs");
    fs::write(&out, source).unwrap_or_else(|error| panic!("{}: {error}", out.display()));
}

/// Names of the files below `dist`, with `/` between folders; names that begin with a dot are none of the page's.
fn list(folder: &Path, prefix: &str, files: &mut Vec<String>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') {
            continue;
        }
        let name = format!("{prefix}{name}");
        if entry.path().is_dir() {
            list(&entry.path(), &format!("{name}/"), files);
        } else {
            files.push(name);
        }
    }
}
