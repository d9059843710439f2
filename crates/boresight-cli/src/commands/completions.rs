//! `boresight completions`: shell completions and the manual page.

use crate::console;
use clap::{CommandFactory, ValueEnum};
use std::process::ExitCode;

/// What to write.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Target {
    Bash,
    Elvish,
    Fish,
    Powershell,
    Zsh,
    /// The manual page, in roff.
    Man,
}

/// Arguments of `boresight completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  boresight completions bash > ~/.local/share/bash-completion/completions/boresight")]
pub struct Args {
    /// The shell, or `man`.
    target: Target,
}

/// Writes the completions of the command `C` to standard output.
pub fn run<C: CommandFactory>(args: &Args) -> anyhow::Result<ExitCode> {
    use clap_complete::Shell;
    let mut command = C::command();
    let mut out = Vec::new();
    let shell = match args.target {
        Target::Bash => Some(Shell::Bash),
        Target::Elvish => Some(Shell::Elvish),
        Target::Fish => Some(Shell::Fish),
        Target::Powershell => Some(Shell::PowerShell),
        Target::Zsh => Some(Shell::Zsh),
        Target::Man => None,
    };
    match shell {
        Some(shell) => clap_complete::generate(shell, &mut command, "boresight", &mut out),
        None => clap_mangen::Man::new(command).render(&mut out)?,
    }
    console::print(&out)?;
    Ok(ExitCode::SUCCESS)
}
