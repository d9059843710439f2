//! The wire: events to standard output, datagrams, a broker.

mod address;
mod lines;
mod mqtt;
mod open;
mod udp;

pub use address::{Broker, Target};
pub use lines::Lines;
pub use mqtt::Mqtt;
pub use open::publisher;
pub use udp::Udp;
