//! Moving pixels as a segmentation: the bits of the background model and of the frame difference go to the regions.

use super::{Background, BitImage, FrameDifference};
use crate::vision::cluster::Clusterer;
use crate::vision::pixel::Pixel;
use crate::vision::segmenter::{PixelWeight, Regions, Segmenter};
use crate::vision::target_finder::TypedFrame;
use crate::vision::threshold::BackgroundGrid;
use crate::{Image, Result};

/// Gives the rows of a mask to the clusterer.
pub(crate) fn mask_rows<T: Pixel>(mask: &BitImage, image: &Image<T>, clusters: &mut Clusterer) {
    for y in 0..image.height() {
        clusters.row(y, mask.row(y), image.row(y));
    }
}

impl<T: Pixel> Segmenter<T> for Background<T> {
    fn remembers(&self) -> bool {
        true
    }

    fn prime_s(&self) -> f64 {
        self.start_s()
    }

    fn prime(&mut self, _: &[f64], frames: &[&Image<T>]) -> Result<()> {
        self.start_from(frames)
    }

    fn weight(&self) -> PixelWeight {
        PixelWeight::Alike
    }

    fn segment(&mut self, frame: &TypedFrame<T>, _: &BackgroundGrid, regions: &mut Regions) -> Result<Option<f64>> {
        self.update(frame.image, frame.dt_s)?;
        mask_rows(self.moving(), frame.image, &mut regions.bright);
        Ok(None)
    }
}

impl<T: Pixel> Segmenter<T> for FrameDifference<T> {
    fn remembers(&self) -> bool {
        true
    }

    fn weight(&self) -> PixelWeight {
        PixelWeight::Alike
    }

    fn segment(&mut self, frame: &TypedFrame<T>, _: &BackgroundGrid, regions: &mut Regions) -> Result<Option<f64>> {
        self.update(frame.image)?;
        mask_rows(self.moving(), frame.image, &mut regions.bright);
        Ok(None)
    }
}
