//! One row of a table of tracks, and what its coordinates count from.

/// What a table's coordinates count from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PixelOrigin {
    /// The centre of the top-left pixel is (0, 0); a box begins at its pixels' outer edge (boresight).
    #[default]
    Centre0,
    /// The first pixel has number 0; a box that begins in it has `left = 0` (KITTI).
    Pixel0,
    /// The first pixel has number 1; a box that begins in it has `left = 1` (MOTChallenge).
    Pixel1,
}

impl PixelOrigin {
    /// What must be taken from a box's left or top to get boresight's edge, px.
    pub fn edge_shift_px(self) -> f64 {
        match self {
            Self::Centre0 => 0.0,
            Self::Pixel0 => 0.5,
            Self::Pixel1 => 1.5,
        }
    }

    /// What must be taken from a point's coordinate to get boresight's, px.
    pub fn point_shift_px(self) -> f64 {
        match self {
            Self::Centre0 | Self::Pixel0 => 0.0,
            Self::Pixel1 => 1.0,
        }
    }
}

/// One row of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackRow {
    /// Frame, from 0.
    pub frame: u32,
    /// The track's number in the file.
    pub id: i64,
    /// Left, top, width, height in the table's own coordinates, px. A point has no width and height.
    pub bbox: [f64; 4],
    /// Confidence, or in a truth of MOTChallenge whether the row counts (0 = ignored).
    pub score: f64,
    /// Class number; 1 where the format has none (MOTChallenge's pedestrian).
    pub class: i32,
    /// Visible share 0..=1; 1 where unknown.
    pub visibility: f64,
    /// How far the box leaves the image (KITTI's truncation), 0 where unknown.
    pub truncation: f64,
    /// How far it is hidden (KITTI's occlusion 0..=3), 0 where unknown.
    pub occlusion: i32,
}

impl Default for TrackRow {
    fn default() -> Self {
        Self { frame: 0, id: 0, bbox: [0.0; 4], score: 1.0, class: 1, visibility: 1.0, truncation: 0.0, occlusion: 0 }
    }
}
