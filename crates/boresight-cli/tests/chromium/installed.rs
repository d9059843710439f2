//! The browser that is installed, and tests that show as ignored where there is none.

use libtest_mimic::Trial;
use std::path::{Path, PathBuf};

/// Where a browser is.
fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome-headless-shell"];
    std::env::split_paths(&path).flat_map(|dir| names.map(|n| dir.join(n))).find(|p| p.is_file())
}

/// A test of this name with the browser; ignored, with the reason, without one.
pub fn trial(name: impl Into<String>, run: impl FnOnce(&Path) + Send + 'static) -> Trial {
    const MISSING: &str = "needs a browser: apt-get install chromium";
    let found = browser();
    let is_missing = found.is_none();
    let trial = Trial::test(name, move || {
        run(&found.ok_or(MISSING)?);
        Ok(())
    });
    if is_missing { trial.with_kind(MISSING).with_ignored_flag(true) } else { trial }
}
