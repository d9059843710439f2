//! The wire: events to standard output, datagrams, a broker, a program; places on Earth as Cursor on Target and ASTERIX.

mod address;
mod asterix;
mod connection;
mod cot;
mod cot_output;
mod datagrams;
mod earth_address;
mod last_words;
mod lines;
mod mqtt;
#[cfg(feature = "nats")]
mod nats;
mod open;
mod program;
mod udp;
mod unplaced;
mod zenoh_address;

pub use address::{Broker, Target};
pub use asterix::Asterix;
pub use cot_output::Cot;
pub use earth_address::{AsterixOptions, CotOptions};
pub use lines::Lines;
pub use mqtt::Mqtt;
#[cfg(feature = "nats")]
pub use nats::Nats;
pub use open::publisher;
pub use udp::Udp;
pub use zenoh_address::ZenohAddress;
