//! The run's end of the page: notes the newest frame, and lets a thread of its own make a picture of it while somebody looks.

use super::hub::{Hub, MOST_SHOWN, Snapshot, message};
use super::picture::Pictures;
use crate::event::Event;
use crate::output::{LiveOutput, Shown};
use crate::slot::{Slot, Taken};
use boresight::{Error, ErrorKind, Pixels, Result};
use std::sync::Arc;
use std::time::Duration;

struct ToShow {
    pixels: Option<Pixels>,
    json: Arc<str>,
}

/// Feeds the page.
pub struct PageOutput {
    hub: Arc<Hub>,
    slot: Arc<Slot<ToShow>>,
    detections: Vec<[f32; 2]>,
}

impl PageOutput {
    /// Starts the thread that encodes.
    /// # Errors
    /// A system without threads.
    pub fn start(hub: Arc<Hub>) -> Result<Self> {
        let slot = Arc::new(Slot::<ToShow>::default());
        let (from, to) = (Arc::clone(&slot), Arc::clone(&hub));
        let encode = move || {
            let mut pictures = Pictures::default();
            loop {
                match from.take(Duration::from_secs(3600)) {
                    Taken::Item(show) => {
                        let jpeg = show.pixels.and_then(|p| pictures.encode(&p)).unwrap_or_default();
                        to.message.send_replace(message(&show.json, &jpeg));
                    }
                    Taken::Nothing => {}
                    Taken::Closed => return,
                }
            }
        };
        let thread = std::thread::Builder::new().name("live-picture".into()).spawn(encode);
        thread.map_err(|e| Error::new(ErrorKind::Output, "no thread can be started").because(e))?;
        Ok(Self { hub, slot, detections: Vec::new() })
    }
}

impl LiveOutput for PageOutput {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        self.detections.clear();
        let positions = shown.view.scan.detections.iter().take(MOST_SHOWN);
        self.detections.extend(positions.map(|d| [d.position.x as f32, d.position.y as f32]));
        let mut snapshot = Snapshot::of(&self.hub.board);
        (snapshot.frame, snapshot.time_s) = (shown.when.frame, shown.when.time.as_secs_f64());
        snapshot.arrived_unix_s = shown.when.arrived_unix_s;
        let pixels = shown.view.frame.map(|f| &f.pixels);
        snapshot.size_px = pixels.map_or([0, 0], |p| [p.width(), p.height()]);
        (snapshot.detections, snapshot.tracks) = (&self.detections, shown.tracks);
        let json: Arc<str> = snapshot.json().into();
        self.hub.set_latest(Arc::clone(&json));
        if self.hub.message.receiver_count() > 0 && self.slot.is_empty() {
            self.slot.put(ToShow { pixels: pixels.cloned(), json });
        }
        for event in shown.events {
            self.event(event);
        }
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        // Without a reader it goes nowhere, which is no loss.
        let _ = self.hub.events.send(Arc::clone(&event.json));
        if event.is_status {
            let json: Arc<str> = Snapshot::of(&self.hub.board).json().into();
            self.hub.set_latest(Arc::clone(&json));
            self.slot.put(ToShow { pixels: None, json });
        }
    }
}

impl Drop for PageOutput {
    fn drop(&mut self) {
        self.slot.close();
    }
}
