//! Every export against the trained policy on recorded control steps of a real training: C of two compilers, Rust without
//! `std`, ONNX, and C on a Cortex-M4F.
//!
//! `cargo xtask test --full` installs what they need. `CANTER_AGREEMENT_STEPS` is the number of control steps, 10,000 if
//! not given.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use canter_export::Exported;
use canter_export::exported::TestVector;
use canter_train::config::Resolved;
use canter_train::evaluate::{Mover, evaluate};
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use common::{CASES, TemporaryFolder, case, compare, compile_c, inputs, pipe, record, succeed, trained};

/// The default preset after a training that is long enough for it to walk.
fn doggo() -> (Resolved, PolicyFile) {
    trained("doggo", &[], 204_800)
}

fn num_steps() -> usize {
    std::env::var("CANTER_AGREEMENT_STEPS").ok().map_or(10_000, |number| number.parse().unwrap())
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Builds the exported crate with a program around it that repeats control steps.
fn compile_rust(exported: &Exported<'_>, folder: &Path) -> PathBuf {
    for (path, content) in canter_export::rust::export(exported) {
        let path = folder.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    fs::create_dir_all(folder.join("src/bin")).unwrap();
    fs::write(folder.join("src/bin/repeat.rs"), include_str!("common/repeat.rs.in")).unwrap();
    // The very versions that the workspace was built with; nothing has to be fetched.
    fs::copy(repository().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    build_rust(folder)
}

fn build_rust(folder: &Path) -> PathBuf {
    succeed(
        Command::new(env!("CARGO"))
            .current_dir(folder)
            .args(["build", "--release", "--offline", "--quiet", "--target-dir", "target"])
            .env_remove("CARGO_TARGET_DIR"),
    );
    folder.join("target/release/repeat")
}

#[test]
fn rust_without_std_repeats_what_was_trained() {
    for own in [CASES[0], CASES[3], CASES[5]] {
        let (resolved, file) = case(own, 1024);
        let exported = Exported::new(&resolved.task, &file).unwrap();
        let folder = TemporaryFolder::new();
        let vectors = record(&exported, 400);
        let program = compile_rust(&exported, folder.path());
        compare(&format!("rust, {own:?}"), &vectors, &pipe(Command::new(program), &inputs(&vectors)));
    }
}

#[test]
fn a_damaged_rust_export_fails_its_self_test() {
    let (resolved, file) = case(CASES[0], 512);
    let exported = Exported::new(&resolved.task, &file).unwrap();
    let folder = TemporaryFolder::new();
    compile_rust(&exported, folder.path());
    let path = folder.join("src/data.rs");
    let source = fs::read_to_string(&path).unwrap();
    let expected = exported.test_vectors()[0].next_phase;
    for (from, to) in [
        (format!("next_phase: {expected:?},"), "next_phase: 0.9,".to_owned()),
        ("        targets: [".to_owned(), "        targets: [f32::NAN + ".to_owned()),
    ] {
        assert!(source.contains(&from), "{from}");
        fs::write(&path, source.replacen(&from, &to, 1)).unwrap();
        let output = Command::new(build_rust(folder.path())).output().unwrap();
        assert!(!output.status.success(), "{to}");
    }
}

#[test]
fn the_exported_crate_carries_all_sources_of_gait() {
    let folder = repository().join("crates/gait/src");
    let mut own: Vec<String> = Vec::new();
    let mut folders = vec![folder.clone()];
    while let Some(inner) = folders.pop() {
        for entry in fs::read_dir(inner).unwrap().map(Result::unwrap) {
            if entry.path().is_dir() {
                folders.push(entry.path());
            } else {
                own.push(entry.path().strip_prefix(&folder).unwrap().display().to_string());
            }
        }
    }
    own.sort();
    assert_eq!(canter_export::rust::GAIT_SOURCES.map(|(path, _)| path.to_owned()).to_vec(), own);
}

#[test]
#[ignore = "needs clang, gcc-arm-none-eabi, qemu-system-arm, and a Python with onnxruntime that CANTER_PYTHON names"]
fn all_exports_agree_with_the_trained_policy() {
    let (resolved, file) = doggo();
    let exported = Exported::new(&resolved.task, &file).unwrap();
    let vectors = record(&exported, num_steps());
    let input = inputs(&vectors);
    for (compiler, flags) in [("gcc", &["-O0"][..]), ("gcc", &["-O2"]), ("clang", &["-O2"])] {
        let folder = TemporaryFolder::new();
        let program = compile_c(&exported, folder.path(), compiler, flags);
        compare(&format!("{compiler} {flags:?}"), &vectors, &pipe(Command::new(program), &input));
    }
    let folder = TemporaryFolder::new();
    let program = compile_rust(&exported, folder.path());
    compare("rust without std", &vectors, &pipe(Command::new(program), &input));

    let folder = TemporaryFolder::new();
    let model = folder.join("policy.onnx");
    fs::write(&model, canter_export::onnx::export(&exported)).unwrap();
    let python = std::env::var_os("CANTER_PYTHON").expect("CANTER_PYTHON is set");
    let mut run = Command::new(&python);
    run.arg(repository().join("tests/export/run_onnx.py")).arg(&model);
    compare("onnxruntime", &vectors, &pipe(run, &input));

    on_cortex_m4f(&exported, &vectors);

    let policy = folder.join("policy.safetensors");
    fs::write(&policy, file.to_bytes()).unwrap();
    print!("{}", succeed(Command::new(&python).arg(repository().join("tests/export/read_policy.py")).arg(&policy)));

    // An episode of somebody else's simulation with the same motors.
    let motor = exported.task().robot.motor();
    let robot = format!(
        "{{\"max_torque_nm\": {}, \"stall_torque_nm\": {}, \"no_load_speed_rad_per_s\": {}}}",
        motor.max_torque_nm, motor.stall_torque_nm, motor.no_load_speed_rad_per_s
    );
    fs::write(folder.join("robot.json"), robot).unwrap();
    let mut settings = resolved.config.evaluation.clone();
    settings.num_episodes = 40;
    let workers = Workers::new(Some(2)).unwrap();
    let (policy, episodes) = (exported.policy(), settings.num_episodes.to_string());
    let own = evaluate(exported.task(), Mover::Policy(&policy), &settings, &workers);
    let said = succeed(
        Command::new(&python)
            .arg(repository().join("tests/export/walk_onnx.py"))
            .arg(&model)
            .arg(repository().join("robots/doggo/doggo.xml"))
            .arg(folder.join("robot.json"))
            .arg(episodes),
    );
    let other: serde_json::Value = serde_json::from_str(said.lines().last().unwrap()).unwrap();
    let (speed, falls) = (other["speed_m_per_s"].as_f64().unwrap(), other["falls"].as_u64().unwrap());
    println!(
        "Python's MuJoCo: {speed:.4} m/s and {falls} falls, canter: {:.4} m/s and {} falls, in {} episodes",
        own.speed_m_per_s, own.falls, settings.num_episodes
    );
    assert!((speed / own.speed_m_per_s - 1.0).abs() < 0.02);
}

/// Nanoseconds of the emulated clock that an instruction takes: 2 to the power of this.
const SHIFT: u32 = 6;
/// The clock of QEMU's board [Hz].
const BOARD_HZ: f64 = 25e6;
/// The clock of a Teensy 3.5 [Hz].
const TEENSY_HZ: f64 = 120e6;

/// Cycles of an instruction of a disassembly, the most that ARM's table has for it. Loads count in full, though several in a
/// row overlap; the flash's wait states, which a cache hides, do not count.
///
/// Source: Cortex-M4 Technical Reference Manual r0p1, tables 3-1 and 7-1.
fn cycles(mnemonic: &str, operands: &str, is_taken: bool) -> u64 {
    let name = mnemonic.split('.').next().unwrap();
    let num_registers = || {
        let list = operands.split('{').nth(1).unwrap_or("").trim_end_matches('}');
        let length = |part: &str| match part.split_once('-') {
            Some((low, high)) => {
                let number =
                    |name: &str| name.trim().trim_start_matches(char::is_alphabetic).parse::<u64>().unwrap_or(0);
                (number(high) - number(low) + 1) * if part.trim().starts_with('d') { 2 } else { 1 }
            }
            None => {
                if part.trim().starts_with('d') {
                    2
                } else {
                    1
                }
            }
        };
        list.split(',').map(length).sum::<u64>()
    };
    let refill = if is_taken { 3 } else { 0 };
    let own = match name {
        "vldmia" | "vstmia" | "vpush" | "vpop" | "push" | "pop" | "ldmia" | "stmia" | "stmdb" | "ldmdb" => {
            1 + num_registers()
        }
        "vdiv" | "vsqrt" => 14,
        "vfma" | "vfms" | "vfnma" | "vfnms" | "vmla" | "vmls" | "vnmla" | "vnmls" => 3,
        "udiv" | "sdiv" => 12,
        "ldrd" | "strd" => 3,
        _ if name.starts_with("ldr")
            || name.starts_with("str")
            || name.starts_with("vldr")
            || name.starts_with("vstr") =>
        {
            2
        }
        "vmov" | "mla" | "mls" => 2,
        _ => 1,
    };
    own + refill
}

/// Cycles of the last call of `canter_step` in a trace, by ARM's table.
fn cycles_of_trace(trace: &str, disassembly: &str) -> u64 {
    let mut code = std::collections::HashMap::new();
    let mut function = "";
    for line in disassembly.lines() {
        if let Some((_, name)) = line.split_once(" <").filter(|_| line.ends_with(">:")) {
            function = name.trim_end_matches(">:");
        } else if let Some((address, rest)) = line.split_once(":\t") {
            let mut parts = rest.split('\t').skip(1);
            let (mnemonic, operands) = (parts.next().unwrap_or(""), parts.next().unwrap_or(""));
            let address = u64::from_str_radix(address.trim(), 16).unwrap();
            let length =
                rest.split('\t').next().unwrap().split_whitespace().map(|word| word.len() as u64 / 2).sum::<u64>();
            code.insert(address, (function, mnemonic.trim(), operands, length));
        }
    }
    let places = trace
        .lines()
        .filter(|line| line.starts_with("Trace"))
        .map(|line| u64::from_str_radix(line.split('/').nth(1).unwrap(), 16).unwrap());
    let places: Vec<u64> = places.collect();
    let (mut all, mut own, mut is_inside) = (0, 0, false);
    for pair in places.windows(2) {
        let &(function, mnemonic, operands, length) = code.get(&pair[0]).unwrap_or_else(|| panic!("{:x}", pair[0]));
        if function == "canter_step" && !is_inside {
            (own, is_inside) = (0, true);
        } else if function == "run" && is_inside {
            (all, is_inside) = (own, false);
        }
        own += cycles(mnemonic, operands, pair[1] != pair[0] + length);
    }
    all
}

/// Builds the policy for the chip, which has no more memory than it may use, and has QEMU run it.
fn on_cortex_m4f(exported: &Exported<'_>, vectors: &[TestVector]) {
    let folder = TemporaryFolder::new();
    let files = canter_export::c::export(exported);
    fs::write(folder.join(canter_export::c::HEADER_NAME), files.header).unwrap();
    fs::write(folder.join(canter_export::c::SOURCE_NAME), files.source).unwrap();
    fs::write(folder.join("inputs.bin"), inputs(vectors)).unwrap();
    for name in ["main.c", "chip.ld"] {
        fs::copy(repository().join("firmware/cortex-m4f").join(name), folder.join(name)).unwrap();
    }
    const CHIP: [&str; 4] = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"];
    succeed(Command::new("arm-none-eabi-gcc").current_dir(folder.path()).args(CHIP).args([
        "-std=gnu99",
        "-O2",
        // A product and a sum take two cycles, fused they take three.
        "-ffp-contract=off",
        "-ffunction-sections",
        "-fdata-sections",
        "-Wl,--gc-sections",
        "-nostartfiles",
        "-Tchip.ld",
        canter_export::c::SOURCE_NAME,
        "main.c",
        "-o",
        "policy.elf",
        "-lm",
    ]));
    let sizes = succeed(Command::new("arm-none-eabi-size").current_dir(folder.path()).arg("policy.elf"));
    let sizes: Vec<u64> =
        sizes.lines().nth(1).unwrap().split_whitespace().take(3).map(|number| number.parse().unwrap()).collect();
    let qemu = |further: &[&str]| {
        let mut qemu = Command::new("qemu-system-arm");
        qemu.current_dir(folder.path()).args(["-machine", "mps2-an386", "-kernel", "policy.elf", "-nographic"]);
        qemu.args(["-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"]);
        succeed(qemu.args(further))
    };
    let said = qemu(&["-icount", &format!("shift={SHIFT},sleep=off")]);
    compare("Cortex-M4F", vectors, &fs::read(folder.join("outputs.bin")).unwrap());
    let value = |name: &str| -> f64 {
        let line = said.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_else(|| panic!("{said}"));
        line.trim().parse().unwrap()
    };
    assert_eq!(value("steps ") as usize, vectors.len());
    let instructions = |ticks: f64| ticks / BOARD_HZ * 1e9 / f64::from(1_u32 << SHIFT);
    let (flash, static_ram) = (sizes[0] + sizes[1], sizes[1] + sizes[2]);
    let ram = static_ram + value("stack_bytes ") as u64;
    let most = instructions(value("ticks_most "));
    // One step again, instruction by instruction.
    fs::write(folder.join("inputs.bin"), inputs(&vectors[..1])).unwrap();
    qemu(&["-singlestep", "-d", "exec,nochain", "-D", "trace.log"]);
    let disassembly =
        succeed(Command::new("arm-none-eabi-objdump").current_dir(folder.path()).args(["-d", "policy.elf"]));
    let cycles = cycles_of_trace(&fs::read_to_string(folder.join("trace.log")).unwrap(), &disassembly);
    let budget = TEENSY_HZ * f64::from(exported.control_dt_s());
    println!(
        "Cortex-M4F: {flash} bytes of flash, {ram} bytes of RAM ({} of them stack, {} the policy's own state); \
         {:.0} instructions a step on average, {most:.0} at most; {cycles} cycles by ARM's table, {:.1} % of a Teensy 3.5's \
         100 Hz budget",
        value("stack_bytes "),
        value("state_bytes "),
        instructions(value("ticks_mean ")),
        100.0 * cycles as f64 / budget
    );
    assert!(flash <= 64 << 10 && ram <= 8 << 10);
    assert!(cycles as f64 > most && (cycles as f64) < 0.05 * budget);
}
