//! A bounded queue to an output that may be slow or away: the giver never waits, the oldest goes and is counted.
//!
//! Why not `crossbeam-queue`: its queue that drops the oldest cannot be waited for.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

struct Inside<T> {
    items: VecDeque<T>,
    dropped: u64,
    closed: bool,
}

/// The queue.
pub struct Queue<T> {
    inside: Mutex<Inside<T>>,
    changed: Condvar,
    most: usize,
}

impl<T> Queue<T> {
    /// A queue of at most `most` things.
    pub fn new(most: usize) -> Self {
        let inside = Inside { items: VecDeque::new(), dropped: 0, closed: false };
        Self { inside: Mutex::new(inside), changed: Condvar::new(), most: most.max(1) }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Inside<T>> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a thing at the end; if the queue is full its oldest one goes.
    pub fn push(&self, item: T) {
        let mut inside = self.lock();
        if inside.items.len() >= self.most {
            inside.items.pop_front();
            inside.dropped += 1;
        }
        inside.items.push_back(item);
        self.changed.notify_one();
    }

    /// Takes the oldest, waiting at most so long; `Err` once it is closed and empty.
    pub fn pop(&self, at_most: Duration) -> Result<Option<T>, Closed> {
        let waits = |inside: &mut Inside<T>| inside.items.is_empty() && !inside.closed;
        let waited = self.changed.wait_timeout_while(self.lock(), at_most, waits);
        let (mut inside, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match inside.items.pop_front() {
            None if inside.closed => Err(Closed),
            item => Ok(item),
        }
    }

    /// Takes the oldest if there is one.
    pub fn try_pop(&self) -> Option<T> {
        self.lock().items.pop_front()
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.lock().items.is_empty()
    }

    /// Things that went because the queue was full.
    pub fn dropped(&self) -> u64 {
        self.lock().dropped
    }

    /// Says that nothing comes any more.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Whether it was closed.
    pub fn is_closed(&self) -> bool {
        self.lock().closed
    }
}

/// The queue was closed, and everything in it was taken.
#[derive(Debug, PartialEq, Eq)]
pub struct Closed;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_goes_and_is_counted_and_the_rest_outlives_the_close() {
        let queue = Queue::new(3);
        (0..5).for_each(|k| queue.push(k));
        queue.close();
        let took: Vec<_> = std::iter::from_fn(|| queue.pop(Duration::ZERO).ok().flatten()).collect();
        assert_eq!((took, queue.dropped()), (vec![2, 3, 4], 2));
        assert_eq!(queue.pop(Duration::ZERO), Err(Closed));
    }
}
