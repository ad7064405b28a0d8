//! The fixed dyadic reduction over passes.
//!
//! Floating-point sums depend on their order, so the order is fixed by the absolute numbers of the passes
//! alone. A node of level l covers the passes [j 2^l, (j + 1) 2^l); its value is the merge of its two halves,
//! left before right. A `Counter` holds the nodes of a contiguous range like the digits of a binary counter:
//! at most one node per level on each side of the widest one, so that log2(passes) partial images suffice.
//! Two counters of adjacent ranges are merged by pushing the nodes of the later one into the earlier. Every
//! node is a function of its passes alone, so the result is the same for every division into blocks and
//! shards.

use serde::{Deserialize, Serialize};

/// A value that joins with the value of the passes after it.
pub trait Merge: Sized {
    /// The value of `self`'s passes followed by `later`'s.
    fn merge(self, later: Self) -> Self;
}

/// Merges element by element.
impl<T: Merge> Merge for Vec<T> {
    fn merge(self, later: Vec<T>) -> Vec<T> {
        assert_eq!(self.len(), later.len(), "vectors of one length");
        self.into_iter().zip(later).map(|(a, b)| a.merge(b)).collect()
    }
}

impl<A: Merge, B: Merge> Merge for (A, B) {
    fn merge(self, later: (A, B)) -> (A, B) {
        (self.0.merge(later.0), self.1.merge(later.1))
    }
}

/// The value of 2^level passes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Node<T> {
    /// Logarithm of the number of passes.
    pub level: u32,
    /// Merged value of the node's passes.
    pub value: T,
}

/// The nodes of a contiguous range of passes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counter<T> {
    start: u64,
    next: u64,
    keep_level: u32,
    nodes: Vec<Node<T>>,
}

impl<T: Merge> Counter<T> {
    /// An empty range that starts at pass `start`. Nodes of `keep_level` are kept and not merged
    /// further ([`Counter::MERGE_ALL`] for none).
    pub fn new(start: u64, keep_level: u32) -> Counter<T> {
        Counter { start, next: start, keep_level, nodes: Vec::new() }
    }

    /// A `keep_level` that no node reaches.
    pub const MERGE_ALL: u32 = 64;

    /// Number of the first pass.
    pub fn start(&self) -> u64 {
        self.start
    }

    /// Number of the pass that comes next.
    pub fn next_pass(&self) -> u64 {
        self.next
    }

    /// The nodes in the order of their passes: with [`Counter::start`], the whole state. Pushing them
    /// into a new counter of the same start makes this counter again.
    pub fn nodes(&self) -> &[Node<T>] {
        &self.nodes
    }

    /// Appends the next pass.
    pub fn push(&mut self, pass: T) {
        self.push_node(0, pass);
    }

    /// Appends the next 2^level passes, already merged by this tree.
    pub fn push_node(&mut self, level: u32, value: T) {
        assert!(
            level <= self.keep_level,
            "a node of level {level} cannot be cut to {}",
            self.keep_level
        );
        assert!(
            level < 64 && self.next.is_multiple_of(1 << level),
            "level {level} at pass {}",
            self.next
        );
        self.next += 1 << level;
        let mut node = Node { level, value };
        while node.level < self.keep_level
            && self.starts_at_even_index(node.level + 1)
            && let Some(left) = self.nodes.pop_if(|left| left.level == node.level)
        {
            node = Node { level: node.level + 1, value: left.value.merge(node.value) };
        }
        self.nodes.push(node);
    }

    /// Appends the range that begins where this one ends.
    pub fn append(&mut self, later: Counter<T>) {
        assert_eq!(self.next, later.start, "ranges are adjacent");
        for node in later.nodes {
            self.push_node(node.level, node.value);
        }
    }

    /// The kept nodes and then, folded into one, what is left of the last of them: the batches.
    pub fn batches(mut self) -> Vec<T> {
        let partial = self.nodes.iter().position(|node| node.level < self.keep_level);
        let tail = self.nodes.split_off(partial.unwrap_or(self.nodes.len()));
        let mut batches: Vec<T> = self.nodes.into_iter().map(|node| node.value).collect();
        batches.extend(fold_back(tail.into_iter().map(|node| node.value)));
        batches
    }

    /// One value for the whole range, folded from the smallest (latest) node to the largest.
    pub fn finish(self) -> Option<T> {
        fold_back(self.nodes.into_iter().map(|node| node.value))
    }

    /// The result of [`Counter::finish`] at this point, from a copy.
    pub fn so_far(&self) -> Option<T>
    where
        T: Clone,
    {
        fold_back(self.nodes.iter().map(|node| node.value.clone()))
    }

    /// Does the node of `level` that ends at the next pass begin at a multiple of its own size, so
    /// that the two nodes before that pass are its halves?
    fn starts_at_even_index(&self, level: u32) -> bool {
        level < 64 && self.next.is_multiple_of(1 << level)
    }
}

fn fold_back<T: Merge>(values: impl DoubleEndedIterator<Item = T>) -> Option<T> {
    values.rev().reduce(|later, earlier| earlier.merge(later))
}

/// The total of a record's batches: from the first to the last.
pub fn total<T: Merge>(batches: impl IntoIterator<Item = T>) -> Option<T> {
    batches.into_iter().reduce(T::merge)
}

/// The level of a record's batches: 64 to 128 of them (the last one partial) from 64 passes on, fewer
/// only where there are fewer passes. A function of the number of passes alone.
pub fn batch_level(passes: u64) -> u32 {
    if passes < 128 { 0 } else { passes.ilog2() - 6 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::moments::Moments;
    use super::*;

    type MomentsTree = Counter<Moments>;

    /// Values whose sums depend on the order of addition.
    fn pass(i: u64) -> Moments {
        let x = (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11) as f64;
        Moments::of(x.sqrt() * if i.is_multiple_of(5) { 1e6 } else { 0.1 })
    }

    fn range(start: u64, end: u64, keep: u32) -> MomentsTree {
        let mut tree = MomentsTree::new(start, keep);
        (start..end).for_each(|i| tree.push(pass(i)));
        tree
    }

    #[test]
    fn order_matters_to_these_values() {
        let forward = (0..100).map(pass).reduce(Merge::merge);
        let backward = (0..100).rev().map(pass).reduce(Merge::merge);
        assert_ne!(forward.map(|m| m.mean), backward.map(|m| m.mean));
        assert_ne!(forward.map(|m| m.mean), range(0, 100, 64).finish().map(|m| m.mean));
    }

    proptest! {
        // Blocks of any lengths, finished in any order and joined when their turn comes.
        #[test]
        fn any_cut_and_completion_order_gives_the_same_bits(
            lengths in prop::collection::vec(1u64..40, 1..12),
            keep in 0u32..8,
            order in any::<u64>(),
        ) {
            let mut bounds = vec![0];
            lengths.iter().for_each(|n| bounds.push(bounds[bounds.len() - 1] + n));
            let mut blocks: Vec<MomentsTree> =
                bounds.windows(2).map(|w| range(w[0], w[1], keep)).collect();
            blocks.sort_by_key(|b| b.start().wrapping_mul(order | 1));
            let mut joined = MomentsTree::new(0, keep);
            while let Some(i) = blocks.iter().position(|b| b.start() == joined.next_pass()) {
                joined.append(blocks.swap_remove(i));
            }
            let whole = range(0, bounds[lengths.len()], keep);
            prop_assert_eq!(&joined, &whole);
            prop_assert_eq!(joined.batches(), whole.batches());
        }

        // Aligned power-of-two blocks arrive as single nodes; a shard starts at any of them.
        #[test]
        fn power_of_two_blocks_give_the_same_bits(passes in 1u64..600, level in 0u32..7, shard in 0u64..9) {
            let start = (shard << level).min(passes);
            let mut tail = MomentsTree::new(start, 64);
            let mut at = start;
            while at + (1 << level) <= passes {
                let block = range(at, at + (1 << level), 64).finish();
                tail.push_node(level, block.expect("passes"));
                at += 1 << level;
            }
            tail.append(range(at, passes, 64));
            let mut joined = range(0, start, 64);
            joined.append(tail);
            prop_assert_eq!(joined.so_far(), range(0, passes, 64).finish());
            prop_assert_eq!(joined.finish(), range(0, passes, 64).finish());
        }

        // A coarser cut of a finer cut is the coarser cut: continuing a run may raise the level.
        #[test]
        fn levels_can_be_raised(passes in 1u64..600, keep in 0u32..5, more in 0u32..5) {
            let fine = range(0, passes, keep);
            let mut coarse = MomentsTree::new(0, keep + more);
            coarse.append(fine);
            prop_assert_eq!(coarse, range(0, passes, keep + more));
        }
    }

    #[test]
    fn batches_are_64_to_128_and_cover_every_pass() {
        for passes in (1..1000).chain([4095, 4096, 5000]) {
            let batches = range(0, passes, batch_level(passes)).batches();
            let full = passes >> batch_level(passes);
            assert!(passes < 64 || (64..128).contains(&full), "{passes} passes: {full}");
            assert_eq!(batches.len() as u64, passes.div_ceil(1 << batch_level(passes)));
            assert_eq!(total(batches).map(|m| m.n), Some(passes));
        }
    }

    #[test]
    fn state_is_the_nodes() {
        let tree = range(64, 200, 5);
        let mut again = MomentsTree::new(tree.start(), 5);
        tree.nodes().iter().for_each(|n| again.push_node(n.level, n.value));
        assert_eq!(again, tree);
    }

    #[test]
    fn an_unfinished_image_tree_is_small() {
        assert!(range(0, 1_000, 64).nodes().len() <= 10);
    }

    #[test]
    #[should_panic(expected = "ranges are adjacent")]
    fn a_missing_block_is_noticed() {
        let mut tree = range(0, 8, 64);
        tree.append(range(16, 24, 64));
    }
}
