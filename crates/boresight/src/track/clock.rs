//! Time of a tracker: the step from scan to scan, refused where it runs back, and the usual interval.

use super::scan_interval::ScanInterval;
use crate::{Error, ErrorKind, Result, Scan, Timestamp};

/// When the newest scan was, and how far scans usually lie apart.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    last: Option<Timestamp>,
    /// The newest scan in which something could be detected.
    last_seeing: Option<Timestamp>,
    /// Usual interval between scans in which something could be detected.
    pub interval: ScanInterval,
}

impl Clock {
    /// Time since the scan before, s; nothing at the first scan.
    /// # Errors
    /// A scan before the last one.
    pub fn step_s(&self, scan: &Scan) -> Result<Option<f64>> {
        let Some(last) = self.last else { return Ok(None) };
        if scan.time < last {
            let what = format!("time runs back: {} ns after {} ns", scan.time.ns, last.ns);
            return Err(Error::new(ErrorKind::Damaged, what)
                .at(format!("frame {}", scan.index.0))
                .hint("sort the scans by time before tracking"));
        }
        Ok(Some(scan.time.seconds_since(last)))
    }

    /// Time of the newest scan; the epoch before the first.
    pub fn now(&self) -> Timestamp {
        self.last.unwrap_or_default()
    }

    /// Takes a scan in.
    pub fn advance(&mut self, scan: &Scan) {
        self.last = Some(scan.time);
        if scan.blind {
            return;
        }
        if let Some(before) = self.last_seeing {
            self.interval.note(scan.time.seconds_since(before));
        }
        self.last_seeing = Some(scan.time);
    }
}
