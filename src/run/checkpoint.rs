//! States of jobs on disk, so that a run goes on where it was stopped and nothing is played twice.
//!
//! One file a job, named by its identity: a header in JSON, the numbers as little-endian f64, and a
//! blake3 of both. A file that does not fit (another job, truncated, damaged) is as good as none.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::job::{Block, Origin, Tally, Work, pair_level};
use crate::error::Result;
use crate::results::atomic;
use crate::results::json::{canonical, hash_bytes};
use crate::stats::moments::{ImageMoments, Moments};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    identity: String,
    origin: Origin,
    tally: Tally,
    /// Level and number of values of every node of moments.
    moments: Vec<(u32, usize)>,
    /// Level, passes and number of values of every image node.
    pixels: Vec<(u32, u64, usize)>,
    /// Level and number of values of every node of pairs.
    spread: Vec<(u32, usize)>,
    /// Level and value of every node of work.
    work: Vec<(u32, Work)>,
}

/// Path of a job's state in an experiment's results folder.
pub fn path(root: &Path, identity: &str) -> PathBuf {
    root.join("state").join(format!("{}.state", &identity[..32]))
}

/// Writes the state of a job whose passes start at 0.
pub fn save(path: &Path, identity: &str, block: &Block) -> Result<()> {
    let moments = block.moments.nodes();
    let (pixels, spread) = (block.pixels.nodes(), block.spread.nodes());
    let header = Header {
        identity: identity.into(),
        origin: block.origin.clone(),
        tally: block.tally,
        moments: moments.iter().map(|n| (n.level, n.value.len())).collect(),
        pixels: pixels.iter().map(|n| (n.level, n.value.n, n.value.mean.len())).collect(),
        spread: spread.iter().map(|n| (n.level, n.value.len())).collect(),
        work: block.work.nodes().iter().map(|n| (n.level, n.value)).collect(),
    };
    let header = canonical(&header);
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header.as_bytes());
    let mut put = |x: f64| bytes.extend(x.to_le_bytes());
    let moments = moments.iter().chain(spread).flat_map(|n| &n.value);
    moments.flat_map(|m| m.to_array()).for_each(&mut put);
    pixels.iter().flat_map(|n| n.value.mean.iter().chain(&n.value.m2)).for_each(|&x| put(x));
    let checksum = hash_bytes(&bytes);
    bytes.extend(checksum);
    atomic::write(path, &bytes, "save the state of the run")
}

/// What stood before the first passes of a job's state, whether or not [`load`] can go on from its
/// passes: they were seen.
pub fn origin(path: &Path, identity: &str) -> Option<Origin> {
    let bytes = std::fs::read(path).ok()?;
    parts(&bytes, identity).map(|(header, _)| header.origin)
}

/// Header and numbers of an undamaged state of the job.
fn parts<'a>(bytes: &'a [u8], identity: &str) -> Option<(Header, &'a [u8])> {
    let (body, checksum) = bytes.split_last_chunk::<32>()?;
    if hash_bytes(body) != *checksum {
        return None;
    }
    let (length, rest) = body.split_first_chunk::<8>()?;
    let (header, numbers) = rest.split_at_checked(u64::from_le_bytes(*length) as usize)?;
    let header: Header = serde_json::from_slice(header).ok()?;
    (header.identity == identity).then_some((header, numbers))
}

/// Reads the state of a job, with moments kept at `keep_level`; `None` where there is none that fits.
pub fn load(path: &Path, identity: &str, keep_level: u32) -> Option<Block> {
    let bytes = std::fs::read(path).ok()?;
    let (header, numbers) = parts(&bytes, identity)?;
    let mut numbers = numbers.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b));
    let mut take = |n: usize| -> Option<Vec<f64>> {
        let taken: Vec<f64> = numbers.by_ref().take(n).collect();
        (taken.len() == n).then_some(taken)
    };
    let mut block = Block::empty(0, keep_level);
    for (level, length) in header.moments {
        if level > keep_level {
            return None; // kept coarser than this run's batches: they cannot be cut
        }
        let values = take(5 * length)?;
        let moments = values.as_chunks::<5>().0.iter().map(|m| Moments::from_array(*m)).collect();
        block.moments.push_node(level, moments);
    }
    for (level, length) in header.spread {
        if level > pair_level(keep_level) {
            return None;
        }
        let values = take(5 * length)?;
        let moments = values.as_chunks::<5>().0.iter().map(|m| Moments::from_array(*m)).collect();
        block.spread.push_node(level, moments);
    }
    for (level, n, length) in header.pixels {
        let (mean, m2) = (take(length)?, take(length)?);
        block.pixels.push_node(level, ImageMoments { n, mean, m2 });
    }
    for (level, work) in header.work {
        if level > keep_level {
            return None;
        }
        block.work.push_node(level, work);
    }
    block.tally = header.tally;
    block.origin = header.origin;
    let ends = [block.pixels.next_pass(), block.work.next_pass()];
    let fits = ends.iter().all(|end| *end == block.moments.next_pass())
        && block.spread.next_pass() == block.moments.next_pass() / 2;
    fits.then_some(block)
}

#[cfg(test)]
mod tests {
    use super::super::job::spread;
    use super::*;
    use crate::estimators::Cost;

    fn work(pass: u64) -> Work {
        Work { cost: [pass; Cost::ALL.len()], cpu_seconds: 0.25 * pass as f64, settled: pass % 2 }
    }

    fn block(passes: u64, keep_level: u32) -> Block {
        let mut block = played(0, passes, keep_level);
        block.tally.cost[0] = 7;
        block
    }

    /// Images of 2 pixels in 2 bands.
    fn image(pass: u64) -> Vec<f64> {
        let x = 1.0 / (pass as f64 + 3.0);
        vec![x, 2.0 * x, x * x, 7.0 * x]
    }

    fn played(start: u64, end: u64, keep_level: u32) -> Block {
        let mut block = Block { bands: 2, ..Block::empty(start, keep_level) };
        for pass in start..end {
            let x = 1.0 / (pass as f64 + 3.0);
            block.moments.push(vec![Moments::of(x), Moments::of(-x)]);
            if pass % 2 == 1 && pass > start {
                block.spread.push(spread(&image(pass - 1), &image(pass), 2));
            }
            block.pixels.push(ImageMoments::of(image(pass)));
            block.work.push(work(pass));
        }
        block
    }

    #[test]
    fn states_survive_the_disk() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.state");
        let block = block(13, 2);
        save(&path, "me", &block).expect("saved");
        // How many bands an image has is said by what is played next.
        assert_eq!(load(&path, "me", 2), Some(Block { bands: 0, ..block.clone() }));
        assert!(load(&path, "you", 2).is_none(), "another job");
        assert!(load(&path, "me", 1).is_none(), "coarser than asked");
        // A longer run keeps wider batches: the nodes merge on.
        assert_eq!(load(&path, "me", 3).expect("a state").moments.nodes().len(), 3);

        let mut bytes = std::fs::read(&path).expect("bytes");
        bytes[200] ^= 1;
        std::fs::write(&path, &bytes).expect("written");
        assert!(load(&path, "me", 2).is_none(), "damaged");
        std::fs::write(&path, &bytes[..100]).expect("written");
        assert!(load(&path, "me", 2).is_none(), "truncated");
    }

    #[test]
    fn going_on_gives_the_same_bits() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.state");
        let whole = block(29, 3);
        let later = played(11, 29, 3);
        save(&path, "me", &block(11, 0)).expect("saved");
        let mut resumed = load(&path, "me", 3).expect("a state");
        resumed.append(later);
        assert_eq!((resumed.moments, resumed.pixels), (whole.moments, whole.pixels));
        assert_eq!(resumed.work, whole.work);
        // Passes 10 and 11 are a pair, of which the state held the first.
        // 14 pairs, kept by four: 4 + 4 + 4 + 2.
        assert_eq!(resumed.spread.nodes().len(), 4);
        assert_eq!(resumed.spread, whole.spread);
    }
}
