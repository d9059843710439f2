//! What a detector finds in the frames that the automatic choice looks at.

use crate::vision::{AtOnce, DetectorConfig};
use crate::{Frame, Result, Scan, SourceInfo};

/// The scans of the frames, one each.
/// # Errors
/// A parameter out of its range; frames of more than one size or pixel type.
pub fn scans<'f>(
    config: &DetectorConfig,
    frames: impl Iterator<Item = &'f Frame>,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Vec<Scan>> {
    let mut detector = crate::vision::build(config, info)?;
    let frames: Vec<&Frame> = frames.collect();
    let mut scans = Vec::with_capacity(frames.len());
    AtOnce::new(&*detector, n_threads.min(frames.len())).detect(&mut *detector, &frames, &mut scans)?;
    Ok(scans)
}
