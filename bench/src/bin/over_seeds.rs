//! Interquartile means over runs that differ in their seed only, from the `eval.json` that each has left.
//!
//! `cargo run --release -p canter-bench --bin over_seeds -- runs/doggo-*-1`

use std::error::Error;
use std::fs;

use canter_train::statistics::{bootstrap_interval, interquartile_mean};
use serde_json::Value;

/// What is summarised: a name and where it stands in `eval.json`.
const QUANTITIES: [(&str, &str); 7] = [
    ("speed [m/s]", "/policy/speed_m_per_s"),
    ("times default speed", "/speed_ratio"),
    ("times own prior", "/prior_speed_ratio"),
    ("falls in evaluation", "/policy/falls"),
    ("drift [m]", "/policy/drift_m"),
    ("power [W]", "/policy/power_w"),
    ("cost of transport", "/policy/cost_of_transport"),
];

fn main() -> Result<(), Box<dyn Error>> {
    let runs: Vec<String> = std::env::args().skip(1).collect();
    let mut verdicts = Vec::new();
    for run in &runs {
        let text = fs::read_to_string(format!("{run}/eval.json")).map_err(|error| format!("{run}: {error}"))?;
        verdicts.push(serde_json::from_str::<Value>(&text)?);
    }
    println!("| | {} runs | interquartile mean [95 % interval] |\n| --- | --- | --- |", runs.len());
    for (name, pointer) in QUANTITIES {
        let values: Vec<f64> = verdicts.iter().filter_map(|verdict| verdict.pointer(pointer)?.as_f64()).collect();
        if values.is_empty() {
            continue;
        }
        let [low, high] = bootstrap_interval(&[&values], |groups| interquartile_mean(&groups[0]));
        let each: Vec<String> = values.iter().map(|value| format!("{value:.2}")).collect();
        println!("| {name} | {} | {:.2} [{low:.2}, {high:.2}] |", each.join(", "), interquartile_mean(&values));
    }
    Ok(())
}
