//! The state of the run as the lines say it: the newest for who asks, and what is said in its place when the lines end without a word.

use serde_json::Value;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Begins the schema of lines that say the state.
const STATUS: &str = "boresight.status/";

#[derive(Debug, Default)]
struct Newest {
    line: String,
    bytes: Vec<u8>,
}

/// The newest state.
#[derive(Clone, Debug, Default)]
pub struct State(Arc<Mutex<Newest>>);

impl State {
    fn inside(&self) -> std::sync::MutexGuard<'_, Newest> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a line says the state of the run.
    pub fn is_status(&self, line: &str) -> bool {
        // Most lines are of tracks; their schema stands first.
        line.contains(STATUS)
            && serde_json::from_str::<Value>(line)
                .is_ok_and(|v| v.get("schema").and_then(Value::as_str).is_some_and(|s| s.starts_with(STATUS)))
    }

    /// Takes the newest, and as it is put.
    pub fn set(&self, line: &str, bytes: Vec<u8>) {
        *self.inside() = Newest { line: line.to_string(), bytes };
    }

    /// The newest as it was put, if there is one.
    pub fn newest(&self) -> Option<Vec<u8>> {
        let newest = self.inside();
        (!newest.line.is_empty()).then(|| newest.bytes.clone())
    }

    /// What is said when the lines end: nothing if the run said that it ended, or never said anything.
    pub fn gone(&self) -> Option<String> {
        let mut value: Value = serde_json::from_str(&self.inside().line).ok()?;
        if value.get("state").and_then(Value::as_str) == Some("ended") {
            return None;
        }
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
        let object = value.as_object_mut()?;
        object.insert("state".into(), "gone".into());
        object.insert("why".into(), "the program ended without a word".into());
        object.insert("unix_s".into(), now.into());
        serde_json::to_string(&value).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_ends_without_a_word_is_gone_and_one_that_ended_is_not() {
        let state = State::default();
        assert_eq!((state.newest(), state.gone()), (None, None));
        let line = r#"{"schema":"boresight.status/1","source":"cam","state":"running","unix_s":5.0}"#;
        assert!(
            state.is_status(line) && !state.is_status(r#"{"schema":"boresight.track/1","source":"boresight.status/"}"#)
        );
        state.set(line, b"put".to_vec());
        assert_eq!(state.newest().as_deref(), Some(b"put".as_slice()));
        let gone: Value = serde_json::from_str(&state.gone().unwrap()).unwrap();
        assert_eq!([&gone["source"], &gone["state"]], ["cam", "gone"]);
        assert!(gone["unix_s"].as_f64().unwrap() > 1e9);
        state.set(&line.replace("running", "ended"), Vec::new());
        assert_eq!(state.gone(), None);
    }
}
