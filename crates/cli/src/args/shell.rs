//! What the user's shell knows of canter.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter completions bash > ~/.local/share/bash-completion/completions/canter
  canter completions zsh > ~/.zfunc/_canter            with ~/.zfunc in fpath
  canter completions fish > ~/.config/fish/completions/canter.fish")]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter man ~/.local/share/man/man1                   then `man canter`, `man canter-train` and so on")]
pub struct ManArgs {
    /// Folder for the pages; made if it is missing
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}
