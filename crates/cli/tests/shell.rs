//! What shells and `man` get from canter.

mod common;

use std::fs;
use std::process::Command;

use common::{TemporaryFolder, names};

#[test]
#[cfg(unix)]
fn bash_completes_commands_and_choices() {
    let folder = TemporaryFolder::new();
    let script = folder.canter(&["completions", "bash"]).succeeded();
    let path = folder.join("canter.bash");
    fs::write(&path, script).unwrap();
    let complete = |words: &str| {
        let ask = format!(
            "source '{}'; COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); \
             _canter canter \"${{COMP_WORDS[-1]}}\" \"${{COMP_WORDS[-2]}}\"; echo \"${{COMPREPLY[@]}}\"",
            path.display()
        );
        let output = Command::new("bash").args(["-c", &ask]).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert_eq!(complete("canter robu"), "robustness\n");
    assert_eq!(complete("canter export run --format ''"), "c onnx rust table gait\n");
    assert_eq!(complete("canter robot ch"), "check\n");
}

#[test]
fn every_shell_has_a_script() {
    let folder = TemporaryFolder::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = folder.canter(&["completions", shell]).succeeded();
        assert!(script.contains("robustness"), "{shell}");
    }
    folder.canter(&["completions", "csh"]).failed_with(2);
}

#[test]
fn every_command_that_the_help_names_has_a_page() {
    let folder = TemporaryFolder::new();
    folder.canter(&["man", "pages/man1"]).succeeded();
    let pages = names(&folder.join("pages/man1"));
    let help = folder.canter(&["--help"]).succeeded();
    let (_, commands) = help.split_once("Commands:\n").unwrap();
    let commands = commands.lines().take_while(|line| !line.is_empty()).filter_map(|line| {
        let rest = line.strip_prefix("  ")?;
        rest.split(' ').next().filter(|name| !name.is_empty())
    });
    let mut num_commands = 0;
    for command in commands.filter(|command| *command != "help") {
        num_commands += 1;
        assert!(pages.contains(&format!("canter-{command}.1")), "{command}: {pages:?}");
    }
    assert!(num_commands > 15, "{help}");
    let page = fs::read_to_string(folder.join("pages/man1/canter-export.1")).unwrap();
    assert!(page.contains(".SH OPTIONS") && page.contains("\\-\\-format"), "{page}");
    let refused = folder.canter(&["man", "pages/man1/canter.1"]).failed_with(1);
    assert!(refused.contains("pages/man1/canter.1"), "{refused}");
}
