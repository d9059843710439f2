//! Events as datagrams, one each: nobody is waited for, and what the network loses is lost.

use crate::cbor::Form;
use crate::event::Event;
use crate::output::{LiveOutput, Shown};
use boresight::{Error, ErrorKind, Result};
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};

/// Events to one address.
pub struct Udp {
    socket: UdpSocket,
    to: SocketAddr,
    form: Form,
    dropped: u64,
}

impl Udp {
    /// Finds the address and opens a socket.
    /// # Errors
    /// A name that is not known.
    pub fn open(address: &str, form: Form) -> Result<Self> {
        let failed = |e: std::io::Error| {
            Error::new(ErrorKind::Output, "cannot be sent to").at(format!("udp://{address}")).because(e)
        };
        let mut found = address.to_socket_addrs().map_err(failed)?;
        let Some(to) = found.next() else {
            return Err(Error::new(ErrorKind::Output, "has no address").at(format!("udp://{address}")));
        };
        let any: SocketAddr = if to.is_ipv4() { ([0, 0, 0, 0], 0).into() } else { ([0u16; 8], 0).into() };
        let socket = UdpSocket::bind(any).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        Ok(Self { socket, to, form, dropped: 0 })
    }
}

impl LiveOutput for Udp {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        shown.events.iter().for_each(|event| self.event(event));
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        // A full buffer, a network that is down, a listener that is not there: counted, never waited for.
        self.dropped += u64::from(self.socket.send_to(&self.form.bytes(&event.json), self.to).is_err());
    }

    fn dropped(&self) -> u64 {
        self.dropped
    }
}
