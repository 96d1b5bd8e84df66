//! `canter compare` as it is typed: its end, its stop, its refusals.

mod common;

use std::fs;
use std::time::Duration;

use common::{TemporaryFolder, canter_in};
use serde_json::Value;

#[test]
fn the_default_gaits_alone_are_compared_and_other_settings_refused() {
    let folder = TemporaryFolder::new();
    // Without a rung to learn or to search it takes seconds.
    let arguments = ["compare", "--quick", "--rungs", "sine", "--out", "comparison", "--threads", "2"];
    let stdout = folder.canter(&arguments).succeeded();
    let first =
        "Comparing sine, stepping with 60000 env steps for each of 2 seeds, 2 jobs side by side, into comparison";
    assert_eq!(stdout.lines().next(), Some(first));
    let text = fs::read_to_string(folder.join("comparison/compare.json")).unwrap();
    let comparison: Value = serde_json::from_str(&text).unwrap();
    let speed = comparison["rungs"]["sine"]["speed_iqm"].as_f64().unwrap();
    assert_eq!(comparison["default_rung"], "sine");
    let row = stdout.lines().find(|line| line.starts_with("sine *")).unwrap();
    assert!(row.contains(&format!("{speed:.2} [")) && row.contains("1.00 ["), "{row}");
    assert!(stdout.contains("\nopen           50 % faster than the default trot: -\n"), "{stdout}");
    // Once more: nothing is left to do, and nothing changes.
    assert_eq!(folder.canter(&arguments).succeeded(), stdout);
    assert_eq!(fs::read_to_string(folder.join("comparison/compare.json")).unwrap(), text);

    let refused = folder.canter(&["compare", "--quick", "--seeds", "3", "--rungs", "sine", "--out", "comparison"]);
    let message = refused.failed_with(1);
    assert!(message.contains("(`seeds` is [1,2] there, [1,2,3] here); choose another with --out"), "{message}");
    let message = folder.canter(&["compare", "--rungs", "sine,gallop"]).failed_with(2);
    assert!(message.contains("there are sine, stepping, tuned, direct, direct-best, paper, doggo"), "{message}");
}

#[cfg(unix)]
#[test]
fn a_signal_saves_and_says_how_to_go_on() {
    let folder = TemporaryFolder::new();
    let arguments =
        ["compare", "--budget", "100000000", "--seeds", "1", "--rungs", "doggo", "--out", "c", "--threads", "1"];
    let child = canter_in(folder.path(), &arguments).spawn().unwrap();
    let metrics = folder.join("c/doggo-1/metrics.jsonl");
    while !metrics.is_file() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let kill = std::process::Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let stdout = String::from_utf8(output.stdout).unwrap();
    let last = "Stopped, saved. Go on with:  canter compare --budget 100000000 --seeds 1 --rungs doggo --out c";
    assert_eq!(stdout.lines().last(), Some(last), "{stdout}");
    assert!(!common::names(&folder.join("c/doggo-1/checkpoints")).is_empty());
}
