//! Disks that are full or cannot be written, in a small file system of the test's own. Mounting needs root.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Finished, TemporaryFolder, canter_in, names, train_args, train_args_with_steps};
use crate::killed::outcome;

/// 200 iterations, with a checkpoint after every tenth.
const STEPS: &str = "25600";
const LONGER: [&str; 4] = ["--set", "training.checkpoint_env_steps=1280", "--set", "network.critic_hidden=256"];

/// A file system in memory, unmounted when dropped.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mount(path: PathBuf, size: &str) -> Self {
        fs::create_dir_all(&path).unwrap();
        let size = format!("size={size}");
        run("mount", &["-t", "tmpfs", "-o", &size, "tmpfs", path.to_str().unwrap()]);
        Self(path)
    }

    fn make_read_only(&self) {
        run("mount", &["-o", "remount,ro", self.0.to_str().unwrap()]);
    }

    /// Fills the disk but for some bytes.
    fn fill(&self, bytes_left: u64) -> PathBuf {
        let path = self.0.join("ballast");
        let mut ballast = OpenOptions::new().create(true).append(true).open(&path).unwrap();
        while ballast.write_all(&[1; 4096]).is_ok() {}
        let len = ballast.metadata().unwrap().len();
        ballast.set_len(len.saturating_sub(bytes_left)).unwrap();
        path
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("--lazy").arg(&self.0).status();
    }
}

#[track_caller]
fn run(program: &str, args: &[&str]) {
    let output = Command::new(program).args(args).output().unwrap();
    assert!(output.status.success(), "`{program}` needs root: {}", String::from_utf8_lossy(&output.stderr));
}

fn num_lines(path: &Path) -> usize {
    fs::read_to_string(path).map_or(0, |text| text.lines().count())
}

#[test]
#[ignore = "needs root"]
fn a_full_disk_stops_the_run_with_a_message_and_it_goes_on_when_there_is_room() {
    let folder = TemporaryFolder::new();
    folder.canter(&train_args_with_steps(STEPS, &[&LONGER[..], &["--out", "undisturbed"]].concat())).succeeded();
    let expected = outcome(&folder.join("undisturbed"));

    let disk = SmallDisk::mount(folder.join("disk"), "32m");
    let mut child =
        canter_in(folder.path(), &train_args_with_steps(STEPS, &[&LONGER[..], &["--out", "disk/run"]].concat()))
            .spawn()
            .unwrap();
    let run = folder.join("disk/run");
    while num_lines(&run.join("metrics.jsonl")) < 15 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before the disk was full");
    }
    // Half a checkpoint fits: lines of metrics do, for a while.
    let checkpoint = run.join("checkpoints").join(&names(&run.join("checkpoints"))[0]);
    let ballast = disk.fill(fs::metadata(checkpoint).unwrap().len() / 2);
    let finished = Finished::of(&child.wait_with_output().unwrap());
    assert_eq!(finished.code, Some(1), "{finished:?}");
    assert!(finished.stderr.starts_with("error: disk/run/checkpoints/"), "{}", finished.stderr);
    assert!(finished.stderr.contains("no room left on the disk"), "{}", finished.stderr);
    assert!(names(&run.join("checkpoints")).iter().all(|name| name.ends_with(".safetensors")));

    // Still full: nothing is lost by trying.
    let refused = folder.canter(&["resume", "disk/run"]);
    assert_eq!(refused.code, Some(1), "{refused:?}");
    assert!(refused.stderr.contains("MB are free here"), "{}", refused.stderr);

    fs::remove_file(ballast).unwrap();
    folder.canter(&["resume", "disk/run", "--threads", "2"]).succeeded();
    for (name, bytes) in outcome(&run) {
        assert!(expected[&name] == bytes, "{name}");
    }
}

#[test]
#[ignore = "needs root"]
fn a_disk_without_room_or_that_cannot_be_written_is_refused_before_training() {
    let folder = TemporaryFolder::new();
    let small = SmallDisk::mount(folder.join("small"), "2m");
    let complaint = folder.canter(&train_args(&["--out", "small/run"]));
    assert_eq!(complaint.code, Some(1), "{complaint:?}");
    let start = "error: small/run: 1 MB are free here, a training needs 9 MB for its checkpoints and results";
    assert!(complaint.stderr.starts_with(start), "{}", complaint.stderr);
    small.make_read_only();
    let complaint = folder.canter(&train_args(&["--out", "small/other"])).failed_with(1);
    assert_eq!(complaint, "error: small/other: Read-only file system (os error 30)\n");
}
