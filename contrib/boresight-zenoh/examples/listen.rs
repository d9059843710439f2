//! Prints what is put on keys: `cargo run --example listen -- 'site/**' --connect tcp/HOST:PORT`, or `--listen tcp/ADDRESS:PORT`; a line each, key and payload.

use std::io::Write;
use zenoh::{Config, Wait};

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let mut words = std::env::args().skip(1);
    let keys = words.next().ok_or("which keys? such as 'site/**'")?;
    let mut config = Config::default();
    while let (Some(option), Some(endpoint)) = (words.next(), words.next()) {
        let key = format!("{}/endpoints", option.trim_start_matches('-'));
        config.insert_json5(&key, &format!("[{endpoint:?}]"))?;
        // A given endpoint is enough: the rest of the network is left alone.
        config.insert_json5("scouting/multicast/enabled", "false")?;
    }
    let session = zenoh::open(config).wait()?;
    let subscriber = session.declare_subscriber(keys).wait()?;
    while let Ok(sample) = subscriber.recv() {
        let mut out = std::io::stdout().lock();
        let payload = sample.payload().to_bytes();
        writeln!(out, "{} {}", sample.key_expr(), String::from_utf8_lossy(&payload))?;
        out.flush()?;
    }
    Ok(())
}
