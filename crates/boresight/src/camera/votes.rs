//! What the patches without a voice in the consensus say of its motion.
//!
//! Source: our own; each is looked for at two places ([`super::find_patch::vote`]). Units: reduced px.

use super::find_patch::{Vote, vote};
use super::key_frame::{KeyFrame, MIN_PATCHES};
use crate::{Homography, Image};

/// How many patches stand still, of those that count: `None` where more object to the motion from the key frame than are for it. `last` is where the key frame lay in the frame before.
pub(super) fn n_still(
    key: &KeyFrame,
    now: &Image<f32>,
    [predicted, motion, last]: [&Homography; 3],
    agree_px: f64,
) -> Option<usize> {
    let (mut n_for, mut n_against, mut n_still) = (0, 0, 0);
    for (i, p) in key.patches.iter().chain(&key.weak).enumerate() {
        let from = p.middle();
        let places = [motion.apply(from), last.apply(from)];
        match vote((&key.image, now), *p, &predicted.similarity_at(from), places, agree_px) {
            Vote::For => n_for += 1,
            Vote::Against => n_against += 1,
            Vote::Still => n_still += usize::from(i < key.patches.len() && !key.even),
            Vote::Neither => {}
        }
    }
    (n_against < MIN_PATCHES || n_against <= n_for).then_some(n_still)
}
