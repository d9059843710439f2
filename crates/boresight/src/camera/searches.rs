//! All patches of a key frame looked for in a frame, and what those without a voice in the consensus say of its motion.
//!
//! Source: our own; each patch is looked for once ([`super::find_patch::Search`]), for its place and for its vote on two places. Units: reduced px.

use super::find_patch::{Search, Vote};
use super::fit::Match;
use super::key_frame::{KeyFrame, MIN_PATCHES};
use crate::{Homography, Image};

/// What was seen around each patch; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Searches(Vec<Search>);

impl Searches {
    /// Looks for the patches where that motion leads them, and adds those that are found.
    pub fn take(&mut self, key: &KeyFrame, now: &Image<f32>, predicted: &Homography, found: &mut Vec<Match>) {
        self.0.resize_with(key.patches.len(), Search::default);
        for (search, p) in self.0.iter_mut().zip(&key.patches) {
            let from = p.middle();
            let template = search.take(&key.image, now, *p, &predicted.similarity_at(from));
            let to = template.and_then(|template| search.place(&template, now));
            found.extend(to.map(|to| Match { from, to, weight: p.weight }));
        }
    }

    /// How many of the patches that were looked for stand still: `None` where more of them and of the weak ones object to the motion from the key frame than are for it. `last` is where the key frame lay in the
    /// frame before.
    pub fn n_still(
        &self,
        key: &KeyFrame,
        now: &Image<f32>,
        [predicted, motion, last]: [&Homography; 3],
        agree_px: f64,
    ) -> Option<usize> {
        let (mut n_for, mut n_against, mut n_still) = (0, 0, 0);
        let mut of_weak = Search::default();
        for (i, p) in key.patches.iter().chain(&key.weak).enumerate() {
            let from = p.middle();
            let search = match self.0.get(i) {
                Some(search) => search,
                None => {
                    of_weak.take(&key.image, now, *p, &predicted.similarity_at(from));
                    &of_weak
                }
            };
            match search.vote([motion.apply(from), last.apply(from)], agree_px) {
                Vote::For => n_for += 1,
                Vote::Against => n_against += 1,
                Vote::Still => n_still += usize::from(i < key.patches.len() && !key.even),
                Vote::Neither => {}
            }
        }
        (n_against < MIN_PATCHES || n_against <= n_for).then_some(n_still)
    }
}
