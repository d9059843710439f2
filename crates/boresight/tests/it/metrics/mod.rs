//! Evaluation against independent references: TrackEval, py-motmetrics, Stone Soup.

mod random_scenes;
mod real_sequences;
mod scenes;
