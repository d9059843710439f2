//! The formats of tables of tracks, by their names.

use crate::io::tables::Dialect;

/// A format of tracks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// MOTChallenge result: the last columns are -1.
    Mot,
    /// MOTChallenge truth: with class and visibility.
    MotTruth,
    /// KITTI tracking labels.
    Kitti,
    /// CSV with named columns.
    Named(Dialect),
    /// Cell Tracking Challenge folder.
    Ctc,
}

impl Format {
    /// The format's name, as the command takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mot => "mot",
            Self::MotTruth => "mot-truth",
            Self::Kitti => "kitti",
            Self::Named(Dialect::Plain) => "csv",
            Self::Named(Dialect::Trackpy) => "trackpy",
            Self::Named(Dialect::TrackMate) => "trackmate",
            Self::Named(Dialect::Btrack) => "btrack",
            Self::Named(Dialect::Ultrack) => "ultrack",
            Self::Ctc => "ctc",
        }
    }

    /// All formats.
    pub const ALL: [Self; 9] = [
        Self::Mot,
        Self::MotTruth,
        Self::Kitti,
        Self::Named(Dialect::Plain),
        Self::Named(Dialect::Trackpy),
        Self::Named(Dialect::TrackMate),
        Self::Named(Dialect::Btrack),
        Self::Named(Dialect::Ultrack),
        Self::Ctc,
    ];
}
