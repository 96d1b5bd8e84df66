//! Sets the run path to MuJoCo's library for this crate's tests, and passes it on to crates that do not see `sim`.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let lib_dir = std::env::var("DEP_CANTER_SIM_LIB_DIR").expect("canter-sim's build script gives the folder");
    println!("cargo::metadata=LIB_DIR={lib_dir}");
    println!("cargo::rustc-link-arg=-Wl,-rpath,{lib_dir}");
}
