//! Evaluation against independent references: TrackEval, py-motmetrics, Stone Soup, py-ctcmetrics, HiGHS.

mod cells;
mod lcg;
mod random_scenes;
mod scenes;
