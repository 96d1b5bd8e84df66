//! The ONNX export, checked and run by other people's programs: `cargo xtask test --full` fetches them.

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;

use canter_export::Exported;
use common::{CASES, TemporaryFolder, WALKS, case, compare, compare_walk, inputs, pipe, record};

#[test]
#[ignore = "needs onnx and onnxruntime: CANTER_PYTHON names a Python that has them"]
fn onnxruntime_repeats_every_geometry_waveform_and_modulation() {
    let python = std::env::var_os("CANTER_PYTHON").expect("CANTER_PYTHON is set");
    for own in CASES {
        let (resolved, file) = case(own, 1024);
        let exported = Exported::new(&resolved.task, &file).unwrap();
        let folder = TemporaryFolder::new();
        let model = folder.join("policy.onnx");
        fs::write(&model, canter_export::onnx::export(&exported)).unwrap();
        let vectors = record(&exported, 400);
        let mut run = Command::new(&python);
        run.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/export/run_onnx.py")).arg(&model);
        compare(&format!("{own:?}"), &vectors, &pipe(run, &inputs(&vectors)));
    }
}

#[test]
#[ignore = "needs onnxruntime: CANTER_PYTHON names a Python that has it"]
fn the_python_runner_ramps_holds_and_stops_as_the_runtime_does() {
    let python = std::env::var_os("CANTER_PYTHON").expect("CANTER_PYTHON is set");
    for own in WALKS {
        let (resolved, file) = case(own, 512);
        let exported = Exported::new(&resolved.task, &file).unwrap();
        let folder = TemporaryFolder::new();
        fs::write(folder.join("policy.onnx"), canter_export::onnx::export(&exported)).unwrap();
        fs::write(folder.join("start.onnx"), canter_export::onnx::export_start(&exported)).unwrap();
        fs::write(folder.join("run_policy.py"), canter_export::onnx::RUNNER).unwrap();
        let mut run = Command::new(&python);
        run.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/export/run_walker.py")).arg(folder.path());
        compare_walk(&exported, run, false);
    }
}
