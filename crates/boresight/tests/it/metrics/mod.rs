//! Evaluation against independent references: TrackEval, py-motmetrics, Stone Soup, py-ctcmetrics, HiGHS.

mod cells;
mod kitti;
mod random_scenes;
mod real_sequences;
mod scenes;
