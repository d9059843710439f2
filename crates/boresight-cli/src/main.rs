//! The command `boresight`.

fn main() {}
