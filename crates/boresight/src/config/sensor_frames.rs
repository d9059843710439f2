//! Frames mended as the configuration says: its dark and flat frames are read here.

use super::whole::InputConfig;
use crate::io::{Colour, OpenOptions};
use crate::sensor::{Calibration, MeanMap, MendedSource};
use crate::{Error, ErrorKind, FrameSource, Result};

/// Dark or flat frames read at most.
const MOST: u32 = 256;

impl InputConfig {
    /// The source with its frames mended as `sensor` says; itself if that says nothing.
    /// # Errors
    /// Dark or flat frames that cannot be read or do not go with the source's; colour frames.
    pub fn mend(&self, source: Box<dyn FrameSource>) -> Result<Box<dyn FrameSource>> {
        if !self.sensor.is_active() {
            return Ok(source);
        }
        let read = |path: &Option<String>, key: &str| {
            path.as_ref().map(|p| self.sensor_frames(p).map_err(|e| e.at(format!("input.sensor.{key}")))).transpose()
        };
        let (dark, flat) = (read(&self.sensor.dark, "dark")?, read(&self.sensor.flat, "flat")?);
        let known = Calibration { dark: dark.as_ref().map(MeanMap::mean), flat: flat.as_ref().map(MeanMap::mean) };
        // A single dark frame does not tell a bad pixel from noise.
        let many = dark.as_ref().filter(|d| d.n_frames() > 1);
        Ok(Box::new(MendedSource::new(source, &self.sensor, &known, many)?))
    }

    /// Mean and variance of the pixels of dark or flat frames (grey, at most 256).
    /// # Errors
    /// Frames that cannot be read, of several sizes, or none.
    pub fn sensor_frames(&self, path: &str) -> Result<MeanMap> {
        let options = OpenOptions { colour: Colour::Gray, ..self.open_options() };
        let mut source = crate::io::open(path, &options)?;
        let mut map = MeanMap::default();
        while map.n_frames() < MOST
            && let Some(frame) = source.next_frame()?
        {
            map.push(&frame.pixels).map_err(|e| e.at(path))?;
            source.recycle(frame);
        }
        if map.n_frames() == 0 {
            return Err(Error::new(ErrorKind::Damaged, "holds no frames").at(path));
        }
        Ok(map)
    }
}
