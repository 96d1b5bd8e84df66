//! Sets the run path to MuJoCo's library, which lies beside the extension in the wheel.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/mujoco");
}
