//! Events as datagrams, one each.

use super::datagrams::Datagrams;
use crate::cbor::Form;
use crate::event::Event;
use crate::output::{LiveOutput, Shown};
use boresight::Result;

/// Events to one address.
pub struct Udp {
    datagrams: Datagrams,
    form: Form,
}

impl Udp {
    /// Finds the address and opens a socket.
    /// # Errors
    /// A name that is not known.
    pub fn open(address: &str, form: Form) -> Result<Self> {
        Ok(Self { datagrams: Datagrams::open(address, &format!("udp://{address}"))?, form })
    }
}

impl LiveOutput for Udp {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        shown.events.iter().for_each(|event| self.event(event));
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        self.datagrams.send(&self.form.bytes(&event.json));
    }

    fn dropped(&self) -> u64 {
        self.datagrams.lost
    }
}
