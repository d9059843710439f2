//! From a target to what takes its events.

use super::address::Target;
use super::asterix::Asterix;
use super::cot_output::Cot;
use super::lines::Lines;
use super::mqtt::Mqtt;
use super::program::Program;
use super::udp::Udp;
use crate::board::Board;
use crate::output::LiveOutput;
use boresight::Result;
use std::sync::Arc;

/// Opens what takes the events of a target.
/// # Errors
/// A name that is not known; a program that is not there; a system without threads. A broker that is away is no error.
pub fn publisher(target: &Target, board: &Arc<Board>) -> Result<Box<dyn LiveOutput>> {
    Ok(match target {
        Target::Standard => Box::new(Lines::start(std::io::stdout())?),
        Target::Udp { address, form } => Box::new(Udp::open(address, *form)?),
        #[cfg(feature = "nats")]
        Target::Nats(broker) => Box::new(super::nats::Nats::start(broker, Arc::clone(board))?),
        Target::Cot { is_tcp: true, address, options } => Box::new(Cot::tcp(address, options, board)?),
        Target::Cot { address, options, .. } => Box::new(Cot::udp(address, options, board)?),
        Target::Asterix { address, options } => Box::new(Asterix::open(address, *options, board)?),
        Target::Zenoh(address) => Box::new(Program::start(address.command(), Arc::clone(board))?),
        Target::Mqtt(broker) => Box::new(Mqtt::start(broker, Arc::clone(board))?),
    })
}
