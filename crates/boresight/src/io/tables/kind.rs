//! The kinds of tables.

/// How a table is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A header with names.
    Named,
    /// MOTChallenge: no header, counted from 1.
    Mot,
    /// KITTI tracking labels: no header, counted from 0.
    Kitti,
    /// AB3DMOT's detections on KITTI: no header, counted from 0.
    Ab3dmot,
}
