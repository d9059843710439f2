//! A place for one thing between two threads: the newest wins, or the giver waits; it never grows.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// What a taker finds.
#[derive(Debug, PartialEq, Eq)]
pub enum Taken<T> {
    /// The newest thing.
    Item(T),
    /// Nothing came in time.
    Nothing,
    /// Nothing will come any more.
    Closed,
}

struct Inside<T> {
    item: Option<T>,
    closed: bool,
}

/// A slot for one thing.
pub struct Slot<T> {
    inside: Mutex<Inside<T>>,
    changed: Condvar,
}

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Self { inside: Mutex::new(Inside { item: None, closed: false }), changed: Condvar::new() }
    }
}

impl<T> Slot<T> {
    fn lock(&self) -> std::sync::MutexGuard<'_, Inside<T>> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a thing in, and returns the older one that nobody took.
    pub fn put(&self, item: T) -> Option<T> {
        let older = self.lock().item.replace(item);
        self.changed.notify_all();
        older
    }

    /// Puts a thing in once the one before is taken; `false` if the slot is closed and it was not put in.
    pub fn put_waiting(&self, item: T) -> bool {
        let mut inside = self.lock();
        while inside.item.is_some() && !inside.closed {
            inside = self.changed.wait(inside).unwrap_or_else(PoisonError::into_inner);
        }
        if inside.closed {
            return false;
        }
        inside.item = Some(item);
        self.changed.notify_all();
        true
    }

    /// Takes the thing, waiting for it at most so long. What is in a closed slot can still be taken.
    pub fn take(&self, at_most: Duration) -> Taken<T> {
        let waits = |inside: &mut Inside<T>| inside.item.is_none() && !inside.closed;
        let waited = self.changed.wait_timeout_while(self.lock(), at_most, waits);
        let (mut inside, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let taken = match inside.item.take() {
            Some(item) => Taken::Item(item),
            None if inside.closed => Taken::Closed,
            None => Taken::Nothing,
        };
        self.changed.notify_all();
        taken
    }

    /// Whether the thing before was taken.
    pub fn is_empty(&self) -> bool {
        self.lock().item.is_none()
    }

    /// Says that nothing comes any more, or that nobody takes any more.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Whether it was closed.
    pub fn is_closed(&self) -> bool {
        self.lock().closed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    const SHORT: Duration = Duration::from_millis(1);

    #[test]
    fn the_newest_is_taken_and_the_older_comes_back_to_be_counted() {
        let slot = Slot::default();
        assert_eq!((slot.put(1), slot.put(2)), (None, Some(1)));
        assert_eq!((slot.take(SHORT), slot.take(SHORT)), (Taken::Item(2), Taken::Nothing));
    }

    #[test]
    fn what_waits_loses_nothing_and_a_closed_slot_gives_its_last() {
        let slot = Arc::new(Slot::default());
        let giver = Arc::clone(&slot);
        let thread = std::thread::spawn(move || {
            let all = (0..50).all(|k| giver.put_waiting(k));
            giver.close();
            all
        });
        let mut got = Vec::new();
        loop {
            match slot.take(Duration::from_secs(10)) {
                Taken::Item(k) => got.push(k),
                Taken::Closed => break,
                Taken::Nothing => panic!("the giver stands still"),
            }
        }
        assert_eq!((got, thread.join().unwrap()), ((0..50).collect::<Vec<_>>(), true));
        assert!(!slot.put_waiting(7), "closed");
    }
}
