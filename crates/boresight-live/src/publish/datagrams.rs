//! Datagrams to one address: nobody is waited for, and what the network loses is lost.

use boresight::{Error, ErrorKind, Result};
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};

/// A socket and where it sends to.
pub(super) struct Datagrams {
    socket: UdpSocket,
    to: SocketAddr,
    /// Datagrams that could not be sent.
    pub lost: u64,
}

impl Datagrams {
    /// Finds the address and opens a socket; `shown` names it in errors.
    /// # Errors
    /// A name that is not known.
    pub fn open(address: &str, shown: &str) -> Result<Self> {
        let failed =
            |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be sent to").at(shown.to_string()).because(e);
        let mut found = address.to_socket_addrs().map_err(failed)?;
        let Some(to) = found.next() else {
            return Err(Error::new(ErrorKind::Output, "has no address").at(shown.to_string()));
        };
        let any: SocketAddr = if to.is_ipv4() { ([0, 0, 0, 0], 0).into() } else { ([0u16; 8], 0).into() };
        let socket = UdpSocket::bind(any).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        Ok(Self { socket, to, lost: 0 })
    }

    /// Sends one; a full buffer, a network that is down, a listener that is not there: counted, never waited for.
    pub fn send(&mut self, bytes: &[u8]) {
        self.lost += u64::from(self.socket.send_to(bytes, self.to).is_err());
    }
}
