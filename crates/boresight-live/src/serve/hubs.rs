//! The sources of a page: which of them a request speaks of, and what all of them are.

use super::hub::Hub;
use crate::board::read;
use axum::http::{StatusCode, Uri};
use percent_encoding::percent_decode_str;
use std::sync::Arc;

/// The sources, in the order of the command line; at least one.
#[derive(Clone)]
pub struct Hubs(Arc<[Arc<Hub>]>);

/// Why a request finds no source.
pub type NoSource = (StatusCode, &'static str);

impl Hubs {
    /// These sources.
    pub fn new(hubs: Vec<Arc<Hub>>) -> Self {
        Self(hubs.into())
    }

    /// All of them.
    pub fn all(&self) -> &[Arc<Hub>] {
        &self.0
    }

    /// The source that `?source=NAME` names; `None` where nothing is named.
    /// # Errors
    /// A name that none has.
    pub fn named(&self, uri: &Uri) -> Result<Option<&Arc<Hub>>, NoSource> {
        let mut pairs = uri.query().unwrap_or("").split('&').filter_map(|pair| pair.split_once('='));
        let Some((_, name)) = pairs.find(|(key, _)| *key == "source") else { return Ok(None) };
        let spaces = name.replace('+', " ");
        let name = percent_decode_str(&spaces).decode_utf8_lossy();
        let found = self.0.iter().find(|hub| hub.board.source == name);
        found.map(Some).ok_or((StatusCode::NOT_FOUND, "no source has that name: /api/sources lists them\n"))
    }

    /// The source that a request speaks of: the one that is named, or the only one.
    /// # Errors
    /// A name that none has, or none where there are several.
    pub fn one(&self, uri: &Uri) -> Result<&Arc<Hub>, NoSource> {
        match (self.named(uri)?, &*self.0) {
            (Some(hub), _) => Ok(hub),
            (None, [only]) => Ok(only),
            (None, _) => {
                Err((StatusCode::BAD_REQUEST, "there are several sources: add ?source=NAME; /api/sources lists them\n"))
            }
        }
    }

    /// Viewers of all sources.
    pub fn n_viewers(&self) -> u64 {
        self.0.iter().map(|hub| read(&hub.board.counts.viewers)).sum()
    }

    /// All of them as JSON.
    pub fn json(&self) -> String {
        let one = |hub: &Arc<Hub>| {
            let (said, tracks) = (hub.board.said(), read(&hub.board.counts.now));
            let (state, rate_hz) = (said.state.word(), hub.board.rate_hz());
            serde_json::json!({ "source": hub.board.source, "state": state, "why": said.why, "rate_hz": rate_hz, "tracks": tracks })
        };
        let sources: Vec<_> = self.0.iter().map(one).collect();
        serde_json::json!({ "schema": "boresight.sources/1", "sources": sources }).to_string()
    }
}
