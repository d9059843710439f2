//! Fuzz target: scene files of the simulator, built.
#![no_main]

use boresight::sim::{SceneConfig, Seed};

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Ok(scene) = SceneConfig::from_toml(text) {
        let _ = scene.build(Seed::new(1));
    }
});
