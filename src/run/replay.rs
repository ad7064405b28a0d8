//! Runs the first passes of every measurement again, in other blocks, in another order and on one thread; the
//! bits must be the same.

use super::job::{Block, Finished, Passes};
use crate::results::json::hash_hex;
use crate::results::record::Replay;
use crate::stats::moments::Moments;
use crate::stats::tree::batch_level;

/// Passes of a block: coprime to every batch and unlike any size that a run would choose.
const BLOCK: u64 = 7;

/// Runs the first `passes` of a finished job again, rounded up to whole batches; nothing where `stop`
/// was raised. The blocks are run last to first and joined in their order.
pub(super) fn replay(
    job: &Passes,
    finished: &Finished,
    passes: u64,
    stop: &dyn Fn() -> bool,
) -> Option<Replay> {
    let level = batch_level(finished.passes);
    let batches = passes.div_ceil(1 << level).min(finished.batches.len() as u64);
    let end = (batches << level).min(finished.passes);
    let starts: Vec<u64> = (0..end).step_by(BLOCK as usize).collect();
    let blocks: Option<Vec<Block>> = starts
        .iter()
        .rev()
        .map(|&start| job.run(job.stage, start, end.min(start + BLOCK), level, stop))
        .collect();
    let mut all = Block::empty(0, level);
    blocks?.into_iter().rev().for_each(|block| all.append(block));
    Some(Replay {
        cell: job.cell,
        estimator: job.arm.name.clone(),
        passes: end,
        recorded: digest(&finished.batches[..batches as usize]),
        replayed: digest(&all.moments.batches()),
    })
}

/// blake3 of the bits of all moments, hex.
fn digest(batches: &[Vec<Moments>]) -> String {
    let numbers = batches.iter().flatten().flat_map(Moments::to_array);
    let bytes: Vec<u8> = numbers.flat_map(f64::to_le_bytes).collect();
    hash_hex(&bytes)
}
