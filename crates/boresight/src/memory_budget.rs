//! The memory that reading one picture, or the histories of one scan, may take: checked before it is taken, whatever a header claims.
//!
//! One budget for the process, as its memory is: half of the machine's (of the control group's, where it has less), or what
//! [`set_memory_budget`] says. It only refuses; no result depends on it.

use crate::{Error, ErrorKind, Result};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes; 0 until somebody says otherwise.
static GIVEN: AtomicU64 = AtomicU64::new(0);

/// Memory of a machine that does not tell, bytes.
const USUAL: u64 = 8 << 30;

/// Sets the memory that reading one picture, or the histories of one scan (`tracker.mht`), may take, bytes, above 0.
pub fn set_memory_budget(bytes: u64) {
    GIVEN.store(bytes.max(1), Ordering::Relaxed);
}

/// The memory that reading one picture may take, bytes.
fn budget() -> u64 {
    static OWN: OnceLock<u64> = OnceLock::new();
    match GIVEN.load(Ordering::Relaxed) {
        0 => *OWN.get_or_init(|| {
            let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
            let group = read("/sys/fs/cgroup/memory.max").trim().parse::<u64>().ok();
            total_of(&read("/proc/meminfo")).unwrap_or(USUAL).min(group.unwrap_or(u64::MAX)) / 2
        }),
        given => given,
    }
}

/// The machine's memory, bytes, as Linux tells it.
fn total_of(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|l| l.strip_prefix("MemTotal:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// Refuses a picture of `width` x `height` px whose reading takes `per_px` bytes a pixel beyond the budget.
pub(crate) fn afford(width: usize, height: usize, per_px: u64) -> Result<()> {
    let (need, allowed) = ((width as u64).saturating_mul(height as u64).saturating_mul(per_px), budget());
    if need <= allowed {
        return Ok(());
    }
    let mb = |bytes: u64| bytes.div_ceil(1 << 20);
    let what = format!(
        "{width} x {height} pixels take {} MB of memory to read, more than the {} MB allowed",
        mb(need),
        mb(allowed)
    );
    Err(Error::new(ErrorKind::Unsupported, what).hint("if the file is sound, allow more: --max-memory, in MB"))
}

/// Refuses `n` things of `each` bytes beyond the budget; `what` names them.
pub(crate) fn afford_all(n: usize, each: u64, what: &str) -> Result<()> {
    let (need, allowed) = ((n as u64).saturating_mul(each), budget());
    if need <= allowed {
        return Ok(());
    }
    let mb = |bytes: u64| bytes.div_ceil(1 << 20);
    let text = format!("{n} {what} take {} MB of memory, more than the {} MB allowed", mb(need), mb(allowed));
    Err(Error::new(ErrorKind::Numeric, text)
        .hint("lower tracker.mht.max-leaves or n-scan, or allow more: --max-memory, in MB"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beyond_the_budget_is_refused_with_both_numbers() {
        assert!(afford(4000, 4000, 8).is_ok());
        let error = afford(1 << 30, 1 << 30, 8).unwrap_err().to_string();
        assert!(error.contains("take 8796093022208 MB") && error.contains("--max-memory"), "{error}");
    }

    #[test]
    fn histories_beyond_the_budget_are_refused() {
        assert!(afford_all(1000, 4096, "histories").is_ok());
        let error = afford_all(usize::MAX, 4096, "histories").unwrap_err().to_string();
        assert!(error.contains("histories take") && error.contains("--max-memory"), "{error}");
    }

    #[test]
    fn the_machine_is_asked() {
        assert_eq!(total_of("MemTotal:       24012345 kB\nMemFree: 1 kB\n"), Some(24_012_345 * 1024));
        assert_eq!(total_of("nothing"), None);
        assert!(budget() > 1 << 20);
    }
}
