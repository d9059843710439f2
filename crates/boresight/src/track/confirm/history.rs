//! What a confirmation rule remembers of one track, and what one scan says of it.
//!
//! Symbols: Λ likelihood ratio of a scan, target against clutter (no unit).
//! Limits: the 64 newest scans.

/// What a confirmation rule remembers of one track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct History {
    /// Hits (1) and misses (0), the newest in the lowest bit.
    pub(super) hits: u64,
    /// Scans with a detection of its own, not merged with another track's (1), the newest in the lowest bit.
    pub(super) alone: u64,
    /// Track score (ln Λ summed), or the odds that the target exists; by the rule.
    pub(super) value: f64,
    /// Largest score so far (sequential test), or ln odds that it ever was a target (existence).
    pub(super) best: f64,
    /// Time of the last detection, its own or merged with another track's, ns: coasting counts from here.
    pub last_seen_ns: i64,
    /// Time of the initiation, ns.
    pub initiated_ns: i64,
    /// Misses in a row.
    pub misses: u32,
    /// Time seen alone less time in merged measurements, s, as far as it may be saved up (`step/delete.rs`).
    pub alone_s: f32,
    /// Scans remembered, at most 64.
    pub(super) scans: u8,
    /// Whether the rule holds the track for confirmed. It then chooses its detections before tentative tracks and coasts; whether it
    /// is reported as confirmed is said by [`super::status`].
    pub accepted: bool,
    /// Whether it ever did.
    pub(super) was_accepted: bool,
}

impl History {
    /// Holds the track for confirmed.
    #[inline]
    pub fn accept(&mut self) {
        (self.accepted, self.was_accepted) = (true, true);
    }

    /// Notes whether the newest scan gave it a detection of its own, not merged with another track's.
    #[inline]
    pub fn note_alone(&mut self, alone: bool) {
        self.alone = (self.alone << 1) | u64::from(alone);
    }

    /// Scans with a detection of its own since its initiation, the newest in the lowest bit.
    pub fn alone_since_initiation(&self) -> u64 {
        self.alone & newest(u32::from(self.scans))
    }

    /// Scans with a detection, its own or merged, the newest in the lowest bit.
    pub fn hits(&self) -> u64 {
        self.hits
    }

    /// Number of hits in the newest `n` scans.
    #[inline]
    pub(super) fn hits_in(&self, n: u32) -> u32 {
        (self.hits & newest(n)).count_ones()
    }

    /// Takes one scan in.
    #[inline]
    pub(super) fn record(&mut self, evidence: Evidence, now_ns: i64) {
        self.hits = (self.hits << 1) | u64::from(evidence.hit);
        self.scans = self.scans.saturating_add(1).min(64);
        if evidence.hit {
            self.misses = 0;
            self.last_seen_ns = now_ns;
        } else {
            self.misses = self.misses.saturating_add(1);
        }
    }
}

/// The lowest `n` bits.
#[inline]
fn newest(n: u32) -> u64 {
    if n >= 64 { u64::MAX } else { (1 << n) - 1 }
}

/// What one scan says of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// A detection was assigned.
    pub hit: bool,
    /// Λ of this scan.
    pub likelihood_ratio: f64,
}

/// What becomes of a track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// It continues.
    Keep,
    /// It is deleted.
    Delete,
}

/// Odds stay within these, so that no past, good or bad, outweighs a new scan for ever.
pub(super) const ODDS: (f64, f64) = (1e-12, 1e12);
