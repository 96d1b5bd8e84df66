//! Release archives: the program with all that it needs on a machine that has neither Rust nor MuJoCo, and the wheel. The
//! same commit gives the same bytes, wherever the checkout lies.

use std::env;
use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::UNIX_EPOCH;

use crate::builds::{self, cargo, target_dir};
use crate::files::{copy, failed, make, remove, write};
use crate::full::{finish, python_with};
use crate::portable::{self, BUILD_PACKAGES, MACHINE, Places};
use crate::{Failure, python, web};

/// Where the program in the archive looks for MuJoCo's library.
const RUN_PATH: &str = "$ORIGIN/../lib";

/// What is in the archive as it is in the checkout.
const DOCUMENTS: [&str; 5] = ["README.md", "CHANGELOG.md", "LICENSE", "LICENSE-MIT", "LICENSE-APACHE"];

/// Shells, and where each of them looks for completions below `share`.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "bash-completion/completions/canter"),
    ("zsh", "zsh/site-functions/_canter"),
    ("fish", "fish/vendor_completions.d/canter.fish"),
];

/// What the archive is made from.
struct Commit {
    /// [s since 1970]
    time: String,
}

/// Makes `target/release-archives/`: archive, wheel, and the hash of each. Gives their paths.
///
/// # Errors
/// A tree with changes, unless they are allowed; what could not be built.
pub fn archives(root: &Path, allow_changes: bool) -> Result<Vec<PathBuf>, Failure> {
    let commit = commit(root, allow_changes)?;
    let folder = target_dir(root).join("release-archives");
    remove(&folder)?;
    // The dashboard's page is in the program.
    web::build(root)?;
    let python = python_with(&python::folder(root)?, &BUILD_PACKAGES)?;
    let environment = same_everywhere(root, &commit)?;
    let mut build = cargo(root, "build");
    build.args(["--release", "--locked", "--package", "canter"]).envs(environment.clone());
    builds::passed(build.status().map_err(builds::cannot_start_cargo)?)?;
    let canter = build_folder(root).join("release/canter");
    names_no_place(root, &canter)?;
    has_the_page(root, &canter)?;

    let archive = pack(&stage(root, &canter, &python, &folder.join("stage"))?, &folder, &commit)?;
    remove(&folder.join("stage"))?;
    try_archive(&archive, &away())?;
    let wheel = python::wheel_of(root, &canter, &environment)?;
    names_no_place(root, &build_folder(root).join("release/libcanter_native.so"))?;
    let beside = folder.join(wheel.file_name().unwrap_or_default());
    copy(&wheel, &beside)?;
    Ok(vec![with_hash(&archive)?, archive, with_hash(&beside)?, beside])
}

/// Makes an archive from the ordinary build, unpacks it far from here, and has its program walk a robot with nothing in
/// the environment.
///
/// # Errors
/// What does not work there, or differs when it is made again.
pub fn test(root: &Path) -> Result<(), Failure> {
    let folder = target_dir(root).join("release-test");
    remove(&folder)?;
    let python = python_with(&python::folder(root)?, &BUILD_PACKAGES)?;
    let commit = Commit { time: "1000000000".to_owned() };
    let canter = builds::build_canter(root)?;
    let hashes = ["one", "other"].map(|name| {
        let stage = stage(root, &canter, &python, &folder.join(name).join("stage"))?;
        if name == "other" {
            // As if it had been made at another time.
            let readme = stage.join("README.md");
            let opened = File::options().write(true).open(&readme);
            opened
                .and_then(|opened| opened.set_modified(UNIX_EPOCH))
                .map_err(|error| failed("write", &readme, &error))?;
        }
        hash(&pack(&stage, &folder.join(name), &commit)?)
    });
    let [one, other] = hashes;
    let (one, other) = (one?, other?);
    if one != other {
        return Err(Failure::Task(format!("two archives of the same program differ: {one} and {other}")));
    }

    try_archive(&folder.join("one").join(archive_name()), &away())?;
    println!("release: {} works on its own, and is the same when made again", archive_name());
    Ok(())
}

/// A folder far from the checkout.
fn away() -> PathBuf {
    env::temp_dir().join(format!("canter-release-{}", std::process::id()))
}

/// Unpacks an archive into a folder, uses what is in it, and removes the folder.
fn try_archive(archive: &Path, away: &Path) -> Result<(), Failure> {
    let result = use_archive(archive, away);
    remove(away)?;
    result
}

fn use_archive(archive: &Path, away: &Path) -> Result<(), Failure> {
    make(away)?;
    let mut tar = Command::new("tar");
    tar.arg("--extract").arg("--file").arg(archive).arg("--directory").arg(away);
    finish(tar, "the archive cannot be unpacked")?;
    let top = away.join(name());
    let run = |arguments: &[&str]| {
        let mut canter = Command::new(top.join("bin/canter"));
        canter.args(arguments).env_clear().current_dir(away);
        finish(canter, &format!("the archive's program fails at {arguments:?}"))
    };
    let version = run(&["--version"])?;
    if !version.starts_with(concat!("canter ", env!("CARGO_PKG_VERSION"))) {
        return Err(Failure::Task(format!("the archive's program says that it is {version}")));
    }
    let verdict = run(&["eval", "--robot", "doggo", "--prior", "stepping", "--episodes", "2"])?;
    if !verdict.contains("no fall in 2 episodes") {
        return Err(Failure::Task(format!("the archive's program does not walk as it should:\n{verdict}")));
    }
    // Were the run path another, the checkout's library would do instead, and nobody would see.
    let mut libraries = Command::new("ldd");
    libraries.arg(top.join("bin/canter"));
    let libraries = finish(libraries, "cannot see the libraries of the archive's program")?;
    let mujoco = libraries.lines().find(|line| line.contains("libmujoco")).unwrap_or("no libmujoco").trim();
    if !mujoco.contains(&*top.to_string_lossy()) {
        return Err(Failure::Task(format!("the archive's program takes another library than its own: {mujoco}")));
    }
    let expected =
        ["share/man/man1/canter.1", "share/man/man1/canter-train.1", "licenses/crates.txt", "licenses/mujoco/LICENSE"];
    let completions = COMPLETIONS.map(|(_, place)| format!("share/{place}"));
    for file in expected.into_iter().chain(completions.iter().map(String::as_str)).chain(DOCUMENTS) {
        if fs::metadata(top.join(file)).map_or(0, |found| found.len()) == 0 {
            return Err(Failure::Task(format!("the archive has no {file}, or nothing in it")));
        }
    }
    Ok(())
}

fn name() -> String {
    format!("canter-{}-{MACHINE}", env!("CARGO_PKG_VERSION"))
}

fn archive_name() -> String {
    format!("{}.tar.gz", name())
}

/// A target folder of its own: other settings would make cargo build everything anew each time.
fn build_folder(root: &Path) -> PathBuf {
    target_dir(root).join("release-build")
}

/// The commit, which nothing may differ from.
fn commit(root: &Path, allow_changes: bool) -> Result<Commit, Failure> {
    let git = |arguments: &[&str]| {
        let mut git = Command::new("git");
        git.env_remove("GIT_DIR").env_remove("GIT_WORK_TREE").env_remove("GIT_INDEX_FILE");
        git.arg("-C").arg(root).args(arguments);
        finish(git, "a release is made from a commit, which Git has to know")
    };
    let changes = git(&["status", "--porcelain", "--untracked-files=all"])?;
    if !changes.is_empty() && !allow_changes {
        return Err(Failure::Task(format!(
            "a release is made from a commit, and this tree differs from it:\n{}\n\
             Commit or remove the changes; --allow-changes makes archives of them that nobody can make again.",
            changes.trim_end()
        )));
    }
    Ok(Commit { time: git(&["show", "--no-patch", "--format=%ct", "HEAD"])?.trim().to_owned() })
}

/// What makes a build forget where it was made, and when.
fn same_everywhere(root: &Path, commit: &Commit) -> Result<Vec<(&'static str, OsString)>, Failure> {
    let mut sysroot = Command::new("rustc");
    sysroot.args(["--print", "sysroot"]).current_dir(root);
    let sysroot = finish(sysroot, "cannot ask rustc where it lies")?;
    let library = Path::new(sysroot.trim()).join("lib/rustlib/src/rust");
    let home = cargo_home();
    let mut places = vec![(root.to_path_buf(), "/canter"), (home.clone(), "/cargo"), (library, "/rust")];
    // Named after where crates come from, which may be a mirror. The last one that fits counts.
    let sources = fs::read_dir(home.join("registry/src")).into_iter().flatten().flatten();
    places.extend(sources.map(|source| (source.path(), "/cargo/registry")));
    let flags: Vec<String> =
        places.iter().map(|(place, shown)| format!("--remap-path-prefix={}={shown}", place.display())).collect();
    Ok(vec![
        ("CARGO_TARGET_DIR", build_folder(root).into_os_string()),
        ("CARGO_ENCODED_RUSTFLAGS", flags.join("\u{1f}").into()),
        // For crates/cli/build.rs, whose own run paths name this checkout.
        ("CANTER_RUN_PATH", RUN_PATH.into()),
        ("SOURCE_DATE_EPOCH", commit.time.clone().into()),
        // What stands there for other builds is nothing for a release.
        ("CANTER_COMMIT", OsString::new()),
    ])
}

fn cargo_home() -> PathBuf {
    env::var_os("CARGO_HOME").map_or_else(
        || PathBuf::from(env::var_os("HOME").unwrap_or_default()).join(".cargo"),
        |home| env::current_dir().unwrap_or_default().join(home),
    )
}

/// Fails where a program names the checkout or cargo's folder: made in another one, it would differ.
fn names_no_place(root: &Path, program: &Path) -> Result<(), Failure> {
    // Not the folders themselves: `/src` stands in other paths too.
    let places = [root.join("crates"), root.join("python/src"), cargo_home().join("registry/src")];
    let content = fs::read(program).map_err(|error| failed("read", program, &error))?;
    for place in places {
        if contains(&content, place.to_string_lossy().as_bytes()) {
            return Err(Failure::Task(format!("{} names {}, where it was made", program.display(), place.display())));
        }
    }
    Ok(())
}

/// Fails where the program was built without the dashboard's page, or with an older one.
fn has_the_page(root: &Path, program: &Path) -> Result<(), Failure> {
    let content = fs::read(program).map_err(|error| failed("read", program, &error))?;
    let script = web::script(root);
    let page = fs::read(&script).map_err(|error| failed("read", &script, &error))?;
    if contains(&content, &page) {
        return Ok(());
    }
    Err(Failure::Task(format!("{} does not hold {}", program.display(), script.display())))
}

fn contains(content: &[u8], part: &[u8]) -> bool {
    // Most places already differ in the first byte.
    let first = part.first().copied().unwrap_or_default();
    content.windows(part.len().max(1)).any(|window| window[0] == first && window == part)
}

/// Puts all that goes into the archive into `folder`, and gives its top.
fn stage(root: &Path, canter: &Path, python: &Path, folder: &Path) -> Result<PathBuf, Failure> {
    let top = folder.join(name());
    let places = Places {
        program: &top.join("bin/canter"),
        library: &top.join("lib"),
        licenses: &top.join("licenses/mujoco"),
        crates: &top.join("licenses/crates.txt"),
        packages: &["canter"],
        run_path: RUN_PATH,
    };
    portable::put(root, canter, python, &places)?;
    for document in DOCUMENTS {
        copy(&root.join(document), &top.join(document))?;
    }
    let share = top.join("share");
    let mut man = Command::new(places.program);
    man.arg("man").arg(share.join("man/man1"));
    finish(man, "the program wrote no manual pages")?;
    for (shell, place) in COMPLETIONS {
        let mut completions = Command::new(places.program);
        completions.args(["completions", shell]);
        let script = finish(completions, "the program wrote no completions")?;
        write(&share.join(place), &script)?;
    }
    Ok(top)
}

/// Packs a folder with nothing of this machine in it: names sorted, no owner, the commit's time.
fn pack(top: &Path, folder: &Path, commit: &Commit) -> Result<PathBuf, Failure> {
    let archive = folder.join(archive_name());
    let mut tar = Command::new("tar");
    tar.args(["--create", "--format=ustar", "--sort=name", "--owner=0", "--group=0", "--numeric-owner"]);
    tar.args(["--mode=u=rwX,go=rX", &format!("--mtime=@{}", commit.time)]);
    // Neither name nor time in gzip's header.
    tar.args(["--use-compress-program", "gzip --no-name --best"]);
    tar.arg("--file").arg(&archive).arg("--directory").arg(top.parent().unwrap_or(top)).arg(name());
    finish(tar, "cannot pack the archive")?;
    Ok(archive)
}

/// Writes a file's hash beside it, in the form that `sha256sum --check` reads.
fn with_hash(file: &Path) -> Result<PathBuf, Failure> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let path = file.with_file_name(format!("{name}.sha256"));
    write(&path, &format!("{}  {name}\n", hash(file)?))?;
    Ok(path)
}

fn hash(file: &Path) -> Result<String, Failure> {
    let mut sum = Command::new("sha256sum");
    sum.arg(file);
    Ok(finish(sum, "cannot hash")?.split(' ').next().unwrap_or_default().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_that_differs_from_its_commit_is_refused() {
        let root = env::temp_dir().join(format!("canter-xtask-release-{}", std::process::id()));
        fs::create_dir_all(&root).unwrap();
        let git = |arguments: &[&str]| {
            let mut git = Command::new("git");
            git.arg("-C").arg(&root).args(["-c", "user.name=a", "-c", "user.email=a@b"]).args(arguments);
            git.env("GIT_COMMITTER_DATE", "1700000000 +0000");
            git.env("GIT_CONFIG_GLOBAL", "/dev/null").env("GIT_CONFIG_SYSTEM", "/dev/null");
            git.env_remove("GIT_DIR").env_remove("GIT_WORK_TREE").env_remove("GIT_INDEX_FILE");
            assert!(git.output().is_ok_and(|output| output.status.success()), "git {arguments:?}");
        };
        git(&["init", "--quiet"]);
        git(&["commit", "--quiet", "--allow-empty", "--message", "first"]);
        let time = |allow_changes| commit(&root, allow_changes).map(|commit| commit.time);
        assert!(time(false).is_ok_and(|time| time == "1700000000"));
        fs::write(root.join("new"), "").unwrap();
        let refused = time(false);
        let allowed = time(true);
        fs::remove_dir_all(&root).unwrap();
        let Err(Failure::Task(message)) = refused else { panic!("accepted") };
        assert!(message.contains("?? new") && message.contains("--allow-changes"), "{message}");
        assert!(allowed.is_ok_and(|time| time == "1700000000"));
    }
}
