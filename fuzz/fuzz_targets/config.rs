//! Fuzz target: configuration files.
#![no_main]

use boresight::Config;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _ = Config::from_toml(text, "config.toml");
});
