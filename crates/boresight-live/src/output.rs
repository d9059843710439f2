//! What outputs of a live run see of each frame, and their trait: the page, the wire, the record.

use crate::event::{Event, TrackReport, When};
use boresight::track::TrackerParameters;
use boresight::{Config, Result, Scan, View};

/// One frame after it was tracked, read only.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// The frame, its detections and all its tracks; the frame is absent where there was none.
    pub view: View<'a>,
    /// Number, time, time of arrival.
    pub when: When,
    /// The confirmed tracks.
    pub tracks: &'a [TrackReport],
    /// Events of this frame.
    pub events: &'a [Event],
}

/// Takes what a live run gives. None of the calls may wait for anybody outside.
pub trait LiveOutput: Send {
    /// The configuration is settled.
    fn configured(&mut self, config: &Config) {
        let _ = config;
    }
    /// The tracker has other parameters from the next frame on; `config` is the configuration with them.
    fn adapted(&mut self, parameters: &TrackerParameters, config: &Config) {
        let _ = (parameters, config);
    }
    /// Takes a frame.
    /// # Errors
    /// What could not be written; the run says it, counts it and goes on.
    fn put(&mut self, shown: &Shown<'_>) -> Result<()>;
    /// Takes a scan that came late: its tracks are seen with the next frame.
    /// # Errors
    /// As [`LiveOutput::put`].
    fn late(&mut self, scan: &Scan, arrived_unix_s: f64) -> Result<()> {
        let _ = (scan, arrived_unix_s);
        Ok(())
    }
    /// Takes an event that belongs to no frame: the run's state.
    fn event(&mut self, event: &Event) {
        let _ = event;
    }
    /// The run is over.
    fn finish(&mut self) {}
    /// Events that could not be taken so far.
    fn dropped(&self) -> u64 {
        0
    }
}
