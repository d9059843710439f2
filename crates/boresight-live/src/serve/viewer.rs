//! One viewer of the page: gets the newest message, says when it has drawn it, and only then gets the next. A slow one gets fewer.

use super::hub::Hub;
use super::hubs::Hubs;
use axum::extract::ws::{Message, WebSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::time::timeout;

/// A viewer that draws nothing for so long is gone, or asleep; it connects again when it wakes.
const PATIENCE: Duration = Duration::from_secs(30);
/// A run that is silent says that it is there.
const ALIVE: Duration = Duration::from_secs(10);

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
