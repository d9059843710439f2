//! The run's end of the page: notes the newest frame, and lets a thread of its own make text and picture of it while somebody looks.

use super::coded_pictures::CodedPictures;
use super::hub::{Hub, Seen, message};
use super::picture::Pictures;
use crate::event::Event;
use crate::output::{LiveOutput, Shown};
use crate::slot::{Slot, Taken};
use boresight::{Error, ErrorKind, Pixels, Result};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

struct ToShow {
    pixels: Option<Pixels>,
    seen: Seen,
}

/// Feeds the page.
pub struct PageOutput {
    hub: Arc<Hub>,
    slot: Arc<Slot<ToShow>>,
}

impl PageOutput {
    /// Starts the thread that encodes.
    /// # Errors
    /// A system without threads.
    pub fn start(hub: Arc<Hub>) -> Result<Self> {
        let slot = Arc::new(Slot::<ToShow>::default());
        let (from, to) = (Arc::clone(&slot), Arc::clone(&hub));
        let encode = move || {
            let (mut pictures, mut coded) = (Pictures::default(), CodedPictures::default());
            loop {
                match from.take(Duration::from_secs(3600)) {
                    Taken::Item(show) => {
                        let json = show.seen.json(&to.board);
                        if to.coded.receiver_count() > 0 {
                            let wants_key = to.wants_key.swap(false, Ordering::SeqCst);
                            // The last viewer may have left meanwhile.
                            let _ = to.coded.send(coded.encode(show.pixels.as_ref(), &json, wants_key));
                        }
                        let looked_at = show.pixels.filter(|_| to.message.receiver_count() > 0);
                        let jpeg = looked_at.and_then(|p| pictures.encode(&p)).unwrap_or_default();
                        to.message.send_replace(message(&json, &jpeg));
                    }
                    Taken::Nothing => {}
                    Taken::Closed => return,
                }
            }
        };
        let thread = std::thread::Builder::new().name("live-picture".into()).spawn(encode);
        thread.map_err(|e| Error::new(ErrorKind::Output, "no thread can be started").because(e))?;
        Ok(Self { hub, slot })
    }
}

impl LiveOutput for PageOutput {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        self.hub.see(Some(shown));
        let n_viewers = self.hub.message.receiver_count() + self.hub.coded.receiver_count();
        if n_viewers > 0 && self.slot.is_empty() {
            let pixels = shown.view.frame.map(|f| f.pixels.clone());
            self.slot.put(ToShow { pixels, seen: self.hub.seen() });
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
            self.hub.see(None);
            self.slot.put(ToShow { pixels: None, seen: Seen::default() });
        }
    }
}

impl Drop for PageOutput {
    fn drop(&mut self) {
        self.slot.close();
    }
}
