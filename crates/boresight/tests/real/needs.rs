//! A test with what it needs: files of the data folder, programs.

use libtest_mimic::Trial;
use std::path::PathBuf;
use std::process::Command;

/// A file or folder of the data folder.
pub fn data(name: &str) -> PathBuf {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::env::var_os("BORESIGHT_TEST_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from).join(name)
}

/// The need of the program `ffmpeg`; every other need is a file or folder of the data folder.
pub const FFMPEG: &str = "ffmpeg";

/// Whether something that a test needs is missing here.
fn is_missing(need: &str) -> bool {
    match need {
        FFMPEG => Command::new(FFMPEG).arg("-version").output().is_err(),
        name => !data(name).exists(),
    }
}

/// A test and what it needs.
pub struct Test {
    name: String,
    needs: Vec<String>,
    run: Box<dyn FnOnce() + Send>,
}

impl Test {
    /// A test of a name that is made at run time.
    pub fn new(name: impl Into<String>, needs: &[&str], run: impl FnOnce() + Send + 'static) -> Self {
        Self { name: name.into(), needs: needs.iter().map(ToString::to_string).collect(), run: Box::new(run) }
    }

    /// As the harness runs it: ignored, with the reason as its kind, if something is missing.
    pub fn trial(self) -> Trial {
        let missing: Vec<&str> = self.needs.iter().map(String::as_str).filter(|n| is_missing(n)).collect();
        // The folder says enough.
        let reason = missing.first().map(|n| format!("no {}", n.split('/').next().unwrap_or(n)));
        let run = self.run;
        let trial = Trial::test(self.name, move || {
            run();
            Ok(())
        });
        match reason {
            None => trial,
            Some(reason) => trial.with_kind(reason).with_ignored_flag(true),
        }
    }
}

/// `real_tests! { name needs ["file", FFMPEG]; .. }` lists a module's tests; `real_tests! { f: .. }` calls the list `f`.
macro_rules! real_tests {
    ($($name:ident needs $needs:expr;)+) => { $crate::needs::real_tests! { tests: $($name needs $needs;)+ } };
    ($list:ident: $($name:ident needs $needs:expr;)+) => {
        pub fn $list() -> Vec<$crate::needs::Test> {
            vec![$($crate::needs::Test::new(concat!(module_path!(), "::", stringify!($name)), &$needs, $name)),+]
        }
    };
}
pub(crate) use real_tests;
