//! What the tests of this crate share: trained policies, recorded control steps, and programs that repeat them.
#![allow(dead_code, reason = "each test binary uses its part")]

#[path = "../../../train/tests/common/folder.rs"]
mod folder;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

use canter_export::Exported;
use canter_export::exported::{Readings, Running, TestVector};
use canter_gait::Mode;
use canter_gait::observation::ObservationBlock;
use canter_sim::{Env, Task};
use canter_train::config::{Resolved, open_preset, resolve};
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use canter_train::trainer::Trainer;

#[allow(unused_imports, reason = "each test binary uses its part")]
pub use folder::TemporaryFolder;

/// What every export must keep to, in rad and cycles.
pub const LIMIT: f32 = 1e-5;

/// Robot, prior, modulation and further settings.
pub type Case = (&'static str, &'static str, &'static str, &'static [(&'static str, &'static str)]);

/// Every geometry, waveform and modulation once. `lifted` and `recorded` are
/// gaits that [`with_gaits`] adds.
pub const CASES: [Case; 12] = [
    ("doggo", "sine", "modulate", &[]),
    ("doggo", "stepping", "leg-amplitude", &[("policy.authority", "0.7")]),
    ("doggo", "sine-literal", "amplitude", &[("policy.authority", "0.5"), ("policy.symmetric", "false")]),
    ("doggo", "recorded", "leg-amplitude", &[("policy.symmetric", "false")]),
    ("doggo", "sine", "direct", &[]),
    ("q8bot", "lifted", "leg-amplitude", &[]),
    ("q8bot", "trot", "direct", &[]),
    ("quad12", "lifted", "leg-amplitude", &[]),
    ("quad12", "trot", "direct", &[]),
    ("doggo", "sine", "residual", &[]),
    ("q8bot", "trot", "residual", &[]),
    ("quad12", "trot", "residual", &[]),
];

/// Those with which runtimes are compared: leg space and joints, coaxial hips, separated hips, serial legs, and a policy that
/// looks at its motor angles only.
pub const WALKS: [Case; 5] = [
    CASES[0],
    CASES[5],
    CASES[7],
    CASES[9],
    ("doggo", "sine", "amplitude", &[("policy.observation", "[\"motor_angles\"]"), ("policy.symmetric", "false")]),
];

/// A preset for a robot with its gait and a modulation, in few small environments.
pub fn resolved(preset: &str, changes: &[(&str, &str)]) -> Resolved {
    let mut document = open_preset(preset).unwrap();
    for (key, value) in changes {
        match *key {
            "robot" | "policy.prior" | "policy.modulation" => document.set_string(key, value),
            _ => document.set(key, value),
        }
    }
    resolve(&document).unwrap()
}

/// One of [`CASES`], learned for so many env steps.
pub fn case((robot, prior, modulation, further): Case, env_steps: u64) -> (Resolved, PolicyFile) {
    let folder = TemporaryFolder::new();
    let robot = with_gaits(folder.path(), robot);
    let own = [
        ("robot", robot.as_str()),
        ("policy.prior", prior),
        ("policy.modulation", modulation),
        ("training.num_environments", "8"),
        ("training.horizon", "64"),
        ("network.actor_hidden", "20"),
        // Large steps from the random start: actions fill their whole range.
        ("ppo.learning_rate", "0.05"),
        ("ppo.final_learning_rate", "0.05"),
    ];
    let changes: Vec<(&str, &str)> = own.into_iter().chain(further.iter().copied()).collect();
    trained("doggo", &changes, env_steps)
}

/// Copies a robot into a folder and gives it a stepping gait called `lifted`, and Doggo a recorded one; returns the path of
/// its file.
fn with_gaits(folder: &Path, robot: &str) -> String {
    let origin = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots").join(robot);
    let mut settings = fs::read_to_string(origin.join("robot.toml")).unwrap();
    let model = format!("{robot}.xml");
    fs::copy(origin.join(&model), folder.join(&model)).unwrap();
    let line = settings.lines().find_map(|line| line.strip_prefix("stance_height_m = ")).unwrap();
    let height: f64 = line.parse().unwrap();
    settings += &format!(
        "\n[[gaits]]\nkind = \"stepping\"\nname = \"lifted\"\ndefault = false\nstable = false\nfootfall = \"trot\"\n\
         stride_frequency_hz = 1.5\nstance_height_m = {}\ndown_amplitude_m = {}\nup_amplitude_m = {}\n\
         flight_fraction = 0.4\nstep_length_m = {}\n",
        0.98 * height,
        0.02 * height,
        0.15 * height,
        0.3 * height
    );
    if robot == "doggo" {
        settings += "\n[[gaits]]\nkind = \"table\"\nname = \"recorded\"\ndefault = false\nstable = false\n\
                     stride_frequency_hz = 1.5\ntable = \"recorded.csv\"\n";
        let legs = ["front_left", "back_left", "back_right", "front_right"];
        let mut table = legs.map(|leg| format!("{leg}_swing,{leg}_extension")).join(",") + "\n";
        for row in 0..20 {
            let t = std::f64::consts::TAU * f64::from(row) / 20.0;
            let target = |i: usize| 0.3 * (t + 0.4 * i as f64).sin() + 0.05 * (3.0 * t).cos();
            table += &((0..8).map(|i| format!("{}", target(i))).collect::<Vec<_>>().join(",") + "\n");
        }
        fs::write(folder.join("recorded.csv"), table).unwrap();
    }
    let path = folder.join("robot.toml");
    fs::write(&path, settings).unwrap();
    path.display().to_string()
}

/// A policy after so many env steps.
pub fn trained(preset: &str, changes: &[(&str, &str)], env_steps: u64) -> (Resolved, PolicyFile) {
    let workers = Workers::new(Some(2)).unwrap();
    let mut trainer = Trainer::new(resolved(preset, changes));
    while trainer.progress().env_steps < env_steps {
        trainer.iterate(&workers).unwrap();
    }
    (resolved(preset, changes), PolicyFile::of(&trainer))
}

/// Numbers in [-1, 1] from a seed: a linear congruential generator, Knuth's MMIX.
pub fn draws(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    }
}

/// Control steps of episodes in the simulator, the actions perturbed so that the robot sees more than its own gait.
pub fn record(exported: &Exported<'_>, count: usize) -> Vec<TestVector> {
    let task: Arc<Task> = Arc::new(exported.task().clone());
    let mut env = Env::new(task.clone());
    let mut draw = draws(7);
    let mut observation = vec![0.0; task.num_observations()];
    let mut vectors: Vec<TestVector> = Vec::new();
    while vectors.len() < count {
        env.reset(&mut || f64::from(0.5 * (draw() + 1.0)).clamp(0.0, 0.999), &mut observation);
        let mut previous = vec![0.0; task.num_actions()];
        while vectors.len() < count {
            let vector = exported.step(Readings::of(&env.sensors()), env.phase(), &previous);
            previous = vector.action.iter().map(|value| (value + 0.3 * draw()).clamp(-1.0, 1.0)).collect();
            vectors.push(vector);
            let outcome = env.step(&previous, &mut observation);
            if outcome.terminated.is_some() || outcome.truncated {
                break;
            }
        }
    }
    vectors
}

/// The inputs, one record after the other: readings, phase, previous action; `f32`, little-endian.
pub fn inputs(vectors: &[TestVector]) -> Vec<u8> {
    let record =
        |vector: &TestVector| [vector.readings.flat(), vec![vector.phase], vector.previous_action.clone()].concat();
    vectors.iter().flat_map(record).flat_map(f32::to_le_bytes).collect()
}

/// Holds the outputs of another implementation (targets, next phase, action) against the policy's; returns the largest
/// error of a target [rad].
pub fn compare(name: &str, vectors: &[TestVector], outputs: &[u8]) -> f32 {
    let values: Vec<f32> = outputs.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
    let expected =
        |vector: &TestVector| [vector.targets.clone(), vec![vector.next_phase], vector.action.clone()].concat();
    let width = expected(&vectors[0]).len();
    assert_eq!(values.len(), width * vectors.len(), "{name}: number of outputs");
    let mut largest = [0.0_f32; 3];
    for (k, (vector, own)) in vectors.iter().zip(values.chunks_exact(width)).enumerate() {
        let num_motors = vector.targets.len();
        for (i, (own, expected)) in own.iter().zip(expected(vector)).enumerate() {
            let mut error = (own - expected).abs();
            let what = usize::from(i >= num_motors) + usize::from(i > num_motors);
            if what == 1 {
                // Just before a whole cycle and just after it is the same place.
                error = error.min(1.0 - error);
            }
            assert!(error <= LIMIT, "{name}: step {k}, output {i}: {own} instead of {expected}");
            largest[what] = largest[what].max(error);
        }
    }
    let actions = || vectors.iter().flat_map(|vector| &vector.action);
    let (low, high) = actions().fold((0.0_f32, 0.0_f32), |(low, high), &value| (low.min(value), high.max(value)));
    assert!(low < -0.3 && high > 0.3, "{name}: actions from {low} to {high} try too little");
    let [targets, phase, action] = largest;
    println!(
        "{name}: {} steps agree; largest error: target {targets:.1e} rad, phase {phase:.1e}, action {action:.1e}",
        vectors.len()
    );
    targets
}

/// Runs a program on bytes and returns what it prints.
pub fn pipe(mut program: Command, input: &[u8]) -> Vec<u8> {
    let name = program.get_program().to_string_lossy().into_owned();
    let mut child = program
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap_or_else(|error| panic!("cannot run {name}: {error}"));
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    let writer = std::thread::spawn(move || stdin.write_all(&input));
    let output = child.wait_with_output().unwrap();
    let _ = writer.join().unwrap();
    assert!(output.status.success(), "{name}: {}", output.status);
    output.stdout
}

/// Runs a program that has to succeed.
pub fn succeed(program: &mut Command) -> String {
    let output = program.output().unwrap_or_else(|error| panic!("cannot run {program:?}: {error}"));
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{program:?}: {}\n{}{}", output.status, said[0], said[1]);
    said.concat()
}

/// Writes a policy as C with a program around it that repeats control steps, and compiles it.
pub fn compile_c(exported: &Exported<'_>, folder: &Path, compiler: &str, flags: &[&str]) -> PathBuf {
    let files = canter_export::c::export(exported);
    fs::write(folder.join(canter_export::c::HEADER_NAME), files.header).unwrap();
    fs::write(folder.join(canter_export::c::SOURCE_NAME), files.source).unwrap();
    fs::write(folder.join("repeat.c"), include_str!("repeat.c")).unwrap();
    let program = folder.join("repeat");
    const STRICT: [&str; 6] = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion"];
    succeed(Command::new(compiler).current_dir(folder).args(STRICT).args(flags).args([
        canter_export::c::SOURCE_NAME,
        "repeat.c",
        "-o",
        "repeat",
        "-lm",
    ]));
    program
}

/// One control step of [`compare_walk`].
#[derive(Clone, Debug)]
struct Scripted {
    walk: bool,
    age_s: f32,
    dt_s: f32,
    readings: Readings,
}

/// Holds another runtime against ours: it waits, rises, stands, walks, loses its sensors in every way, walks on and stops.
/// The program reads records of readings, their age, whether to walk and the step's time, and writes targets and the mode's
/// number. Times are the control law's own unless `is_late`.
pub fn compare_walk(exported: &Exported<'_>, program: Command, is_late: bool) {
    let vectors = exported.test_vectors();
    let script: Vec<Scripted> = (0..600)
        .map(|step| {
            let (walk, age_s) = match step {
                0..5 => (true, f32::INFINITY),
                5..100 => (false, 0.0),
                100..190 => (true, 0.04),
                190..200 => (true, 0.2),
                200..205 => (true, f32::NAN),
                205..210 => (true, -0.01),
                210..400 => (true, 0.0),
                400..410 => (false, 0.0),
                410..420 => (true, 0.0),
                _ => (false, 0.0),
            };
            let mut readings = vectors[step % vectors.len()].readings.clone();
            // What no motor angle, and nothing that is observed, may be; and what may be anything if it is not observed.
            let is_observed = |block| exported.controller().blocks().contains(&block);
            match step {
                3 => readings.motor_angles[0] = f32::NAN,
                330 => readings.motor_angles[1] = f32::NAN,
                331 => readings.motor_angles[1] = f32::NEG_INFINITY,
                332 if is_observed(ObservationBlock::Orientation) => readings.orientation[2] = f32::NAN,
                333 if is_observed(ObservationBlock::MotorVelocities) => readings.motor_velocities[1] = f32::NAN,
                334 => readings.motor_angles[0] = 7.0,
                335.. if !is_observed(ObservationBlock::Orientation) => readings.orientation[0] = f32::NAN,
                335.. if !is_observed(ObservationBlock::MotorVelocities) => readings.motor_velocities[0] = f32::NAN,
                _ => {}
            }
            let dt_s = match step {
                _ if !is_late => exported.control_dt_s(),
                250 => 0.3,
                251 => f32::NAN,
                252 => f32::INFINITY,
                253 => -1.0,
                _ => exported.control_dt_s(),
            };
            Scripted { walk, age_s, dt_s, readings }
        })
        .collect();
    let input: Vec<u8> = script
        .iter()
        .flat_map(|step| [step.readings.flat(), vec![step.age_s, f32::from(u8::from(step.walk)), step.dt_s]].concat())
        .flat_map(f32::to_le_bytes)
        .collect();
    let output = pipe(program, &input);
    let mut running = Running::new(exported);
    let num_motors = running.targets().len();
    let rows: Vec<f32> = output.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
    assert_eq!(rows.len(), script.len() * (num_motors + 1));
    let mut modes = Vec::new();
    for (step, (now, row)) in script.iter().zip(rows.chunks_exact(num_motors + 1)).enumerate() {
        running.walk(now.walk);
        let mode = running.step_for(now.readings.sensors(), now.age_s, now.dt_s);
        assert_eq!(Mode::ALL[row[num_motors] as usize], mode, "step {step}");
        for (own, expected) in row.iter().zip(running.targets()) {
            assert!((own - expected).abs() < LIMIT, "step {step}, {mode:?}: {own} instead of {expected}");
        }
        modes.push(mode);
    }
    assert!(Mode::ALL.iter().all(|mode| modes.contains(mode)), "{modes:?}");
    assert!([330, 331, 334].iter().all(|step| modes[*step] == Mode::Holding));
    assert!(
        modes[332..400].contains(&Mode::Rising) && matches!(modes[399], Mode::RampingIn | Mode::Walking),
        "{modes:?}"
    );
}
