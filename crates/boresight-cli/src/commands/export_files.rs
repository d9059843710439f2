//! The files of the formats of other programs, in the folder of a run.

use boresight::io::tracks::{Dialect, Format};

/// Each format with the name of its file, or its folder.
pub const FORMATS: [(Format, &str); 13] = [
    (Format::Geff, "tracks.geff/"),
    (Format::TrackMateXml, "trackmate.xml"),
    (Format::Cvat, "cvat.xml"),
    (Format::MotZip, "mot.zip"),
    (Format::Napari, "napari.npy"),
    (Format::Mcap, "tracks.mcap"),
    (Format::Vmti, "vmti.ts"),
    (Format::Parquet, "tracks.parquet"),
    (Format::Kitti, "kitti.txt"),
    (Format::Named(Dialect::Trackpy), "trackpy.csv"),
    (Format::Named(Dialect::TrackMate), "trackmate.csv"),
    (Format::Named(Dialect::Btrack), "btrack.csv"),
    (Format::Named(Dialect::Ultrack), "ultrack.csv"),
];
