//! Evaluation against independent references: TrackEval, py-motmetrics, Stone Soup.

mod real_sequences;
