//! From decoding order to presentation order.
//!
//! A file with composition times names the order itself: every shown picture has a rank, and a picture leaves as soon
//! as all ranks before it have left or are known to be lost. A file without them (old muxers drop them even from
//! streams with B-pictures) is ordered by the pictures' own count (ITU-T H.264 8.2.1), and its times, sorted, are dealt
//! out in that order.
//! Limits: at most [`MAX_HELD`] pictures are held, whatever a file claims.

use std::collections::{BTreeMap, VecDeque};

/// Largest number of held pictures: a decoder holds 16 frames at most (ITU-T H.264 A.3.1), so more never helps.
const MAX_HELD: usize = 20;

/// How the order is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Order {
    /// By the file's own times.
    Rank,
    /// By picture order count, `depth` pictures of delay.
    Count {
        /// Pictures held back.
        depth: usize,
    },
}

/// Holds pictures back until their turn.
pub(super) struct Reorder<T> {
    order: Order,
    held: BTreeMap<(u32, i64), (u64, T)>,
    next: u64,
    lost: VecDeque<u64>,
    ranks: Vec<u64>,
}

impl<T> Reorder<T> {
    pub fn new(order: Order) -> Self {
        Self { order, held: BTreeMap::new(), next: 0, lost: VecDeque::new(), ranks: Vec::new() }
    }

    /// Whether the file's own times say the order.
    pub fn is_by_rank(&self) -> bool {
        self.order == Order::Rank
    }

    /// Takes a decoded picture with its period, order count and rank; gives out what is due, with the rank it is
    /// shown at.
    pub fn push(&mut self, period: u32, count: i32, rank: u64, picture: T, out: &mut Vec<(u64, T)>) {
        match self.order {
            Order::Rank => {
                self.held.insert((0, rank as i64), (rank, picture));
                self.release(out);
                if self.held.len() > MAX_HELD {
                    self.pop(out);
                    self.release(out);
                }
            }
            Order::Count { depth } => {
                if self.held.keys().next_back().is_some_and(|k| k.0 < period) {
                    self.finish(out);
                }
                self.ranks.push(rank);
                self.held.insert((period, i64::from(count)), (rank, picture));
                while self.held.len() > depth.min(MAX_HELD) {
                    self.pop(out);
                }
            }
        }
    }

    /// Says that the picture of a rank will not come.
    pub fn lose(&mut self, rank: u64, out: &mut Vec<(u64, T)>) {
        if self.order == Order::Rank {
            let at = self.lost.partition_point(|r| *r < rank);
            self.lost.insert(at, rank);
            self.release(out);
        }
    }

    /// Gives out all that is held.
    pub fn finish(&mut self, out: &mut Vec<(u64, T)>) {
        while !self.held.is_empty() {
            self.pop(out);
        }
    }

    fn release(&mut self, out: &mut Vec<(u64, T)>) {
        loop {
            while self.lost.front().is_some_and(|r| *r <= self.next) {
                if self.lost.pop_front() == Some(self.next) {
                    self.next += 1;
                }
            }
            match self.held.keys().next() {
                Some(&(_, rank)) if rank as u64 <= self.next => self.pop(out),
                _ => return,
            }
        }
    }

    fn pop(&mut self, out: &mut Vec<(u64, T)>) {
        let Some((_, (mut rank, picture))) = self.held.pop_first() else { return };
        if self.order != Order::Rank {
            // The smallest time among the pictures held is this picture's.
            if let Some(at) = (0..self.ranks.len()).min_by_key(|i| self.ranks[*i]) {
                rank = self.ranks.swap_remove(at);
            }
        }
        self.next = self.next.max(rank + 1);
        out.push((rank, picture));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(order: Order, pictures: &[(u32, i32, u64)]) -> Vec<(u64, i32)> {
        let mut r = Reorder::new(order);
        let mut out = Vec::new();
        for &(period, count, rank) in pictures {
            r.push(period, count, rank, count, &mut out);
        }
        r.finish(&mut out);
        out
    }

    #[test]
    fn ranks_are_given_out_as_soon_as_their_turn_comes() {
        let mut r = Reorder::new(Order::Rank);
        let mut out = Vec::new();
        r.push(0, 0, 0, 'a', &mut out);
        assert_eq!(out.len(), 1);
        r.push(0, 0, 3, 'd', &mut out);
        r.push(0, 0, 1, 'b', &mut out);
        assert_eq!(out, [(0, 'a'), (1, 'b')]);
        r.lose(2, &mut out);
        assert_eq!(out.last(), Some(&(3, 'd')));
    }

    #[test]
    fn without_composition_times_the_order_count_decides_and_times_stay_sorted() {
        // I P B B, times in decoding order.
        let got = run(Order::Count { depth: 2 }, &[(1, 0, 0), (1, 6, 1), (1, 2, 2), (1, 4, 3), (2, 0, 4)]);
        assert_eq!(got, [(0, 0), (1, 2), (2, 4), (3, 6), (4, 0)]);
    }

    #[test]
    fn a_file_that_shows_its_first_picture_last_does_not_fill_memory() {
        let mut r = Reorder::new(Order::Rank);
        let mut out = Vec::new();
        for i in 0..1000u64 {
            r.push(0, 0, 1000 - i, (), &mut out);
            assert!(r.held.len() <= MAX_HELD);
        }
        r.finish(&mut out);
        assert_eq!(out.len(), 1000);
    }
}
