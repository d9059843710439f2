//! Connections over TCP that are made again with growing pauses while somebody is away; each change is said once.

use crate::board::Board;
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(10);

/// Connects to the first of a host's addresses that answers; connecting and each write may take so long.
/// # Errors
/// A name that is not known, nobody who answers.
pub(super) fn open(place: impl ToSocketAddrs, answer: Duration) -> io::Result<TcpStream> {
    let mut last = io::Error::other("the host has no address");
    for to in place.to_socket_addrs()? {
        match TcpStream::connect_timeout(&to, answer) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(answer))?;
                return Ok(stream);
            }
            Err(e) => last = e,
        }
    }
    Err(last)
}

/// Has `talk` connect and talk until it ends well or is abandoned; it calls what it is given once its connection stands. `name` is said with each loss and return, and that `n_waiting`
/// events at most wait.
pub(super) fn again_and_again(
    name: &str,
    n_waiting: usize,
    board: &Board,
    abandoned: &AtomicBool,
    mut talk: impl FnMut(&mut dyn FnMut()) -> io::Result<()>,
) {
    let (mut pause, mut said) = (FIRST_PAUSE, false);
    while !abandoned.load(Ordering::SeqCst) {
        let outcome = talk(&mut || {
            if std::mem::take(&mut said) {
                board.say(&format!("{name}: connected again"));
            }
            pause = FIRST_PAUSE;
        });
        let Err(e) = outcome else { return };
        if !std::mem::replace(&mut said, true) {
            board.say(&format!("warning: {name}: {e}; events wait, at most {n_waiting}"));
        }
        let until = Instant::now() + pause;
        while Instant::now() < until && !abandoned.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(20));
        }
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}
