//! The program's commit, in every form that a checkout can have. The build script's own code is what is tested.

#[path = "../build/stamp.rs"]
mod stamp;

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::TemporaryFolder;

const NO_GIT: &str = "/nonexistent/git";

/// Runs Git in a folder; the commits' dates and authors are fixed.
fn git(folder: &Path, arguments: &[&str]) -> String {
    let mut git = Command::new("git");
    git.args(["-c", "init.defaultBranch=main", "-c", "protocol.file.allow=always", "-C"]).arg(folder).args(arguments);
    git.env("GIT_CONFIG_GLOBAL", "/dev/null").env("GIT_CONFIG_SYSTEM", "/dev/null");
    // A hook's environment names another repository.
    git.env_remove("GIT_DIR").env_remove("GIT_WORK_TREE").env_remove("GIT_INDEX_FILE");
    for role in ["AUTHOR", "COMMITTER"] {
        git.env(format!("GIT_{role}_NAME"), "a").env(format!("GIT_{role}_EMAIL"), "a@b");
        git.env(format!("GIT_{role}_DATE"), "2026-03-04T23:30:00 +0200");
    }
    let output = git.output().expect("these tests need Git");
    assert!(output.status.success(), "git {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// A repository with two commits, and the last one's first seven digits.
fn repository(folder: &TemporaryFolder) -> (PathBuf, String) {
    let root = folder.path().join("repository");
    fs::create_dir_all(root.join("crates/a/src")).unwrap();
    git(&root, &["init", "--quiet"]);
    for content in ["1", "2"] {
        fs::write(root.join("crates/a/src/lib.rs"), content).unwrap();
        fs::write(root.join("README.md"), content).unwrap();
        git(&root, &["add", "--all"]);
        git(&root, &["commit", "--quiet", "--message", content]);
    }
    let hash = git(&root, &["rev-parse", "HEAD"])[..7].to_owned();
    (root, hash)
}

/// What the stamp says with and without Git's program.
fn stamps(root: &Path) -> [String; 2] {
    ["git", NO_GIT].map(|git| stamp::of(root, None, git).commit)
}

#[test]
fn a_commit_is_found_in_every_form_of_a_checkout() {
    let folder = TemporaryFolder::new();
    let (root, hash) = repository(&folder);
    let expected = [format!("{hash} 2026-03-04"), hash.clone()];
    assert_eq!(stamps(&root), expected);

    git(&root, &["pack-refs", "--all"]);
    assert!(!root.join(".git/refs/heads/main").exists());
    assert_eq!(stamps(&root), expected, "packed references");

    git(&root, &["worktree", "add", "--quiet", "-b", "other", "../worktree"]);
    let worktree = folder.path().join("worktree");
    assert!(worktree.join(".git").is_file());
    assert_eq!(stamps(&worktree), expected, "worktree");

    let source = format!("file://{}", root.display());
    git(folder.path(), &["clone", "--quiet", "--depth", "1", &source, "shallow"]);
    let shallow = folder.path().join("shallow");
    assert!(shallow.join(".git/shallow").is_file());
    assert_eq!(stamps(&shallow), expected, "shallow clone");

    git(&shallow, &["checkout", "--quiet", "--detach"]);
    assert_eq!(stamps(&shallow), expected, "detached HEAD");
}

#[test]
fn changes_of_sources_show_and_others_do_not() {
    let folder = TemporaryFolder::new();
    let (root, hash) = repository(&folder);
    fs::write(root.join("README.md"), "3").unwrap();
    assert_eq!(stamp::of(&root, None, "git").commit, format!("{hash} 2026-03-04"));
    fs::write(root.join("crates/a/src/lib.rs"), "3").unwrap();
    assert_eq!(stamp::of(&root, None, "git").commit, format!("{hash}+changes 2026-03-04"));
    git(&root, &["checkout", "--quiet", "."]);
    fs::write(root.join("crates/a/src/new.rs"), "").unwrap();
    assert_eq!(stamp::of(&root, None, "git").commit, format!("{hash}+changes 2026-03-04"));
}

#[test]
fn without_a_repository_there_is_what_was_given_or_nothing() {
    let folder = TemporaryFolder::new();
    let (root, _) = repository(&folder);
    // An archive that was unpacked inside of another repository.
    let archive = root.join("archive");
    fs::create_dir(&archive).unwrap();
    assert_eq!(stamps(&archive), ["", ""]);
    assert_eq!(stamp::of(&archive, Some("b0ff85c 2026-11-25\n"), "git").commit, "b0ff85c 2026-11-25");
    assert_eq!(stamp::of(&archive, Some(" "), "git").commit, "");
}

#[test]
fn what_it_depends_on_is_there_and_changes_with_a_commit() {
    let folder = TemporaryFolder::new();
    let (root, _) = repository(&folder);
    for is_packed in [false, true] {
        for has_log in [true, false] {
            if is_packed {
                git(&root, &["pack-refs", "--all"]);
            }
            if !has_log {
                git(&root, &["config", "core.logAllRefUpdates", "false"]);
                fs::remove_dir_all(root.join(".git/logs")).unwrap();
            }
            let places = stamp::of(&root, None, "git").depends_on;
            assert!(places.iter().all(|place| place.exists()), "{places:?}");
            assert!(places.contains(&root.join("crates/a/src")), "{places:?}");
            let before: Vec<_> = places.iter().map(|place| changed(place)).collect();
            git(&root, &["commit", "--quiet", "--allow-empty", "--message", "next"]);
            let after: Vec<_> = places.iter().map(|place| changed(place)).collect();
            assert_ne!(before, after, "packed: {is_packed}, log: {has_log}: {places:?}");
            git(&root, &["config", "core.logAllRefUpdates", "true"]);
            git(&root, &["commit", "--quiet", "--allow-empty", "--message", "writes the log"]);
        }
    }
}

/// When a file was written, or the last one in a folder, as cargo looks at it.
fn changed(place: &Path) -> std::time::SystemTime {
    let own = fs::metadata(place).unwrap().modified().unwrap();
    let inside = fs::read_dir(place).into_iter().flatten().flatten().map(|entry| changed(&entry.path()));
    inside.chain([own]).max().unwrap()
}

#[test]
fn every_file_that_is_compiled_in_counts() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    let sources = stamp::of(&root, None, "git").depends_on;
    if sources.is_empty() {
        // Not a repository: an archive of the sources.
        return;
    }
    let sources: Vec<PathBuf> = sources.iter().map(|source| source.canonicalize().unwrap()).collect();
    let mut folders: Vec<PathBuf> =
        fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path().join("src")).collect();
    let mut num_included = 0;
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() {
                folders.push(entry);
                continue;
            }
            let source = fs::read_to_string(&entry).unwrap_or_default();
            for macro_name in ["include_str!(\"", "include_bytes!(\""] {
                for (position, _) in source.match_indices(macro_name) {
                    let name = source[position + macro_name.len()..].split('"').next().unwrap();
                    // Tests of a module may read files that no program holds.
                    let included = folder.join(name);
                    if included.components().any(|part| part.as_os_str() == "tests") {
                        continue;
                    }
                    let included =
                        included.canonicalize().unwrap_or_else(|error| panic!("{}: {error}", included.display()));
                    num_included += 1;
                    let counts = sources.iter().any(|source| included.starts_with(source));
                    assert!(
                        counts,
                        "{} is in the program by {}, but not in SOURCES",
                        included.display(),
                        entry.display()
                    );
                }
            }
        }
    }
    assert!(num_included >= 10, "{num_included}");
}
