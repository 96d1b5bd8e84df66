//! The C export, compiled by the system's compiler and run on recorded control steps.

mod common;

use std::fs;
use std::process::Command;

use canter_export::Exported;
use common::{CASES, TemporaryFolder, WALKS, case, compare, compare_walk, compile_c, inputs, pipe, record, succeed};

#[test]
fn c_repeats_every_geometry_waveform_and_modulation() {
    for own in CASES {
        let (resolved, file) = case(own, 1024);
        let exported = Exported::new(&resolved.task, &file).unwrap();
        let folder = TemporaryFolder::new();
        let vectors = record(&exported, 400);
        let program = compile_c(&exported, folder.path(), "cc", &["-O1"]);
        compare(&format!("{own:?}"), &vectors, &pipe(Command::new(program), &inputs(&vectors)));
    }
}

#[test]
fn a_damaged_weight_fails_the_self_test() {
    let (resolved, file) = case(CASES[0], 512);
    let exported = Exported::new(&resolved.task, &file).unwrap();
    let folder = TemporaryFolder::new();
    compile_c(&exported, folder.path(), "cc", &["-O1"]);
    let path = folder.join(canter_export::c::SOURCE_NAME);
    let source = fs::read_to_string(&path).unwrap();
    let (before, biases) = source.split_once("biases_2[17] = {\n    ").unwrap();
    let (_, rest) = biases.split_once(',').unwrap();
    fs::write(&path, format!("{before}biases_2[17] = {{\n    0.5f,{rest}")).unwrap();
    succeed(Command::new("cc").current_dir(folder.path()).args(["canter_policy.c", "repeat.c", "-o", "repeat", "-lm"]));
    assert!(!Command::new(folder.join("repeat")).output().unwrap().status.success());
}

/// Rises, walks, loses the sensors, walks on and stops, in C and in Rust.
#[test]
fn c_rises_ramps_holds_and_stops_as_the_runtime_does() {
    for own in WALKS {
        let (resolved, file) = case(own, 512);
        let exported = Exported::new(&resolved.task, &file).unwrap();
        let folder = TemporaryFolder::new();
        compile_c(&exported, folder.path(), "cc", &["-O1"]);
        fs::write(folder.join("walk.c"), include_str!("common/walk.c")).unwrap();
        succeed(Command::new("cc").current_dir(folder.path()).args(["canter_policy.c", "walk.c", "-o", "walk", "-lm"]));
        for is_late in [false, true] {
            compare_walk(&exported, Command::new(folder.join("walk")), is_late);
        }
    }
}

#[test]
fn c_that_could_not_see_a_missing_number_does_not_compile() {
    let (resolved, file) = case(CASES[0], 512);
    let exported = Exported::new(&resolved.task, &file).unwrap();
    let folder = TemporaryFolder::new();
    compile_c(&exported, folder.path(), "cc", &["-O1"]);
    for flag in ["-ffast-math", "-ffinite-math-only"] {
        let mut fast = Command::new("cc");
        fast.current_dir(folder.path()).args([flag, "-c", "canter_policy.c"]);
        let refused = fast.output().unwrap();
        assert!(!refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains(flag), "{flag}");
    }
}

#[test]
fn the_sketch_runs_against_a_stub_of_arduino() {
    let (resolved, file) = case(CASES[0], 512);
    let exported = Exported::new(&resolved.task, &file).unwrap();
    let folder = TemporaryFolder::new();
    let files = canter_export::c::export(&exported);
    fs::write(folder.join(canter_export::c::HEADER_NAME), files.header).unwrap();
    fs::write(folder.join(canter_export::c::SOURCE_NAME), files.source).unwrap();
    // The two functions that are the robot's owner's to write.
    let own = [
        ("  (void)readings;\n  return false;\n", "  return sense(readings);\n"),
        ("  (void)angles;\n", "  moved(angles);\n"),
    ];
    let sketch = own.iter().fold(canter_export::c::SKETCH.to_owned(), |sketch, (from, to)| {
        assert!(sketch.contains(from), "{from}");
        sketch.replace(from, to)
    });
    fs::write(folder.join("sketch.ino"), sketch).unwrap();
    fs::write(folder.join("arduino.cpp"), include_str!("common/arduino.cpp")).unwrap();
    let compile = |arguments: &[&str]| succeed(Command::new("c++").current_dir(folder.path()).args(arguments));
    // As the Arduino environment does: a sketch is C++, the policy stays C.
    compile(&["-x", "c", "-std=c99", "-c", "canter_policy.c"]);
    compile(&["-std=c++14", "-Wall", "-Wextra", "-Werror", "arduino.cpp", "canter_policy.o", "-o", "sketch", "-lm"]);
    print!("{}", succeed(&mut Command::new(folder.join("sketch"))));
}
