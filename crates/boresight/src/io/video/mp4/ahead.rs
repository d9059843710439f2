//! How far the decoding thread goes ahead of the caller: a few frames, or as far as the caller is going to hold them all.

use std::sync::{Condvar, Mutex, PoisonError};

/// Frames that wait for the caller at most, where it does not hold them.
const FEW: usize = 4;

/// What the decoding thread waits for.
#[derive(Debug, Default)]
pub(super) struct Ahead {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// Frames that the caller has not taken yet.
    n_waiting: usize,
    /// Number behind that of the last frame which is going to be held.
    held: u64,
    ended: bool,
}

impl Ahead {
    /// Waits until the frame of that number may be handed on; `false` if nobody takes it.
    pub fn wait_for(&self, number: u64) -> bool {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let waits = |s: &mut State| !s.ended && s.n_waiting >= FEW && number >= s.held;
        let mut state = self.changed.wait_while(state, waits).unwrap_or_else(PoisonError::into_inner);
        state.n_waiting += 1;
        !state.ended
    }

    /// A frame was taken.
    pub fn taken(&self) {
        self.change(|s| s.n_waiting = s.n_waiting.saturating_sub(1));
    }

    /// The frames before this number are going to be held.
    pub fn go_on_to(&self, number: u64) {
        self.change(|s| s.held = s.held.max(number));
    }

    /// Nobody takes any more.
    pub fn end(&self) {
        self.change(|s| s.ended = true);
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner));
        self.changed.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;
    use std::time::Duration;

    #[test]
    fn few_frames_wait_or_those_that_are_going_to_be_held() {
        let ahead = Ahead::default();
        ahead.go_on_to(10);
        let (out, numbers) = channel();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                (0..).take_while(|&k| ahead.wait_for(k)).for_each(|k| out.send(k).unwrap());
                drop(out);
            });
            let next = || numbers.recv_timeout(Duration::from_secs(20)).unwrap();
            // All of the ten come though none is said to be taken; the one behind them does not.
            assert_eq!((0..10).map(|_| next()).collect::<Vec<_>>(), (0..10).collect::<Vec<_>>());
            assert!(numbers.recv_timeout(Duration::from_millis(50)).is_err());
            // Six taken leave four, one more lets one on.
            (0..6).for_each(|_| ahead.taken());
            assert!(numbers.recv_timeout(Duration::from_millis(50)).is_err());
            ahead.taken();
            assert_eq!(next(), 10);
            ahead.go_on_to(13);
            assert_eq!((next(), next()), (11, 12));
            ahead.end();
        });
        assert!(numbers.recv().is_err());
    }
}
