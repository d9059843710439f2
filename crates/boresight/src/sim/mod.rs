//! Simulated scenes: targets, noise, background, radar; never sees the tracker.
