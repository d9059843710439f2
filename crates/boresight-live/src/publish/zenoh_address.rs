//! Where events go on a zenoh network: `zenoh/KEY?connect=tcp/HOST:PORT`, and the program that speaks it.
//!
//! Why a program of its own: the `zenoh` crate brings more crates than all the rest of the live run, minutes of compiling, and a licence that the workspace does not take
//! (contrib/boresight-zenoh/README.md).

use super::program::Command;

/// What speaks zenoh.
const PROGRAM: &str = "boresight-zenoh";
const MEND: &str = "build it with: cargo install --path contrib/boresight-zenoh";
/// Longest key, bytes.
const MAX_KEY: usize = 512;

/// A place on a zenoh network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ZenohAddress {
    /// Key of the tracks' events; the state of the run goes to `status` below it.
    pub key: String,
    /// Words for the program: how the network is found, how events are written.
    options: Vec<String>,
}

impl ZenohAddress {
    /// Reads `KEY[?connect=ENDPOINT&listen=ENDPOINT&config=FILE&cbor]`.
    pub(super) fn parse(text: &str) -> Result<Self, &'static str> {
        let (key, query) = text.split_once('?').unwrap_or((text, ""));
        let bad = |c: char| c.is_control() || "*$#".contains(c);
        if key.len() > MAX_KEY || key.contains(bad) || key.starts_with('-') || key.split('/').any(str::is_empty) {
            return Err("expected a key without * $ #, such as zenoh/site/camera");
        }
        let mut options = Vec::new();
        for part in query.split('&').filter(|part| !part.is_empty()) {
            match part.split_once('=') {
                None if part == "cbor" => options.push("--cbor".into()),
                Some((name @ ("connect" | "listen" | "config"), value)) if !value.is_empty() => {
                    options.extend([format!("--{name}"), value.to_string()]);
                }
                _ => return Err("expected connect=, listen=, config= or cbor behind the ?"),
            }
        }
        Ok(Self { key: key.into(), options })
    }

    /// The same below the key, under a name.
    pub(super) fn below(&self, name: &str) -> Self {
        Self { key: format!("{}/{name}", self.key), options: self.options.clone() }
    }

    /// What is started.
    pub(super) fn command(&self) -> Command {
        let words = [self.key.clone(), "--acknowledge".into()].into_iter().chain(self.options.iter().cloned());
        Command { name: format!("zenoh/{}", self.key), program: PROGRAM.into(), words: words.collect(), mend: MEND }
    }
}
