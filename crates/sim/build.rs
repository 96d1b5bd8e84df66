//! Tells the crates that use this one where MuJoCo's library lies, so that their programs and tests find it.
//!
//! Link arguments do not travel from a library to another crate's programs. So each crate above this one that has
//! programs or tests sets its own run path, in a build script of one statement that reads `DEP_CANTER_SIM_LIB_DIR`.

use std::env;
use std::path::PathBuf;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=MUJOCO_DYNAMIC_LINK_DIR");
    // `.cargo/config.toml` sets this for every build in the repository.
    let lib_dir = env::var_os("MUJOCO_DYNAMIC_LINK_DIR").map(PathBuf::from).unwrap_or_default();
    if !lib_dir.join("libmujoco.so").is_file() {
        println!(
            "cargo::error=MuJoCo is not there yet: run `cargo xtask setup` in the repository, once, and build again"
        );
        return;
    }
    println!("cargo::metadata=LIB_DIR={}", lib_dir.display());
    println!("cargo::rustc-link-arg=-Wl,-rpath,{}", lib_dir.display());
}
