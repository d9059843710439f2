//! The wire: events to standard output, datagrams, a broker.

mod address;
mod last_words;
mod lines;
mod mqtt;
#[cfg(feature = "nats")]
mod nats;
mod open;
mod udp;

pub use address::{Broker, Target};
pub use lines::Lines;
pub use mqtt::Mqtt;
#[cfg(feature = "nats")]
pub use nats::Nats;
pub use open::publisher;
pub use udp::Udp;
