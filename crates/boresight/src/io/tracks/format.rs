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
    /// Graph Exchange File Format 1.3: a folder; written only.
    Geff,
    /// TrackMate's own file; written only.
    TrackMateXml,
    /// CVAT for video; written only.
    Cvat,
    /// MOT's archive as CVAT and Datumaro take it; written only.
    MotZip,
    /// napari's array of tracks; written only.
    Napari,
    /// MCAP with Foxglove's messages; written only.
    Mcap,
    /// MISB ST 0903 VMTI in an MPEG transport stream; written only.
    Vmti,
    /// Apache Parquet, with the feature `parquet`; written only.
    Parquet,
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
            Self::Geff => "geff",
            Self::TrackMateXml => "trackmate-xml",
            Self::Cvat => "cvat",
            Self::MotZip => "mot-zip",
            Self::Napari => "napari",
            Self::Mcap => "mcap",
            Self::Vmti => "vmti",
            Self::Parquet => "parquet",
        }
    }

    /// Formats that are written for other programs and not read.
    pub const EXPORTS: [Self; 8] =
        [Self::Geff, Self::TrackMateXml, Self::Cvat, Self::MotZip, Self::Napari, Self::Mcap, Self::Vmti, Self::Parquet];

    /// Whether it is a folder rather than a file.
    pub fn is_folder(self) -> bool {
        matches!(self, Self::Ctc | Self::Geff)
    }

    /// All formats that are read and written.
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
