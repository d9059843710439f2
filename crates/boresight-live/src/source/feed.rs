//! What a source gives: frames or scans, one after another; and how it is connected, again if it is lost.

use boresight::io::StopFlag;
use boresight::track::TrackerParameters;
use boresight::{Frame, FrameSource, Result, Scan, SourceInfo, Timestamp};

/// One thing that came.
#[derive(Debug)]
pub enum Content {
    /// A picture.
    Frame(Frame),
    /// Detections made elsewhere.
    Scan(Scan),
    /// The same, of a record: from it on the tracker had these parameters.
    Adapted(Scan, Box<TrackerParameters>),
}

impl Content {
    /// The stamp of the stream.
    pub fn stamp(&self) -> Timestamp {
        match self {
            Self::Frame(frame) => frame.time,
            Self::Scan(scan) | Self::Adapted(scan, _) => scan.time,
        }
    }
}

/// A connection to a source.
pub trait Feed: Send {
    /// Waits for the next thing; `None` at the end.
    /// # Errors
    /// What breaks the connection.
    fn next(&mut self) -> Result<Option<Content>>;
    /// Whether the stamps are of the stream; else the time of arrival counts.
    fn has_stamps(&self) -> bool {
        true
    }
    /// How far a stamp may lie before the newest and is late, ns; `None` where stamps only run back when the stream's clock begins anew.
    fn late_ns(&self) -> Option<i64> {
        None
    }
    /// What is known of the frames; `None` for detections.
    fn info(&self) -> Option<&SourceInfo>;
    /// Lines that could not be read, so far.
    fn bad_lines(&self) -> u64 {
        0
    }
    /// What the source warns of, so far.
    fn warnings(&self) -> &[String] {
        &[]
    }
}

/// Connects to a source.
pub trait Connect: Send {
    /// Connects.
    /// # Errors
    /// A source that is not there or gives nothing.
    fn connect(&mut self) -> Result<Box<dyn Feed>>;
    /// Whether it never ends by itself, so that an end is a loss: it is connected again.
    fn is_endless(&self) -> bool;
    /// Ends a wait for a silent stream, where that can be done.
    fn stop_flag(&self) -> Option<StopFlag> {
        None
    }
    /// Whether the newest counts and older things may be dropped; else the source waits for the tracker.
    fn newest_counts(&self) -> bool;
}

/// A source of frames as a feed.
pub struct Frames {
    source: Box<dyn FrameSource>,
    has_stamps: bool,
}

impl Frames {
    /// Takes a source; `has_stamps` says whether its times are to be believed.
    pub fn new(source: Box<dyn FrameSource>, has_stamps: bool) -> Self {
        Self { source, has_stamps }
    }
}

impl Feed for Frames {
    fn next(&mut self) -> Result<Option<Content>> {
        Ok(self.source.next_frame()?.map(Content::Frame))
    }

    fn has_stamps(&self) -> bool {
        self.has_stamps
    }

    fn info(&self) -> Option<&SourceInfo> {
        Some(self.source.info())
    }

    fn warnings(&self) -> &[String] {
        self.source.warnings()
    }
}
