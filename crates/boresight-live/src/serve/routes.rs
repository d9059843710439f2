//! The addresses of the page: the page itself, its picture, the tracks, the events, the metrics. Nothing of the file system is served.

use super::access::{Access, CHANGE_PATH, Verdict};
use super::hubs::Hubs;
use super::{metrics, viewer};
use crate::board::{add, read};
use crate::cbor::of_json;
use crate::tune::{self, Change};
use axum::Router;
use axum::body::to_bytes;
use axum::extract::{Request, State, WebSocketUpgrade};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use futures_util::stream::{self, select_all};
use serde::Deserialize;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use tokio::sync::broadcast::error::RecvError;

const HTML: &str = include_str!("page.html");
const CSS: &str = include_str!("page.css");
const JS: &str = include_str!("page.js");
const OPENAPI: &str = include_str!("openapi.json");
const TUNING: &str = include_str!("tuning.js");

/// Longest body of a change, bytes.
const MOST_WISHED: usize = 1024;

/// What every answer says to the browser: run nothing of others, stand in no frame, guess no type, keep nothing.
const HEADERS: [(&str, &str); 6] = [
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cache-control", "no-store"),
];

/// What the handlers share.
#[derive(Clone)]
pub struct Shared {
    /// What is shown: the sources.
    pub hubs: Hubs,
    /// Requests that were refused.
    pub n_refused: Arc<AtomicU64>,
    /// Who may see it.
    pub access: Arc<Access>,
    /// Viewers at once.
    pub most_viewers: u64,
}

/// All addresses, behind the guard.
pub fn router(shared: Shared) -> Router {
    let text =
        |kind: &'static str, body: &'static str| get(move || async move { ([(header::CONTENT_TYPE, kind)], body) });
    Router::new()
        .route("/", text("text/html; charset=utf-8", HTML))
        .route("/page.css", text("text/css; charset=utf-8", CSS))
        .route("/page.js", text("text/javascript; charset=utf-8", JS))
        .route("/tuning.js", text("text/javascript; charset=utf-8", TUNING))
        .route("/api/openapi.json", text("application/json", OPENAPI))
        .route("/api/sources", get(sources))
        .route("/api/tracks", get(tracks))
        .route(CHANGE_PATH, get(config).post(change))
        .route("/api/stream", get(events))
        .route("/api/view", get(view))
        .route("/metrics", get(numbers))
        .layer(from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

/// Refuses what may not be answered, and puts the headers on everything.
async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let verdict = shared.access.judge(request.method(), request.uri(), request.headers());
    let mut response = match verdict {
        Verdict::Pass => next.run(request).await,
        Verdict::Welcome(cookie) => {
            // On to the address without the token, so that it stays in no history.
            let headers = [(header::SET_COOKIE, cookie), (header::LOCATION, "/".to_string())];
            (StatusCode::SEE_OTHER, headers).into_response()
        }
        Verdict::Refuse(code, why) => {
            add(&shared.n_refused, 1);
            let mut refused = (code, why).into_response();
            // What a refused request goes on to say is not read.
            refused.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
            refused
        }
    };
    let headers: &mut HeaderMap = response.headers_mut();
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn json(text: String) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], text).into_response()
}

/// JSON, or CBOR where the request asks for that.
fn answer(headers: &HeaderMap, text: String) -> Response {
    let asked = headers.get(header::ACCEPT).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let wants_cbor =
        asked.split(',').any(|kind| kind.split(';').next().unwrap_or_default().trim() == "application/cbor");
    match wants_cbor.then(|| of_json(&text)).flatten() {
        Some(bytes) => ([(header::CONTENT_TYPE, "application/cbor")], bytes).into_response(),
        None => json(text),
    }
}

async fn sources(State(shared): State<Shared>, headers: HeaderMap) -> Response {
    answer(&headers, shared.hubs.json())
}

async fn tracks(State(shared): State<Shared>, uri: Uri, headers: HeaderMap) -> Response {
    match shared.hubs.one(&uri) {
        Ok(hub) => answer(&headers, hub.seen().json(&hub.board)),
        Err(refused) => refused.into_response(),
    }
}

async fn config(State(shared): State<Shared>, uri: Uri, headers: HeaderMap) -> Response {
    match shared.hubs.one(&uri) {
        Ok(hub) => {
            let (toml, reasons) = hub.board.configuration();
            let mut told = serde_json::json!({ "toml": toml, "reasons": reasons });
            if let Some(token) = shared.access.change_token() {
                let dials = tune::dials(&toml, hub.board.detects()).into_iter().map(|(dial, value)| {
                    let mut dial = serde_json::to_value(dial).unwrap_or_default();
                    dial["value"] = value.into();
                    dial
                });
                (told["dials"], told["change_token"]) = (dials.collect(), token.into());
            }
            answer(&headers, told.to_string())
        }
        Err(refused) => refused.into_response(),
    }
}

#[derive(Deserialize)]
struct Wish {
    key: String,
    value: f64,
}

/// Takes a change of one parameter; the run makes it before its next frame, and says it.
async fn change(State(shared): State<Shared>, request: Request) -> Response {
    let hub = match shared.hubs.one(request.uri()) {
        Ok(hub) => hub,
        Err(refused) => return refused.into_response(),
    };
    let is_json = request.headers().get(header::CONTENT_TYPE).is_some_and(|kind| kind == "application/json");
    if !is_json {
        return (StatusCode::UNSUPPORTED_MEDIA_TYPE, "expected application/json\n").into_response();
    }
    let Ok(body) = to_bytes(request.into_body(), MOST_WISHED).await else {
        return (StatusCode::PAYLOAD_TOO_LARGE, "a change is shorter\n").into_response();
    };
    let Ok(wish) = serde_json::from_slice::<Wish>(&body) else {
        let why = "expected {\"key\":\"tracker.coast-s\",\"value\":2}\n";
        return (StatusCode::BAD_REQUEST, why).into_response();
    };
    let (toml, _) = hub.board.configuration();
    if toml.is_empty() {
        return (StatusCode::CONFLICT, "the configuration is not chosen yet\n").into_response();
    }
    match Change::of(&toml, hub.board.detects(), &wish.key, wish.value) {
        Err(e) => (StatusCode::UNPROCESSABLE_ENTITY, format!("{e}\n")).into_response(),
        Ok(change) if hub.board.ask_change(change) => {
            let told = serde_json::json!({ "change": change.words(), "toml": change.toml() });
            (StatusCode::ACCEPTED, json(told.to_string())).into_response()
        }
        Ok(_) => (StatusCode::TOO_MANY_REQUESTS, "the run has not yet taken those before\n").into_response(),
    }
}

async fn numbers(State(shared): State<Shared>) -> Response {
    let boards: Vec<_> = shared.hubs.all().iter().map(|hub| &*hub.board).collect();
    let text = metrics::text(&boards, read(&shared.n_refused));
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text).into_response()
}

/// Events as they come, of the source that is named or of all; one who lags too far behind is told how many are lost.
async fn events(State(shared): State<Shared>, uri: Uri) -> Response {
    let hubs = match shared.hubs.named(&uri) {
        Ok(Some(hub)) => std::slice::from_ref(hub),
        Ok(None) => shared.hubs.all(),
        Err(refused) => return refused.into_response(),
    };
    let each = hubs.iter().map(|hub| {
        let lines = stream::unfold(hub.events.subscribe(), |mut receiver| async move {
            let event = match receiver.recv().await {
                Ok(json) => Event::default().data(&*json),
                Err(RecvError::Lagged(n)) => Event::default().event("lost").data(n.to_string()),
                Err(RecvError::Closed) => return None,
            };
            Some((Ok::<_, Infallible>(event), receiver))
        });
        Box::pin(lines)
    });
    Sse::new(select_all(each)).keep_alive(KeepAlive::default()).into_response()
}

async fn view(State(shared): State<Shared>, uri: Uri, upgrade: WebSocketUpgrade) -> Response {
    let hub = match shared.hubs.one(&uri) {
        Ok(hub) => hub,
        Err(refused) => return refused.into_response(),
    };
    let Some(seat) = viewer::enter(hub, &shared.hubs, shared.most_viewers) else {
        return (StatusCode::SERVICE_UNAVAILABLE, "all places are taken\n").into_response();
    };
    let upgrade = upgrade.max_message_size(viewer::MAX_WORD).max_frame_size(viewer::MAX_WORD);
    let wants_video = uri.query().unwrap_or_default().split('&').any(|pair| pair == "video=h264");
    upgrade.on_upgrade(move |socket| async move {
        match wants_video {
            true => viewer::serve_coded(socket, seat).await,
            false => viewer::serve(socket, seat).await,
        }
    })
}
