//! Debian's packages that the full tests need.

use std::process::{Command, Stdio};

use crate::{Failure, web};

/// What films are drawn with: OpenGL on the processor, and what puts pictures into an MP4.
pub const FILMS: [&str; 3] = ["libegl1", "libgl1-mesa-dri", "ffmpeg"];

/// What C exports are compiled and run with: another compiler, one for the Cortex-M4F with its C library, an emulator.
pub const EXPORTS: [&str; 4] = ["clang", "gcc-arm-none-eabi", "libnewlib-arm-none-eabi", "qemu-system-arm"];

/// What text in PNG figures is drawn with.
pub const FONTS: [&str; 1] = ["fonts-dejavu-core"];

/// What ranks are built and started with: MPI with its compiler wrapper, and what reads MPI's C headers.
pub const RANKS: [&str; 3] = ["openmpi-bin", "libopenmpi-dev", "clang"];

/// What the dashboard's page is built with.
const NODE: [&str; 2] = ["nodejs", "npm"];

/// Installs Node and npm where there is no npm, wherever it came from.
///
/// # Errors
/// As [`ensure`].
pub fn ensure_npm() -> Result<(), Failure> {
    if web::has_npm() { Ok(()) } else { ensure(&NODE) }
}

/// Installs the packages that are missing, where this is root; elsewhere says how.
///
/// Where there is no `dpkg` nothing is done: the tests themselves say what they miss.
pub fn ensure(packages: &[&str]) -> Result<(), Failure> {
    let missing: Vec<&str> = packages.iter().copied().filter(|package| is_missing(package)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let by_hand = format!("sudo apt-get install -y {}", missing.join(" "));
    if !is_root() {
        return Err(Failure::Task(format!(
            "the full tests need Debian's {}; install with:\n  {by_hand}",
            missing.join(", ")
        )));
    }
    println!("installing {}", missing.join(", "));
    apt_get(&["update", "-q"])?;
    apt_get(&[&["install", "-y", "-q", "--no-install-recommends"], &missing[..]].concat())
}

/// Whether Debian's package database knows that a package is not installed.
fn is_missing(package: &str) -> bool {
    let query = Command::new("dpkg-query").args(["--show", "--showformat=${db:Status-Status}", package]).output();
    query.is_ok_and(|output| output.stdout != b"installed")
}

fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

fn apt_get(arguments: &[&str]) -> Result<(), Failure> {
    let mut apt_get = Command::new("apt-get");
    apt_get.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null());
    match apt_get.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err(Failure::Task(format!("`apt-get {}` failed", arguments.join(" ")))),
        Err(error) => Err(Failure::Task(format!("cannot run apt-get: {error}"))),
    }
}
