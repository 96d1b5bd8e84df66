//! No file can hurt a report: each file that it reads is damaged, see `../../train/tests/common/fuzz.rs`.

mod common;
#[path = "../../train/tests/common/fuzz.rs"]
mod fuzz;

use std::fs;
use std::path::{Path, PathBuf};

use canter_report::{ReportError, Written, report_compare, report_run, report_sweep};
use common::{RUNGS, SampleGait, TemporaryFolder, comparison, sweep, trajectory, write_run};
use fuzz::{JSON, Random, fuzz_bytes};
use serde_json::Value;

/// A folder in memory where there is one, so that flushing a file costs nothing.
fn fast_folder(name: &str) -> PathBuf {
    let memory = Path::new("/dev/shm");
    let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    let folder = parent.join(format!("canter-fuzz-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// An episode of a few steps with one leg: what takes few bytes.
fn short_trajectory() -> Value {
    let gait = SampleGait { name: "learned", label: "learned gait", falls_at: Some(5), ..RUNGS[6] };
    let mut trajectory = trajectory(&gait);
    for key in ["legs", "hip_m", "knee_m", "foot_m", "contact"] {
        keep_one_leg(key, &mut trajectory[key]);
    }
    for key in ["commanded_swing_rad", "commanded_extension_rad", "swing_rad", "extension_rad"] {
        keep_one_leg(key, &mut trajectory[key]);
    }
    trajectory
}

fn keep_one_leg(key: &str, column: &mut Value) {
    let rows = column.as_array_mut().unwrap();
    if key == "legs" {
        return rows.truncate(1);
    }
    rows.iter_mut().for_each(|row| row.as_array_mut().unwrap().truncate(1));
}

/// A run directory with small files.
fn small_run(folder: &Path) {
    write_run(folder, 1, false);
    let mut eval: Value = serde_json::from_slice(&fs::read(folder.join("eval.json")).unwrap()).unwrap();
    eval["protocol"]["num_episodes"] = Value::from(2);
    for pointer in ["/policy", "/prior", "/default_gaits/sine", "/default_gaits/stepping"] {
        eval.pointer_mut(pointer).unwrap()["speeds_m_per_s"].as_array_mut().unwrap().truncate(2);
    }
    fs::write(folder.join("eval.json"), eval.to_string()).unwrap();
    let export = serde_json::json!({ "passed": true, "is_open_loop": true, "exported": eval["prior"] });
    fs::write(folder.join("export.json"), serde_json::json!({ "table": export }).to_string()).unwrap();
    let metrics = fs::read_to_string(folder.join("metrics.jsonl")).unwrap();
    let lines: String = metrics.split_inclusive('\n').skip(1).take(3).collect();
    fs::write(folder.join("metrics.jsonl"), lines).unwrap();
    fs::create_dir_all(folder.join("trajectories")).unwrap();
    fs::write(folder.join("trajectories/learned.json"), short_trajectory().to_string()).unwrap();
}

/// A comparison with small files.
fn small_comparison(folder: &Path) {
    let mut comparison = comparison();
    let rungs = comparison["rungs"].as_object_mut().unwrap();
    rungs.retain(|name, _| ["sine", "tuned", "doggo"].contains(&name.as_str()));
    for rung in rungs.values_mut() {
        let seeds = rung["seeds"].as_array_mut().unwrap();
        seeds.truncate(1);
        seeds[0]["return_curve"].as_array_mut().unwrap().truncate(3);
        seeds[0]["speeds_m_per_s"].as_array_mut().unwrap().truncate(2);
    }
    let sweeps = comparison["sweeps"].as_object_mut().unwrap();
    sweeps.retain(|name, _| ["slope_deg", "delay_s"].contains(&name.as_str()));
    for sweep in sweeps.values_mut() {
        let rungs = sweep["rungs"].as_object_mut().unwrap();
        rungs.retain(|name, _| name == "doggo");
        let curve = &mut rungs["doggo"];
        for key in ["speed_m_per_s", "speed_ci", "falls_per_episode"] {
            curve[key].as_array_mut().unwrap().truncate(2);
        }
        sweep["values"] = serde_json::json!([0.0, 20.0]);
    }
    comparison["claims"].as_array_mut().unwrap().truncate(2);
    let own = serde_json::json!({ "doggo": "trajectories/learned.json" });
    (comparison["trajectories"], comparison["uphill_trajectories"]) = (own.clone(), own);
    fs::create_dir_all(folder.join("trajectories")).unwrap();
    fs::write(folder.join("trajectories/learned.json"), short_trajectory().to_string()).unwrap();
    fs::write(folder.join("compare.json"), comparison.to_string()).unwrap();
}

/// Reports on damaged versions of one file of a folder.
///
/// Most reports are drawn but find no folder to lie in, which leaves out what takes most of the time.
fn fuzz_file(name: &str, folder: &Path, file: &str, report: impl Fn(&Path) -> Result<(), ReportError>) {
    let path = folder.join(file);
    let valid = [fs::read(&path).unwrap()];
    let (nowhere, out) = (folder.join("nowhere"), folder.join("out"));
    fs::write(&nowhere, "a file where a folder would have to be").unwrap();
    fuzz_bytes(name, &valid, &JSON, |bytes, random: &mut Random| {
        fs::write(&path, bytes).unwrap();
        if random.once_in(50) {
            report(&out).map_err(|error| error.to_string())?;
            assert_drawn(&out);
            return Ok(());
        }
        match report(&nowhere) {
            Err(ReportError::Io { path, .. }) if path == nowhere => Ok(()),
            Err(error) => Err(error.to_string()),
            Ok(()) => panic!("it was written somewhere"),
        }
    });
    fs::write(&path, &valid[0]).unwrap();
}

/// Whether every figure of a report has numbers for coordinates.
fn assert_drawn(out: &Path) {
    for entry in fs::read_dir(out.join("figures")).unwrap() {
        let path = entry.unwrap().path();
        let svg = fs::read_to_string(&path).unwrap();
        let is_wrong =
            |number: &str| ["\"", " ", "L", "M"].iter().any(|before| svg.contains(&format!("{before}{number}")));
        assert!(!["NaN", "inf ", "-inf", "inf\""].into_iter().any(is_wrong), "{}", path.display());
    }
}

fn fuzz_run(name: &str, file: &str) {
    let folder = fast_folder(file.split(['.', '/']).next().unwrap());
    let run = folder.join("run");
    small_run(&run);
    fuzz_file(name, &run, file, |out| report_run(std::slice::from_ref(&run), out).map(drop));
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn verdicts() {
    fuzz_run("eval.json", "eval.json");
}

#[test]
fn exports() {
    fuzz_run("export.json", "export.json");
}

#[test]
fn metrics() {
    fuzz_run("metrics.jsonl", "metrics.jsonl");
}

#[test]
fn trajectories() {
    fuzz_run("trajectory", "trajectories/learned.json");
}

#[test]
fn comparisons() {
    let folder = fast_folder("compare");
    small_comparison(&folder);
    fuzz_alone(&folder, "compare.json", report_compare);
}

#[test]
fn sweeps() {
    let folder = fast_folder("sweep");
    fs::write(folder.join("sweep.json"), sweep("policy.authority", ["0", "0.5", "1"]).to_string()).unwrap();
    fuzz_alone(&folder, "sweep.json", report_sweep);
}

/// Reports on damaged versions of what is reported in its own folder: where that has a file `figures`, it cannot be.
fn fuzz_alone(folder: &Path, file: &str, report: fn(&Path) -> Result<Written, ReportError>) {
    let figures = folder.join("figures");
    let path = folder.join(file);
    let valid = [fs::read(&path).unwrap()];
    fuzz_bytes(file, &valid, &JSON, |bytes, random| {
        fs::write(&path, bytes).unwrap();
        if random.once_in(50) {
            report(folder).map_err(|error| error.to_string())?;
            assert_drawn(folder);
            fs::remove_dir_all(&figures).unwrap();
            return Ok(());
        }
        fs::write(&figures, "").unwrap();
        let result = report(folder);
        fs::remove_file(&figures).unwrap();
        match result {
            Err(ReportError::Io { path, .. }) if path == figures => Ok(()),
            Err(error) => Err(error.to_string()),
            Ok(_) => panic!("it was written somewhere"),
        }
    });
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_file_that_never_ends_is_refused_without_being_read() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    small_run(&run);
    // 1 TB that the disk need not hold.
    fs::File::create(run.join("eval.json")).unwrap().set_len(1 << 40).unwrap();
    let message = report_run(&[run], &folder.join("out")).unwrap_err().to_string();
    assert!(message.contains("it has more than 256 MiB; it comes from `canter train`"), "{message}");
}
