//! Whether standard output was open when the program began.
//!
//! Rust's runtime opens `/dev/null` in the place of a standard stream that is closed (`>&-`), before `main`: what is written there is lost without an error. So it is asked
//! earlier, by a function that the loader calls (`.init_array`, as the ELF specification has it).
//! Afterwards it cannot be told: what the runtime opened has the flags, the device and the number (`/proc/self/fdinfo/1`: 0100002, read and write) that
//! Python's `subprocess.DEVNULL` and daemons give a program whose output is not wanted, and that is no mistake.
//! Limits: Linux; elsewhere a closed stream passes for one that is not read. The one file of the command with unsafe code: naming a section is, for what stands there runs before
//! the runtime; the function below allocates, asks the file system, and stores one word.

#[cfg(target_os = "linux")]
mod start {
    use std::sync::atomic::{AtomicBool, Ordering};

    static WAS_CLOSED: AtomicBool = AtomicBool::new(false);

    #[used]
    #[allow(unsafe_code)] // The name of a section, see above.
    #[unsafe(link_section = ".init_array")]
    static LOOK: extern "C" fn() = look;

    extern "C" fn look() {
        // Without /proc nothing is known, and nothing said.
        let is_there = |fd: &str| std::fs::symlink_metadata(format!("/proc/self/fd{fd}")).is_ok();
        if is_there("") && !is_there("/1") {
            WAS_CLOSED.store(true, Ordering::Relaxed);
        }
    }

    pub fn was_closed() -> bool {
        WAS_CLOSED.load(Ordering::Relaxed)
    }
}

/// Refuses a standard output that was closed when the program began.
/// # Errors
/// [`boresight::ErrorKind::Output`] if it was.
pub fn check() -> boresight::Result<()> {
    #[cfg(target_os = "linux")]
    if start::was_closed() {
        let e = boresight::Error::new(boresight::ErrorKind::Output, "is closed: what goes there would be lost");
        return Err(e.at("standard output").hint("leave out `>&-`, or write to a file"));
    }
    Ok(())
}
