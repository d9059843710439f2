//! `cargo xtask docs`: writes what is generated in `docs/`: the parameter reference and the configuration's JSON schema.

use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};

/// Arguments of `docs`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Write nothing; fail if a file is out of date.
    #[arg(long)]
    check: bool,
}

/// Writes or checks the files.
pub fn run(args: &Args) -> Result<()> {
    let dir = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs");
    put(args, &dir.join("parameters.md"), &boresight::config::reference())?;
    put(args, &dir.join("boresight.schema.json"), &schema()?)
}

/// The JSON schema as `boresight config --schema` prints it.
pub fn schema() -> Result<String> {
    Ok(serde_json::to_string_pretty(&boresight::config::schema())? + "\n")
}

fn put(args: &Args, path: &Path, text: &str) -> Result<()> {
    if std::fs::read_to_string(path).is_ok_and(|old| old == text) {
        return Ok(());
    }
    if args.check {
        bail!("{} is out of date: run `cargo xtask docs`", path.display());
    }
    std::fs::write(path, text).with_context(|| path.display().to_string())?;
    println!("{}", path.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generated_chapters_are_current() {
        run(&Args { check: true }).unwrap();
    }
}
