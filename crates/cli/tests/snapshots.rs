//! What the program prints without simulating. After a wanted change: `CANTER_UPDATE_SNAPSHOTS=1 cargo test`.

mod common;

use std::fs;
use std::path::Path;

use common::TemporaryFolder;

#[track_caller]
fn assert_snapshot(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots").join(name);
    if std::env::var_os("CANTER_UPDATE_SNAPSHOTS").is_some_and(|value| value == "1") {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
    }
    let expected = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    if let Some((i, (old, new))) =
        expected.lines().zip(text.lines()).enumerate().find(|(_, (expected, found))| expected != found)
    {
        panic!("{}:{}\n  expected: {old}\n     found: {new}", path.display(), i + 1);
    }
    assert!(expected == text, "{}: expected {} bytes, found {}", path.display(), expected.len(), text.len());
}

#[test]
fn help() {
    let folder = TemporaryFolder::new();
    assert_snapshot("help.txt", &folder.canter(&["--help"]).succeeded());
    for command in [
        "train",
        "resume",
        "eval",
        "compare",
        "sweep",
        "report",
        "serve",
        "export",
        "run",
        "film",
        "view",
        "robots",
        "config",
        "completions",
        "man",
    ] {
        assert_snapshot(&format!("help-{command}.txt"), &folder.canter(&[command, "--help"]).succeeded());
    }
    for command in ["fit", "table"] {
        assert_snapshot(&format!("help-gait-{command}.txt"), &folder.canter(&["gait", command, "--help"]).succeeded());
    }
    for command in ["new", "check"] {
        let help = folder.canter(&["robot", command, "--help"]).succeeded();
        assert_snapshot(&format!("help-robot-{command}.txt"), &help);
    }
    // Without arguments the help is the complaint.
    assert_snapshot("help-nothing.txt", &folder.canter(&[]).failed_with(2));
    let version = folder.canter(&["--version"]).succeeded();
    // Behind it stands the commit, where there is one.
    let stamp = env!("CANTER_STAMP");
    let stamp = if stamp.is_empty() { String::new() } else { format!(" ({stamp})") };
    assert_eq!(version, format!("canter {}{stamp}\n", env!("CARGO_PKG_VERSION")));
    assert_eq!(common::names(folder.path()), Vec::<String>::new());
}

#[test]
fn robots() {
    let folder = TemporaryFolder::new();
    assert_snapshot("robots.txt", &folder.canter(&["robots"]).succeeded());
    assert_snapshot("robots-doggo.txt", &folder.canter(&["robots", "doggo"]).succeeded());
}

#[test]
fn config() {
    let folder = TemporaryFolder::new();
    assert_snapshot("config.txt", &folder.canter(&["config"]).succeeded());
    let paper = folder.canter(&["config", "paper"]).succeeded();
    assert_snapshot("config-paper.txt", &paper);
    // What is printed is a configuration: the same again, with an override.
    fs::write(folder.join("own.toml"), &paper).unwrap();
    assert_eq!(folder.canter(&["config", "own.toml"]).succeeded(), paper);
    let changed = folder.canter(&["config", "own.toml", "--set", "ppo.gamma=0.5"]).succeeded();
    assert_eq!(changed, paper.replace("\ngamma = 0.99\n", "\ngamma = 0.5\n"));
    assert_ne!(changed, paper);
}
