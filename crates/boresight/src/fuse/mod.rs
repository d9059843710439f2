//! Fusion of tracks and of measurements from several sensors.
