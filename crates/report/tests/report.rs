//! Reports on sample files: what is on the page, what is refused, and that the bytes do not change.

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use canter_report::{ReportError, report_compare, report_run, report_sweep};
use common::{TemporaryFolder, comparison, sweep, write_comparison, write_json, write_run};
use serde_json::{Value, json};

const RECORDED: [&str; 6] = ["film-strip", "footfall", "foot-paths", "speed-per-step", "torque", "leg-space"];

/// All files below a folder with their bytes.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            files.extend(contents(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            files.insert(name, fs::read(&path).unwrap());
        }
    }
    files
}

fn read_json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Cells of a CSV file without quotation marks: rows of the column names' values.
fn csv(path: &Path) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.split_terminator("\r\n").map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let names = lines.next().unwrap();
    lines.map(|cells| names.iter().cloned().zip(cells).collect()).collect()
}

#[track_caller]
fn assert_figures(folder: &Path, page: &str, names: &[&str]) {
    let mut found: Vec<String> = contents(&folder.join("figures")).into_keys().collect();
    found.retain(|name| name.ends_with(".svg"));
    let mut expected: Vec<String> = names.iter().map(|name| format!("{name}.svg")).collect();
    expected.sort();
    assert_eq!(found, expected);
    for name in names {
        assert!(page.contains(&format!("<figure id=\"fig-{name}\">")), "{name} is not on the page");
        let svg = fs::read_to_string(folder.join(format!("figures/{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n"), "{name}");
        assert!(!svg.contains("NaN") && !svg.contains("inf "), "{name} has a coordinate that is none");
    }
}

#[test]
fn a_run_has_its_figures_and_its_numbers() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    write_run(&run, 1, true);
    let written = report_run(std::slice::from_ref(&run), &run).unwrap();
    assert_eq!((written.num_figures, written.num_tables), (10, 2));
    assert_eq!(written.left_out, Vec::<String>::new());
    let page = fs::read_to_string(written.page).unwrap();
    assert_figures(&run, &page, &[&["ladder", "learning", "energy", "falls"][..], &RECORDED].concat());
    let eval = read_json(&run.join("eval.json"));
    let number = |pointer: &str| eval.pointer(pointer).unwrap().as_f64().unwrap();
    let verdict = format!(
        "<h1>The learned gait walks {:.2} m/s: {:.2} times as fast as the default gait sine ({:.2} m/s), with 1 fall in 20 episodes.</h1>",
        number("/policy/speed_m_per_s"),
        number("/speed_ratio"),
        number("/default_speed_m_per_s")
    );
    assert!(page.contains(&verdict), "{verdict}");
    for (row, report) in
        csv(&run.join("tables/gaits.csv")).iter().zip(["/policy", "/default_gaits/sine", "/default_gaits/stepping"])
    {
        for (column, key) in [
            ("speed_m_per_s", "speed_m_per_s"),
            ("speed_m_per_s_low", "speed_ci/0"),
            ("speed_m_per_s_high", "speed_ci/1"),
            ("falls", "falls"),
            ("drift_m", "drift_m"),
            ("power_w", "power_w"),
            ("cost_of_transport", "cost_of_transport"),
            ("episode_return", "episode_return"),
        ] {
            assert_eq!(row[column].parse::<f64>().unwrap(), number(&format!("{report}/{key}")), "{report} {column}");
        }
        let shown = format!("<td class=\"n\">{:.3} <small>", number(&format!("{report}/speed_m_per_s")));
        assert!(page.contains(&shown), "{shown}");
    }
    assert_eq!(csv(&run.join("tables/learning.csv")).len(), 150);
}

#[test]
fn the_page_needs_nothing_but_itself() {
    let folder = TemporaryFolder::new();
    write_comparison(&folder.join("compare"), &comparison());
    report_compare(&folder.join("compare")).unwrap();
    let page = fs::read_to_string(folder.join("compare/report.html")).unwrap();
    // The name of SVG, which no browser asks for.
    let page = page.replace("http://www.w3.org/2000/svg", "");
    for other in ["http:", "https:", "src=", "@import", "url(", "fetch(", "XMLHttpRequest"] {
        assert!(!page.contains(other), "{other}");
    }
    assert!(page.contains("default-src 'none'"));
}

#[test]
fn several_runs_share_a_page() {
    let folder = TemporaryFolder::new();
    let runs = [folder.join("first"), folder.join("second")];
    write_run(&runs[0], 1, true);
    write_run(&runs[1], 2, false);
    let out = folder.join("both");
    let written = report_run(&runs, &out).unwrap();
    assert_eq!(written.left_out, ["No episode of second was recorded; it is missing in the figures from recordings."]);
    let page = fs::read_to_string(written.page).unwrap();
    assert!(page.contains(&written.left_out[0]));
    let gaits: Vec<String> = csv(&out.join("tables/gaits.csv")).iter().map(|row| row["gait"].clone()).collect();
    assert_eq!(gaits, ["first", "second", "sine", "stepping"]);
    assert!(page.contains("2 trainings walk"));

    // Another protocol: the numbers do not belong in one table.
    let mut eval = read_json(&runs[1].join("eval.json"));
    eval["protocol"]["slope_deg"] = json!(20.0);
    write_json(&runs[1].join("eval.json"), &eval);
    let error = report_run(&runs, &out).unwrap_err();
    assert!(matches!(error, ReportError::Different { .. }), "{error}");
    assert!(error.to_string().contains("measured in different ways"), "{error}");
    assert!(matches!(report_run(&[], &out), Err(ReportError::NoRun)));
}

#[test]
fn a_comparison_has_every_figure_and_its_numbers() {
    let folder = TemporaryFolder::new();
    let (path, comparison) = (folder.join("compare"), comparison());
    write_comparison(&path, &comparison);
    let written = report_compare(&path).unwrap();
    assert_eq!((written.num_figures, written.num_tables, written.left_out.len()), (16, 4, 0));
    let page = fs::read_to_string(written.page).unwrap();
    let own = ["ladder", "return", "uphill", "slope", "friction", "mass", "delay", "push", "energy", "falls"];
    assert_figures(&path, &page, &[&own[..], &RECORDED].concat());
    assert!(page.contains(
        "<h1>Canter walks 2.41 m/s: 4.55 times as fast as the default gait (0.53 m/s) and 1.41 times as fast as the best \
         constant gait that a search found, with no fall in 100 episodes.</h1>"
    ));
    let rows = csv(&path.join("tables/gaits.csv"));
    let order: Vec<&str> = rows.iter().map(|row| row["gait"].as_str()).take(3).collect();
    assert_eq!(order, ["default sine", "firmware's trot", "tuned by search"]);
    let seeds = csv(&path.join("tables/seeds.csv"));
    assert_eq!(seeds.len(), 2 + 5 * 5);
    for (row, seed) in seeds
        .iter()
        .filter(|row| row["gait"] == "canter")
        .zip(comparison["rungs"]["doggo"]["seeds"].as_array().unwrap())
    {
        assert_eq!(row["speed_m_per_s"].parse::<f64>().unwrap(), seed["speed_m_per_s"].as_f64().unwrap());
        assert_eq!(row["seed"], seed["seed"].to_string());
    }
    for verdict in ["holds yes", "holds no", "holds open"] {
        assert!(page.contains(&format!("<td class=\"{verdict}\">")), "{verdict}");
    }
    // 7 gaits; 10, 6, 5, 5 and 4 values.
    assert_eq!(csv(&path.join("tables/sweeps.csv")).len(), 7 * 30);
}

#[test]
fn the_same_files_give_the_same_bytes_and_old_figures_go() {
    let folder = TemporaryFolder::new();
    let (first, second) = (folder.join("a/compare"), folder.join("b/compare"));
    for path in [&first, &second] {
        write_comparison(path, &comparison());
        report_compare(path).unwrap();
    }
    let once = contents(&first);
    assert!(once == contents(&second), "another folder, other bytes");
    report_compare(&first).unwrap();
    assert!(once == contents(&first), "another time, other bytes");

    // Without recordings their figures go, and what others have put there stays.
    fs::write(first.join("figures/mine.svg"), "").unwrap();
    let mut without = comparison();
    without["trajectories"] = json!({});
    without["uphill_trajectories"] = json!({});
    without["sweeps"] = json!({});
    without["quick"] = json!(true);
    write_json(&first.join("compare.json"), &without);
    let written = report_compare(&first).unwrap();
    assert_eq!(written.left_out.len(), 2, "{:?}", written.left_out);
    let page = fs::read_to_string(written.page).unwrap();
    assert!(page.contains("No episode was recorded") && page.contains("A quick comparison"));
    assert!(!page.contains("<script"));
    let left = contents(&first.join("figures"));
    let left: Vec<&str> = left.keys().map(String::as_str).filter(|name| name.ends_with(".svg")).collect();
    assert_eq!(left, ["energy.svg", "falls.svg", "ladder.svg", "mine.svg", "return.svg"]);
    assert!(!first.join("tables/sweeps.csv").exists());
}

#[test]
fn exported_open_loops_stand_beside_the_policy() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    write_run(&run, 1, false);
    let stepping = read_json(&run.join("eval.json"))["default_gaits"]["stepping"].clone();
    let entry = |passed: bool, is_open_loop: bool| serde_json::json!({ "passed": passed, "is_open_loop": is_open_loop, "exported": stepping });
    let exports =
        serde_json::json!({ "c": entry(true, false), "gait": entry(true, true), "table": entry(false, true) });
    fs::write(run.join("export.json"), exports.to_string()).unwrap();
    report_run(std::slice::from_ref(&run), &run).unwrap();
    let rows = csv(&run.join("tables/gaits.csv"));
    let of = |label: &str| rows.iter().find(|row| row["gait"] == label);
    assert!(of("exported c").is_none());
    assert_eq!(of("exported gait").unwrap()["role"], "open-loop export");
    let table = of("exported table").unwrap();
    assert_eq!(table["role"], "open-loop export (not safe)");
    assert_eq!(table["speed_m_per_s"].parse::<f64>().ok(), stepping["speed_m_per_s"].as_f64());
    let mut broken = exports;
    broken["table"]["exported"]["speeds_m_per_s"] = serde_json::json!([]);
    fs::write(run.join("export.json"), broken.to_string()).unwrap();
    let error = report_run(std::slice::from_ref(&run), &run).unwrap_err().to_string();
    assert!(error.contains("export.json") && error.contains("`table` has no speeds"), "{error}");
}

#[test]
fn a_run_without_recordings_says_so() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    write_run(&run, 1, false);
    let written = report_run(std::slice::from_ref(&run), &run).unwrap();
    assert_eq!(written.num_figures, 4);
    let page = fs::read_to_string(written.page).unwrap();
    assert!(page.contains("No episode was recorded (there is no trajectories folder)"));
    assert!(!page.contains("id=\"replay\""));
}

#[test]
fn hostile_names_are_text() {
    const HOSTILE: &str = "</script><script>alert(1)</script>\"'&<img onerror=x>";
    let folder = TemporaryFolder::new();
    let path = folder.join("compare");
    let mut comparison = comparison();
    comparison["robot"] = json!(HOSTILE);
    comparison["protocol"]["text"] = json!(HOSTILE);
    comparison["claims"][0]["sentence"] = json!(HOSTILE);
    comparison["sweeps"][HOSTILE] = comparison["sweeps"]["friction"].clone();
    comparison["sweeps"]["friction"]["unit"] = json!(HOSTILE);
    for name in ["doggo", "sine"] {
        comparison["rungs"][name]["label"] = json!(HOSTILE);
        comparison["rungs"][name]["description"] = json!(HOSTILE);
    }
    comparison["rungs"]["direct"]["seeds"][0]["falls_by_cause"] = json!({ HOSTILE: 3 });
    write_comparison(&path, &comparison);
    let trajectory_path = path.join("trajectories/doggo.json");
    let mut trajectory = read_json(&trajectory_path);
    trajectory["legs"][0] = json!(HOSTILE);
    trajectory["terminated"] = json!(HOSTILE);
    write_json(&trajectory_path, &trajectory);
    report_compare(&path).unwrap();
    for (name, bytes) in
        contents(&path).into_iter().filter(|(name, _)| name.ends_with(".html") || name.ends_with(".svg"))
    {
        let text = String::from_utf8(bytes).unwrap();
        assert!(!text.contains("<script>alert") && !text.contains("<img"), "{name}");
        if name == "report.html" {
            // The data of the replay, its script, and nothing else.
            assert_eq!(text.matches("<script").count(), 2);
            assert_eq!(text.matches("</script").count(), 2);
            assert!(text.contains("\\u003c/script>\\u003cscript>alert(1)"), "the label is not in the replay");
        }
    }
    let run = folder.join("run<img onerror=x>");
    write_run(&run, 1, true);
    report_run(&[run.clone(), run.clone()], &run).unwrap();
    assert!(!fs::read_to_string(run.join("report.html")).unwrap().contains("<img"));
}

/// A change to a sample file, and what the complaint has to say.
type Damage = (&'static str, fn(&mut Value), &'static str);

#[test]
fn wrong_files_are_refused_with_their_name_and_what_to_do() {
    let folder = TemporaryFolder::new();
    let path = folder.join("compare");
    write_comparison(&path, &comparison());
    let damages: [Damage; 12] = [
        ("compare.json", |file| file["version"] = json!(2), "version 2, but this canter reads version 1"),
        (
            "compare.json",
            |file| file["default_rung"] = json!("trot"),
            "`default_rung` is `trot`, which is none of `rungs`",
        ),
        ("compare.json", |file| file["rungs"]["doggo"]["seeds"] = json!([]), "rung `doggo` has no seeds"),
        ("compare.json", |file| file["rungs"]["doggo"]["speed_iqm"] = json!("fast"), "invalid type: string \"fast\""),
        ("compare.json", |file| file["rungs"]["doggo"]["kind"] = json!("magic"), "unknown variant `magic`"),
        ("compare.json", |file| file["sweeps"]["delay_s"]["values"] = json!([0.0]), "[5, 5, 5] numbers for 1 values"),
        (
            "compare.json",
            |file| file["trajectories"]["doggo"] = json!("../../secret.json"),
            "is not a path below the folder",
        ),
        ("compare.json", |file| file["trajectories"]["horse"] = json!("horse.json"), "a rung `horse`, which is none"),
        ("compare.json", |file| file["rungs"]["doggo"]["seeds"][0]["falls"] = json!(21), "21 falls in 20 episodes"),
        ("trajectories/doggo.json", |file| file["phase"] = json!([0.5]), "`phase` has 1 rows for 1000 steps"),
        (
            "trajectories/doggo.json",
            |file| file["foot_m"][7] = json!([]),
            "a row of `foot_m` has not one entry for each of 4",
        ),
        (
            "trajectories/doggo.json",
            |file| file["control_dt_s"] = json!(0.0),
            "`control_dt_s` is 0, expected a number from 0.000001 to 1000000",
        ),
    ];
    for (name, damage, complaint) in damages {
        let file = path.join(name);
        let good = fs::read_to_string(&file).unwrap();
        let mut value: Value = serde_json::from_str(&good).unwrap();
        damage(&mut value);
        write_json(&file, &value);
        let error = report_compare(&path).unwrap_err().to_string();
        assert!(error.contains(&file.display().to_string()) && error.contains(complaint), "{complaint}: {error}");
        assert!(!path.join("report.html").exists(), "{complaint}");
        fs::write(&file, good).unwrap();
    }
    fs::remove_file(path.join("trajectories/doggo.json")).unwrap();
    let error = report_compare(&path).unwrap_err();
    assert!(matches!(error, ReportError::Missing { .. }), "{error}");

    let run = folder.join("run");
    let refused = || report_run(std::slice::from_ref(&run), &run).unwrap_err().to_string();
    fs::create_dir_all(&run).unwrap();
    assert!(refused().contains("eval.json: there is no such file; it comes from `canter train`"), "{}", refused());
    write_run(&run, 1, true);
    let metrics = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    fs::write(run.join("metrics.jsonl"), "{\"env_steps\": 1}\n").unwrap();
    assert!(refused().contains("line 1: missing field"), "{}", refused());
    // Half a line at the end is what a killed process leaves.
    fs::write(run.join("metrics.jsonl"), metrics + "{\"env_st").unwrap();
    report_run(std::slice::from_ref(&run), &run).unwrap();
    let mut eval = read_json(&run.join("eval.json"));
    eval["prior"]["speeds_m_per_s"] = json!([1.0]);
    write_json(&run.join("eval.json"), &eval);
    assert!(refused().contains("`prior` has 1 speeds for 20 episodes"), "{}", refused());
    eval.as_object_mut().unwrap().remove("policy");
    eval["prior"] = eval["default_gaits"]["sine"].clone();
    write_json(&run.join("eval.json"), &eval);
    assert!(refused().contains("it has no `policy`"), "{}", refused());
}

#[test]
fn numbers_at_the_ends_of_their_ranges_can_be_drawn_or_are_refused() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    write_run(&run, 1, true);
    let report = || report_run(std::slice::from_ref(&run), &run);
    let change = |name: &str, change: &dyn Fn(&mut Value)| {
        let path = run.join(name);
        let good = fs::read_to_string(&path).unwrap();
        let changed: String = good
            .lines()
            .map(|line| {
                let mut value: Value = serde_json::from_str(line).unwrap();
                change(&mut value);
                format!("{value}\n")
            })
            .collect();
        fs::write(&path, changed).unwrap();
        let result = report().map(|_| assert_no_nan(&run)).map_err(|error| error.to_string());
        fs::write(&path, good).unwrap();
        result
    };
    // Nothing was done; a number that no axis has room for; so far away that an axis has no room for what differs.
    change("metrics.jsonl", &|line| line["env_steps"] = json!(0)).unwrap();
    change("metrics.jsonl", &|line| line["approx_kl"] = json!(5e-324)).unwrap();
    change("metrics.jsonl", &|line| line["power_w"] = json!(1e17)).unwrap();
    change("eval.json", &|file| file["policy"]["speed_ci"] = json!([-1e19, 1e19])).unwrap();
    let trajectory = "trajectories/learned.json";
    change(trajectory, &|file| file["foot_m"][500][0] = json!([1e18, 0.0, 0.0])).unwrap();
    change(trajectory, &|file| file["position_m"][500] = json!([-1e18, 1e18, 0.1])).unwrap();
    change(trajectory, &|file| file["settle_s"] = json!(-1e18)).unwrap();
    change(trajectory, &|file| file["time_s"][3] = json!(1e18)).unwrap();

    for (name, pointer, value, complaint) in [
        ("eval.json", "/policy/speed_m_per_s", json!(1e300), "the number 1e+300 is beyond all measure"),
        ("eval.json", "/policy/falls", json!(u64::MAX), "18446744073709551615 is more than can be counted"),
        ("metrics.jsonl", "/accidents/rollover", json!(u64::MAX), "18446744073709551615 is more than can be counted"),
        (trajectory, "/control_dt_s", json!(1e-300), "expected a number from 0.000001 to 1000000"),
        (trajectory, "/legs", json!(vec!["leg"; 17]), "1000 steps of 17 legs"),
    ] {
        let error = change(name, &|file| *file.pointer_mut(pointer).unwrap() = value.clone()).unwrap_err();
        assert!(error.contains(complaint), "{error}");
    }
}

/// Whether all figures of a report have numbers for coordinates.
#[track_caller]
fn assert_no_nan(folder: &Path) {
    for (name, bytes) in contents(&folder.join("figures")) {
        let text = String::from_utf8_lossy(&bytes);
        assert!(!text.contains("NaN") && !text.contains("inf "), "{name}");
    }
}

#[test]
fn recordings_of_odd_gaits_can_be_drawn() {
    let folder = TemporaryFolder::new();
    let path = folder.join("compare");
    write_comparison(&path, &comparison());
    // One that stands still without a cycle, and one that fell at once.
    for (name, steps) in [("doggo", 300), ("direct", 2)] {
        let file = path.join(format!("trajectories/{name}.json"));
        let mut trajectory = read_json(&file);
        for column in trajectory.as_object_mut().unwrap().values_mut() {
            if let Value::Array(rows) = column
                && rows.len() > 100
            {
                rows.truncate(steps);
                let first = rows[0].clone();
                rows.fill(first);
            }
        }
        trajectory["time_s"] = (1..=steps).map(|step| json!(step as f64 * 0.01)).collect();
        write_json(&file, &trajectory);
    }
    report_compare(&path).unwrap();
    assert_no_nan(&path);
}

#[test]
fn a_sweep_over_numbers_is_a_dial_and_over_words_a_ladder() {
    let temporary = TemporaryFolder::new();
    let folder = temporary.join("sweep");
    fs::create_dir(&folder).unwrap();
    write_json(&folder.join("sweep.json"), &sweep("policy.authority", ["0", "0.5", "1"]));
    report_sweep(&folder).unwrap();
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    assert_figures(&folder, &page, &["dial"]);
    // A copy of the page may lie far from the trainings.
    assert!(page.contains("Each training has left a folder of its own") && !page.contains("seed, beside this page"));
    // Of three points with 1, 2 and 3 times the default's 0.5 m/s.
    assert!(
        page.contains(
            "The most is won with 1: 1.50 m/s, 3.00 times its default gait trot, with 2 falls in 40 episodes."
        )
    );
    let rows = csv(&folder.join("tables/points.csv"));
    let column = |name: &str| rows.iter().map(|row| row[name].clone()).collect::<Vec<_>>();
    assert_eq!(column("point"), ["0", "0.5", "1"]);
    assert_eq!(column("speed_m_per_s_low"), ["0.4", "0.9", "1.4"]);
    assert_eq!(column("falls"), ["0", "1", "2"]);

    write_json(&folder.join("sweep.json"), &sweep("preset", ["<b>dog</b>", "q8bot", "hexapod"]));
    report_sweep(&folder).unwrap();
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    assert_figures(&folder, &page, &["ladder"]);
    assert!(page.contains("&lt;b&gt;dog&lt;/b&gt;") && !page.contains("<b>dog"));

    let mut broken = sweep("preset", ["a", "b", "c"]);
    broken["points"][1]["values"] = json!([]);
    write_json(&folder.join("sweep.json"), &broken);
    let message = report_sweep(&folder).unwrap_err().to_string();
    assert!(message.contains("a point has not one value for each key"), "{message}");
}
