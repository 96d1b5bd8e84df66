//! Sets the run path to MuJoCo's library: where it lies now, and where it lies from `target/release/` in a checkout that
//! has been moved. Gives the program its commit.

#[path = "build/stamp.rs"]
mod stamp;

use std::env;
use std::path::PathBuf;

/// Stands in for the commit, where there is no repository: `b0ff85c 2026-11-25`.
const COMMIT_VARIABLE: &str = "CANTER_COMMIT";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let lib_dir = env::var("DEP_CANTER_SIM_LIB_DIR").expect("canter-sim's build script gives the folder");
    println!("cargo::rustc-link-arg=-Wl,-rpath,{lib_dir}");
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../../.mujoco/3.17.0/lib");

    println!("cargo::rerun-if-env-changed={COMMIT_VARIABLE}");
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo gives the package's folder"));
    let stamp = stamp::of(&package.join("../.."), env::var(COMMIT_VARIABLE).ok().as_deref(), "git");
    for place in stamp.depends_on {
        println!("cargo::rerun-if-changed={}", place.display());
    }
    println!("cargo::rustc-env=CANTER_STAMP={}", stamp.commit);
}
