//! Sets the run path to MuJoCo's library: where it lies now, and where it lies from `target/release/` in a checkout that
//! has been moved. Gives the program its commit.

#[path = "build/stamp.rs"]
mod stamp;

use std::env;
use std::path::PathBuf;

/// Stands in for the commit, where there is no repository: `b0ff85c 2026-11-25`.
const COMMIT_VARIABLE: &str = "CANTER_COMMIT";

/// A run path in the place of these, for a program that is to hold no path of this checkout.
const RUN_PATH_VARIABLE: &str = "CANTER_RUN_PATH";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed={RUN_PATH_VARIABLE}");
    let lib_dir = env::var("DEP_CANTER_SIM_LIB_DIR").expect("canter-sim's build script gives the folder");
    let run_paths = match env::var(RUN_PATH_VARIABLE) {
        Ok(run_path) => vec![run_path],
        Err(_) => vec![lib_dir, "$ORIGIN/../../.mujoco/3.17.0/lib".to_owned()],
    };
    for run_path in run_paths {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{run_path}");
    }

    println!("cargo::rerun-if-env-changed={COMMIT_VARIABLE}");
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo gives the package's folder"));
    let stamp = stamp::of(&package.join("../.."), env::var(COMMIT_VARIABLE).ok().as_deref(), "git");
    for place in stamp.depends_on {
        println!("cargo::rerun-if-changed={}", place.display());
    }
    println!("cargo::rustc-env=CANTER_STAMP={}", stamp.commit);
}
