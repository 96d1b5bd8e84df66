//! `canter film`, from the command to the file. Needs OpenGL: `cargo xtask test --full` runs it.

mod common;

use std::fs;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{Finished, TemporaryFolder, canter_in, names, train_args};

#[test]
#[ignore = "needs OpenGL: cargo xtask test --full"]
fn a_film_lies_in_its_run_or_nowhere() {
    let folder = TemporaryFolder::new();
    folder.canter(&train_args(&["--out", "run"])).succeeded();
    let small = ["film", "run", "--size", "320x120", "--slope", "5"];
    let said = folder.canter(&[&small[..], &["--seconds", "0.2"]].concat()).succeeded();
    assert_eq!(said, "Film:     run/film.gif\n");
    assert!(fs::read(folder.join("run/film.gif")).unwrap().starts_with(b"GIF89a"));

    let long = [&small[..], &["--seconds", "60", "--out", "long.gif"]].concat();
    let child = canter_in(folder.path(), &long).spawn().unwrap();
    let begin = Instant::now();
    while !folder.join("long.gif.tmp").exists() {
        assert!(begin.elapsed() < Duration::from_secs(60), "no film begins");
        sleep(Duration::from_millis(20));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let stopped = Finished::of(&child.wait_with_output().unwrap());
    assert_eq!(stopped.failed_with(130), "\nstopping; no film is written\n");
    assert_eq!(names(folder.path()), ["run"]);
}
