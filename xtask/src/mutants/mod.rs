//! How strong the tests are: all sampled mutants in one build, each run against the tests.
//!
//! `cargo mutants --list --json` gives the mutants; instead of one build for each, a second checkout is instrumented so that it holds
//! them all and the environment variable `MUTANT` switches one on. Those that do not compile are found by rustc's errors and
//! taken out. Then for each: the tests of its file, of its room, of the crate, the integration tests; the first failure ends it.

mod build;
mod instrument;
mod tests_of;

use anyhow::Context as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant;
use tests_of::Outcome;

/// Options.
#[derive(clap::Args)]
pub struct Args {
    /// What `cargo mutants --list --json` printed, of one package.
    list: PathBuf,
    /// Another checkout of the same commit, which is changed: `git worktree add --detach DIR`.
    #[arg(long)]
    tree: PathBuf,
    /// Package whose mutants they are.
    #[arg(long, default_value = "boresight")]
    package: String,
    /// Its integration tests that are run on what the unit tests leave.
    #[arg(long, default_value = "it")]
    test: Vec<String>,
    /// A mutant whose tests take longer is caught, seconds.
    #[arg(long, default_value_t = 120)]
    timeout_s: u64,
    /// Only the tests of the mutant's file and room: a first look, whose survivors `--only` then takes further.
    #[arg(long)]
    nearest: bool,
    /// Only the mutants of these numbers.
    #[arg(long, value_delimiter = ',')]
    only: Vec<usize>,
    /// A line for each mutant: number, outcome, name; numbers that stand there already are left out.
    #[arg(long, default_value = "mutants.tsv")]
    out: PathBuf,
}

/// # Errors
/// If the list cannot be read, the tree not be built, or its tests fail with no mutant on.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let list = std::fs::read_to_string(&args.list).with_context(|| args.list.display().to_string())?;
    let mutants: Vec<instrument::Mutant> = serde_json::from_str(&list)?;
    let done = std::fs::read_to_string(&args.out).unwrap_or_default();
    let is_done = |k: usize| done.lines().any(|l| l.split('\t').next() == Some(&k.to_string()));
    // Known from an earlier run: the same text is not compiled twice.
    let known = done.lines().filter(|l| l.split('\t').nth(1) == Some("not compiled"));
    let known = known.filter_map(|l| l.split('\t').next()?.parse().ok()).collect();
    let unviable = build::instrumented(&mutants, &args.tree, &args.package, known)?;
    let programs = build::tests(&args.tree, &args.package, &args.test)?;
    let mut out = std::fs::File::options().append(true).create(true).open(&args.out)?;
    let begin = Instant::now();
    let known = if args.nearest { Vec::new() } else { tests_of::failing_without(&programs)? };
    println!(
        "without a mutant: {:.0} s, {} tests fail and are left out: {known:?}",
        begin.elapsed().as_secs_f64(),
        known.len()
    );
    for (k, mutant) in mutants.iter().enumerate() {
        if is_done(k) || !(args.only.is_empty() || args.only.contains(&k)) {
            continue;
        }
        let begin = Instant::now();
        let outcome = match unviable.contains(&k) {
            true => Outcome::NotCompiled,
            false => tests_of::hunt(k, mutant, &programs, &known, args.timeout_s, args.nearest)?,
        };
        let line = format!("{k}\t{outcome}\t{:.1} s\t{}", begin.elapsed().as_secs_f64(), mutant.name);
        println!("{line}");
        writeln!(out, "{line}")?;
    }
    Ok(())
}
