//! Where the real data lie.

use std::path::PathBuf;

/// The folder of the real data: `BORESIGHT_TEST_DATA`, by default `../shared/data` beside the repository.
pub fn test_data() -> PathBuf {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    std::env::var_os("BORESIGHT_TEST_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from)
}
