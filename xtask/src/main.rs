//! Repository chores: `cargo xtask <NAME>`.

fn main() {}
