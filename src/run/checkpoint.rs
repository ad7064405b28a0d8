//! States of jobs on disk, so that a run resumes where it was stopped and nothing is computed twice.
//!
//! One file per job, named by the identity of the job: a header in JSON, the numbers as little-endian f64,
//! and a blake3 hash of both. A file that does not fit (another job, truncated, damaged) is ignored. A state
//! holds the claims that were made before the first pass, and the data from which a larger budget resumes:
//! for an estimator at most 128 batches of 40 bytes per observable and band, and an image of 16 bytes per
//! pixel and band for each bit that is set in the number of passes; for a sampler its counts.

use std::fs;
use std::path::{Path, PathBuf};

use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};

use super::chi_square::Sampled;
use super::job::{Block, Start, Tally, Work, pair_level};
use crate::error::{Error, Result};
use crate::results::atomic;
use crate::results::json::{canonical, hash_bytes};
use crate::results::npy::Array;
use crate::results::sampler::SamplerRun;
use crate::results::store::RecordFolder;
use crate::results::timing::TimeSpent;
use crate::stats::moments::{ImageMoments, Moments};

/// The header of a state, before its numbers.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header<T> {
    identity: String,
    start: Start,
    content: T,
}

/// The numbers of an estimator's state: nodes of moments and of pairs, then of images.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Nodes {
    /// First pass.
    start: u64,
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

/// The numbers of a sampler's state: its arrays one after the other.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Counted {
    run: SamplerRun,
    /// Path and shape of every array.
    arrays: Vec<(String, Vec<usize>)>,
    cost: TimeSpent,
}

/// The folder of the states in an experiment's results folder.
fn folder(root: &Path) -> PathBuf {
    root.join("state")
}

/// Name of a job's state.
fn name(identity: &str) -> String {
    format!("{}.state", &identity[..32])
}

/// Path of a job's state in an experiment's results folder.
pub(crate) fn path(root: &Path, identity: &str) -> PathBuf {
    folder(root).join(name(identity))
}

/// Makes the folder of the states, and removes what a killed run left unfinished in the results folder.
pub(crate) fn prepare(root: &Path) -> Result<()> {
    atomic::create_folder(&folder(root), "create the results folder")?;
    RecordFolder::new(root).remove_unfinished()?;
    atomic::sweep(root)?;
    atomic::sweep(&folder(root))
}

/// The record is complete: a larger budget resumes from no states of jobs other than these. Of those
/// the claims made before their first pass are kept, because their passes were seen.
pub(crate) fn reduce_others<'a>(root: &Path, identities: impl Iterator<Item = &'a str>) -> Result<()> {
    let kept: Vec<String> = identities.map(name).collect();
    let folder = folder(root);
    let entries = fs::read_dir(&folder).map_err(Error::io(&folder, "read the states of the run"))?;
    for entry in entries.flatten().filter(|entry| !kept.iter().any(|name| entry.file_name() == **name)) {
        let path = entry.path();
        match read::<IgnoredAny>(&path) {
            Some((old, _)) => save(&path, &old.identity, &old.start, (), std::iter::empty())?,
            None => fs::remove_file(&path).map_err(Error::io(&path, "remove a damaged state"))?,
        }
    }
    Ok(())
}

fn save<T: Serialize>(
    path: &Path,
    identity: &str,
    start: &Start,
    content: T,
    numbers: impl Iterator<Item = f64>,
) -> Result<()> {
    let header = canonical(&Header { identity: identity.into(), start: start.clone(), content });
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header.as_bytes());
    numbers.for_each(|x| bytes.extend(x.to_le_bytes()));
    let checksum = hash_bytes(&bytes);
    bytes.extend(checksum);
    atomic::write(path, &bytes, "save the state of the run")
}

/// Header and numbers of an undamaged state of the job.
fn load<T: DeserializeOwned>(path: &Path, identity: &str) -> Option<(Header<T>, Vec<f64>)> {
    read(path).filter(|(header, _)| header.identity == identity)
}

/// Header and numbers of an undamaged state.
fn read<T: DeserializeOwned>(path: &Path) -> Option<(Header<T>, Vec<f64>)> {
    let bytes = fs::read(path).ok()?;
    let (body, checksum) = bytes.split_last_chunk::<32>()?;
    if hash_bytes(body) != *checksum {
        return None;
    }
    let (length, rest) = body.split_first_chunk::<8>()?;
    let (header, numbers) = rest.split_at_checked(u64::from_le_bytes(*length) as usize)?;
    let header: Header<T> = serde_json::from_slice(header).ok()?;
    let numbers = numbers.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    Some((header, numbers))
}

/// The claims made before the first passes or draws of a job's state, whether or not the job can resume
/// from it: they were seen.
pub(crate) fn start(path: &Path, identity: &str) -> Option<Start> {
    load::<IgnoredAny>(path, identity).map(|(header, _)| header.start)
}

/// Writes the state of a job, or of a part of it.
pub(crate) fn save_passes(path: &Path, identity: &str, start: &Start, block: &Block) -> Result<()> {
    let moments = block.moments.nodes();
    let (pixels, spread) = (block.pixels.nodes(), block.spread.nodes());
    let nodes = Nodes {
        start: block.moments.start(),
        tally: block.tally,
        moments: moments.iter().map(|n| (n.level, n.value.len())).collect(),
        pixels: pixels.iter().map(|n| (n.level, n.value.n, n.value.mean.len())).collect(),
        spread: spread.iter().map(|n| (n.level, n.value.len())).collect(),
        work: block.work.nodes().iter().map(|n| (n.level, n.value)).collect(),
    };
    let moments = moments.iter().chain(spread).flat_map(|n| &n.value).flat_map(|m| m.to_array());
    let images = pixels.iter().flat_map(|n| n.value.mean.iter().chain(&n.value.m2)).copied();
    save(path, identity, start, nodes, moments.chain(images))
}

/// Reads the state of a job from pass `start` on, with moments kept at `keep_level`; `None` where there is none that
/// fits.
pub(crate) fn load_passes(path: &Path, identity: &str, start: u64, keep_level: u32) -> Option<Block> {
    let (Header { content: nodes, .. }, numbers) = load::<Nodes>(path, identity)?;
    if nodes.start != start {
        return None;
    }
    let mut numbers = numbers.into_iter();
    let mut take = |n: usize| take(&mut numbers, n);
    let mut block = Block::empty(start, keep_level);
    for (level, length) in nodes.moments {
        if level > keep_level {
            return None; // kept coarser than this run's batches: they cannot be cut
        }
        let values = take(5 * length)?;
        let moments = values.as_chunks::<5>().0.iter().map(|m| Moments::from_array(*m)).collect();
        block.moments.push_node(level, moments);
    }
    for (level, length) in nodes.spread {
        if level > pair_level(keep_level) {
            return None;
        }
        let values = take(5 * length)?;
        let moments = values.as_chunks::<5>().0.iter().map(|m| Moments::from_array(*m)).collect();
        block.spread.push_node(level, moments);
    }
    for (level, n, length) in nodes.pixels {
        let (mean, m2) = (take(length)?, take(length)?);
        block.pixels.push_node(level, ImageMoments { n, mean, m2 });
    }
    for (level, work) in nodes.work {
        if level > keep_level {
            return None;
        }
        block.work.push_node(level, work);
    }
    block.tally = nodes.tally;
    let ends = [block.pixels.next_pass(), block.work.next_pass()];
    let fits = ends.iter().all(|end| *end == block.moments.next_pass())
        && block.spread.next_pass() == block.moments.next_pass() / 2;
    fits.then_some(block)
}

/// The pass, or draw, after the last that an undamaged state of the job holds.
pub(crate) fn end(path: &Path, identity: &str) -> Option<u64> {
    if let Some((Header { content: nodes, .. }, _)) = load::<Nodes>(path, identity) {
        let passes = nodes.moments.iter().map(|(level, _)| 1u64.checked_shl(*level).unwrap_or(0));
        return Some(nodes.start + passes.sum::<u64>());
    }
    load::<Counted>(path, identity).map(|(header, _)| header.content.run.samples)
}

/// Writes the state of a sampler.
pub(crate) fn save_draws(path: &Path, identity: &str, start: &Start, sampled: &Sampled) -> Result<()> {
    let arrays = sampled.arrays.iter().map(|(name, array)| (name.clone(), array.shape.clone()));
    let counted = Counted { run: sampled.run.clone(), arrays: arrays.collect(), cost: sampled.cost };
    let numbers = sampled.arrays.values().flat_map(|array| array.data.iter().copied());
    save(path, identity, start, counted, numbers)
}

/// Reads the state of a sampler of so many draws; `None` where there is none that fits.
pub(crate) fn load_draws(path: &Path, identity: &str, samples: u64) -> Option<Sampled> {
    let (Header { content: counted, .. }, numbers) = load::<Counted>(path, identity)?;
    let mut numbers = numbers.into_iter();
    let arrays = counted.arrays.into_iter().map(|(name, shape)| {
        let data = take(&mut numbers, shape.iter().product())?;
        Some((name, Array::new(shape, data)))
    });
    let arrays = arrays.collect::<Option<_>>()?;
    (counted.run.samples == samples).then_some(Sampled { run: counted.run, arrays, cost: counted.cost })
}

/// The next `n` numbers, where there are so many.
fn take(numbers: &mut impl Iterator<Item = f64>, n: usize) -> Option<Vec<f64>> {
    let taken: Vec<f64> = numbers.take(n).collect();
    (taken.len() == n).then_some(taken)
}

#[cfg(test)]
mod tests {
    use super::super::job::spread;
    use super::*;
    use crate::estimators::Cost;

    fn work(pass: u64) -> Work {
        Work {
            cost: [pass; Cost::ALL.len()],
            cpu_seconds: 0.25 * pass as f64,
            settled: pass % 2,
            twice: [0.5, pass as f64],
        }
    }

    fn block(passes: u64, keep_level: u32) -> Block {
        let mut block = blocks(0, passes, keep_level);
        block.tally.anomalies[0] = 7;
        block
    }

    /// Images of 2 pixels in 2 bands.
    fn image(pass: u64) -> Vec<f64> {
        let x = 1.0 / (pass as f64 + 3.0);
        vec![x, 2.0 * x, x * x, 7.0 * x]
    }

    fn blocks(start: u64, end: u64, keep_level: u32) -> Block {
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
        save_passes(&path, "me", &Start::default(), &block).expect("saved");
        // How many bands an image has is known from the next run.
        assert_eq!(load_passes(&path, "me", 0, 2), Some(Block { bands: 0, ..block.clone() }));
        assert!(load_passes(&path, "you", 0, 2).is_none(), "another job");
        assert!(load_passes(&path, "me", 0, 1).is_none(), "coarser than asked");
        // A longer run keeps wider batches: the nodes merge on.
        assert_eq!(load_passes(&path, "me", 0, 3).expect("a state").moments.nodes().len(), 3);

        let mut bytes = std::fs::read(&path).expect("bytes");
        bytes[200] ^= 1;
        std::fs::write(&path, &bytes).expect("written");
        assert!(load_passes(&path, "me", 0, 2).is_none(), "damaged");
        std::fs::write(&path, &bytes[..100]).expect("written");
        assert!(load_passes(&path, "me", 0, 2).is_none(), "truncated");
    }

    #[test]
    fn of_another_job_only_the_start_remains() {
        let folder = tempfile::tempdir().expect("a folder");
        prepare(folder.path()).expect("prepared");
        let start_of = |claim: &str| Start { claims: vec![claim.into()], ..Start::default() };
        let [mine, other] = ["a", "b"].map(|letter| letter.repeat(64));
        let [own, theirs] = [&mine, &other].map(|identity| path(folder.path(), identity));
        save_passes(&own, &mine, &start_of("x"), &block(13, 2)).expect("saved");
        save_passes(&theirs, &other, &start_of("y"), &block(13, 2)).expect("saved");
        fs::write(folder.path().join("state/damaged.state"), "?").expect("written");
        reduce_others(folder.path(), [mine.as_str()].into_iter()).expect("reduced");
        assert!(
            load_passes(&own, &mine, 0, 2).is_some() && load_passes(&theirs, &other, 0, 2).is_none()
        );
        assert_eq!(start(&theirs, &other), Some(start_of("y")));
        assert_eq!(fs::read_dir(folder.path().join("state")).expect("a folder").count(), 2);
        reduce_others(folder.path(), std::iter::empty()).expect("reduced");
        assert_eq!(start(&theirs, &other), Some(start_of("y")));
    }

    #[test]
    fn what_a_killed_run_left_unfinished_goes() {
        let folder = tempfile::tempdir().expect("a folder");
        prepare(folder.path()).expect("prepared");
        for name in [".timing.json.123.tmp", "state/.x.state.123.tmp", "kept.tmp"] {
            fs::write(folder.path().join(name), "half").expect("written");
        }
        fs::create_dir(folder.path().join(".record.new")).expect("a folder");
        prepare(folder.path()).expect("prepared");
        let left: Vec<_> = fs::read_dir(folder.path()).expect("a folder").flatten().collect();
        let mut left: Vec<_> = left.into_iter().map(|entry| entry.file_name()).collect();
        left.sort();
        assert_eq!(left, ["kept.tmp", "state"]);
        assert_eq!(fs::read_dir(folder.path().join("state")).expect("a folder").count(), 0);
    }

    /// A state that begins anywhere, odd passes included, joins with the one before it.
    #[test]
    fn parts_join() {
        let folder = tempfile::tempdir().expect("a folder");
        let whole = block(29, 3);
        for cut in [1, 8, 11, 16, 28] {
            let parts = [(0, cut), (cut, 29)].map(|(start, end)| {
                let path = folder.path().join(format!("{start}.state"));
                save_passes(&path, "me", &Start::default(), &blocks(start, end, 3)).expect("saved");
                assert_eq!(super::end(&path, "me"), Some(end));
                assert!(load_passes(&path, "me", start + 1, 3).is_none(), "another part");
                load_passes(&path, "me", start, 3).expect("a state")
            });
            let [mut first, second] = parts;
            // A state does not say how many bands its images have; the run does.
            (first.bands, first.tally) = (2, whole.tally);
            first.append(Block { bands: 2, tally: Tally::default(), ..second });
            assert_eq!(first, whole, "{cut}");
        }
    }

    #[test]
    fn going_on_gives_the_same_bits() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.state");
        let whole = block(29, 3);
        let later = blocks(11, 29, 3);
        save_passes(&path, "me", &Start::default(), &block(11, 0)).expect("saved");
        let mut resumed = load_passes(&path, "me", 0, 3).expect("a state");
        resumed.append(later);
        assert_eq!((resumed.moments, resumed.pixels), (whole.moments, whole.pixels));
        assert_eq!(resumed.work, whole.work);
        // Passes 10 and 11 are a pair, of which the state held the first.
        // 14 pairs, kept by four: 4 + 4 + 4 + 2.
        assert_eq!(resumed.spread.nodes().len(), 4);
        assert_eq!(resumed.spread, whole.spread);
    }
}
