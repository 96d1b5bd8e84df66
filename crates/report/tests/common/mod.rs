//! Sample files: a run directory and a comparison with plausible numbers of a trotting robot, the same each time.
#![allow(dead_code, reason = "each user takes its part")]

#[path = "../../../train/tests/common/folder.rs"]
mod folder;

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

#[allow(unused_imports, reason = "each test binary uses its part")]
pub use folder::TemporaryFolder;

/// Fixed noise in [-1, 1].
fn noise(i: usize) -> f64 {
    let wild = ((i as f64 + 1.0) * 12.9898).sin() * 43_758.545;
    2.0 * (wild - wild.floor()) - 1.0
}

fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4 + 0.0
}

/// A gait of the samples: name, label, speed [m/s], stride frequency [Hz], swing amplitude [rad], unsteadiness, and the
/// step at which it falls.
pub struct SampleGait {
    pub name: &'static str,
    pub label: &'static str,
    pub speed: f64,
    pub frequency: f64,
    pub swing: f64,
    pub unsteady: f64,
    pub falls_at: Option<usize>,
}

const fn gait(
    name: &'static str,
    label: &'static str,
    (speed, frequency, swing, unsteady): (f64, f64, f64, f64),
    falls_at: Option<usize>,
) -> SampleGait {
    SampleGait { name, label, speed, frequency, swing, unsteady, falls_at }
}

/// The rungs of the sample comparison.
pub const RUNGS: [SampleGait; 7] = [
    gait("sine", "default sine", (0.53, 2.0, 0.415, 0.1), None),
    gait("stepping", "firmware's trot", (0.40, 2.0, 0.38, 0.05), None),
    gait("tuned", "tuned by search", (1.71, 3.9, 0.62, 0.15), None),
    gait("direct", "no prior", (0.22, 2.0, 0.3, 1.5), Some(430)),
    gait("direct-best", "no prior, best effort", (0.74, 2.0, 0.45, 0.9), None),
    gait("paper", "paper's method", (0.86, 2.0, 0.6, 0.2), None),
    gait("doggo", "canter", (2.41, 4.0, 0.75, 0.15), None),
];

/// One recorded episode: five-bar legs that trot over flat ground.
pub fn trajectory(gait: &SampleGait) -> Value {
    let (dt, upper, lower) = (0.01, 0.09, 0.162);
    let legs = ["front_left", "back_left", "back_right", "front_right"];
    let hips = [(0.19, 0.11), (-0.19, 0.11), (-0.19, -0.11), (0.19, -0.11)];
    let steps = gait.falls_at.unwrap_or(1000);
    let mut columns: Vec<Vec<Value>> = vec![Vec::new(); 14];
    let mut x = 0.0;
    for step in 0..steps {
        let time = (step + 1) as f64 * dt;
        let start = (time / 0.6).min(1.0);
        let cycle = time * gait.frequency;
        let fallen = gait.falls_at.map_or(0.0, |end| (1.0 - (end - step) as f64 / 25.0).max(0.0));
        let ripple = 0.25 * (2.0 * TAU * cycle).sin() + gait.unsteady * noise(step);
        x += gait.speed * dt * start * (1.0 + ripple) * (1.0 - fallen);
        let (roll, pitch) =
            (0.02 * (TAU * cycle).sin() + 1.1 * fallen, 0.03 * (TAU * cycle + 0.5).sin() + 0.2 * fallen);
        let yaw = 0.0;
        let mut rows: Vec<Vec<Value>> = vec![Vec::new(); 9];
        let leg_space: Vec<[f64; 4]> = (0..4)
            .map(|leg| {
                let phase = TAU * (cycle + if leg % 2 == 0 { 0.0 } else { 0.5 });
                let swing = gait.swing * start * phase.cos() + 0.04 * gait.unsteady * noise(4 * step + leg);
                let extension = start * if phase.sin() > 0.0 { 0.06 } else { 0.5 } * phase.sin();
                let lag = TAU * 0.06;
                let commanded = gait.swing * start * (phase + lag).cos() * 1.1;
                [swing, extension, commanded, start * 0.55 * (phase + lag).sin().min(0.15)]
            })
            .collect();
        let length = |extension: f64| {
            let half_angle: f64 = 1.21 - extension;
            upper * half_angle.cos() + (lower * lower - (upper * half_angle.sin()).powi(2)).sqrt()
        };
        let height =
            leg_space.iter().map(|[swing, extension, ..]| length(*extension) * swing.cos()).fold(0.0, f64::max);
        let height = height * (1.0 - 0.6 * fallen);
        for (leg, [swing, extension, commanded_swing, commanded_extension]) in leg_space.into_iter().enumerate() {
            let (hip_x, hip_y) = hips[leg];
            let hip = [x + hip_x * pitch.cos(), hip_y, height - hip_x * pitch.sin()];
            let at = |angle: f64, radius: f64| {
                [
                    rounded(hip[0] + radius * (angle - pitch).sin()),
                    hip_y,
                    rounded(hip[2] - radius * (angle - pitch).cos()),
                ]
            };
            let half_angle = 1.21 - extension;
            let mut foot = at(swing, length(extension));
            foot[2] = rounded(foot[2].max(0.0));
            rows[0].push(json!(hip.map(rounded)));
            rows[1].push(json!([at(swing + half_angle, upper), at(swing - half_angle, upper)]));
            rows[2].push(json!(foot));
            rows[3].push(json!(u8::from(foot[2] < 0.008)));
            rows[4].push(json!(rounded(commanded_swing)));
            rows[5].push(json!(rounded(commanded_extension)));
            rows[6].push(json!(rounded(swing)));
            rows[7].push(json!(rounded(extension)));
            for (motor, sign) in [1.0, -1.0].into_iter().enumerate() {
                let torque = 7.0 * (commanded_swing - swing) + sign * (1.0 + 0.6 * gait.speed);
                rows[8].push(json!(rounded((torque + 0.3 * noise(8 * step + 2 * leg + motor)).clamp(-4.2, 4.2))));
            }
        }
        let scalars = [
            json!(rounded(time)),
            json!(rounded(cycle.fract())),
            json!([rounded(x), rounded(0.01 * time), rounded(height)]),
            json!([rounded(roll), rounded(pitch), yaw]),
            json!(u8::from(fallen > 0.7)),
        ];
        let rows = rows.into_iter().map(Value::from);
        for (column, value) in columns.iter_mut().zip(scalars.into_iter().chain(rows)) {
            column.push(value);
        }
    }
    let keys = [
        "time_s",
        "phase",
        "position_m",
        "orientation_rad",
        "body_contact",
        "hip_m",
        "knee_m",
        "foot_m",
        "contact",
        "commanded_swing_rad",
        "commanded_extension_rad",
        "swing_rad",
        "extension_rad",
        "torque_nm",
    ];
    let mut trajectory = json!({
        "version": 1, "name": gait.name, "label": gait.label, "robot": "doggo", "legs": legs, "control_dt_s": dt,
        "settle_s": 1.0, "slope_deg": 0.0, "seed": 0, "episode": 0,
        "terminated": gait.falls_at.map(|_| "rollover"), "leg_length_m": 0.17, "max_torque_nm": 4.2,
        "swing_limits_rad": [-1.2, 1.2], "extension_limits_rad": [-1.3129, 1.0422],
    });
    for (key, column) in keys.into_iter().zip(columns) {
        trajectory[key] = Value::from(column);
    }
    trajectory
}

fn report(speed: f64, falls: u64) -> Value {
    let speeds: Vec<f64> =
        (0..20).map(|i| speed * (1.0 + 0.05 * noise(i)) * if i < falls as usize { 0.4 } else { 1.0 }).collect();
    let mean = speeds.iter().sum::<f64>() / 20.0;
    json!({
        "speed_m_per_s": mean, "speed_ci": [mean * 0.98, mean * 1.02], "displacement_speed_m_per_s": mean * 1.03,
        "falls": falls, "falls_by_cause": if falls > 0 { json!({ "rollover": falls }) } else { json!({}) },
        "drift_m": 0.31, "heading_deg": 7.25, "height_std_m": 0.0048, "power_w": 18.0 + 40.0 * mean,
        "cost_of_transport": (18.0 + 40.0 * mean) / (4.8 * 9.81 * mean), "episode_return": 40.0 * mean,
        "speeds_m_per_s": speeds,
    })
}

/// A finished run directory.
pub fn write_run(path: &Path, seed: usize, with_trajectories: bool) {
    fs::create_dir_all(path).unwrap();
    let policy = report(2.3 + 0.1 * noise(seed), 1);
    let (prior, stepping) = (report(0.53, 0), report(0.40, 0));
    let default = prior["speed_m_per_s"].as_f64().unwrap();
    let ratio = policy["speed_m_per_s"].as_f64().unwrap() / default;
    let eval = json!({
        "protocol": { "robot": "doggo", "num_episodes": 20, "episode_s": 10.0, "settle_s": 1.0, "seed": 1000,
                      "slope_deg": 0.0, "friction": null },
        "policy": policy, "prior": prior, "prior_name": "sine",
        "default_gaits": { "sine": prior, "stepping": stepping }, "default_gait": "sine",
        "default_speed_m_per_s": default, "speed_ratio": ratio, "speed_ratio_ci": [ratio * 0.97, ratio * 1.03],
        "prior_speed_ratio": ratio, "prior_speed_ratio_ci": [ratio * 0.97, ratio * 1.03],
    });
    write_json(&path.join("eval.json"), &eval);
    let lines: Vec<String> = (1..=150)
        .map(|i| {
            let done = 1.0 - (-(i as f64) / 40.0).exp();
            let n = noise(i + 1000 * seed);
            json!({
                "iteration": i, "env_steps": i * 4096, "episodes": i * 4,
                "episode_return": if i < 3 { None } else { Some(20.0 + 75.0 * done + 4.0 * n) },
                "episode_length": 900.0, "accidents": { "rollover": if i % 7 == 0 { 2 } else { 0 }, "too_low": 0 },
                "speed_m_per_s": 0.4 + 1.9 * done + 0.05 * n, "power_w": 20.0 + 90.0 * done,
                "mean_std": 0.37 - 0.2 * done, "approx_kl": 0.006 + 0.002 * n,
                "explained_variance": if i == 1 { -2.1 } else { 0.95 - 1.2 / (i as f64) + 0.02 * n },
            })
            .to_string()
        })
        .collect();
    fs::write(path.join("metrics.jsonl"), lines.join("\n") + "\n").unwrap();
    if with_trajectories {
        let bare = [&RUNGS[0], &RUNGS[1]];
        let learned = gait("learned", "learned gait", (2.3, 4.0, 0.75, 0.15), None);
        fs::create_dir_all(path.join("trajectories")).unwrap();
        for gait in bare.into_iter().chain([&learned]) {
            write_json(&path.join(format!("trajectories/{}.json", gait.name)), &trajectory(gait));
        }
    }
}

/// A comparison's content; trajectories are not written.
pub fn comparison() -> Value {
    let mut rungs = json!({});
    for (number, gait) in RUNGS.iter().enumerate() {
        let kind = match gait.name {
            "sine" | "stepping" => "gait",
            "tuned" => "tuned",
            _ => "learned",
        };
        let seeds = if kind == "gait" { 1 } else { 5 };
        let falls = if gait.name == "direct" { 9 } else { u64::from(gait.name == "direct-best") * 2 };
        let results: Vec<Value> = (0..seeds)
            .map(|seed| {
                let speed = gait.speed * (1.0 + 0.05 * noise(10 * number + seed));
                let report = report(speed, falls);
                let curve: Vec<[f64; 2]> = (1..=40)
                    .map(|i| {
                        let done = 1.0 - (-f64::from(i) / 12.0).exp();
                        let prior = if gait.name.starts_with("direct") { -4.0 } else { 18.0 };
                        let end = 40.0 * speed;
                        [f64::from(i) * 25_000.0, prior + (end - prior) * done + 3.0 * noise(100 * seed + i as usize)]
                    })
                    .collect();
                json!({
                    "seed": if kind == "gait" { None } else { Some(seed + 1) },
                    "env_steps": if kind == "gait" { 0 } else { 1_000_000 },
                    "speed_m_per_s": speed, "displacement_speed_m_per_s": speed * 1.03, "falls": falls,
                    "num_episodes": 20, "falls_by_cause": report["falls_by_cause"], "episode_return": 40.0 * speed,
                    "drift_m": 0.3, "heading_deg": 6.0, "height_std_m": 0.005, "power_w": report["power_w"],
                    "cost_of_transport": report["cost_of_transport"], "speed_per_step_std_m": 0.002,
                    "speeds_m_per_s": report["speeds_m_per_s"],
                    "return_curve": if kind == "learned" { json!(curve) } else { json!([]) },
                })
            })
            .collect();
        let probability = |other: f64| if gait.speed > other { 1.0 } else { 0.0 };
        rungs[gait.name] = json!({
            "label": gait.label, "kind": kind, "description": format!("What {} is.", gait.label), "seeds": results,
            "speed_iqm": gait.speed, "speed_ci": [gait.speed * 0.96, gait.speed * 1.03], "return_iqm": 40.0 * gait.speed,
            "return_ci": [38.0 * gait.speed, 42.0 * gait.speed],
            "ratio_to_default": { "iqm": gait.speed / 0.53, "ci": [gait.speed / 0.55, gait.speed / 0.51] },
            "probability_faster_than_default": probability(0.53),
            "probability_faster_than_tuned": if kind == "learned" { Some(probability(1.71)) } else { None },
        });
    }
    let sweep = |unit: &str, values: Vec<f64>, shape: &dyn Fn(f64) -> f64| {
        let mut curves = json!({});
        for gait in &RUNGS {
            let speeds: Vec<f64> = values.iter().map(|&value| gait.speed * shape(value)).collect();
            curves[gait.name] = json!({
                "speed_m_per_s": speeds,
                "speed_ci": speeds.iter().map(|speed| [speed - 0.05, speed + 0.05]).collect::<Vec<_>>(),
                "falls_per_episode": speeds.iter().map(|speed| (0.3 * gait.unsteady - 0.3 * (speed / gait.speed - 1.0)).clamp(0.0, 1.0)).collect::<Vec<_>>(),
            });
        }
        json!({ "unit": unit, "values": values, "rungs": curves })
    };
    json!({
        "version": 1, "robot": "doggo", "canter": "0.1.0", "quick": false,
        "protocol": {
            "budget_env_steps": 1_000_000, "seeds": [1, 2, 3, 4, 5],
            "evaluation": { "num_episodes": 20, "episode_s": 10.0, "settle_s": 1.0, "seed": 1000 },
            "search_seed": 7, "text": "Nothing is selected on the evaluation's seeds.",
        },
        "default_rung": "sine", "rungs": rungs,
        "sweeps": {
            "slope_deg": sweep("deg", (-4..=5).map(|i| f64::from(i) * 5.0).collect(), &|slope| 1.0 - slope / 22.0),
            "friction": sweep("", vec![0.3, 0.45, 0.6, 0.8, 1.0, 1.2], &|mu| 1.0 - 0.5 * (0.8 - mu).max(0.0)),
            "mass_factor": sweep("", vec![0.7, 0.85, 1.0, 1.15, 1.3], &|factor| 1.4 - 0.4 * factor),
            "delay_s": sweep("s", vec![0.0, 0.01, 0.02, 0.03, 0.04], &|delay| 1.05 - 9.0 * delay),
            "push_m_per_s": sweep("m/s", vec![0.0, 0.3, 0.6, 0.9], &|push| 1.0 - 0.4 * push * push),
        },
        "claims": [
            { "claim": "50 % faster than the default trot", "source": "abstract, section V-C", "paper": "1.5",
              "ours": "4.55 [4.38, 4.73]", "holds": true, "sentence": "Most of it comes from a higher stride frequency." },
            { "claim": "Twice the return of learning without the prior", "source": "section V-B, figure 5", "paper": "2",
              "ours": "10.9 [9.1, 13.0]", "holds": true, "sentence": "Without the prior it hardly walks at this budget." },
            { "claim": "Holds its speed on 20 degrees uphill", "source": "section V-D, figure 7", "paper": "yes",
              "ours": "0.22 m/s", "holds": false, "sentence": "It climbs, at a tenth of its speed on the flat." },
            { "claim": "Runs on the real robot", "source": "section VI", "paper": "future work", "ours": "not measured",
              "holds": null, "sentence": "Nothing here was run on a robot." },
        ],
        "uphill_trajectories": { "doggo": "trajectories/doggo-uphill.json", "sine": "trajectories/sine-uphill.json" },
        "trajectories": RUNGS.iter().map(|gait| (gait.name.to_owned(), json!(format!("trajectories/{}.json", gait.name)))).collect::<serde_json::Map<_, _>>(),
    })
}

/// A comparison's folder.
pub fn write_comparison(path: &Path, comparison: &Value) {
    fs::create_dir_all(path.join("trajectories")).unwrap();
    write_json(&path.join("compare.json"), comparison);
    for gait in &RUNGS {
        let mut trajectory = trajectory(gait);
        write_json(&path.join(format!("trajectories/{}.json", gait.name)), &trajectory);
        trajectory["slope_deg"] = json!(20.0);
        write_json(&path.join(format!("trajectories/{}-uphill.json", gait.name)), &trajectory);
    }
}

pub fn write_json(path: &Path, value: &Value) {
    fs::write(path, value.to_string()).unwrap();
}

/// `sweep.json` with three points of two runs: 1, 2 and 3 times the default's speed, and 0, 1 and 2 falls.
pub fn sweep(key: &str, values: [&str; 3]) -> Value {
    let point = |(i, value): (usize, &str)| {
        let speed = 0.5 * (i + 1) as f64;
        let run = |seed: u64| {
            let speed = speed + 0.1 * (seed as f64 - 1.5);
            json!({ "seed": seed, "speed_m_per_s": speed, "speed_ratio": speed / 0.5, "prior_speed_ratio": speed / 0.5,
                    "falls": u64::from(seed == 1) * i as u64, "num_episodes": 20 })
        };
        json!({
            "values": [value], "robot": "doggo", "default_gait": "trot", "default_speed_m_per_s": 0.5,
            "default_falls": 0, "runs": [run(1), run(2)], "speed_iqm": speed, "speed_ci": [speed - 0.1, speed + 0.1],
            "ratio_iqm": speed / 0.5, "ratio_ci": [speed / 0.5 - 0.2, speed / 0.5 + 0.2], "falls": [i, 40],
        })
    };
    let points: Vec<Value> = values.into_iter().enumerate().map(point).collect();
    json!({ "version": 1, "canter": "0.1.0", "preset": "doggo", "overrides": [], "keys": [key], "seeds": [1, 2],
            "points": points })
}
