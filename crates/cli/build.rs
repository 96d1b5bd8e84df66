//! Sets the run path to MuJoCo's library: where it lies now, and where it lies from `target/release/` in a checkout that
//! has been moved.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let lib_dir = std::env::var("DEP_CANTER_SIM_LIB_DIR").expect("canter-sim's build script gives the folder");
    println!("cargo::rustc-link-arg=-Wl,-rpath,{lib_dir}");
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../../.mujoco/3.17.0/lib");
}
