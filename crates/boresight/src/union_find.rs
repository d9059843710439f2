//! Union-find: which nodes belong together, by links that are added one at a time.
//!
//! Source: R. E. Tarjan, J. van Leeuwen, *Worst-case analysis of set union algorithms*, J. ACM 31(2), 1984 (path halving).
//! A node names its parent; a root names itself. The smaller number stays the root, so that a group is known by its first
//! member. Cost: near O(1) a step.

/// A node that holds the number of its parent.
pub(crate) trait Node {
    /// The parent's number; its own at a root.
    fn parent(&self) -> u32;
    /// Moves the node below another one.
    fn set_parent(&mut self, parent: u32);
}

impl Node for u32 {
    fn parent(&self) -> u32 {
        *self
    }
    fn set_parent(&mut self, parent: u32) {
        *self = parent;
    }
}

/// The root of a node; halves the path to it.
#[inline(always)]
pub(crate) fn root<N: Node>(nodes: &mut [N], mut i: u32) -> u32 {
    loop {
        let parent = nodes[i as usize].parent();
        if parent == i {
            return i;
        }
        let above = nodes[parent as usize].parent();
        nodes[i as usize].set_parent(above);
        i = above;
    }
}

/// Joins the groups of two nodes.
pub(crate) fn join(nodes: &mut [impl Node], a: u32, b: u32) {
    let (a, b) = (root(nodes, a), root(nodes, b));
    nodes[a.max(b) as usize].set_parent(a.min(b));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn roots_are_the_least_members_of_what_a_flood_reaches(
            links in prop::collection::vec((0u32..12, 0u32..12), 0..14),
        ) {
            let mut parents: Vec<u32> = (0..12).collect();
            for (a, b) in &links {
                join(&mut parents, *a, *b);
            }
            for start in 0..12 {
                let mut reached = vec![start];
                let mut k = 0;
                while k < reached.len() {
                    for (a, b) in &links {
                        for (from, to) in [(*a, *b), (*b, *a)] {
                            if from == reached[k] && !reached.contains(&to) {
                                reached.push(to);
                            }
                        }
                    }
                    k += 1;
                }
                prop_assert_eq!(root(&mut parents, start), *reached.iter().min().unwrap());
            }
        }
    }

    #[test]
    fn a_long_chain_is_halved_on_the_way_up() {
        let mut parents: Vec<u32> = vec![0, 0, 1, 2, 3];
        assert_eq!(root(&mut parents, 4), 0);
        assert_eq!(parents, [0, 0, 0, 2, 2]);
    }
}
