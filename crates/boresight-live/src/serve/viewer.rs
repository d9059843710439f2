//! One viewer of the page: gets the newest message, says when it has drawn it, and only then gets the next. A slow one gets fewer.

use super::hub::{Hub, coded_message};
use super::hubs::Hubs;
use axum::extract::ws::{Message, WebSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{sleep, timeout};

/// A viewer that draws nothing for so long is gone, or asleep; it connects again when it wakes.
const PATIENCE: Duration = Duration::from_secs(30);
/// A run that is silent says that it is there.
const ALIVE: Duration = Duration::from_secs(10);

/// Coded pictures that are sent and not yet drawn, at most; coded pictures that wait for a viewer before it has fallen behind.
const UNDER_WAY: u32 = 2;
const BEHIND: usize = 8;

/// Largest message that a viewer may send, bytes: it has one word to say.
pub const MAX_WORD: usize = 256;

/// Counts viewers, however one leaves.
struct Counted(Arc<Hub>);

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.board.counts.viewers.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Takes a place among the viewers of all sources, if there is one left.
pub fn enter(hub: &Arc<Hub>, all: &Hubs, most: u64) -> Option<Seat> {
    let seat = Seat(Counted(Arc::clone(hub)));
    hub.board.counts.viewers.fetch_add(1, Ordering::SeqCst);
    (all.n_viewers() <= most).then_some(seat)
}

/// A place among the viewers.
pub struct Seat(Counted);

/// Serves one viewer until it leaves.
pub async fn serve(mut socket: WebSocket, seat: Seat) {
    let hub = Arc::clone(&seat.0.0);
    let mut newest = hub.message.subscribe();
    newest.mark_changed();
    loop {
        let changed = tokio::select! {
            changed = timeout(ALIVE, newest.changed()) => changed,
            word = socket.recv() => match word {
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                Some(Ok(_)) => continue,
            },
        };
        let message = match changed {
            Ok(Ok(())) => Message::Binary(newest.borrow_and_update().clone()),
            Ok(Err(_)) => return,
            Err(_) => Message::Ping(Default::default()),
        };
        let waits = matches!(message, Message::Binary(_));
        if !matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(()))) {
            return;
        }
        if waits && !has_drawn(&mut socket).await {
            return;
        }
    }
}

/// Serves one viewer who takes H.264, until it leaves: a picture needs those before it, so several may be on their way; one who has fallen behind goes on at the next key.
pub async fn serve_coded(mut socket: WebSocket, seat: Seat) {
    let hub = Arc::clone(&seat.0.0);
    let mut newest = hub.coded.subscribe();
    hub.wants_key.store(true, Ordering::SeqCst);
    let first = Message::Binary(coded_message(&hub.seen().json(&hub.board), "", &[]));
    if !matches!(timeout(PATIENCE, socket.send(first)).await, Ok(Ok(()))) {
        return;
    }
    let (mut n_under_way, mut waits_for_key, mut heard) = (1, true, Instant::now());
    loop {
        let message = tokio::select! {
            coded = newest.recv(), if n_under_way < UNDER_WAY => match coded {
                Ok(Some(coded)) => {
                    waits_for_key |= newest.len() > BEHIND;
                    if waits_for_key && coded.key == Some(false) {
                        hub.wants_key.store(true, Ordering::SeqCst);
                        continue;
                    }
                    waits_for_key &= coded.key != Some(true);
                    n_under_way += 1;
                    Message::Binary(coded.bytes)
                }
                Err(RecvError::Lagged(_)) => {
                    waits_for_key = true;
                    continue;
                }
                // Such frames cannot be coded: the viewer asks for JPEG.
                Ok(None) | Err(RecvError::Closed) => return,
            },
            word = socket.recv() => match word {
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                Some(Ok(Message::Text(_))) => {
                    (n_under_way, heard) = (n_under_way.saturating_sub(1), Instant::now());
                    continue;
                }
                Some(Ok(_)) => continue,
            },
            () = sleep(ALIVE) => Message::Ping(Default::default()),
        };
        let is_gone = n_under_way >= UNDER_WAY && heard.elapsed() > PATIENCE;
        if is_gone || !matches!(timeout(PATIENCE, socket.send(message)).await, Ok(Ok(()))) {
            return;
        }
    }
}

/// Waits until the viewer says that it has drawn; `false` if it leaves, or takes too long.
async fn has_drawn(socket: &mut WebSocket) -> bool {
    loop {
        match timeout(PATIENCE, socket.recv()).await {
            Ok(Some(Ok(Message::Text(_)))) => return true,
            Ok(Some(Ok(Message::Ping(_) | Message::Pong(_)))) => {}
            _ => return false,
        }
    }
}
